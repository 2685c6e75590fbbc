"""Torques of a train, what they do to rotors and teeth at rest, and the sliding friction that follows.

Friction adds sigma mu h (k_p g^T q + c_p g^T q') to the left side for every pair of teeth in contact, h = u + s v; see
:mod:`gearstab.gears.friction`. With the load shares k_p/k as functions of the mesh phase it is the mesh stiffness and
damping, whatever their wave, times these functions along u and v: the rigid-body motion, g^T q = 0, feels none of it.
The terms are not symmetric.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.mesh import Mesh, PeriodicForce, PeriodicTerm
from gearstab.system import Array, GearSystem
from gearstab.systems.assembly import Element, Row, total
from gearstab.systems.gearbox.bodies import base_radius, number
from gearstab.systems.gearbox.teeth import Rubbing
from gearstab.systems.kinematics import TrainError
from gearstab.waveforms import Constant, Product, Profile, Scaled


def torques(train: Any) -> dict[str, Array]:
    """Torque on the input and the output rotors, N m, each positive in the sense in which its rotor turns.

    The outputs take power: sum T_i |speed_i| = 0. Without a torque an output shares what the input brings equally; the
    input torque follows from the outputs' where it is not given itself.
    """
    p = train.p
    start, ends = p.input.rotor, [item.rotor for item in p.outputs]
    speed = {end: float(abs(train.speeds[end])) for end in ends}
    given = [end_torque(train, ("outputs", k)) for k in range(len(ends))]
    own = end_torque(train, ("input",))
    if own is None and all(value is None for value in given):
        return {}
    if all(value is not None for value in given):
        taken = {end: value[0] for end, value in zip(ends, given, strict=True) if value is not None}
    else:
        power = (np.zeros(()) if own is None else own[0]) / len(ends)
        taken = {end: power / speed[end] for end in ends}
    brought = sum((taken[end] * speed[end] for end in ends), np.zeros(()))
    return {start: np.asarray(brought)} | {end: -taken[end] for end in ends}


def end_torque(train: Any, where: tuple[str | int, ...]) -> tuple[Array, Array] | None:
    """The torque at an end of a train as given, N m, and its slope over the speed of the rotor, N m s; None without.

    where: ``("input",)`` or ``("outputs", k)``. Raises TrainError for a speed outside the table of a law.
    """
    p = train.p.input if where == ("input",) else train.p.outputs[int(where[1])]
    if p.torque_law is None:
        return None if p.torque is None else (np.asarray(p.torque, dtype=float), np.zeros(()))
    speed = number(train.p.input.speed) * float(abs(train.speeds[p.rotor]))
    try:
        found: tuple[Array, Array] = p.torque_law.at_speed(speed)
    except NotPossible as error:
        raise TrainError((*where, "torque_law"), error.message, error.remedy or "") from None
    if not np.all(found[0] >= 0):
        message = f"is negative at {float(np.min(speed)) * 30 / np.pi:.5g} rpm"
        raise TrainError((*where, "torque_law"), message, "let the rotor that gives power be the input")
    return found


def dampers(train: Any) -> Iterator[Element]:
    """Yield the slopes of torques that depend on the speed: dampers between rotor and housing."""
    for where, p in ((("input",), train.p.input), *((("outputs", k), p) for k, p in enumerate(train.p.outputs))):
        if p.torque_law is not None and (found := end_torque(train, where)) is not None:
            taken = -1.0 if where == ("input",) else 1.0
            yield Element(train.rotation(train.place[p.rotor]), damping=taken * found[1])


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
    return unit * taken / base_radius(train.rotors[train.place[motion.gears[0]]])


def set_force(train: Any, item: Any) -> Array:
    """Return the normal force of a mesh of a set, N, the same with sun and ring; planets share the load equally."""
    unit = _torque_per_reaction(train, item.where)
    taken = abs(float(train.reactions[item.where])) * item.counted("sun")
    return unit * taken / (item.count * base_radius(item.teeth.gears["sun"]))


def _torque_per_reaction(train: Any, where: tuple[str | int, ...]) -> Array:
    """The input torque over what the input's relation carries. Raises TrainError where teeth are not loaded by it."""
    if not train.determinate:
        message = "relief needs the force of the mesh, which depends on the stiffness of a loop of this train"
        raise TrainError(where, message, "remove relief, or open the loop")
    applied = torques(train)
    if not applied:
        raise TrainError(where, "relief depends on the load, and there are no torques", "add torque to input")
    return applied[train.p.input.rotor] / abs(float(train.reactions["input",]))


