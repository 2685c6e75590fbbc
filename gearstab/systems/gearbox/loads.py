"""Loads of a train: input and outputs, torques over the speed, forces of teeth at rest, and their sliding friction.

A rotor that vibrates by theta about its speed w feels the torque T(w + theta') = T(w) + T'(w) theta' of a fan, a pump,
a brake or a motor: the torque at the speed is part of the load, and its slope is a damper between rotor and housing,
c = T' of what takes power and c = -T' of what gives it.

Friction adds sigma mu h (k_p g^T q + c_p g^T q') to the left side for every pair of teeth in contact, h = u + s v; see
:mod:`gearstab.gears.friction`. With the load shares k_p/k as functions of the mesh phase it is the mesh stiffness and
damping, whatever their wave, times these functions along u and v: the rigid-body motion, g^T q = 0, feels none of it.
The terms are not symmetric.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.model.conflicts import Conflict, plain_number
from gearstab.config.model.fields import AngularFrequency, Choice, NameText, Quantity, Section, optional
from gearstab.config.model.reading import WRONG
from gearstab.errors import NotPossible
from gearstab.mesh import Mesh, PeriodicForce, PeriodicTerm
from gearstab.system import Array
from gearstab.systems.assembly import Element, Row, total
from gearstab.systems.gearbox.bodies import base_radius, number
from gearstab.systems.gearbox.teeth import Rubbing
from gearstab.systems.kinematics import TrainError
from gearstab.waveforms import Constant, Product, Profile, Scaled

TableSpeed = Annotated[float, Field(ge=0), Quantity("rad/s")]
TableTorque = Annotated[float, Quantity("N m")]
FORMS = {"power": ("at", "torque", "exponent"), "polynomial": ("polynomial",), "table": ("speeds", "torques")}
"""Ways to give a law, and the keys of each."""


class TorqueLaw(Section):
    """A torque over the speed of its rotor: a power of it, a polynomial or a table."""

    at: AngularFrequency | None = optional("speed of the torque")
    """n_0 of T = T_0 (n/n_0)^p (rad/s, "1500 rpm")."""
    torque: Annotated[float, Field(gt=0), Quantity("N m")] | None = None
    """T_0, the torque at that speed (N m)."""
    exponent: Annotated[float, Quantity()] | None = None
    """p: 2 of a fan, 0 of a hoist, -1 of what is driven with constant power (1)."""
    polynomial: Annotated[list[float], Field(min_length=1)] | None = None
    """[T_0 (N m), T_1 (N m s), T_2 (N m s^2), ...] of T = T_0 + T_1 w + T_2 w^2 + ..., w in rad/s."""
    speeds: Annotated[list[TableSpeed], Field(min_length=2)] | None = None
    """Speeds of a table, ascending (rad/s); between them the torque follows cubics without overshoot."""
    torques: Annotated[list[TableTorque], Field(min_length=2)] | None = None
    """Torques at these speeds (N m)."""

    def conflicts(self) -> Iterator[Conflict]:
        """One form with all of its keys; a table of as many torques as speeds, which ascend."""
        given = [form for form, keys in FORMS.items() if any(self[key] is not None for key in keys)]
        if not given:
            hint = "add at, torque and exponent, or polynomial, or speeds and torques of a table"
            yield (), "missing", "does not say how the torque depends on the speed", hint
            return
        for other in given[1:]:
            key = next(key for key in FORMS[other] if self[key] is not None)
            yield (key,), "already_given", f"{FORMS[given[0]][0]} is given already", "keep one of the forms"
        for key in FORMS[given[0]]:
            if self[key] is None:
                yield (key,), "missing", "is missing", f"give {' and '.join(FORMS[given[0]])} together"
        if self.speeds is not None and self.torques is not None:
            yield from _table_conflicts(self.speeds, self.torques)

    def at_speed(self, speed: Array) -> tuple[Array, Array]:
        """T (N m) and T' (N m s) at speeds (rad/s) of any shape. Raises NotPossible outside a table."""
        if self.speeds is not None:
            return _in_table(speed, self.speeds, self.torques or [])
        if self.polynomial is not None:
            terms = [np.asarray(value, dtype=float) for value in self.polynomial]
            value = sum((t * speed**k for k, t in enumerate(terms)), np.zeros(()))
            slope = sum((k * t * speed ** (k - 1) for k, t in enumerate(terms) if k), np.zeros(()))
            return np.asarray(value), np.asarray(slope)
        reference, torque, exponent = (np.asarray(getattr(self, key), dtype=float) for key in FORMS["power"])
        value = torque * (speed / reference) ** exponent
        return value, exponent * value / speed


