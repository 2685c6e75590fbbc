"""The section ``system`` of a planetary gear: sun, carrier, planets and ring."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from gearstab.config.document.problems import Path
from gearstab.config.document.yaml import Document
from gearstab.config.model.conflicts import Conflict, within, wrong_length
from gearstab.config.model.fields import Choice, Count, Flag, Quantity, also
from gearstab.config.model.introspection import held
from gearstab.system import GearSystem
from gearstab.systems import feasibility
from gearstab.systems.base import START_MESH, Start, System, first_number
from gearstab.systems.gearbox.bodies import Teeth
from gearstab.systems.gearbox.feasibility import MOST_TEETH, built, check_points
from gearstab.systems.planetary import angles
from gearstab.systems.planetary.angles import ASSEMBLE, angles_of
from gearstab.systems.planetary.bodies import (
    HARMONICS,
    MOST_HARMONICS,
    BodyLoad,
    Inertias,
    Masses,
    PressureAngles,
    Ring,
    Supports,
)
from gearstab.systems.planetary.build import build, size
from gearstab.systems.planetary.carrier import CarrierSpeed
from gearstab.systems.planetary.feasibility import MOST_PLANETS, assembly, check_assembly, clear_of_each_other, whole
from gearstab.systems.planetary.meshes import Meshes, Phases, PlanetaryMesh, ToothNumbers
from gearstab.systems.planetary.phasing import RULES, SENSES, Turning, lags
from gearstab.systems.planetary.teeth import with_teeth

if TYPE_CHECKING:
    from gearstab.config.model.axes import Grid

BODIES = ("sun", "carrier", "ring")
"""The bodies on the axis, of which one drives and one is fixed."""

OF_GEARS = ("module", "pressure_angle", "face_width")
NEEDED = {
    "masses": ("ring", "planet"), "inertias": ("carrier", "sun", "planet"), "pressure_angles": ("sun", "ring"),
}  # fmt: skip
"""Numbers that are given, or follow from the teeth."""


class Planetary(System):
    """Sun, carrier, equal planets and a ring (Parker 2009)."""

    start: ClassVar[Start | None] = Start(
        "A planetary gear with a rigid ring",
        {
            "kind": "planetary", "planets": 4, "damping_ratio": 0.02, "ring": {"kind": "rigid"},
            "masses": {"ring": 2.4, "carrier": 5.4, "sun": 0.4, "planet": 0.7},
            "inertias": {"ring": 3.0, "carrier": 6.3, "sun": 0.4, "planet": 0.6},
            "supports": {
                "carrier": 1.0e8, "sun": 1.0e8, "planet": 1.0e8, "carrier_rotation": 0.0, "sun_rotation": 0.0,
                "ring_radial": 1.0e8, "ring_tangential": 1.0e9,
            },
            "pressure_angles": {"sun": "24.6 deg", "ring": "24.6 deg"},
            "meshes": {"sun": START_MESH | {"contact_ratio": 1.4}, "ring": START_MESH | {"contact_ratio": 1.8}},
            "teeth": {"sun": 27, "planet": 35, "ring": 97},
        },
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 60000.0, "num": 301}, "rad/s"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 9}, "of all meshes"),
        },
    )  # fmt: skip

    kind: Literal["planetary"] = Field(title="kind of system", description="A planetary gear.")
    planets: Annotated[Fraction, Count(of="planets"), Field(le=MOST_PLANETS)] = Field(
        title="number of planets", description="N >= 3, equally spaced without angles."
    )
    angles: list[Annotated[float, Quantity("rad")]] | None = Field(
        default=None,
        title="angle of a planet",
        description="psi_n (rad, or with a unit), or assemble: the nearest to equal ones at which the teeth fit.",
        json_schema_extra=also({"const": ASSEMBLE}),
    )
    motion: Annotated[str, Choice("motion", ("planar", "rotational"))] = Field(
        default="planar",
        title="motion",
        description="planar, or rotational: bodies only rotate and the planets' centres move with the carrier.",
    )
    scaling: Annotated[str, Choice("scaling", ("SI", "dimensionless"))] = Field(
        default="SI",
        title="scaling",
        description="dimensionless: masses over m_r, stiffnesses over k_rp and frequencies over sqrt(k_rp/m_r).",
    )
    ring: Ring = Field(title="ring", description="How the ring deforms.")
    masses: Masses = Field(default=Masses(), title="masses", description="Mass of each body.")
    inertias: Inertias = Field(
        default=Inertias(), title="inertias", description="Moments of inertia over squared base radii."
    )
    supports: Supports = Field(
        default=Supports(), title="supports", description="Stiffness of the supports and planet bearings."
    )
    pressure_angles: PressureAngles = Field(
        default=PressureAngles(), title="pressure angles", description="Of both kinds of meshes."
    )
    meshes: Meshes = Field(title="meshes", description="The meshes of the sun and of the ring.")
    load: BodyLoad | None = Field(
        default=None, title="load", description="Constant torques on ring, carrier and sun, over their radii (N)."
    )
    phases: Phases | None = Field(
        default=None, title="mesh phases", description="When the waves of the meshes begin; or give teeth."
    )
    teeth: ToothNumbers | None = Field(
        default=None, title="tooth numbers", description="From which the mesh phases follow; or give phases."
    )

    input: Annotated[str, Choice("input", BODIES)] = Field(
        default="sun", title="input", description="The body whose speed input_speed is, where teeth are given."
    )
    fixed: Annotated[str, Choice("fixed body", BODIES)] = Field(
        default="ring",
        title="fixed body",
        description="The body that does not turn: it tells how fast the teeth mesh at an input_speed.",
    )

    sense: Annotated[str, Choice("sense", SENSES)] = Field(
        default="counter-clockwise",
        title="sense of rotation",
        description="Of the input, seen along z, where teeth are given; planets are numbered counter-clockwise.",
    )

    carrier_speed: CarrierSpeed | None = Field(
        default=None,
        title="speed of the carrier",
        description="Of the frame of the coordinates; bodies are at rest without. Damping turns with it.",
        json_schema_extra=also({"type": ["number", "string"]}),
    )
    pin_preload: Flag = Field(
        default=True,
        title="preload of the pins",
        description="Whether planet bearings carry the planets' centrifugal forces, without which no rotation is free.",
    )

    gears: Teeth | None = Field(
        default=None,
        title="gears",
        description="With teeth: module, pressure_angle and face_width, from which masses, inertias, pressure angles "
        "and stiffness of the meshes follow where they are not given.",
    )

    @classmethod
    def complete(cls, document: Document, raw: dict[str, Any], size: int | None) -> None:
        """Write out the ring's teeth, the angles that are to be assembled, and a speed written in short."""
        angles.complete(document, raw)
        CarrierSpeed.complete(document, raw)

    @classmethod
    def cycles_of_input(cls, raw: dict[str, Any]) -> float | None:
        """Cycles of the meshes, which all have one frequency, in a turn of the input: see :class:`.phasing.Turning`."""
        z_s, z_r = (first_number([(raw.get("teeth") or {}).get(key)]) for key in ("sun", "ring"))
        if z_s is None or z_r is None:
            return None
        moving = Turning.of(raw, z_s, z_r)
        return 1.0 if moving is None else float(moving.cycles)  # what is wrong with input or fixed is reported

    def summary(self) -> dict[str, str]:
        """Say where the planets are, how many teeth the gears have, and what only the speeds know to be fixed."""
        p = with_teeth(self)
        psi = [np.degrees(float(angle)) for angle in angles_of(p)]
        equal = "" if p.get("angles") is not None else ", equally spaced"
        said = {"planets": f"{len(psi)} at {', '.join(f'{angle:.6g}' for angle in psi)} deg{equal}"}
        if p.get("teeth"):
            said |= {"teeth": _teeth(p["teeth"]), "phases": _phasing(p)}
            held = p.get("fixed", "ring")
            turning = "ring_tangential" if held == "ring" and p["ring"]["kind"] == "elastic" else f"{held}_rotation"
            keys = {turning, "ring_tangential"} if held == "ring" else {turning}
            if not any(np.any(p["supports"].get(key)) for key in keys):
                said["fixed"] = (
                    f"{held}, by the speeds alone: no stiffness keeps it from turning; give supports.{turning}"
                )
        return said

    def doubts(self) -> Iterator[tuple[Path, str, str]]:
        """Yield the ring's lag of profile-shifted teeth of which nothing but their numbers is known."""
        p: Any = self
        given = p.get("gears") is not None or (p.get("phases") or {}).get("sun_ring") is not None
        if p.get("teeth") and not given and (extra := _shifted(p["teeth"])):
            lag = float(lags(p, 1)["ring"][0])
            message = f"is {abs(extra)} {'more' if extra > 0 else 'less'} than z_s + 2 z_p, by profile shifts: "
            message += f"the lag of the ring's meshes depends on them, and that of standard teeth, {lag:g}, is taken"
            yield ("teeth", "ring"), message, "give phases.sun_ring, or gears and teeth.profile_shift"

    @classmethod
    def mesh_rule(cls, raw: dict[str, Any]) -> Callable[[Any], Iterator[Conflict]]:
        """With gears, the teeth give what a mesh does not."""
        return lambda mesh: PlanetaryMesh.conflicts_of(mesh, raw.get("gears") is not None)

    def equations(self) -> GearSystem:
        """See :func:`gearstab.systems.planetary.build.build`."""
        return build(with_teeth(self))

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """Planets that can be assembled at every point of a grid over their number or their teeth, besides."""
        check_assembly(document, grid)
        if grid.system.get("gears") is None:
            super().check_feasible(document, grid)
        else:
            feasibility.check_symmetric(document, grid.system)
            check_points(document, grid, ((built, MOST_TEETH // 2),))

    def dependent(self, varied: set[Path]) -> Self:
        """The teeth of the ring follow from the others if these vary: z_r = z_s + 2 z_p."""
        if ("teeth", "ring") in varied or not varied & {("teeth", "sun"), ("teeth", "planet")}:
            return self
        teeth: Any = self.teeth
        ring = teeth.sun + 2 * teeth.planet
        return self.model_copy(update={"teeth": teeth.model_copy(update={"ring": ring})})

    def assembled(self) -> bool:
        """Whether planets with known teeth fit between sun and ring, and keep clear of each other."""
        p, teeth = self, self.teeth
        if not teeth:
            return True
        sun, planet, ring, planets = (int(v) for v in (teeth["sun"], teeth["planet"], teeth["ring"], p["planets"]))
        fits = not any(True for _ in assembly(sun, planet, ring, planets, p.get("angles")))
        return fits and clear_of_each_other(sun, planet, ring, angles_of(p))

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int | None:
        ring: dict[str, Any] = raw.get("ring") or {}
        planets: Any = raw.get("planets")
        harmonics = ring.get("harmonics", HARMONICS)
        if raw.get("ring") is None or not (whole(planets, 3, MOST_PLANETS) and whole(harmonics, 2, MOST_HARMONICS)):
            return None
        waves = 1 if ring.get("kind") == "rigid" else int(harmonics)
        return size(int(planets), waves, raw.get("motion", "planar"))

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Yield what is missing for the kind of motion and ring, and phases that fit the planets and teeth."""
        yield from super().conflicts(raw)
        ring, supports = raw.get("ring") or {}, raw.get("supports") or {}
        if ring.get("kind") == "elastic" and ring.get("bending_stiffness") is None:
            remedy = "add k_bend = E J/(R^3 (1 - nu^2)), or make the ring rigid"
            yield ("ring", "bending_stiffness"), "missing", "is missing", remedy
        if ring.get("kind") == "elastic":
            for key in ("ring", "ring_rotation"):
                if supports.get(key) is not None:
                    remedy = "give ring_radial and ring_tangential, or make the ring rigid"
                    yield ("supports", key), "not_applicable", "holds a rigid ring, and this one is elastic", remedy
        gears, counts = raw.get("gears"), raw.get("teeth") or {}
        if gears is not None:
            for key in OF_GEARS:
                if gears.get(key) is None:
                    yield ("gears", key), "missing", "is missing", f"add {key}, which all gears share"
            if not all(counts.get(body) for body in ("sun", "planet", "ring")):
                hint = "add teeth: {sun: .., planet: .., ring: ..}"
                yield ("gears",), "needs_other", "needs the numbers of teeth", hint
        for section, keys in NEEDED.items():
            for key in keys if gears is None else keys[:1] if section == "inertias" else ():
                if (raw.get(section) or {}).get(key) is None:
                    where = (
                        "add it" if key == "carrier" else f"add {key}, or gears: {{module, pressure_angle, face_width}}"
                    )
                    yield (section, key), "missing", "is missing", where
        if raw.get("motion", "planar") == "planar":
            of_bodies = ("carrier", "sun") if gears is None else ("carrier",)
            for section, keys in (("masses", of_bodies), ("supports", ("planet",))):
                inner = raw.get(section, {})
                for key in keys:
                    if inner is not None and inner.get(key) is None:
                        yield (section, key), "missing", "is missing", f"add {key}, which planar motion needs"
        yield from CarrierSpeed.conflicts(raw)
        yield from _phases(raw)
        if raw.get("input", "sun") == raw.get("fixed", "ring"):
            where = "input" if "input" in raw else "fixed"
            yield (
                (where,),
                "inconsistent",
                "the body that drives is fixed",
                "choose another input, or another fixed body",
            )


def _shifted(teeth: Any) -> int:
    """Teeth of the ring beyond z_s + 2 z_p."""
    return int(teeth["ring"] - teeth["sun"] - 2 * teeth["planet"])


def _teeth(teeth: Any) -> str:
    """Numbers of teeth, and the geometry that gears were computed with."""
    extra = _shifted(teeth)
    said = f"sun {teeth['sun']}, planet {teeth['planet']}, ring {teeth['ring']} = z_s + 2 z_p" + (
        f" {'+' if extra > 0 else '-'} {abs(extra)}" if extra else ""
    )
    if teeth.get("centre_distance") is not None:
        said += f"; centre distance {teeth['centre_distance']:.6g} m"
    if shifts := held(teeth.get("profile_shift")):
        said += ", profile shifts " + ", ".join(f"{body} {value:.4g}" for body, value in shifts.items())
    return said


def _phasing(p: Any) -> str:
    """How planets turn, and by which rule the ring's meshes lag the sun's."""
    phases, moving = p.get("phases") or {}, Turning.of(p, int(p["teeth"]["sun"]), int(p["teeth"]["ring"]))
    rule = phases.get("rule") or ("as given" if phases.get("sun_ring") is not None else "pitch_point")
    lag = float(lags(p, 1)["ring"][0])
    said = f"the ring's mesh lags the sun's by {lag:.6g}, {RULES.get(rule, rule)}"
    if moving is None:
        return said
    driver = "sun" if moving.sun_drives else "planet"
    way = SENSES[moving.planets_turn < 0]
    return f"{said}; planets turn {way} on the carrier, the {driver} drives in the sun's meshes"


def _phases(raw: dict[str, Any]) -> Iterator[Conflict]:
    phases, teeth, planets = raw.get("phases"), raw.get("teeth"), raw.get("planets")
    if phases is None and teeth is None:
        yield (
            (),
            "missing",
            "phases or teeth are missing",
            "add phases: {sun: [one lag per planet], sun_ring: ..}, or teeth",
        )
    for key in ("rule", "drives") if teeth is None else ():
        if (phases or {}).get(key) is not None:
            yield ("phases", key), "not_applicable", "is of teeth, and none are given", "add teeth, or remove it"
    rule, between = ((phases or {}).get(key) for key in ("rule", "sun_ring"))
    if rule is not None and between is not None and raw.get("gears") is not None:
        yield ("phases", "rule"), "already_given", "sun_ring is given already", "keep one of sun_ring and rule"
    if rule == "entry" and between is None and teeth is not None and raw.get("gears") is None:
        hint = "add gears: {module, pressure_angle, face_width}, or take pitch_point"
        yield ("phases", "rule"), "needs_other", "needs the radii of the teeth", hint
    sun = (phases or {}).get("sun")
    if sun is not None and teeth is not None:
        yield ("phases", "sun"), "already_given", "the phases follow from teeth already", "keep phases.sun or teeth"
    elif whole(planets, 3, MOST_PLANETS):
        yield from within(raw, "phases", lambda phases: wrong_length(phases, "sun", planets, "planet"))
    numbers: list[Any] = [(teeth or {}).get(key) for key in ("sun", "planet", "ring")]
    psi = raw.get("angles")
    if whole(planets, 3, MOST_PLANETS):
        yield from wrong_length(raw, "angles", planets, "planet")
    if psi is None and all(whole(number, 4, 10**6) for number in numbers):
        yield from assembly(int(numbers[0]), int(numbers[1]), int(numbers[2]), planets)