def arms(
    train: Any, gears: tuple[int, int], rubbing: Rubbing, push: tuple[Array, Array], sense: int, swapped: bool
) -> tuple[Array, Array]:  # fmt: skip
    """u and v ``(..., n)`` of one mesh, h = u + s v.

    Parameters
    ----------
    gears: numbers of driver and driven gear. sense: 1 where the driver turns counter-clockwise.
    push: n, the direction of the driver's force on the driven gear.
    swapped: whether the pinion that friction counts from is the driven gear.
    """
    pinion, wheel = gears[::-1] if swapped else gears
    # Where the internal gear drives, the pinion presses the teeth together by turning back: its positive sense, that of
    # the wheel and n change sign.
    back = -1.0 if swapped else 1.0
    n = tuple(back * np.asarray(part) for part in push)
    t = (-back * sense * n[1], back * sense * n[0])
    lever: Row = {train.name(wheel): -back * rubbing.length}
    arm = total(lever, train.shift(pinion, t), train.shift(wheel, (-t[0], -t[1])))
    turn = {train.name(pinion): back, train.name(wheel): back * rubbing.wheel_sign}
    return train.coordinates.vector(arm), train.coordinates.vector(turn)


def terms(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array], damping: Array, follows: bool) -> list[PeriodicTerm]:
    """The two terms of one mesh, along u and along v.

    damping: of the mesh, N s/m; follows: whether it varies as the mesh stiffness does.
    """
    drag: Profile | None = None
    if np.any(damping):
        drag = Scaled(mesh.waveform, damping, 2 * mesh.epsilon * damping) if follows else Constant(damping)
    return [
        PeriodicTerm(
            name, left, mesh.direction, Product(level(mesh), share), None if drag is None else Product(drag, share),
            mesh.frequency_ratio, mesh.lag,
        )
        for name, left, share in _parts(mesh, rubbing, ends)
    ]  # fmt: skip


def forces(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array]) -> list[PeriodicForce]:
    """Return the forces that a transmission error e adds: the mesh force is k (g^T q - e), and so friction has sigma mu
    h k_p e less.

    Its damping part, c_p de/dt, is small of second order (friction times damping) and left out.
    """
    error = mesh.transmission_error
    if error is None:
        return []
    return [
        PeriodicForce(name, left, Product(Product(level(mesh), share), error), mesh.frequency_ratio, mesh.lag)
        for name, left, share in _parts(mesh, rubbing, ends)
    ]


def level(mesh: Mesh) -> Profile:
    """Return k(x)."""
    return Scaled(mesh.waveform, mesh.mean_stiffness, 2 * mesh.amplitude)


def _parts(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array]) -> tuple[tuple[str, Array, Profile], ...]:
    return (
        (f"friction of {mesh.name}", ends[0], rubbing.share),
        (f"friction torque of {mesh.name}", ends[1], rubbing.share_arm),
    )


def static_forces(system: GearSystem) -> Array:
    """``(..., meshes)``: the mesh forces k_g g^T q under the constant load, without the rigid-body motion."""
    from gearstab.modal import mean_modes

    modes = mean_modes(system)
    load = np.zeros(system.size) if system.load is None else np.asarray(system.load)
    modal = np.einsum("...np,...n->...p", modes.shapes, load)
    squared = np.where(modes.rigid, np.inf, modes.squared_frequency)
    deflection = np.einsum("...pi,...p->...i", modes.mesh_deflection, modal / squared)
    stiffness = np.stack(np.broadcast_arrays(*[mesh.mean_stiffness for mesh in system.meshes]), axis=-1)
    return np.asarray(stiffness * deflection)
