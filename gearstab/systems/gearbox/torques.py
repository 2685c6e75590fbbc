"""Sections of input and outputs, and torques that depend on the speed of a rotor: fans, pumps, brakes, motors.

A rotor that vibrates by theta about its speed w feels the torque T(w + theta') = T(w) + T'(w) theta': the torque at
the speed is part of the load, and its slope is a damper between rotor and housing, c = T' of what takes power and
c = -T' of what gives it.
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
from gearstab.system import Array

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
