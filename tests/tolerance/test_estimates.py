"""Probabilities, their intervals and Sobol indices where the truth is known."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

from gearstab.tolerance import SCRAMBLES, SamplingDesign, _jackknife, mean_of_chances, probability, sobol_indices

NOTHING = np.zeros((1, 1, 1), dtype=bool)


def one_edge(points, p):
    return points[:, 0] < p


def corner(points, p):
    """x + y < t has the area t^2/2 up to t = 1, and the rest is symmetric."""
    return points.sum(axis=1) < (np.sqrt(2 * p) if p < 0.5 else 2 - np.sqrt(2 * (1 - p)))


def plane(points, p):
    """Normal deviates beyond a plane."""
    return ndtri(points).mean(axis=1) * np.sqrt(points.shape[1]) < ndtri(p)


CASES = {
    "an edge": (one_edge, (0,), False, 1024), "an edge, few samples": (one_edge, (0,), False, 100),
    "a corner": (corner, (0, 1), False, 1000), "a corner with indices": (corner, (0, 1), True, 1024),
    "four numbers": (plane, (0, 1, 2, 3), False, 512), "three with indices": (plane, (0, 1, 2), True, 1024),
}  # fmt: skip


def covered(case, repetitions, largest):
    unstable, groups, indices, samples = CASES[case]
    random = np.random.default_rng(0)
    hits = 0
    for seed in range(repetitions):
        design = SamplingDesign.of(groups, samples, indices, seed)
        p = random.uniform(0.0, largest)
        found = unstable(design.points, p).reshape(design.shape)
        middle, lower, upper = probability(found, NOTHING, design)
        assert lower <= middle <= upper
        hits += lower <= p <= upper
    return hits / repetitions


@pytest.mark.parametrize("case", CASES)
def test_intervals_cover_the_truth(case):
    # Of 200 repetitions at 95 % fewer than 180 succeed once in 500 times; seeds are fixed.
    assert covered(case, 200, 1.0) >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("largest", [1.0, 0.05, 0.005])
@pytest.mark.parametrize("case", CASES)
def test_intervals_cover_the_truth_in_a_thousand_repetitions(case, largest):
    assert covered(case, 1000, largest) >= 0.93


def test_an_interval_is_no_wider_than_it_must_be():
    # Independent samples would give 0.031 at p = 1/2; scrambled ones of a number know an edge to 1/128.
    design = SamplingDesign.of((0,), 1024, False, 0)
    _, lower, upper = probability(one_edge(design.points, 0.47).reshape(design.shape), NOTHING, design)
    assert upper - lower < 0.015
    none = np.zeros(design.shape, dtype=bool)
    # (1 - p)^1024 = 2.5 %: Clopper and Pearson's end where nothing is seen.
    assert probability(none, NOTHING, design)[1:] == (0.0, pytest.approx(1 - 0.025 ** (1 / 1024), rel=1e-6))
    assert probability(~none, NOTHING, design)[1:] == (pytest.approx(0.025 ** (1 / 1024), rel=1e-6), 1.0)


def test_failed_samples_count_as_either():
    design = SamplingDesign.of((0,), 1024, False, 0)
    x = design.points[:, 0].reshape(design.shape)
    middle, lower, upper = probability(x < 0.4, x > 0.9, design)
    assert middle == pytest.approx(0.4 / 0.9, abs=0.01)
    assert lower < 0.4
    assert upper > 0.5
    assert np.isnan(probability(x < 0.0, x > 0.0, design)[0])


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.5), (0.8, 0.4), (0.9, 0.6)])
def test_sobol_indices_of_a_rectangle(a, b):
    # y = [x < a][z < b] has V = ab (1 - ab), S_x = b (1 - a)/(1 - ab) and T_x = 1 - S_z; a third number does nothing.
    design = SamplingDesign.of((0, 1, 2), 2**15, True, 5)
    points = design.points
    unstable = ((points[:, 0] < a) & (points[:, 1] < b)).reshape(design.shape)
    first, total, of_first, of_total = sobol_indices(unstable, design)
    truth = np.array([b * (1 - a), a * (1 - b), 0.0]) / (1 - a * b)
    # Three half-widths of 95 %: six standard deviations.
    assert np.all(np.abs(first - truth) <= 3 * of_first + 1e-12)
    assert np.all(np.abs(total - (1 - truth[[1, 0, 0]]) * [1, 1, 0]) <= 3 * of_total + 1e-12)
    assert np.all(of_first < 0.05)
    assert np.all(of_total[:2] < 0.05)


def test_indices_are_masked_where_nothing_varies():
    design = SamplingDesign.of((0, 1), 1024, True, 5)
    for p in (0.0, 0.01, 0.995):
        unstable = one_edge(design.points, p).reshape(design.shape)
        assert all(np.isnan(found).all() for found in sobol_indices(unstable, design))


def test_a_single_group_has_the_index_one():
    design = SamplingDesign.of((0, 0), 1024, True, 5)
    unstable = corner(design.points, 0.5).reshape(design.shape)
    assert design.matrices == 1
    assert np.array_equal(sobol_indices(unstable, design)[0], [1.0, 1.0])


def conditional_corner(points, p):
    """P(x + y < t | x), y being integrated."""
    t = np.sqrt(2 * p) if p < 0.5 else 2 - np.sqrt(2 * (1 - p))
    return np.clip(t - points[:, 0], 0.0, 1.0)


def conditional_plane(points, p):
    """Normal deviates beyond a plane, the last of them integrated."""
    return ndtr(ndtri(p) * np.sqrt(points.shape[1] + 1) - ndtri(points).sum(axis=1))


def steep(points, p):
    """Nearly an edge: what is integrated hardly matters."""
    return ndtr((p - points[:, 0]) / 1e-4)


CHANCES = {
    "a corner": (conditional_corner, 1, 1024), "a corner, few samples": (conditional_corner, 1, 100),
    "a plane": (conditional_plane, 1, 512), "four numbers": (conditional_plane, 3, 512), "steep": (steep, 1, 1024),
}  # fmt: skip


def covered_by_chances(case, repetitions, largest):
    chances, count, samples = CHANCES[case]
    random = np.random.default_rng(0)
    hits = 0
    for seed in range(repetitions):
        design = SamplingDesign.of(tuple(range(count)), samples, False, seed)
        # Next to 0 and 1 the steep one has no simple mean.
        p = random.uniform(1e-3, largest)
        middle, lower, upper = mean_of_chances(chances(design.points, p).reshape(design.shape), design)
        assert lower <= middle <= upper
        hits += lower <= p <= upper
    return hits / repetitions


@pytest.mark.parametrize("case", CHANCES)
def test_intervals_of_conditional_probabilities_cover_the_truth(case):
    assert covered_by_chances(case, 200, 1.0) >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("largest", [0.99, 0.05, 0.005])
@pytest.mark.parametrize("case", CHANCES)
def test_intervals_of_conditional_probabilities_cover_the_truth_in_a_thousand_repetitions(case, largest):
    assert covered_by_chances(case, 1000, largest) >= 0.93


def test_conditional_probabilities_tell_more():
    design = SamplingDesign.of((0, 1), 1024, False, 0)
    chances = conditional_plane(design.points, 0.3).reshape(design.shape)
    middle, lower, upper = mean_of_chances(chances, design)
    drawn = probability(plane(design.points, 0.3).reshape(design.shape), NOTHING, design)
    assert abs(middle - 0.3) < 2e-4
    assert upper - lower < 0.5 * (drawn[2] - drawn[1])
    # What differs little is known well, and equal chances are the probability.
    assert np.ptp(mean_of_chances(0.3 + 0.01 * chances, design)) < 2e-4
    assert mean_of_chances(np.full(design.shape, 0.3), design) == pytest.approx((0.3, 0.3, 0.3), abs=1e-6)
    # Where no sample has a chance there may yet be systems that have one.
    assert mean_of_chances(np.zeros(design.shape), design)[2] == pytest.approx(1 - 0.025 ** (1 / 1024))


@pytest.mark.parametrize("seed", range(3))
def test_the_jackknife_of_a_mean_is_students_interval(seed: int) -> None:
    """Leaving out one of n values at a time gives the mean the variance s^2/n, exactly (Efron & Stein 1981)."""
    values = np.random.default_rng(seed).normal(size=(SCRAMBLES, 4))
    without = tuple(np.delete(values, k, axis=0).mean(axis=0) for k in range(SCRAMBLES))
    interval = stats.t.interval(0.95, SCRAMBLES - 1, values.mean(axis=0), stats.sem(values, axis=0))
    # Rounding of a sum of a few squares.
    np.testing.assert_allclose(_jackknife(without), 0.5 * (interval[1] - interval[0]), rtol=1e-12)
