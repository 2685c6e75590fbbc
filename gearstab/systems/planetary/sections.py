"""The section ``system`` of a planetary gear: sun, carrier, planets and ring."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Field

from gearstab.config.document.problems import Path
from gearstab.config.document.yaml import Document
from gearstab.config.model.conflicts import Conflict, within, wrong_length
from gearstab.config.model.fields import (
    Choice,
    Count,
    Mass,
    NonNegative,
    Quantity,
    Section,
    ToothCount,
    Turns,
    Whole,
)
from gearstab.system import GearSystem
from gearstab.systems.base import START_MESH, Start, System, first_number
from gearstab.systems.gearbox import sections as gearbox
from gearstab.systems.parts.mesh import ToothMesh
from gearstab.systems.planetary import angles, teeth
from gearstab.systems.planetary.angles import ASSEMBLE, angles_of
from gearstab.systems.planetary.build import build, coordinates
from gearstab.systems.planetary.feasibility import MOST_PLANETS, assembly, check_assembly, clear_of_each_other, whole
from gearstab.systems.planetary.phasing import cycles

if TYPE_CHECKING:
    from gearstab.config.model.axes import Grid

HARMONICS = 12
"""Default of J. Natural frequencies converge as J^-3: of a gear as in Parker (2009, Table 1) with 3 to 8 planets
the first nine are within 4e-5 of their limits with 8, 1.1e-5 with 12, 4e-6 with 16 and 2e-6 with 20, relative."""
MOST_HARMONICS = 200

BODIES = ("sun", "carrier", "ring")
"""The bodies on the axis, of which one drives and one is fixed."""

Support = Annotated[float, Field(ge=0), Quantity("N/m")]
BodyForce = Annotated[float, Quantity("N", entry=True)]
PressureAngle = Annotated[float, Field(gt=-1.5, lt=1.5), Quantity("rad")]


class Ring(Section):
    """The ring gear: a rigid body, or a thin ring that bends in its plane without stretching."""

    kind: Annotated[str, Choice("kind of ring", ("rigid", "elastic"))] = Field(
        title="kind of ring", description="rigid, or elastic: it bends in its plane (Parker 2009)."
    )
    harmonics: Annotated[int, Field(ge=2, le=MOST_HARMONICS), Whole] = Field(
        default=HARMONICS,
        title="harmonics of the ring's deflection",
        description="J: the elastic deflection has 2 to J waves around an elastic ring.",
    )
    bending_stiffness: Annotated[float, Field(gt=0), Quantity("N/m")] | None = Field(
        default=None,
        title="bending stiffness of the ring",
        description="k_bend = E J/(R^3 (1 - nu^2)) of an elastic ring (N/m).",
    )


class Masses(Section):
    """Masses of the bodies."""

    ring: Mass | None = Field(default=None, title="mass of the ring", description="m_r (kg); from gears without.")
    carrier: Mass | None = Field(default=None, title="mass of the carrier", description="m_c, for planar motion (kg).")
    sun: Mass | None = Field(default=None, title="mass of the sun", description="m_s, for planar motion (kg).")
    planet: Mass | None = Field(
        default=None, title="mass of a planet", description="m_p, of each planet (kg); from gears without."
    )


class Inertias(Section):
    """Moments of inertia over squared base radii, of the carrier over that of the planets' centres."""

    ring: Mass | None = Field(
        default=None,
        title="inertia of the ring",
        description="I_r/r_r^2 (kg); m_r/cos^2 of the ring's pressure angle, a thin rim at the pitch radius, without.",
    )
    carrier: Mass | None = Field(
        default=None,
        title="inertia of the carrier",
        description="I_c/r_c^2, r_c where the planets' centres are (kg); required.",
    )
    sun: Mass | None = Field(
        default=None, title="inertia of the sun", description="I_s/r_s^2 (kg); from gears without."
    )
    planet: Mass | None = Field(
        default=None, title="inertia of a planet", description="I_p/r_p^2, of each planet (kg); from gears without."
    )


