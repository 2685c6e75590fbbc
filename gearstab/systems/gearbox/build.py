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

from gearstab.system import Array, GearSystem, Mesh
from gearstab.systems import assembly
from gearstab.systems.gearbox import matrices, rotors
from gearstab.systems.gearbox.train import Link, mesh_frequency_ratios, mesh_link, speeds

STEEL = {"young": 206.8e9, "poisson": 0.3, "density": 7850.0, "shear": 80e9}


@dataclass(frozen=True)
class Train:
    """The parameters of a train with what follows from them alone: who drives whom, how fast, which way."""

    p: dict[str, Any]

    @property
    def rotors(self) -> list[dict[str, Any]]:
        return list(self.p["rotors"])

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

    def internal(self, mesh: int) -> bool:
        """Whether one gear of a mesh is internal."""
        return any(bool(self.rotors[gear].get("internal")) for gear in self.meshes[mesh])

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
            links.append(mesh_link(driver, driven, teeth, self.internal(k), ("meshes", k)))
        return speeds(len(self.rotors), links, self.place[self.p["input"]["rotor"]])

    @cached_property
    def frequency_ratios(self) -> list[Fraction]:
        """Mesh frequency of each mesh over that of the first."""
        drivers = [driver for driver, _ in self.meshes]
        return mesh_frequency_ratios([self.teeth(driver) for driver in drivers], drivers, self.speeds)

    @property
    def layout(self) -> matrices.Layout:
        supported = tuple(k for k, rotor in enumerate(self.rotors) if rotor.get("support") is not None)
        return matrices.Layout(tuple(self.place), supported)

    @cached_property
    def inertias(self) -> list[Array]:
        return [rotors.inertia(rotor, self.material["density"]) for rotor in self.rotors]

    @cached_property
    def masses(self) -> dict[int, Array]:
        """Of the supported rotors."""
        return {k: rotors.mass(self.rotors[k], self.material["density"]) for k in self.layout.supported}


def build(p: dict[str, Any]) -> GearSystem:
    """The gear system of a train; raises TrainError where its parts do not hang together."""
    train = Train(p)
    layout = train.layout
    meshes = tuple(mesh(train, k) for k in range(len(train.meshes)))
    mass = assembly.diagonal([*train.inertias, *(m for m in train.masses.values() for _ in "xy")])
    stiffness, damping = _shafts_and_supports(train)
    system = GearSystem(mass, stiffness, meshes, coordinates=layout.coordinates, load=load(train))
    system = assembly.damped(system, p | {"meshes": [{} for _ in meshes]})
    for k, item in enumerate(meshes):
        damping = damping + matrices.spring(item.direction, _mesh_damping(train, k, item))
    total = damping if system.damping is None else system.damping + damping
    return replace(system, damping=total if np.any(total) else None)


def mesh(train: Train, k: int) -> Mesh:
    """One mesh of the train; its lag is a fraction of its own period."""
    p, (driver, driven) = train.p["meshes"][k], train.meshes[k]
    gears = train.rotors[driver], train.rotors[driven]
    sense = 1 if train.speeds[driver] > 0 else -1
    sense *= int(train.p["input"].get("sense") or 1)
    push = matrices.line_of_action(rotors.number(p, "position"), _operating_angle(p, gears), sense)
    radii = rotors.base_radius(gears[0]), rotors.base_radius(gears[1])
    direction = matrices.mesh_direction(train.layout, (driver, driven), radii, push)
    return assembly.mesh(p, direction, train.frequency_ratios[k], rotors.number(p, "lag"))


def _operating_angle(p: dict[str, Any], gears: tuple[dict[str, Any], dict[str, Any]]) -> Array:
    """phi_w of the centre distance, or the pressure angle of the gears where none is given."""
    return rotors.number(gears[0], "pressure_angle")


def _mesh_damping(train: Train, k: int, item: Mesh) -> Array:
    """``damping`` (N s/m) or ``damping_ratio`` of a mesh."""
    p, (driver, driven) = train.p["meshes"][k], train.meshes[k]
    if p.get("damping") is not None:
        return rotors.number(p, "damping")
    radii = rotors.base_radius(train.rotors[driver]), rotors.base_radius(train.rotors[driven])
    inertias = train.inertias[driver], train.inertias[driven]
    return matrices.mesh_damping(rotors.number(p, "damping_ratio"), item.mean_stiffness, radii, inertias)


def shaft_stiffness(train: Train, shaft: dict[str, Any]) -> Array:
    """k as given, or G pi (d^4 - d_i^4)/(32 l) of a round shaft, N m/rad."""
    if shaft.get("stiffness") is not None:
        return rotors.number(shaft, "stiffness")
    polar = np.pi / 32 * (rotors.number(shaft, "diameter") ** 4 - rotors.number(shaft, "bore") ** 4)
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
