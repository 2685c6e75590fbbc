"""Evenly spaced axes hold the decimal numbers that a user would type, not what rounding makes of them."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest

import gearstab as gs
from gearstab.config.sections.expansion import as_typed

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
    values = as_typed(float(start) + float(step) * np.arange(count))
    assert values.tolist() == exact
    assert as_typed(np.linspace(exact[0], exact[-1], count)).tolist() == exact


def test_other_numbers_stay_within_rounding() -> None:
    for values in (np.linspace(0, 1, 1001) / 3, np.linspace(1, np.pi, 777), np.zeros(3), np.full(2, 1e-300)):
        assert (np.abs(as_typed(values) - values) <= 4 * np.spacing(np.abs(values).max())).all()
    thirds = np.linspace(0, 1, 4)
    assert as_typed(thirds).tolist() == thirds.tolist()