class Supports(Section):
    """Stiffness of the supports; a body without one is free."""

    carrier: Support = Field(
        default=0.0, title="support of the carrier", description="k_c, in every direction of the plane (N/m)."
    )
    sun: Support = Field(
        default=0.0, title="support of the sun", description="k_s, in every direction of the plane (N/m)."
    )
    planet: Support | None = Field(
        default=None,
        title="planet bearing",
        description="k_p, between each planet and the carrier, in every direction, for planar motion (N/m).",
    )
    carrier_rotation: Support = Field(
        default=0.0,
        title="rotational support of the carrier",
        description="k_cu, torsional stiffness over r_c^2 (N/m).",
    )
    sun_rotation: Support = Field(
        default=0.0, title="rotational support of the sun", description="k_su, torsional stiffness over r_s^2 (N/m)."
    )
    ring: Support | None = Field(
        default=None,
        title="support of the ring",
        description="k_r of a rigid ring, in every direction of the plane (N/m).",
    )
    ring_rotation: Support | None = Field(
        default=None,
        title="rotational support of the ring",
        description="k_ru of a rigid ring, torsional stiffness over r_r^2 (N/m).",
    )
    ring_radial: Support = Field(
        default=0.0,
        title="radial foundation of the ring",
        description="k_rbs R: radial stiffness per radian of the ring's circumference (N/m).",
    )
    ring_tangential: Support = Field(
        default=0.0,
        title="tangential foundation of the ring",
        description="k_rus R: tangential stiffness per radian of the ring's circumference (N/m).",
    )


class PressureAngles(Section):
    """Pressure angles; negative ones for load on the other flanks."""

    sun: PressureAngle | None = Field(
        default=None,
        title="pressure angle of the sun's meshes",
        description='alpha_s; in rad, or with a unit: "24.6 deg".',
    )
    ring: PressureAngle | None = Field(
        default=None,
        title="pressure angle of the ring's meshes",
        description='alpha_r; in rad, or with a unit: "24.6 deg".',
    )


class PlanetaryMesh(ToothMesh):
    """The meshes of the sun, or of the ring, with the planets: all alike but for their phases."""

    single_pair_stiffness: Annotated[float, Field(gt=0), Quantity("N/m")] | None = Field(
        default=None,
        title="measured stiffness of a pair",
        description="With gears: in contact at the pitch point (N/m); the ring's teeth are not computed and need it.",
    )
    double_contact_factor: Annotated[float, Field(gt=0.5, le=1), Quantity()] | None = Field(
        default=None,
        title="double contact factor",
        description="With gears: stiffness of two pairs over the sum of theirs (1); 1 without.",
    )
    variation: NonNegative | None = Field(
        default=None,
        title="measured variation",
        description="With gears: (max k - min k)/mean k of the mesh stiffness (1).",
    )

    misplaced: ClassVar[dict[str, str]] = {
        "name": "the meshes are called sun1, sun2, ... and ring1, ring2, ...",
        "lag": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phase": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phasing": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
    }


class BodyLoad(Section):
    """Constant torques on the bodies on the axis, over their base radius, of the carrier over that of the planets."""

    ring: BodyForce = Field(default=0.0, title="load of the ring", description="Torque on the ring over r_r (N).")
    carrier: BodyForce = Field(
        default=0.0, title="load of the carrier", description="Torque on the carrier over r_c (N)."
    )
    sun: BodyForce = Field(default=0.0, title="load of the sun", description="Torque on the sun over r_s (N).")


class Meshes(Section):
    """Both kinds of meshes."""

    sun: PlanetaryMesh = Field(title="sun's meshes", description="Each planet with the sun.")
    ring: PlanetaryMesh = Field(title="ring's meshes", description="Each planet with the ring.")


