"""The number of steps that points get, with errors that follow a law: c 2^(-p k) after k doublings, above rounding."""

import numpy as np
import pytest

from gearstab.propagation.control import StepControl

ORDER = 6
LAST = 12


def reached(size: np.ndarray, tolerance: float, rounding: float = 0.0) -> tuple[np.ndarray, np.ndarray, int]:
    """Levels that points end at, their errors there, and how many of them were computed in all."""
    error, computed = np.full(size.shape, np.nan), 0
    level = np.zeros(size.shape, dtype=int)
    control = StepControl(level, LAST, tolerance, ORDER)
    for current, chosen in control:
        error[chosen] = size[chosen] * 2.0 ** (-ORDER * current) + rounding
        computed += int(chosen.sum())
        control.judge(error[chosen], rounding)
    return level, error, computed


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_every_point_reaches_the_tolerance_with_at_most_one_doubling_too_many(tolerance: float) -> None:
    size = np.geomspace(1e-12, 1e2, 200).reshape(4, 50)
    level, error, computed = reached(size, tolerance)
    assert np.all(error <= tolerance)
    enough = np.maximum(np.ceil(np.log2(size / tolerance) / ORDER), 0)
    assert np.all((level == enough) | (level == enough + 1))
    # One doubling after the other would take a look at each level below.
    assert computed < np.sum(1 + enough) or enough.max() <= 2


def test_more_steps_are_not_tried_against_rounding() -> None:
    level, error, _ = reached(np.geomspace(1e-2, 1e2, 50), 1e-9, rounding=1e-7)
    assert np.all(error <= 2e-7)
    assert level.max() <= 6


@pytest.mark.parametrize(("error", "levels"), [(np.inf, list(range(LAST + 1))), (np.nan, [0])])
def test_results_beyond_doubles_take_twice_the_steps_until_the_last_and_none_where_nothing_is_known(
    error: float, levels: list[int]
) -> None:
    control, seen = StepControl(np.zeros(1, dtype=int), LAST, 1e-9, ORDER), []
    for level, _ in control:
        seen.append(level)
        control.judge(error)
    assert seen == levels
