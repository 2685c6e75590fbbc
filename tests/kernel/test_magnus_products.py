"""Compiled products of Magnus steps, and eigenvalues, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from gearstab import ckernel
from gearstab.propagation.magnus import MagnusSteps, eigenvalues, propagated


@pytest.fixture(params=ckernel.library.levels())
def level(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", str(request.param))


def steps_of(size: int, largest: float, count: int = 6) -> MagnusSteps:
    """Random steps whose later coefficients are ever smaller, as those of a slowly varying A."""
    random = np.random.default_rng(size)
    coefficients = random.normal(size=(count, 5, size, size)) * 0.1 ** np.arange(5)[:, None, None]
    return MagnusSteps(largest * coefficients / size, random.uniform(0.5, 1.5, count))


PERIODS = np.geomspace(1e-3, 2.0, 11)
"""One more than vectors have lanes; from no halving to eight and more, side by side."""


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("size", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("largest", [1.0, 50.0, 400.0])
def test_products_agree_with_those_of_scipy(size: int, largest: float) -> None:
    steps = steps_of(size, largest)
    start = np.random.default_rng(1).normal(size=(len(PERIODS), size, size))
    matrix, scale = propagated(steps, PERIODS, start, np.full(len(PERIODS), 0.5))
    assert np.abs(matrix).max(axis=(1, 2)) == pytest.approx(1.0, rel=1e-12)
    for k, period in enumerate(PERIODS):
        expected, taken, condition = start[k], 0.5, 0.0
        for coefficients, length in zip(steps.coefficients, steps.length, strict=True):
            w = np.tensordot((length * period) ** np.arange(1, 6), coefficients, axes=1)
            growth = np.linalg.eigvals(w).real.max()
            expected, taken = expm(w - growth * np.eye(size)) @ expected, taken + growth
            size_of = np.abs(expected).max()
            expected, taken = expected / size_of, taken + np.log(size_of)
            condition += np.abs(w).sum(axis=0).max()
        # Either exponential is right to eps times the 1-norm of the exponent, times what their product cancels.
        off = 4e-15 * (1 + condition)
        np.testing.assert_allclose(matrix[k], expected, atol=100 * off)
        assert scale[k] == pytest.approx(taken, abs=100 * off, rel=1e-13)


@pytest.mark.usefixtures("level")
def test_a_point_has_the_same_bits_beside_any_others() -> None:
    steps, start = steps_of(4, 50.0), np.tile(np.eye(4), (len(PERIODS), 1, 1))
    matrix, scale = propagated(steps, PERIODS, start, np.zeros(len(PERIODS)))
    for k in (0, 4, len(PERIODS) - 1):
        alone = propagated(steps, PERIODS[k:], start[k:], np.zeros(len(PERIODS) - k))
        np.testing.assert_array_equal(alone[0], matrix[k:])
        np.testing.assert_array_equal(alone[1], scale[k:])


@pytest.mark.usefixtures("level")
def test_long_steps_neither_overflow_nor_underflow() -> None:
    """Each product is freed of its growth; what is left of the other direction is nothing."""
    rates = np.zeros((2, 5, 2, 2))
    rates[0, 0], rates[1, 0] = np.diag([1e4, -1e4]), np.diag([-2e4, -3e4])
    matrix, scale = propagated(MagnusSteps(rates, np.ones(2)), np.array([1.0]), np.eye(2)[None], np.zeros(1))
    np.testing.assert_allclose(matrix[0], np.diag([1.0, 0.0]), atol=1e-300)
    assert scale[0] == pytest.approx(-1e4, rel=1e-14)


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("size", [1, 2, 3, 5, 8])
def test_eigenvalues(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(13, size, size))
    matrix[3, 0, 0] = np.nan
    matrix[5] = np.eye(size)
    found = eigenvalues(matrix)
    assert np.isnan(found[3]).all()
    for k in set(range(13)) - {3}:
        expected = np.linalg.eigvals(matrix[k])
        gaps = np.abs(found[k][:, None] - expected[None])
        # Eigenvalues of such matrices are known to eps times a condition number of at most some hundreds.
        assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-12
