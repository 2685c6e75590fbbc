"""Evenly spaced axes hold the decimal numbers that a user would type, not what rounding makes of them."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import gearstab as gs
from gearstab.config.model.axes import evenly

PAIR = {
    "kind": "gear_pair", "equivalent_mass": 1.0,
    "meshes": [{"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}],
}  # fmt: skip


@pytest.mark.parametrize("axis", [{"start": 0, "stop": 1, "step": 0.1}, {"start": 0, "stop": 1, "num": 11}])
def test_tenths_are_tenths(axis: dict[str, float]) -> None:
    sweep = {"mesh_frequency": [1.0], "epsilon": axis}
    config = gs.load({"system": PAIR | {"allow_negative_stiffness": True}, "sweep": sweep, "methods": {"floquet": {}}})
    values = next(a for a in config.axes if a.name == "epsilon").values
    assert [repr(float(v)) for v in values] == [repr(k / 10) for k in range(11)]


@pytest.mark.parametrize(
    ("start", "step", "count"), [("0.35", "0.05", 134), ("-1", "0.1", 21), ("1e5", "0.1", 1000), ("1e-5", "3e-7", 300)]
)
def test_every_value_is_the_nearest_double_of_the_decimal(start: str, step: str, count: int) -> None:
    exact = [float(Decimal(start) + k * Decimal(step)) for k in range(count)]
    values = evenly(float(start), Decimal(step), 1, count)
    assert values is not None
    assert values.tolist() == exact
    values = evenly(exact[0], Decimal(repr(exact[-1])) - Decimal(repr(exact[0])), count - 1, count)
    assert values is not None
    assert values.tolist() == exact


def test_values_between_decimals_are_rounded_once() -> None:
    values = evenly(0.1, Decimal("0.6"), 8, 9)
    assert values is not None
    assert values.tolist() == [float(Fraction(1, 10) + k * Fraction(6, 80)) for k in range(9)]
    assert evenly(0.1, Decimal("0.6"), 7, 8) is None  # sevenths are no decimals: NumPy's values


@pytest.mark.parametrize(("start", "change"), [(np.pi, "1"), (1e-300, "1"), (0.0, "1e-30"), (1e15, "1e-5")])
def test_numbers_of_too_many_digits_are_left_to_floating_point(start: float, change: str) -> None:
    assert evenly(start, Decimal(change), 10, 11) is None
