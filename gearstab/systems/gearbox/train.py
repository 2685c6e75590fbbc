"""A train of rotors, shafts, meshes and planetary sets: how its bodies turn, who drives whom, and its coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

import numpy as np

from gearstab.config.model.reading import held
from gearstab.errors import NotPossible
from gearstab.system import Array
from gearstab.systems.assembly import Coordinates, Row
from gearstab.systems.gearbox import bodies
from gearstab.systems.gearbox.bodies import STEEL, hands, line_of_action, moves, number, slides, turns
from gearstab.systems.gearbox.loads import pair_force, set_force
from gearstab.systems.gearbox.planet_set import MEMBERS, TrainMesh, TrainSet
from gearstab.systems.gearbox.teeth import MeshTeeth
from gearstab.systems.kinematics import MeshMotion, Relation, TrainError, Undetermined, Where, reactions, solve


@dataclass(frozen=True)
class Train:
    """The parameters of a train with what follows from them alone: who drives whom, how fast, which way."""

    p: Any

    @cached_property
    def rotors(self) -> list[dict[str, Any]]:
        """Gears with what they share, and the hand of each where one is helical."""
        shared, own = held(self.p.gears), [held(rotor) for rotor in self.p.rotors]
        found = [shared | rotor if rotor.get("teeth") is not None else rotor for rotor in own]
        if all(rotor.get("helix_angle") is None for rotor in found):
            return found
        place = {rotor["name"]: k for k, rotor in enumerate(own)}
        mates = [(place[item.sun], place[item.ring], False) for item in self.p.planetary_sets]
        for one, two in ([place[name] for name in mesh.gears] for mesh in self.p.meshes):
            mates.append((one, two, bool(own[one].get("internal") or own[two].get("internal"))))
        return [rotor | {"hand": hand} for rotor, hand in zip(found, hands(found, mates), strict=True)]

    @cached_property
    def place(self) -> dict[str, int]:
        """Number of each rotor by name."""
        return {rotor["name"]: k for k, rotor in enumerate(self.rotors)}

    @cached_property
    def sets(self) -> list[TrainSet]:
        """The planetary sets."""
        found = []
        for k, p in enumerate(self.p.planetary_sets):
            members = {member: self.rotors[self.place[p[member]]] for member in MEMBERS}
            found.append(TrainSet(p, members, self.material, ("planetary_sets", k), partial(set_force, self)))
        return found

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """(driver, driven) of each mesh of a pair of gears."""
        return [(self.place[first], self.place[second]) for first, second in (p.gears for p in self.p.meshes)]

    @property
    def damping_factor(self) -> Array:
        return number(self.p.damping_factor)

    @property
    def material(self) -> dict[str, Any]:
        return STEEL | held(self.p.material)

    def internal(self, pair: int) -> int | None:
        """0 where the driver of a pair is internal, 1 where the driven gear is, None where neither is."""
        return next((k for k, gear in enumerate(self.pairs[pair]) if self.rotors[gear].get("internal")), None)

    def teeth(self, rotor: int) -> int:
        return int(self.rotors[rotor]["teeth"])

    def name(self, rotor: int) -> str:
        return str(self.rotors[rotor]["name"])

    # ---- kinematics

    @cached_property
    def motions(self) -> list[MeshMotion]:
        """How the gears of each pair turn."""
        found = []
        for k, (driver, driven) in enumerate(self.pairs):
            names, teeth = (self.name(driver), self.name(driven)), (self.teeth(driver), self.teeth(driven))
            found.append(MeshMotion(names, teeth, self.internal(k) is not None, ("meshes", k)))
        return found

    @cached_property
    def held(self) -> dict[str, Where]:
        """Rotors that do not turn, with the place that says so."""
        sets = ((k, p) for k, p in enumerate(self.p.planetary_sets) if p.held is not None)
        return {p[p.held]: ("planetary_sets", k, "held") for k, p in sets}

    @cached_property
    def _relations(self) -> list[Relation]:
        """Input, held members, sun's meshes and ring's meshes of each set, shafts, pairs."""
        found = [Relation({self.p.input.rotor: 1}, ("input",), 1)]
        found += [Relation({rotor: 1}, where) for rotor, where in self.held.items()]
        found += [motion.relation for item in self.sets for motion in item.motions]
        ends = (shaft.between for shaft in self.p.shafts)
        found += [Relation({first: 1, second: -1}, ("shafts", k)) for k, (first, second) in enumerate(ends)]
        return found + [motion.relation for motion in self.motions]

    @property
    def _bodies(self) -> list[str]:
        return [*self.place, *(item.planet for item in self.sets)]

    @cached_property
    def speeds(self) -> dict[str, Fraction]:
        """Signed speed of every rotor, and of the planets of a set, over that of the input rotor. Raises TrainError."""
        try:
            return solve(self._bodies, self._relations)
        except Undetermined as error:
            loose = next(body for body in error.bodies if body in self.place)
            place: Where = ("rotors", self.place[loose])
            if any(loose in item.body.values() for item in self.sets):
                raise TrainError(place, error.message, "hold a member of its set, or connect it by a shaft") from None
            message = "is not connected to the input by shafts and meshes"
            raise TrainError(place, message, "add a shaft or a mesh to it, or a planetary set with it") from None

    @property
    def driving(self) -> int:
        """1 where the input turns counter-clockwise, -1 where clockwise."""
        return -1 if self.p.input.sense == "clockwise" else 1

    @cached_property
    def signs(self) -> dict[str, int]:
        """1 of bodies that turn counter-clockwise or rest, else -1."""
        return {body: -1 if self.driving * speed < 0 else 1 for body, speed in self.speeds.items()}

    @cached_property
    def reactions(self) -> dict[Where, Fraction]:
        """Return the loads of each held member and of the sun's mesh of each set, by its path: see
        :func:`.kinematics.reactions`.

        The input turns counter-clockwise with what balances the outputs; without outputs every body takes as much as
        it turns, as inertias do in a run-up.
        """
        outputs = [(item.rotor, item.torque) for item in self.p.outputs]
        taken = {body: -speed for body, speed in self.speeds.items()}
        if outputs:
            shared = {rotor: 1 / abs(self.speeds[rotor]) for rotor, _ in outputs}
            given = {rotor: Fraction(float(np.ravel(value)[0])) for rotor, value in outputs if value is not None}
            taken = {rotor: -value * (1 if self.speeds[rotor] > 0 else -1) for rotor, value in (shared | given).items()}
        carried = reactions(self._bodies, self._relations, taken)
        return {self._relations[k].where: value for k, value in reversed(carried.items())}

    @property
    def determinate(self) -> bool:
        """Whether torques alone give all forces: no relation follows from the others."""
        return len(self._relations) == len(self._bodies)

    def power(self, item: TrainSet) -> tuple[int, bool, int]:
        """Return how a set turns and carries the load: sigma, whether the sun drives, and the sign of the sun's torque.

        sigma: 1 where planets turn counter-clockwise on the carrier, else -1; the sun drives as seen from there.
        """
        ahead, turning = (item.motions[0].relative(self.speeds, gear) for gear in (0, 1))
        load = -self.reactions.get(item.where, Fraction(0)) or ahead
        return self.driving * (1 if turning > 0 else -1), load * ahead > 0, self.driving * (1 if load > 0 else -1)

    @cached_property
    def meshes(self) -> list[TrainMesh]:
        """All meshes: those of the sets, then the pairs. Raises TrainError."""
        found: list[TrainMesh] = []
        for item in self.sets:
            self._turning(item.motions[0])
            planets_turn, sun_drives, _ = self.power(item)
            found += item.meshes(planets_turn, sun_drives)
        for k, motion in enumerate(self.motions):
            self._turning(motion)
            p = self.p.meshes[k]
            found.append(TrainMesh(p.name, motion, self.pair_teeth[k], number(p.lag)))
        return found

    def _turning(self, motion: MeshMotion) -> None:
        if not motion.frequency(self.speeds):
            names = ", ".join((*motion.gears, *([motion.fixed_in] if motion.fixed_in else [])))
            message = f"its teeth do not mesh: {names} turn as one body"
            raise TrainError(motion.where, message, "leave the mesh out, or change what is held")

    def frequency_ratio(self, motion: MeshMotion) -> Fraction:
        """Return a mesh frequency over that of the first mesh."""
        return motion.frequency(self.speeds) / self.cycles

    @property
    def cycles(self) -> Fraction:
        """Cycles of the first mesh in a turn of the input."""
        return (self.sets[0].motions if self.sets else self.motions)[0].frequency(self.speeds)

    def sense(self, pair: int) -> int:
        """1 where the driver of a pair turns counter-clockwise, -1 where clockwise."""
        return self._sense(self.motions[pair])

    def _sense(self, motion: MeshMotion) -> int:
        return self.driving * (1 if motion.relative(self.speeds) > 0 else -1)

    def thrust(self, mesh: TrainMesh) -> Array:
        """Return the axial force on the driver over the force of a mesh, tan beta_b or its negative.

        It is positive along z, towards which a right-handed gear is pushed that drives counter-clockwise.
        """
        hand = -1 if mesh.turned and not mesh.motion.internal else 1
        return hand * self._sense(mesh.motion) * mesh.teeth.lead

    # ---- teeth

    @cached_property
    def pair_teeth(self) -> list[MeshTeeth]:
        """The teeth of each pair, computed when asked for."""
        return [
            MeshTeeth((self.rotors[driver], self.rotors[driven]), p, self.material, partial(pair_force, self, k))
            for k, ((driver, driven), p) in enumerate(zip(self.pairs, self.p.meshes, strict=True))
        ]

    def push(self, pair: int) -> tuple[Array, Array]:
        """The direction in which the driver of a pair pushes. Raises TrainError for gears that cannot mesh."""
        teeth = self.pair_teeth[pair]
        try:
            angle = teeth.each(lambda pair: pair.pressure_angle)
        except NotPossible as error:
            raise TrainError(("meshes", pair), error.message, error.remedy or "change the teeth") from None
        position = number(self.p.meshes[pair].position)
        return line_of_action(position, angle, self.sense(pair), self.internal(pair))

    # ---- coordinates

    @cached_property
    def supported(self) -> list[int]:
        """Numbers of the rotors that move in their plane."""
        return [k for k, rotor in enumerate(self.rotors) if moves(rotor.get("support"))]

    @cached_property
    def sliding(self) -> list[int]:
        """Numbers of the rotors that move along their axis."""
        return [k for k, rotor in enumerate(self.rotors) if slides(rotor.get("support"))]

    @cached_property
    def coordinates(self) -> Coordinates:
        """Rotations, displacements of supported rotors in their plane and along their axis, then planets.

        Each rotation is positive in the sense in which the body turns, so that every term of the rigid-body motion is
        positive; a held rotor has none without a torsional support. Displacements of the members of a set turn with its
        carrier.
        """
        free = [rotor["name"] for rotor in self.rotors if turns(rotor.get("support"), rotor["name"] in self.held)]
        sides = {f"{self.name(k)}.{axis}": "m" for k in self.supported for axis in "xy"}
        sides |= {f"{self.name(k)}.z": "m" for k in self.sliding}
        planets = {name: unit for item in self.sets for name, unit in item.coordinates.items()}
        return Coordinates(dict.fromkeys(free, "rad") | sides | planets)

    def rotation(self, rotor: int) -> Row:
        """Return the rotation of a rotor as a row."""
        return {self.name(rotor): 1.0} if self.name(rotor) in self.coordinates.units else {}

    def shift(self, rotor: int, along: tuple[Any, Any]) -> Row:
        """Return the displacement of a rotor along a direction (x, y) as a row."""
        name = self.name(rotor)
        return {f"{name}.x": along[0], f"{name}.y": along[1]} if rotor in self.supported else {}

    def slide(self, rotor: int, along: Any) -> Row:
        """Return ``along`` times the displacement of a rotor along its axis as a row."""
        return {f"{self.name(rotor)}.z": along} if rotor in self.sliding else {}

    def shared(self, item: TrainSet) -> list[str]:
        """Supported members of a set that are in another mesh as well."""
        others = {name for other in self.sets if other is not item for name in other.body.values()}
        others |= {name for motion in self.motions for name in motion.gears}
        return [name for name in item.body.values() if name in others and self.place.get(name) in self.supported]

    # ---- bodies

    @cached_property
    def inertias(self) -> list[Array]:
        return [self._solid(k, 1) for k in range(len(self.rotors))]

    @cached_property
    def masses(self) -> dict[int, Array]:
        """Masses of the rotors that move in their plane or along their axis."""
        return {k: self._solid(k, 0) for k in sorted({*self.supported, *self.sliding})}

    def _solid(self, rotor: int, which: int) -> Array:
        """Mass (0) or moment of inertia (1)."""
        name, density = self.name(rotor), self.material["density"]
        owner = next((item for item in self.sets if item.p.ring == name), None)
        if owner is not None and self.rotors[rotor].get(("mass", "inertia")[which]) is None:
            with owner.told():
                return owner.teeth.body("ring")[which]
        value = (bodies.mass, bodies.inertia)[which](self.rotors[rotor], density)
        if not np.all(value > 0):
            raise TrainError(("rotors", rotor), "the bore leaves nothing of its body", "reduce bore_radius")
        return value
