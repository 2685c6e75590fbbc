"""From the parameters of a train to its GearSystem.

    M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = f,    one rigid-body mode for each train that is free to turn

Source: Kuria & Kihiu 2008, sections II and III, for any connected train of rotors, shafts and meshes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gearstab.config.model.arrays import diagonal
from gearstab.errors import NotPossible
from gearstab.system import Array, GearSystem, Mesh, PeriodicForce, PeriodicTerm
from gearstab.systems.gearbox import friction, matrices, rotors
from gearstab.systems.gearbox.teeth import MeshTeeth
from gearstab.systems.gearbox.train import Link, TrainError, mesh_frequency_ratios, mesh_link, speeds
from gearstab.systems.gearbox.wanted import from_teeth
from gearstab.systems.parts.damping import with_damping
from gearstab.systems.parts.forcing import with_forcing
from gearstab.systems.parts.mesh import build_mesh

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
    def material(self) -> dict[str, Any]:
        return STEEL | {key: value for key, value in (self.p.get("material") or {}).items() if value is not None}

    def internal(self, mesh: int) -> int | None:
        """0 where the driver of a mesh is internal, 1 where the driven gear is, None where neither is."""
        return next((k for k, gear in enumerate(self.meshes[mesh]) if self.rotors[gear].get("internal")), None)

    def teeth(self, rotor: int) -> int:
        return int(self.rotors[rotor]["teeth"])

    @cached_property
    def speeds(self) -> list[Fraction]:
        """Signed speed of every rotor over that of the input rotor. Raises TrainError."""
        links = [
            Link(*self.ends(shaft["between"]), Fraction(1), ("shafts", k))
            for k, shaft in enumerate(self.p.get("shafts") or [])
        ]
        for k, (driver, driven) in enumerate(self.meshes):
            teeth = self.teeth(driver), self.teeth(driven)
            links.append(mesh_link(driver, driven, teeth, self.internal(k) is not None, ("meshes", k)))
        return speeds(len(self.rotors), links, self.place[self.p["input"]["rotor"]])

    @cached_property
    def frequency_ratios(self) -> list[Fraction]:
        """Mesh frequency of each mesh over that of the first."""
        drivers = [driver for driver, _ in self.meshes]
        return mesh_frequency_ratios([self.teeth(driver) for driver in drivers], drivers, self.speeds)

    def sense(self, mesh: int) -> int:
        """1 where the driver of a mesh turns counter-clockwise, -1 where clockwise."""
        driving = -1 if self.p["input"].get("sense") == "clockwise" else 1
        return driving if self.speeds[self.meshes[mesh][0]] > 0 else -driving

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
        return matrices.line_of_action(position, angle, self.sense(mesh), self.internal(mesh))

    @property
    def layout(self) -> matrices.RotorCoordinates:
        supported = tuple(k for k, rotor in enumerate(self.rotors) if rotor.get("support") is not None)
        return matrices.RotorCoordinates(tuple(self.place), supported)

    @cached_property
    def inertias(self) -> list[Array]:
        return [self._solid(k, rotors.inertia(rotor, self.material["density"])) for k, rotor in enumerate(self.rotors)]

    @cached_property
    def masses(self) -> dict[int, Array]:
        """Masses of the supported rotors."""
        density = self.material["density"]
        return {k: self._solid(k, rotors.mass(self.rotors[k], density)) for k in self.layout.supported}

    @staticmethod
    def _solid(rotor: int, value: Array) -> Array:
        if not np.all(value > 0):
            raise TrainError(("rotors", rotor), "the bore leaves nothing of its body", "reduce bore_radius")
        return value


def build(p: dict[str, Any]) -> GearSystem:
    """The gear system of a train; raises TrainError where its parts do not fit together."""
    train = Train(p)
    layout = train.layout
    filled = [_filled(train, k) for k in range(len(train.meshes))]
    meshes = tuple(mesh(train, k, filled[k]) for k in range(len(train.meshes)))
    mass = diagonal([*train.inertias, *(m for m in train.masses.values() for _ in "xy")])
    stiffness, held = _shafts_and_supports(train)
    factor = rotors.number(p, "damping_factor", 1.0)
    held = factor[..., None, None] * held
    drag = [factor * _mesh_damping(train, k, item) for k, item in enumerate(meshes)]
    given = [part | {"damping": c if np.any(c) else None} for part, c in zip(filled, drag, strict=True)]
    bare = GearSystem(mass, stiffness, meshes, None, layout.coordinates, units=layout.units)
    system = with_damping(bare, p | {"meshes": given})
    damping = held if system.damping is None else held + system.damping
    system = replace(system, damping=damping if np.any(damping) else None)
    system = with_forcing(system, {"meshes": given})
    return _rubbed(train, replace(system, load=load(train)), drag)


def _filled(train: Train, k: int) -> dict[str, Any]:
    """The parameters of a mesh with what its teeth give."""
    p = train.p["meshes"][k]
    if not from_teeth(p):
        return dict(p)
    try:
        return train.teeth_of(k).filled()
    except NotPossible as error:
        remedy = f"{error.remedy or 'change the teeth'}, or give the stiffness of the mesh"
        raise TrainError(("meshes", k), error.message, remedy) from None


def mesh(train: Train, k: int, p: dict[str, Any]) -> Mesh:
    """One mesh of the train from its complete parameters; its lag is a fraction of its own period."""
    gears = train.meshes[k]
    radii = tuple(rotors.base_radius(train.rotors[gear]) for gear in gears)
    direction = matrices.mesh_direction(train.layout, gears, (radii[0], radii[1]), train.push(k))
    ratio, lag = train.frequency_ratios[k], rotors.number(p, "lag")
    if "wave" in p:
        return Mesh(p["name"], direction, p["mean_stiffness"], p["epsilon"], p["wave"], ratio, lag)
    return build_mesh(p, direction, ratio, lag)


def _rubbed(train: Train, system: GearSystem, drag: list[Array]) -> GearSystem:
    """The system with the friction of its meshes."""
    laws = [p.get("friction") for p in train.p["meshes"]]
    if not any(laws):
        return system
    forces = np.abs(friction.static_forces(system))
    terms: list[PeriodicTerm] = []
    pushes: list[PeriodicForce] = []
    for k, law in enumerate(laws):
        if law is None:
            continue
        teeth, gears = train.teeth_of(k), train.meshes[k]
        plain = law.get("kind", "constant") == "constant"
        speed = 1.0 if plain else rotors.number(train.p["input"], "speed") * float(abs(train.speeds[gears[0]]))
        try:
            rubbing = teeth.friction(law, np.asarray(speed), np.ones(()) if plain else forces[..., k])
        except NotPossible as error:
            remedy = "change the teeth or the operating point"
            raise TrainError(("meshes", k, "friction"), error.message, remedy) from None
        arms = friction.arms(train.layout, gears, rubbing, train.push(k), train.sense(k), teeth.pairs[0].wheel_drives)
        item, follows = system.meshes[k], bool(train.p["meshes"][k].get("damping_follows_stiffness"))
        terms += friction.terms(item, rubbing, arms, drag[k], follows)
        pushes += friction.forces(item, rubbing, arms)
    return replace(system, terms=(*system.terms, *terms), forces=(*system.forces, *pushes))


def _mesh_damping(train: Train, k: int, item: Mesh) -> Array:
    """``damping`` (N s/m) or ``damping_ratio`` of a mesh."""
    p, (driver, driven) = train.p["meshes"][k], train.meshes[k]
    if p.get("damping_ratio") is None:
        return rotors.number(p, "damping")
    radii = rotors.base_radius(train.rotors[driver]), rotors.base_radius(train.rotors[driven])
    inertias = train.inertias[driver], train.inertias[driven]
    return matrices.mesh_damping(rotors.number(p, "damping_ratio"), item.mean_stiffness, radii, inertias)


def shaft_stiffness(train: Train, shaft: dict[str, Any]) -> Array:
    """k as given, or G pi (d^4 - d_i^4)/(32 l) of a round shaft, N m/rad."""
    if shaft.get("stiffness") is not None:
        return rotors.number(shaft, "stiffness")
    polar = np.pi / 32 * (rotors.number(shaft, "diameter") ** 4 - rotors.number(shaft, "bore") ** 4)
    if not np.all(polar > 0):
        raise TrainError(("shafts", train.p["shafts"].index(shaft), "bore"), "leaves nothing of the shaft", "reduce it")
    return np.asarray(train.material["shear"]) * polar / rotors.number(shaft, "length")


def _shafts_and_supports(train: Train) -> tuple[Array, Array]:
    """K0 and the damping of shafts and supports, ``(..., n, n)``."""
    layout = train.layout
    stiffness, damping = (np.zeros((layout.size, layout.size)) for _ in range(2))
    for shaft in train.p.get("shafts") or []:
        ends = train.ends(shaft["between"])
        twist = matrices.shaft_direction(layout, *ends)
        k = shaft_stiffness(train, shaft)
        c = matrices.shaft_damping(
            rotors.number(shaft, "damping_ratio"), k, (train.inertias[ends[0]], train.inertias[ends[1]])
        )
        stiffness, damping = stiffness + matrices.spring(twist, k), damping + matrices.spring(twist, c)
    for rotor, place in layout.lateral.items():
        support = train.rotors[rotor]["support"]
        k = rotors.number(support, "stiffness")
        c = 2 * rotors.number(support, "damping_ratio") * np.sqrt(k * train.masses[rotor])
        for axis in range(2):
            along = matrices.unit(layout, {place + axis: 1.0})
            stiffness, damping = stiffness + matrices.spring(along, k), damping + matrices.spring(along, c)
    return stiffness, damping


def torques(train: Train) -> dict[int, Array]:
    """Torque on the input and the output rotors, N m, each positive in the sense in which its rotor turns.

    The outputs take power: sum T_i |speed_i| = 0. Without a torque an output shares what the input brings equally; the
    input torque follows from the outputs' where it is not given itself.
    """
    p = train.p
    start, ends = train.place[p["input"]["rotor"]], [train.place[item["rotor"]] for item in p.get("outputs") or []]
    speed = {end: float(abs(train.speeds[end])) for end in ends}
    given = [item.get("torque") for item in p.get("outputs") or []]
    if p["input"].get("torque") is None and all(value is None for value in given):
        return {}
    if all(value is not None for value in given):
        taken = {end: np.asarray(value, dtype=float) for end, value in zip(ends, given, strict=True)}
    else:
        power = rotors.number(p["input"], "torque") / len(ends)
        taken = {end: power / speed[end] for end in ends}
    brought = sum((taken[end] * speed[end] for end in ends), np.zeros(()))
    return {start: np.asarray(brought)} | {end: -taken[end] for end in ends}


def load(train: Train) -> Array | None:
    """The constant torques as generalised forces ``(..., n)``, None where there are none."""
    found = torques(train)
    return matrices.unit(train.layout, dict(found)) if found else None
