"""Effect of the torques of a train on its rotors and on the teeth of its meshes, at rest, by virtual work alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import Array
from gearstab.systems.gearbox import rotors
from gearstab.systems.kinematics import TrainError


def torques(train: Any) -> dict[str, Array]:
    """Torque on the input and the output rotors, N m, each positive in the sense in which its rotor turns.

    The outputs take power: sum T_i |speed_i| = 0. Without a torque an output shares what the input brings equally; the
    input torque follows from the outputs' where it is not given itself.
    """
    p = train.p
    start, ends = p.input.rotor, [item.rotor for item in p.outputs]
    speed = {end: float(abs(train.speeds[end])) for end in ends}
    given = [item.torque for item in p.outputs]
    if p.input.torque is None and all(value is None for value in given):
        return {}
    if all(value is not None for value in given):
        taken = {end: np.asarray(value, dtype=float) for end, value in zip(ends, given, strict=True)}
    else:
        power = rotors.number(p.input.torque) / len(ends)
        taken = {end: power / speed[end] for end in ends}
    brought = sum((taken[end] * speed[end] for end in ends), np.zeros(()))
    return {start: np.asarray(brought)} | {end: -taken[end] for end in ends}


def pair_force(train: Any, pair: int) -> Array:
    """Return the normal force of a pair of gears, N. Raises TrainError where it is not known, or the driver is driven.

    T_1/R_b1 in the transverse plane, with the torque T_1 that the mesh takes from the driver.
    """
    where = ("meshes", pair)
    motion = train.motions[pair]
    unit = _torque_per_reaction(train, where)
    sense = 1 if train.speeds[motion.gears[0]] > 0 else -1
    taken = -float(train.reactions[where] * motion.teeth[0]) * sense
    if not taken > 0:
        first, second = motion.gears
        message = f"{second} drives {first} under these torques"
        raise TrainError((*where, "gears"), message, "name the driver first: relief acts at the ends of contact")
    return unit * taken / rotors.base_radius(train.rotors[train.place[motion.gears[0]]])


def set_force(train: Any, item: Any) -> Array:
    """Return the normal force of a mesh of a set, N, the same with sun and ring; planets share the load equally."""
    unit = _torque_per_reaction(train, item.where)
    taken = abs(float(train.reactions[item.where])) * item.counted("sun")
    return unit * taken / (item.count * rotors.base_radius(item.teeth.gears["sun"]))


def _torque_per_reaction(train: Any, where: tuple[str | int, ...]) -> Array:
    """The input torque over what the input's relation carries. Raises TrainError where teeth are not loaded by it."""
    if not train.determinate:
        message = "relief needs the force of the mesh, which depends on the stiffness of a loop of this train"
        raise TrainError(where, message, "remove relief, or open the loop")
    applied = torques(train)
    if not applied:
        raise TrainError(where, "relief depends on the load, and there are no torques", "add torque to input")
    return applied[train.p.input.rotor] / abs(float(train.reactions["input",]))
