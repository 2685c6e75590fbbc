"""A planetary set in a train: its members are rotors, its planets bodies of their own.

Its lateral coordinates turn with the carrier; rotations are those of the bodies, absolute, as elsewhere in the train.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import tau
from typing import Any

import numpy as np

from gearstab.config.model.reading import held
from gearstab.errors import NotPossible
from gearstab.mesh import Rotation
from gearstab.system import Array, Cyclic
from gearstab.systems.assembly import Coordinates, Element, Row, total
from gearstab.systems.gearbox.bodies import base_radius, number, other
from gearstab.systems.gearbox.meshes import MEMBERS, Planets, SetFault, SetPhases
from gearstab.systems.gearbox.teeth import MeshTeeth
from gearstab.systems.kinematics import MeshMotion, TrainError, Where
from gearstab.systems.planetary.planets import SetRows, angles_of, assembly, misfit, turn_matrix
from gearstab.systems.planetary.teeth import SetTeeth

OF_PLANETS = ("module", "pressure_angle", "helix_angle", "face_width", "addendum", "dedendum")
"""Fields that planets share with the sun by default."""
TYPES = ("rotational", "translational", "planet")


@dataclass(frozen=True)
class TrainMesh:
    """One mesh of a train: its name, how its gears turn, the driver first, their teeth, and the lag in mesh periods.

    lag: exact where it follows from numbers of teeth alone. turned: whether the driver is the second gear of ``teeth``.
    """

    name: str
    motion: MeshMotion
    teeth: MeshTeeth
    lag: Fraction | Array
    turned: bool = False

    @property
    def gears(self) -> tuple[str, str]:
        """Names of driver and driven gear."""
        return self.motion.gears


@dataclass(frozen=True)
class TrainSet:
    """A set by its parameters p, with the rotors that are its gears, by member.

    where: its path below ``system``. force: returns the force of a mesh of a set, N.
    """

    p: Any
    rotors: Mapping[str, dict[str, Any]]
    material: dict[str, Any]
    where: Where
    force: Callable[[TrainSet], Array]

    @property
    def name(self) -> str:
        return str(self.p.name)

    @property
    def planet(self) -> str:
        """Name of all planets in a table of speeds."""
        return f"{self.name}.planet"

    @property
    def planets(self) -> Planets:
        return self.p.planets

    @property
    def count(self) -> int:
        return int(self.planets.count)

    def counted(self, gear: str) -> int:
        """Number of teeth of ``sun``, ``ring`` or ``planet``."""
        return int(self.planets.teeth if gear == "planet" else self.rotors[gear]["teeth"])

    @property
    def body(self) -> dict[str, str]:
        """Names of the members, and of the planets, in the train."""
        return {member: self.p[member] for member in MEMBERS} | {"planet": self.planet}

    @cached_property
    def teeth(self) -> SetTeeth:
        sun = self.rotors["sun"]
        shared = {key: sun[key] for key in OF_PLANETS if key in sun}
        planet = shared | held(self.planets)
        if sun.get("hand") is not None:
            planet["hand"] = other(sun["hand"])  # the ring's is that of its rotor
        gears = {"sun": sun, "planet": planet, "ring": self.rotors["ring"]}
        return SetTeeth(gears, dict(self.p.meshes), self.material, self.p.centre_distance, lambda: self.force(self))

    @contextmanager
    def told(self) -> Iterator[None]:
        """Say of a mistake in the teeth which set has it."""
        try:
            yield
        except TrainError as error:
            raise TrainError((*self.where, *error.where), error.message, error.remedy) from None
        except NotPossible as error:
            raise TrainError(self.where, error.message, error.remedy or "change the teeth") from None

    @cached_property
    def motions(self) -> tuple[MeshMotion, MeshMotion]:
        """How sun and planet, planet and ring turn."""
        body, carrier = self.body, self.p.carrier
        first, second = ((body[a], body[b]) for a, b in (("sun", "planet"), ("planet", "ring")))
        z = {gear: self.counted(gear) for gear in ("sun", "planet", "ring")}
        return (
            MeshMotion(first, (z["sun"], z["planet"]), False, self.where, carrier),
            MeshMotion(second, (z["planet"], z["ring"]), True, self.where, carrier),
        )

    @property
    def angles(self) -> list[Array]:
        """psi_1..psi_N."""
        return angles_of(self.count, self.planets.angles)

    @property
    def turns(self) -> list[Fraction | Array]:
        """psi_n/2 pi: equal parts, or the places of the teeth that the angles mean; exact without a batch of angles.

        Raises TrainError where teeth do not fit.
        """
        sun, ring = self.counted("sun"), self.counted("ring")
        if self.planets.angles is None:
            for _, _, message, remedy in assembly(sun, self.counted("planet"), ring, self.count):
                raise TrainError((*self.where, "planets", "teeth"), message, remedy)
            return [Fraction(n, self.count) for n in range(self.count)]
        angles, places = self.angles, sun + ring
        if wrong := misfit(sun, ring, angles):
            n, message, remedy = wrong
            if any(np.any(np.abs(angle) > tau) for angle in angles):
                remedy = f'plain numbers are radians: write "{float(np.ravel(angles[n - 1])[0]):.6g} deg"'
            raise TrainError((*self.where, "planets", "angles"), message, remedy)
        steps = [np.rint((angle - angles[0]) * places / tau) for angle in angles]
        return [step / places if step.ndim else Fraction(round(float(step)), places) for step in steps]

    def lags(self, planets_turn: int, sun_drives: bool) -> dict[str, list[Any]]:
        """Return gamma_sn = -sigma z_s psi_n/2 pi, exact, and gamma_rn = gamma_sn + gamma_sr, in mesh periods.

        planets_turn: sigma, 1 for planets that turn counter-clockwise on the carrier, else -1.
        """
        sun = [-planets_turn * self.counted("sun") * turn % 1 for turn in self.turns]
        phases = self.p.phases or SetPhases()
        with self.told():
            between = self.teeth.lag(phases.rule or "entry", sun_drives)
        between = between if phases.sun_ring is None else number(phases.sun_ring)
        return {"sun": [*sun], "ring": [(np.asarray(lag, dtype=float) + between) % 1 for lag in sun]}

    def meshes(self, planets_turn: int, sun_drives: bool) -> Iterator[TrainMesh]:
        """Yield the meshes of sun and planets, then those of planets and ring, as :meth:`lags`."""
        lags = self.lags(planets_turn, sun_drives)
        for motion, name in zip(self.motions, ("sun", "ring"), strict=True):
            driven = motion if sun_drives else motion.reversed
            for n, lag in enumerate(lags[name], start=1):
                yield TrainMesh(f"{self.name}.{name}.{n}", driven, self.teeth.pairs[name], lag, not sun_drives)

    def weak_pairs(self, planets_turn: int, sun_drives: bool) -> Iterator[tuple[str, int, SetFault, int]]:
        """Yield every mesh, ``sun`` or ``ring`` and the planet's number, in which a weak tooth carries, and when.

        That is the section of the fault, and the number of cycles that its pair enters after the start of the wave of
        the mesh. A tooth of sun or ring meets the planets in turn. A planet's tooth comes from the sun to the ring in
        z_p/2 cycles, half a cycle less where the sun drives, and half a cycle more where it is driven: a crack weakens
        both meshes.
        """
        lags, turns = self.lags(planets_turn, sun_drives), self.turns
        for fault in self.p.faults:
            gear, first = fault.gear, fault.tooth - 1
            if gear == "planet":
                n = fault.planet or 1
                meets = {"sun": 0.0, "ring": self.counted("planet") / 2 + (-0.5 if sun_drives else 0.5)}
                wanted = ("sun", "ring") if fault.kind == "crack" else (fault.flank or "sun",)
                for name in wanted:
                    after = meets[name] + _first(lags["sun"][n - 1]) - _first(lags[name][n - 1])
                    yield name, n, fault, round(after) + first
                continue
            sense = -planets_turn if gear == "sun" else planets_turn
            for n, turn in enumerate(turns, start=1):
                start = sense * self.counted(gear) * _first(turn) + _first(lags[gear][0])
                yield gear, n, fault, round(start - _first(lags[gear][n - 1])) + first

    @property
    def coordinates(self) -> dict[str, str]:
        """Coordinates of the planets and their units."""
        ways = (".radial", ".tangential") if self.planets.support is not None else ()
        planets = [f"{self.planet} {n + 1}" for n in range(self.count)]
        return {f"{planet}{way}": "m" if way else "rad" for planet in planets for way in ("", *ways)}

    def rows(self, coordinates: Coordinates, signs: Mapping[str, int]) -> TrainSetRows:
        """Return how its bodies move. signs: 1 of bodies whose coordinate is counter-clockwise, else -1."""
        return TrainSetRows(self.count, tuple(self.angles), self, coordinates, signs)


@dataclass(frozen=True)
class TrainSetRows(SetRows):
    """Motions of the bodies of a set as rows over the coordinates of the train."""

    item: TrainSet
    coordinates: Coordinates
    signs: Mapping[str, int]

    def name(self, body: str) -> str:
        """Return what the train calls a body."""
        number = body.removeprefix("planet")
        return self.item.body[body] if number == body else f"{self.item.planet} {number}"

    def rotation(self, body: str) -> Row:
        kind, name = body.rstrip("0123456789"), self.name(body)
        teeth = self.item.teeth
        radius = teeth.centre if kind == "carrier" else base_radius(teeth.gears[kind])
        sign = self.signs[self.item.body[kind]]
        return {name: sign * radius} if name in self.coordinates.units else {}

    def shift(self, body: str, x: Any, y: Any) -> Row:
        name, planet = self.name(body), body.startswith("planet")
        ways = ("radial", "tangential") if planet else ("x", "y")
        if f"{name}.{ways[0]}" in self.coordinates.units:
            return {f"{name}.{ways[0]}": x, f"{name}.{ways[1]}": y}
        if not planet:
            return {}
        psi = self.angle(int(body.removeprefix("planet")))
        cosine, sine = np.cos(psi), np.sin(psi)
        turning = {key: y * value for key, value in self.rotation("carrier").items()}
        return total(self.shift("carrier", x * cosine - y * sine, x * sine + y * cosine), turning)

    def deflection(self, name: str, n: int, angle: Array) -> dict[str, Any]:
        """Return the deflection with that along the axis: u - z tan beta_b of a right-handed gear in place of u.

        Planets keep their place on the carrier.
        """
        lead = self.item.teeth.pairs[name].lead
        return total(super().deflection(name, n, angle), self.slide(name, -lead), self.slide("carrier", lead))

    def slide(self, body: str, along: Any) -> Row:
        """Return ``along`` times the displacement of a member along the axis."""
        name = f"{self.name(body)}.z"
        return {name: along} if name in self.coordinates.units else {}

    def planets_of(self, factor: Array) -> Iterator[Element]:
        """Yield masses and bearings of the planets. factor: of all damping."""
        with self.item.told():
            mass, inertia = self.item.teeth.body("planet")
        support = self.item.planets.support
        yield Element(self.slide("carrier", 1.0), mass=self.planets * np.asarray(mass))
        for n in self.numbers:
            yield Element({self.name(f"planet{n}"): 1.0}, mass=inertia)
            for along in ((1.0, 0.0), (0.0, 1.0)):
                yield Element(self.shift(f"planet{n}", *along), mass=mass)
            if support is None:
                continue
            for way, row in zip(("radial", "tangential"), self.bearing(n), strict=True):
                k = number(support.stiffness)
                c = 2 * number(support.damping_ratio) * np.sqrt(k * mass)
                yield Element(row, stiffness=k, damping=factor * c, name=f"{self.name(f'planet{n}')}.{way}")

    def turning(self, members: Mapping[str, tuple[Any, Any]], ratio: Fraction) -> Rotation:
        """Return the terms of the carrier's speed. members: mass and damping to the housing of those that move."""
        mass, _ = self.item.teeth.body("planet")
        support = self.item.planets.support
        bodies = {**members, **{f"planet{n}": (mass, 0.0) for n in self.numbers}}
        bearing = None if support is None else number(support.stiffness)
        return self.of_frame(self.coordinates, bodies, bearing, ratio)

    def cyclic(self) -> Cyclic:
        """Return the symmetry of equally spaced planets."""
        known = self.coordinates.units
        waves = [(f"{self.name(member)}.x", f"{self.name(member)}.y", 1) for member in MEMBERS]
        ways = [way for way in ("", ".radial", ".tangential") if f"{self.name('planet1')}{way}" in known]
        cycles = [[f"{self.name(f'planet{n}')}{way}" for n in self.numbers] for way in ways]
        turn = turn_matrix(self.coordinates.index, self.planets, [wave for wave in waves if wave[0] in known], cycles)
        moving = any(wave[0] in known for wave in waves)
        return Cyclic(self.planets, turn, TYPES if moving else (TYPES[0], TYPES[2]), name=self.item.name)


def _first(value: Any) -> float:
    """The number, or the first of a batch: all of it comes to the same tooth."""
    return float(np.ravel(np.asarray(value, dtype=float))[0])
