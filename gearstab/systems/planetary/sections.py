"""The section ``system`` of a planetary gear: sun, carrier, planets and ring."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from gearstab.config.document import Document, Path
from gearstab.config.model import Grid
from gearstab.config.model.conflicts import Conflict, below, within, wrong_length
from gearstab.config.model.fields import Choice, Count, Flag, Quantity, also, optional
from gearstab.config.model.reading import WRONG, known
from gearstab.system import Array, GearSystem
from gearstab.systems import feasibility
from gearstab.systems.base import START_MESH, Start, System
from gearstab.systems.gearbox.bodies import Teeth
from gearstab.systems.gearbox.feasibility import MOST_TEETH, built, check_points
from gearstab.systems.planetary.build import build, size
from gearstab.systems.planetary.parts import (
    SENSES,
    BodyLoad,
    CarrierSpeed,
    Inertias,
    Masses,
    Meshes,
    Phases,
    PlanetaryMesh,
    PressureAngles,
    Ring,
    Supports,
    ToothNumbers,
    Turning,
    lags,
)
from gearstab.systems.planetary.planets import (
    ASSEMBLE,
    MOST_PLANETS,
    angles_of,
    assembly,
    check_assembly,
    clear_of_each_other,
    write_out_teeth,
)
from gearstab.systems.planetary.teeth import listed, phasing_of, shifted, with_teeth

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

    kind: Literal["planetary"] = Field(title="kind of system")
    """A planetary gear."""
    planets: Annotated[Fraction, Count(of="planets"), Field(le=MOST_PLANETS)] = Field(title="number of planets")
    """N >= 3, equally spaced without angles."""
    angles: list[Annotated[float, Quantity("rad")]] | None = optional(
        "angle of a planet", json_schema_extra=also({"const": ASSEMBLE})
    )
    """psi_n (rad, or with a unit), or assemble: the nearest to equal ones at which the teeth fit."""
    motion: Annotated[str, Choice("motion", ("planar", "rotational"))] = "planar"
    """planar, or rotational: bodies only rotate and the planets' centres move with the carrier."""
    scaling: Annotated[str, Choice("scaling", ("SI", "dimensionless"))] = "SI"
    """dimensionless: masses over m_r, stiffnesses over k_rp and frequencies over sqrt(k_rp/m_r)."""
    ring: Ring
    """How the ring deforms."""
    masses: Masses = Masses()
    """Mass of each body."""
    inertias: Inertias = Inertias()
    """Moments of inertia over squared base radii."""
    supports: Supports = Supports()
    """Stiffness of the supports and planet bearings."""
    pressure_angles: PressureAngles = PressureAngles()
    """Pressure angles of both kinds of meshes."""
    meshes: Meshes
    """The meshes of the sun and of the ring."""
    load: BodyLoad | None = None
    """Constant torques on ring, carrier and sun, over their radii (N)."""
    phases: Phases | None = optional("mesh phases")
    """When the waves of the meshes begin; or give teeth."""
    teeth: ToothNumbers | None = optional("tooth numbers")
    """From which the mesh phases follow; or give phases."""

    input: Annotated[str, Choice("input", BODIES)] = "sun"
    """The body whose speed input_speed is, where teeth are given."""
    fixed: Annotated[str, Choice("fixed body", BODIES)] = Field(default="ring", title="fixed body")
    """The body that does not turn: it tells how fast the teeth mesh at an input_speed."""

    sense: Annotated[str, Choice("sense", SENSES)] = Field(default="counter-clockwise", title="sense of rotation")
    """Sense of rotation of the input, seen along z, where teeth are given; planets are numbered counter-clockwise."""

    carrier_speed: CarrierSpeed | None = optional(
        "speed of the carrier", json_schema_extra=also({"type": ["number", "string"]})
    )
    """Speed of the frame of the coordinates; bodies are at rest without. Damping turns with it."""
    pin_preload: Flag = Field(default=True, title="preload of the pins")
    """Whether planet bearings carry the planets' centrifugal forces, without which no rotation is free."""

    gears: Teeth | None = None
    """With teeth: module, pressure_angle and face_width, from which masses, inertias, pressure angles and stiffness of
    the meshes follow where they are not given."""

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """Write out the ring's teeth, the angles that are to be assembled, and a speed written in short."""
        write_out_teeth(document, document.data["system"])
        CarrierSpeed.complete(document, document.data["system"])
        return super().complete(document, source)

    def cycles_of_input(self) -> float | None:
        """Cycles of the meshes, which all have one frequency, in a turn of the input: see :class:`.phasing.Turning`."""
        if self.teeth is None:
            return None
        moving = Turning.of(self, int(self.teeth.sun), int(self.teeth.ring))
        return 1.0 if moving is None else float(moving.cycles)  # what is wrong with input or fixed is reported

    def summary(self) -> dict[str, str]:
        """Say where the planets are, how many teeth the gears have, and what only the speeds know to be fixed."""
        p = with_teeth(self)
        psi = [np.degrees(float(angle)) for angle in angles_of(self.planets, self.angles)]
        equal = "" if self.angles is not None else ", equally spaced"
        said = {"planets": f"{len(psi)} at {', '.join(f'{angle:.6g}' for angle in psi)} deg{equal}"}
        if p.teeth is not None:
            said |= {"teeth": listed(p.teeth), "phases": phasing_of(p)}
            fixed = self.fixed
            turning = "ring_tangential" if fixed == "ring" and self.ring.kind == "elastic" else f"{fixed}_rotation"
            keys = {turning, "ring_tangential"} if fixed == "ring" else {turning}
            if not any(np.any(self.supports[key]) for key in keys if self.supports[key] is not None):
                said["fixed"] = (
                    f"{fixed}, by the speeds alone: no stiffness keeps it from turning; give supports.{turning}"
                )
        return said

    def doubts(self) -> Iterator[tuple[Path, str, str]]:
        """Yield the ring's lag of profile-shifted teeth of which nothing but their numbers is known."""
        given = self.gears is not None or (self.phases is not None and self.phases.sun_ring is not None)
        if self.teeth and not given and (extra := shifted(self.teeth)):
            lag = float(lags(self, 1)["ring"][0])
            message = f"is {abs(extra)} {'more' if extra > 0 else 'less'} than z_s + 2 z_p, by profile shifts: "
            message += f"the lag of the ring's meshes depends on them, and that of standard teeth, {lag:g}, is taken"
            yield ("teeth", "ring"), message, "give phases.sun_ring, or gears and teeth.profile_shift"

    def mesh_conflicts(self, mesh: PlanetaryMesh) -> Iterator[Conflict]:
        """With gears, the teeth give what a mesh does not."""
        yield from mesh.conflicts(self.gears is not None)

    def equations(self) -> GearSystem:
        """See :func:`gearstab.systems.planetary.build.build`."""
        return build(with_teeth(self))

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """Planets that can be assembled at every point of a grid over their number or their teeth, besides."""
        check_assembly(document, grid)
        if grid.system.gears is None:
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
        teeth = self.teeth
        if teeth is None:
            return True
        sun, planet, ring = int(teeth.sun), int(teeth.planet), int(teeth.ring)
        fits = not any(True for _ in assembly(sun, planet, ring, int(self.planets), self.angles))
        return fits and clear_of_each_other(sun, planet, ring, angles_of(self.planets, self.angles))

    def size(self) -> int | None:
        return size(self)

    def conflicts(self) -> Iterator[Conflict]:
        """Yield what is missing for the kind of motion and ring, and phases that fit the planets and teeth."""
        yield from super().conflicts()
        for rule in (self._elastic_ring, self._gears, self._bodies, self._phases, self._assembly):
            yield from known(rule())
        yield from within(self, "carrier_speed", lambda speed: speed.conflicts(self))
        if self.input == self.fixed:
            where = "input" if "input" in self.model_fields_set else "fixed"
            message = "the body that drives is fixed"
            yield (where,), "inconsistent", message, "choose another input, or another fixed body"

    def _elastic_ring(self) -> Iterator[Conflict]:
        if self.ring.kind != "elastic":
            return
        if self.ring.bending_stiffness is None:
            remedy = "add k_bend = E J/(R^3 (1 - nu^2)), or make the ring rigid"
            yield ("ring", "bending_stiffness"), "missing", "is missing", remedy
        for key in ("ring", "ring_rotation"):
            if self.supports[key] is not None:
                remedy = "give ring_radial and ring_tangential, or make the ring rigid"
                yield ("supports", key), "not_applicable", "holds a rigid ring, and this one is elastic", remedy

    def _gears(self) -> Iterator[Conflict]:
        if self.gears is None:
            return
        for key in OF_GEARS:
            if self.gears[key] is None:
                yield ("gears", key), "missing", "is missing", f"add {key}, which all gears share"
        if self.teeth is None:
            hint = "add teeth: {sun: .., planet: .., ring: ..}"
            yield ("gears",), "needs_other", "needs the numbers of teeth", hint

    def _bodies(self) -> Iterator[Conflict]:
        needed = NEEDED if self.gears is None else {"inertias": ("carrier",)}
        for section, keys in needed.items():
            for key in keys:
                if self[section] is not WRONG and self[section][key] is None:
                    gears = f"add {key}, or gears: {{module, pressure_angle, face_width}}"
                    yield (section, key), "missing", "is missing", "add it" if key == "carrier" else gears
        if self.motion != "planar":
            return
        for section, keys in {
            "masses": ("carrier", "sun")[: 2 - (self.gears is not None)],
            "supports": ("planet",),
        }.items():
            for key in keys:
                if self[section] is not WRONG and self[section][key] is None:
                    yield (section, key), "missing", "is missing", f"add {key}, which planar motion needs"

    def _phases(self) -> Iterator[Conflict]:
        phases, teeth = self.phases, self.teeth
        if phases is None:
            if teeth is None:
                hint = "add phases: {sun: [one lag per planet], sun_ring: ..}, or teeth"
                yield (), "missing", "phases or teeth are missing", hint
            return
        for key in ("rule", "drives") if teeth is None else ():
            if phases[key] is not None:
                yield ("phases", key), "not_applicable", "is of teeth, and none are given", "add teeth, or remove it"
        if phases.rule is not None and phases.sun_ring is not None and self.gears is not None:
            yield ("phases", "rule"), "already_given", "sun_ring is given already", "keep one of sun_ring and rule"
        if phases.rule == "entry" and phases.sun_ring is None and teeth is not None and self.gears is None:
            hint = "add gears: {module, pressure_angle, face_width}, or take pitch_point"
            yield ("phases", "rule"), "needs_other", "needs the radii of the teeth", hint
        if phases.sun is not None and teeth is not None:
            yield ("phases", "sun"), "already_given", "the phases follow from teeth already", "keep phases.sun or teeth"
        else:
            yield from below("phases", wrong_length(phases, "sun", int(self.planets), "planet"))

    def _assembly(self) -> Iterator[Conflict]:
        yield from wrong_length(self, "angles", int(self.planets), "planet")
        if self.angles is None and self.teeth is not None:
            teeth = self.teeth
            yield from assembly(int(teeth.sun), int(teeth.planet), int(teeth.ring), self.planets)