def _table_conflicts(speeds: list[Any], torques: list[Any]) -> Iterator[Conflict]:
    """As many torques as speeds, which ascend."""
    if speeds is WRONG or torques is WRONG:
        return
    if len(speeds) != len(torques):
        yield ("torques",), "wrong_count", f"has {len(torques)} torques for {len(speeds)} speeds", "give one for each"
    for k, (before, after) in enumerate(pairwise(speeds)):
        low, high = plain_number(before), plain_number(after)
        if low is not None and high is not None and not low < high:
            yield ("speeds", k + 1), "wrong_order", "is not above the speed before it", "sort the table"


def _in_table(speed: Array, speeds: list[Any], torques: list[Any]) -> tuple[Array, Array]:
    """The same by monotone cubics (Fritsch & Butland 1984)."""
    from scipy.interpolate import PchipInterpolator

    count = len(speeds)
    rows = np.stack(np.broadcast_arrays(speed, *speeds, *torques), axis=-1)
    flat = rows.reshape(-1, 2 * count + 1)
    outside = (flat[:, 0] < flat[:, 1]) | (flat[:, 0] > flat[:, count])
    if outside.any():
        rpm = 30 / np.pi * flat[np.argmax(outside)]
        message = f"the speed {rpm[0]:.5g} rpm lies outside the table, {rpm[1]:.5g} to {rpm[count]:.5g} rpm"
        raise NotPossible(message, "extend the table, or change the speeds")
    found = np.empty((len(flat), 2))
    for k, row in enumerate(flat):
        curve = PchipInterpolator(row[1 : count + 1], row[count + 1 :])
        found[k] = curve(row[0]), curve(row[0], 1)
    value, slope = np.moveaxis(found.reshape(*rows.shape[:-1], 2), -1, 0)
    return value, slope


Torque = Annotated[float, Field(gt=0), Quantity("N m")]


class Input(Section):
    """Input of the train."""

    rotor: NameText = Field(title="input rotor")
    """Name of the rotor that drives the train, where power enters it."""
    torque: Torque | None = optional("input torque")
    """On the input rotor (N m); follows from the outputs' without."""
    torque_law: TorqueLaw | None = optional("torque over the speed")
    """The input torque as it depends on the speed of the input; its slope damps or drives vibrations."""
    speed: AngularFrequency | None = optional("nominal speed")
    """Speed of the input rotor, for friction and torques (rad/s, "1500 rpm"); sweeps set it by the axis input_speed."""
    sense: Annotated[str, Choice("sense", ("counter-clockwise", "clockwise"))] = Field(
        default="counter-clockwise", title="sense of rotation"
    )
    """Sense of rotation of the input rotor, seen along z."""


class Output(Section):
    """Where power leaves the train."""

    rotor: NameText = Field(title="output rotor")
    """Name of the rotor that is loaded."""
    torque: Torque | None = optional("output torque")
    """It takes (N m); without, the outputs share the input's power equally."""
    torque_law: TorqueLaw | None = optional("torque over the speed")
    """The torque it takes as it depends on the speed of the rotor; its slope damps or drives vibrations."""


def torque_of(end: Input | Output) -> Any:
    """The torque of an end of the train, constant or not, None without."""
    return end.torque if end.torque is not None else end.torque_law


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
