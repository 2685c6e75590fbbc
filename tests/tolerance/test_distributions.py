"""Distributions, the samples that are drawn of them, and their correlation."""

import numpy as np
import pytest
from scipy import stats

from gearstab.tolerance import Distribution, SamplingDesign, correlated, groups_of

CASES = [
    (Distribution("normal", (1.5, 0.03)), stats.norm(1.5, 0.03)),
    (Distribution("uniform", (-0.2, 0.4)), stats.uniform(-0.2, 0.6)),
    (Distribution("triangular", (0.4, 0.5, 0.9)), stats.triang(0.2, 0.4, 0.5)),
    (Distribution("triangular", (1.0, 1.0, 2.0)), stats.triang(0.0, 1.0, 1.0)),
    (Distribution("triangular", (1.0, 2.0, 2.0)), stats.triang(1.0, 1.0, 1.0)),
]
U = np.linspace(0.001, 0.999, 37)


@pytest.mark.parametrize(("own", "reference"), CASES)
def test_numbers_are_those_of_scipy(own, reference):
    x = reference.ppf(U)
    assert own.inverse(U) == pytest.approx(x, rel=1e-12)
    assert own.below(x) == pytest.approx(U, abs=1e-12)
    assert own.below(x[0] - 10.0) == pytest.approx(0.0, abs=1e-15)
    assert own.below(x[-1] + 10.0) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(("own", "reference"), CASES)
def test_cut_off_it_is_the_conditional_distribution(own, reference):
    low, high = reference.ppf([0.3, 0.8])
    x = own.quantile(U, low, high)
    assert np.all((x >= low) & (x <= high))
    # P(X < x | low < X < high)
    assert (reference.cdf(x) - 0.3) / 0.5 == pytest.approx(U, abs=1e-10)
    assert float(own.outside(low, high)) == pytest.approx(0.5, abs=1e-12)


def test_samples_are_those_of_the_seed_alone():
    first, again, other = (SamplingDesign.of((0, 1, 2), 1000, True, seed).points for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.any(first == other)
    assert np.all((first > 0) & (first < 1))


def test_every_scramble_covers_the_square_evenly():
    # Of 256 points of a (0, m, 2)-net every dyadic rectangle of area 2^-8 holds one; random ones miss a third of them.
    design = SamplingDesign.of((0, 1), 2048, False, 7)
    for points in design.points.reshape(8, 256, 2):
        for k in range(9):
            cell = np.floor(points * [2**k, 2 ** (8 - k)])
            assert len(np.unique(cell, axis=0)) == 256


def test_matrices_mix_the_columns_of_a_group():
    design = SamplingDesign.of((0, 1, 0), 500, True, 1)
    a, b, first, second = design.points.reshape(*design.shape, 3)[2]
    assert np.array_equal(first, np.column_stack([b[:, 0], a[:, 1], b[:, 2]]))
    assert np.array_equal(second, np.column_stack([a[:, 0], b[:, 1], a[:, 2]]))
    assert design.size >= 500
    assert design.size < 500 + 8 * 4


def test_groups():
    assert groups_of(5, [(1, 3), (3, 4)]) == (0, 1, 2, 1, 1)
    assert groups_of(3, []) == (0, 1, 2)


def test_copula_has_the_correlation_and_keeps_the_margins():
    matrix = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 1.0]])
    points = SamplingDesign.of((0, 1, 2), 2**14, False, 2).points
    found = correlated(points, matrix)
    assert np.array_equal(found[:, 2], points[:, 2])
    deviates = stats.norm.ppf(found)
    # Of 16384 independent samples the error would be 0.005 (one standard deviation); these are more even.
    assert np.corrcoef(deviates.T) == pytest.approx(matrix, abs=0.01)
    for column in found.T:
        assert stats.kstest(column, "uniform").statistic < 0.01