class Phases(Section):
    """Mesh phases, as lags in periods of the mesh."""

    sun: list[Turns] | None = Field(
        default=None,
        title="phase of a sun's mesh",
        description="gamma_sn, one per planet, of the waves of the sun's meshes (1); all 0, in phase, without.",
    )
    sun_ring: Turns | None = Field(
        default=None,
        title="phase of the ring's meshes",
        description="gamma_sr: the ring's mesh of a planet lags its sun's mesh by this (1); 0 or from teeth without.",
    )


Teeth = Annotated[ToothCount, Field(ge=4)]


class ToothNumbers(Section):
    """Tooth numbers, from which the mesh phases follow."""

    sun: Teeth = Field(title="teeth of the sun", description="z_s.")
    planet: Teeth = Field(title="teeth of a planet", description="z_p.")
    ring: Teeth = Field(
        default=cast(Any, None),  # from the others
        title="teeth of the ring",
        description="z_r = z_s + 2 z_p, without too; (z_s + z_r)/planets is an integer for equal angles.",
    )


NEEDED = {
    "masses": ("ring", "planet"), "inertias": ("carrier", "sun", "planet"), "pressure_angles": ("sun", "ring"),
}  # fmt: skip
"""Numbers that are given, or follow from the teeth."""


def _or_assemble(schema: dict[str, Any]) -> None:
    schema["anyOf"].append({"const": ASSEMBLE})


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
        json_schema_extra=_or_assemble,
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

    gears: gearbox.Teeth | None = Field(
        default=None,
        title="gears",
        description="With teeth: module, pressure_angle and face_width, from which masses, inertias, pressure angles "
        "and stiffness of the meshes follow where they are not given.",
    )

    @classmethod
    def complete(cls, document: Document, raw: dict[str, Any], size: int | None) -> None:
        """Fill in what follows from the teeth, see :mod:`.angles` and :mod:`.teeth`."""
        angles.complete(document, raw)
        teeth.fill(document, raw)

    @classmethod
    def cycles_of_input(cls, raw: dict[str, Any]) -> float | None:
        """Cycles of the meshes, which all have one frequency, in a turn of the input: see :func:`.phasing.cycles`."""
        teeth = raw.get("teeth") or {}
        z_s, z_r = (first_number([teeth.get(key)]) for key in ("sun", "ring"))
        driving, held = raw.get("input", "sun"), raw.get("fixed", "ring")
        return None if z_s is None or z_r is None else cycles(str(driving), str(held), z_s, z_r)

    @classmethod
    def summary(cls, p: dict[str, Any]) -> dict[str, str]:
        """Say where the planets are, and how many teeth the gears have."""
        psi = [np.degrees(float(angle)) for angle in angles_of(p)]
        equal = "" if p.get("angles") is not None else ", equally spaced"
        said = {"planets": f"{len(psi)} at {', '.join(f'{angle:.6g}' for angle in psi)} deg{equal}"}
        if p.get("teeth"):
            z_s, z_p, z_r = (int(p["teeth"][body]) for body in ("sun", "planet", "ring"))
            said["teeth"] = f"sun {z_s}, planet {z_p}, ring {z_r} = z_s + 2 z_p"
        return said

    @classmethod
    def build(cls, p: dict[str, Any]) -> GearSystem:
        """See :func:`gearstab.systems.planetary.build.build`."""
        return build(p)

    @classmethod
    def check_feasible(cls, document: Document, grid: Grid) -> None:
        """Planets that can be assembled at every point of a grid over their number or their teeth, besides."""
        super().check_feasible(document, grid)
        check_assembly(document, grid)

    @classmethod
    def dependent(cls, p: dict[str, Any], varied: set[Path]) -> dict[str, Any]:
        """The teeth of the ring follow from the others if these vary: z_r = z_s + 2 z_p."""
        if ("teeth", "ring") in varied or not varied & {("teeth", "sun"), ("teeth", "planet")}:
            return p
        teeth = p["teeth"]
        return p | {"teeth": teeth | {"ring": teeth["sun"] + 2 * teeth["planet"]}}

    @classmethod
    def assembled(cls, p: dict[str, Any]) -> bool:
        """Whether planets with known teeth fit between sun and ring, and keep clear of each other."""
        teeth = p.get("teeth")
        if not teeth:
            return True
        sun, planet, ring, planets = (int(v) for v in (teeth["sun"], teeth["planet"], teeth["ring"], p["planets"]))
        fits = not any(True for _ in assembly(sun, planet, ring, planets, p.get("angles")))
        return fits and clear_of_each_other(sun, planet, angles_of(p))

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int | None:
        ring: dict[str, Any] = raw.get("ring") or {}
        planets: Any = raw.get("planets")
        harmonics = ring.get("harmonics", HARMONICS)
        if raw.get("ring") is None or not (whole(planets, 3, MOST_PLANETS) and whole(harmonics, 2, MOST_HARMONICS)):
            return None
        waves = 1 if ring.get("kind") == "rigid" else int(harmonics)
        return len(coordinates(int(planets), waves, raw.get("motion", "planar")))

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Yield what is missing for the kind of motion and ring, and phases that fit the planets and teeth."""
        yield from super().conflicts(raw)
        ring, supports = raw.get("ring") or {}, raw.get("supports") or {}
        if ring.get("kind") == "elastic" and ring.get("bending_stiffness") is None:
            remedy = "add k_bend = E J/(R^3 (1 - nu^2)), or make the ring rigid"
            yield ("ring", "bending_stiffness"), "is missing", remedy
        if ring.get("kind") == "elastic":
            for key in ("ring", "ring_rotation"):
                if supports.get(key) is not None:
                    remedy = "give ring_radial and ring_tangential, or make the ring rigid"
                    yield ("supports", key), "holds a rigid ring, and this one is elastic", remedy
        for section, keys in NEEDED.items():
            for key in keys:
                if (raw.get(section) or {}).get(key) is None:
                    where = (
                        "add it" if key == "carrier" else f"add {key}, or gears: {{module, pressure_angle, face_width}}"
                    )
                    yield (section, key), "is missing", where
        if raw.get("motion", "planar") == "planar":
            for section, keys in (("masses", ("carrier", "sun")), ("supports", ("planet",))):
                inner = raw.get(section, {})
                for key in keys:
                    if inner is not None and inner.get(key) is None:
                        yield (section, key), "is missing", f"add {key}, which planar motion needs"
        yield from _phases(raw)
        if raw.get("input", "sun") == raw.get("fixed", "ring"):
            where = "input" if "input" in raw else "fixed"
            yield (where,), "the body that drives is fixed", "choose another input, or another fixed body"


def _phases(raw: dict[str, Any]) -> Iterator[Conflict]:
    phases, teeth, planets = raw.get("phases"), raw.get("teeth"), raw.get("planets")
    if phases is None and teeth is None:
        yield (), "phases or teeth are missing", "add phases: {sun: [one lag per planet], sun_ring: ..}, or teeth"
    sun = (phases or {}).get("sun")
    if sun is not None and teeth is not None:
        yield ("phases", "sun"), "the phases follow from teeth already", "keep phases.sun or teeth"
    elif whole(planets, 3, MOST_PLANETS):
        yield from within(raw, "phases", lambda phases: wrong_length(phases, "sun", planets, "planet"))
    numbers: list[Any] = [(teeth or {}).get(key) for key in ("sun", "planet", "ring")]
    psi = raw.get("angles")
    if whole(planets, 3, MOST_PLANETS):
        yield from wrong_length(raw, "angles", planets, "planet")
    if psi is None and all(whole(number, 4, 10**6) for number in numbers):
        yield from assembly(int(numbers[0]), int(numbers[1]), int(numbers[2]), planets)
