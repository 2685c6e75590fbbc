"""A train of rotors, shafts and meshes: who drives whom, how fast and which way, and where its coordinates are."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gearstab.config.model.not_modelled import CARRIER, INSTEAD_OF_CARRIER
from gearstab.errors import NotPossible
from gearstab.system import Array
from gearstab.systems.assembly import Coordinates, Row
from gearstab.systems.gearbox import rotors
from gearstab.systems.gearbox.teeth import MeshTeeth
from gearstab.systems.kinematics import MeshMotion, Relation, TrainError, Undetermined, alike, solve

STEEL = {"young": 206.8e9, "poisson": 0.3, "density": 7850.0, "shear": 80e9}


@dataclass(frozen=True)
class Train:
    """The parameters of a train with what follows from them alone: who drives whom, how fast, which way."""

    p: dict[str, Any]

    @cached_property
    def rotors(self) -> list[dict[str, Any]]:
        """Gears with what they share."""
        shared = {key: value for key, value in (self.p.get("gears") or {}).items() if value is not None}
        own = [{key: value for key, value in rotor.items() if value is not None} for rotor in self.p["rotors"]]
        return [shared | rotor if rotors.is_gear(rotor) else rotor for rotor in own]

    @cached_property
    def place(self) -> dict[str, int]:
        """Number of each rotor by name."""
        return {rotor["name"]: k for k, rotor in enumerate(self.rotors)}

    def ends(self, names: list[str]) -> tuple[int, int]:
        """Numbers of two rotors."""
        first, second = (self.place[name] for name in names)
        return first, second

    @cached_property
    def meshes(self) -> list[tuple[int, int]]:
        """(driver, driven) of each mesh."""
        return [self.ends(mesh["gears"]) for mesh in self.p["meshes"]]

    @property
    def damping_factor(self) -> Array:
        return rotors.number(self.p, "damping_factor", 1.0)

    @property
    def material(self) -> dict[str, Any]:
        return STEEL | {key: value for key, value in (self.p.get("material") or {}).items() if value is not None}

    def internal(self, mesh: int) -> int | None:
        """0 where the driver of a mesh is internal, 1 where the driven gear is, None where neither is."""
        return next((k for k, gear in enumerate(self.meshes[mesh]) if self.rotors[gear].get("internal")), None)

    def teeth(self, rotor: int) -> int:
        return int(self.rotors[rotor]["teeth"])

    def name(self, rotor: int) -> str:
        return str(self.rotors[rotor]["name"])

    @cached_property
    def motions(self) -> list[MeshMotion]:
        """How the gears of each mesh turn."""
        found = []
        for k, gears in enumerate(self.meshes):
            names, teeth = ((f(gears[0]), f(gears[1])) for f in (self.name, self.teeth))
            found.append(MeshMotion(names, teeth, self.internal(k) is not None, ("meshes", k)))
        return found

    @cached_property
    def speeds(self) -> dict[str, Fraction]:
        """Signed speed of every rotor over that of the input rotor. Raises TrainError."""
        relations = [Relation({self.p["input"]["rotor"]: 1}, ("input",), 1)]
        relations += [alike(*shaft["between"], ("shafts", k)) for k, shaft in enumerate(self.p.get("shafts") or [])]
        try:
            return solve(self.place, relations + [motion.relation for motion in self.motions])
        except Undetermined as error:
            raise TrainError(
                ("rotors", self.place[error.bodies[0]]),
                "is not connected to the input by shafts and meshes",
                f"add a shaft or a mesh to it; {CARRIER}: {INSTEAD_OF_CARRIER}",
            ) from None

    @cached_property
    def frequency_ratios(self) -> list[Fraction]:
        """Mesh frequency of each mesh over that of the first."""
        passing = [motion.frequency(self.speeds) for motion in self.motions]
        return [value / passing[0] for value in passing]

    def sense(self, mesh: int) -> int:
        """1 where the driver of a mesh turns counter-clockwise, -1 where clockwise."""
        driving = -1 if self.p["input"].get("sense") == "clockwise" else 1
        return driving if self.motions[mesh].relative(self.speeds) > 0 else -driving

    def teeth_of(self, mesh: int) -> MeshTeeth:
        """The teeth of a mesh, computed when asked for."""
        if mesh not in self._teeth:
            driver, driven = self.meshes[mesh]
            gears = self.rotors[driver], self.rotors[driven]
            self._teeth[mesh] = MeshTeeth(gears, self.p["meshes"][mesh], self.material)
        return self._teeth[mesh]

    @cached_property
    def _teeth(self) -> dict[int, MeshTeeth]:
        return {}

    @property
    def teeth_of_meshes(self) -> list[MeshTeeth]:
        """The teeth of all meshes, from which their stiffness may or may not come."""
        return [self.teeth_of(k) for k in range(len(self.meshes))]

    def push(self, mesh: int) -> tuple[Array, Array]:
        """The direction in which the driver of a mesh pushes. Raises TrainError for gears that cannot mesh."""
        teeth = self.teeth_of(mesh)
        try:
            angle = teeth.each(lambda pair: pair.pressure_angle)
        except NotPossible as error:
            raise TrainError(("meshes", mesh), error.message, "change the teeth") from None
        position = rotors.number(self.p["meshes"][mesh], "position")
        return line_of_action(position, angle, self.sense(mesh), self.internal(mesh))

    @cached_property
    def supported(self) -> list[int]:
        """Numbers of the rotors that move in their plane."""
        return [k for k, rotor in enumerate(self.rotors) if rotor.get("support") is not None]

    @property
    def coordinates(self) -> Coordinates:
        """Rotations, each positive in the sense in which the rotor turns, then displacements of supported rotors.

        With the positive rotations every term of the rigid-body motion is positive.
        """
        sides = {f"{self.name(k)}.{axis}": "m" for k in self.supported for axis in "xy"}
        return Coordinates(dict.fromkeys(self.place, "rad") | sides)

    def shift(self, rotor: int, along: tuple[Any, Any]) -> Row:
        """Return the displacement of a rotor along a direction (x, y) as a row."""
        name = self.name(rotor)
        return {f"{name}.x": along[0], f"{name}.y": along[1]} if rotor in self.supported else {}

    @cached_property
    def inertias(self) -> list[Array]:
        return [self._solid(k, rotors.inertia(rotor, self.material["density"])) for k, rotor in enumerate(self.rotors)]

    @cached_property
    def masses(self) -> dict[int, Array]:
        """Masses of the supported rotors."""
        density = self.material["density"]
        return {k: self._solid(k, rotors.mass(self.rotors[k], density)) for k in self.supported}

    @staticmethod
    def _solid(rotor: int, value: Array) -> Array:
        if not np.all(value > 0):
            raise TrainError(("rotors", rotor), "the bore leaves nothing of its body", "reduce bore_radius")
        return value


def line_of_action(
    position: Array | float, pressure_angle: Array | float, sense: int, internal: int | None = None
) -> tuple[Array, Array]:
    """n, the direction in which the driver pushes the driven gear.

        external gears     psi + sense (90 deg - phi_w)
        internal driven    psi + 180 deg + sense (90 deg - phi_w)
        internal driver    psi + sense (90 deg + phi_w)

    The flank of the external gear is pushed towards its own centre; where one gear is internal, both centres lie on the
    same side of the pitch point. Turning the whole train as one body leaves the teeth alone: r_b1 w_1 - r_b2 w_2 +
    n . (u_1 - u_2) = 0.

    position: psi, from the centre of the driver to that of the driven gear, rad.
    sense: 1 where the driver turns counter-clockwise, -1 where clockwise.
    internal: 0 where the driver is internal, 1 where the driven gear is.
    """
    right, phi = 0.5 * np.pi, np.asarray(pressure_angle)
    turn = np.pi if internal == 1 else 0.0
    angle = np.asarray(position) + turn + sense * (right + phi if internal == 0 else right - phi)
    return np.cos(angle), np.sin(angle)
