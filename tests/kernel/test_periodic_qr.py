"""Multipliers that lie far apart: the compiled periodic QR algorithm and orthogonal iteration in NumPy."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

import mpmath as mp
import numpy as np
import numpy_kernel
import orthogonal_iteration
import pytest
from oracle import assert_exponents_match, plain
from oracle import solve as reference
from scipy.optimize import linear_sum_assignment
from systems import damped_patterns, system, train

from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.kernel import c_kernel, damped
from gearstab.modal import modal_damping_matrix

LEVELS = ckernel.library.levels()


@pytest.fixture(params=["numpy", *LEVELS])
def log_multipliers(request, monkeypatch):
    """ln lambda of given factors: NumPy's way and the compiled one at each level of vector instructions."""
    if request.param == "numpy":
        return orthogonal_iteration.log_multipliers
    monkeypatch.setenv("GEARSTAB_SIMD", request.param)
    return c_kernel.graded


@pytest.fixture(params=LEVELS)
def way(request, monkeypatch):
    """Systems are analysed at each level of vector instructions."""
    monkeypatch.setenv("GEARSTAB_SIMD", request.param)


def apart(found, expected):
    """The largest distance of logarithms matched one to one, modulo 2 pi i."""
    gap = np.asarray(found)[:, None] - np.asarray(expected)[None, :]
    turns = gap.imag - 2 * np.pi * np.rint(gap.imag / (2 * np.pi))
    distance = np.hypot(gap.real, turns)
    return distance[linear_sum_assignment(distance)].max()


def chain(rng, blocks, coupling=0.3):
    """Factors ``(1, m, m)`` each, orthogonal changes of basis between block triangles; blocks: ``(F, b, k, k)``."""
    count, number, size = blocks.shape[:3]
    m = number * size
    turns = [np.linalg.qr(rng.normal(size=(m, m)))[0] for _ in range(count)]
    factors = []
    for k in range(count):
        triangle = np.triu(coupling * rng.normal(size=(m, m)), 1)
        for b in range(number):
            part = slice(b * size, (b + 1) * size)
            triangle[part, part] = blocks[k, b]
        factors.append((turns[(k + 1) % count] @ triangle @ turns[k].T)[None])
    return factors


def exact(factors):
    """ln lambda in mpmath, with 60 digits more than the multipliers of the product need."""
    logs = [np.linalg.slogdet(factor[0]) for factor in factors]
    spread = sum(abs(log) for _, log in logs) + sum(np.log(np.linalg.cond(factor[0])) for factor in factors)
    with mp.workdps(60 + int(spread / np.log(10))):
        product = mp.eye(factors[0].shape[1])
        for factor in factors:
            product = mp.matrix(factor[0].tolist()) * product
        return [complex(mp.log(value)) for value in mp.eig(product, left=False, right=False)]


class TestGivenFactors:
    @pytest.mark.parametrize("count", [1, 2, 7])
    def test_random_ones_against_60_digits(self, log_multipliers, count):
        """Well-conditioned factors: each rounds like eps, which single multipliers feel magnified some ten times."""
        rng = np.random.default_rng(count)
        for m in (1, 2, 3, 5, 6):
            factors = [np.eye(m) + 0.3 * rng.normal(size=(3, m, m)) for _ in range(count)]
            found = log_multipliers(factors)
            for k in range(3):
                assert apart(found[k], exact([f[k : k + 1] for f in factors])) < 2e-13 * count

    @pytest.mark.parametrize("rates", [(1.4, 0.2, 0.15, -0.1, -1.4), (0.6, 0.0, -1.0, -1.4, -1.4)])
    def test_multipliers_that_span_more_than_300_decades(self, log_multipliers, rates):
        """Triangles of 250 factors of size e^rate; every seventh diagonal entry is negative: some multipliers are."""
        rng = np.random.default_rng(3)
        count, m = 250, len(rates)
        sign = np.where(rng.integers(0, 7, (count, m)) == 0, -1.0, 1.0)
        sign[0, 0] *= -np.prod(sign[:, 0])
        blocks = (sign * np.exp(rates))[:, :, None, None]
        (found,) = log_multipliers(chain(rng, blocks))
        expected = count * np.array(rates) + 1j * np.where(np.prod(sign, axis=0) < 0, np.pi, 0.0)
        assert np.ptp(found.real) > 300 * np.log(10) * 0.7
        # 1e-14 a factor.
        assert apart(found, expected) < 1e-14 * count
        negative = found[np.argmin(np.abs(found.real - expected[0].real))]
        assert negative.imag == np.pi

    @pytest.mark.parametrize("count", [1, 3, 40])
    def test_pairs_far_apart(self, log_multipliers, count):
        """Rotations times e^rate commute: angles and rates add up, however the pairs are coupled."""
        rng = np.random.default_rng(count)
        rates, angles = np.array([0.9, 0.1, 0.1, -0.9]), rng.uniform(0.1, 1.0, (count, 4))
        cosine, sine = np.cos(angles), np.sin(angles)
        turns = np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], -2)
        (found,) = log_multipliers(chain(rng, np.exp(rates)[:, None, None] * turns))
        expected = count * rates + 1j * angles.sum(axis=0)
        assert apart(found, np.concatenate([expected, expected.conj()])) < 2e-14 * max(count, 20)

    @pytest.mark.parametrize("split", [0.0, 1e-12, 1e-6])
    def test_defective_pairs(self, log_multipliers, split):
        """A Jordan block among multipliers far apart: the two are known to the root of eps, their product to eps."""
        rng = np.random.default_rng(8)
        count = 60
        blocks = np.zeros((count, 3, 2, 2))
        blocks[:, 0] = np.exp(0.8) * np.eye(2) + np.diag([0.0, 0.3])
        blocks[:, 1] = [[1.0, 1.0], [0.0, 1.0 + split]]
        blocks[:, 2] = np.exp(-1.2) * np.eye(2) + np.diag([0.0, 0.1])
        factors = chain(rng, blocks)
        (found,) = log_multipliers(factors)
        expected = exact(factors)
        assert apart(found, expected) < 1e-5
        middle = np.argsort(found.real)[2:4]
        both = np.sort([value.real for value in expected])[2:4].sum()
        assert found[middle].sum().real == pytest.approx(both, abs=1e-14 * count)

    @pytest.mark.parametrize(("m", "count"), [(18, 20), (66, 8)])
    def test_many_coordinates_with_levels_close_together(self, log_multipliers, m, count):
        """No gap is so wide that a few rounds of iteration part the levels, and all together span e^52 and e^21."""
        rng = np.random.default_rng(m)
        rates = np.linspace(1.3, -1.3, m)
        sign = rng.choice([-1.0, 1.0], (count, m))
        blocks = (sign * np.exp(rates))[:, :, None, None]
        (found,) = log_multipliers(chain(rng, blocks, coupling=0.02))
        expected = count * rates + 1j * np.where(np.prod(sign, axis=0) < 0, np.pi, 0.0)
        # 1e-14 a factor, and an eigenvalue's own condition.
        assert apart(found, expected) < 1e-12

    def test_growth_in_the_wrong_order(self, log_multipliers):
        """Decaying solutions stand first: the sweeps sort them."""
        rng = np.random.default_rng(1)
        rates = np.array([-2.0, -1.5, 0.0, 1.0, 2.5, 3.0])
        factors = [(np.diag(np.exp(rates)) + 1e-9 * rng.normal(size=(6, 6)))[None] for _ in range(30)]
        (found,) = log_multipliers(factors)
        assert apart(found, exact(factors)) < 1e-12

    def test_a_point_that_is_not_finite_leaves_its_neighbours_alone(self, way):
        rng = np.random.default_rng(2)
        factors = [np.eye(4) + 0.3 * rng.normal(size=(5, 4, 4)) for _ in range(3)]
        plain_logs = c_kernel.graded(factors)
        broken = [factor.copy() for factor in factors]
        broken[1][2, 0, 0] = np.nan
        logs = np.empty((5, 4), dtype=complex)
        ckernel.library.graded(ckernel.simd(), 3, 4, 0, 5, 5, np.ascontiguousarray(broken), logs)
        assert np.isnan(logs[2]).any()
        np.testing.assert_array_equal(np.delete(logs, 2, axis=0), np.delete(plain_logs, 2, axis=0))


@cache
def expected(size, kind, strength, omega, row):
    """Exponents in high precision and the period, of a system of general damping."""
    found = reference(plain(system(size, kind, 4, strength), row), omega)
    return found.all_exponents(), found.period


class TestDampedPatterns:
    # The two dearest references take most of the time of this file.
    @pytest.mark.parametrize(
        ("size", "kind"),
        [
            (2, "one mesh"),
            (2, "ratios"),
            (2, "negative stiffness"),
            (3, "one mesh"),
            pytest.param(3, "ratios", marks=pytest.mark.slow),
            pytest.param(3, "negative stiffness", marks=pytest.mark.slow),
        ],
    )
    def test_against_the_reference_in_high_precision(self, way, size, kind):
        """From light damping to multipliers that span 60 decades, over periods of hundreds of radians."""
        for strength, omega in ((0.01, 2.3), (0.01, 0.06), (0.3, 0.06)):
            found = solve(system(size, kind, 4, strength), np.array([omega]), exponents=True).exponents
            for row in (0, 2):
                assert_exponents_match(found[row, 0], *expected(size, kind, strength, omega, row))

    @pytest.mark.parametrize(("size", "points"), [(9, 12), (33, 2)])
    def test_compiled_and_numpy_agree_for_many_coordinates(self, way, size, points):
        for pattern, generator, omega in damped_patterns(system(size, "one mesh", 1, 0.05), points):
            first = pattern.row(0), generator.row(0), omega[:1]
            (found,), (other,) = (kernel.log_multipliers_damped(*first) for kernel in (c_kernel, numpy_kernel))
            for point in range(points):
                # Each single eigenvalue of so many has a condition of its own.
                assert apart(found[point], other[point]) < 1e-9

    @pytest.mark.parametrize("damping", [0.005, 0.3])
    def test_a_period_repeated_a_hundred_times(self, way, damping):
        """r = 1/2 written as 1/2 + 5e-3: multipliers from e^30 to e^-1000, exponents as of the short period."""
        found = {}
        for ratio in (Fraction(101, 200), Fraction(1, 2)):
            item = train((0.4, 0.0), ratio=ratio)
            damping_matrix = modal_damping_matrix(item.mass, item.mean_stiffness_matrix(), np.full(3, damping))
            item = replace(item, damping=damping_matrix)
            found[ratio] = np.sort(solve(item, np.array([2 * 0.5412]), exponents=True).exponents[0].real)
        long, short = found.values()
        np.testing.assert_allclose(long, short, atol=1e-12)

    def test_results_do_not_depend_on_threads(self):
        for pattern, generator, omega in damped_patterns(system(3, "one mesh", 2, 0.1), 203):
            one, four = (c_kernel.log_multipliers_damped(pattern, generator, omega, limit) for limit in (1, 4))
            np.testing.assert_array_equal(one, four)

    def test_states_that_cannot_be_diagonalised(self):
        """Critical damping of a single coordinate beside others: the factors are exponentials of the matrices."""
        (found,) = damped_patterns(system(2, "one mesh", 3, 0.1), 4)
        pattern, generator, omega = found
        matrix = generator.matrix.copy()
        matrix[1, 0] = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, -2, 0], [0, -4, 0, -1]]
        critical = damped.Generators(matrix)
        assert not critical.well_conditioned[1]
        logs = c_kernel.log_multipliers_damped(pattern, critical, omega)
        other = numpy_kernel.log_multipliers_damped(pattern, critical, omega)
        for point in np.ndindex(omega.shape):
            assert apart(logs[point], other[point]) < 1e-11


class TestArguments:
    """Arrays of wrong sizes are refused, never read beyond their ends."""

    def test_given_factors(self):
        arguments = ["plain", 2, 3, 0, 5, 5, np.ones((2, 5, 3, 3)), np.empty((5, 3), dtype=complex)]
        ckernel.library.graded(*arguments)
        for place, wrong in (
            (1, 3),
            (1, 0),
            (2, 2),
            (3, -1),
            (4, 6),
            (5, 4),
            (6, np.ones(89)),
            (7, np.empty(14, complex)),
        ):
            changed = list(arguments)
            changed[place] = wrong
            with pytest.raises(ValueError, match="shapes"):
                ckernel.library.graded(*changed)

    def test_runs_of_points(self):
        ((pattern, generator, omega), *_) = damped_patterns(system(2, "one mesh", 1, 0.1), 9)
        values, basis, inverse = generator.real_modes
        pairs = pattern.pairs(inverse, basis)
        given = c_kernel.damped_arguments(pattern.cycles, values, pattern.fractions, pattern.states, *pairs)
        logs = np.empty((*omega.shape, 4), dtype=complex)
        runs = 2 * len(omega)
        ckernel.library.exponents("plain", *given, 0, runs, 9, omega, logs)
        few, room = omega[:, :8].copy(), logs[1:]
        for wrong in ((-1, runs, 9, omega, logs), (0, runs + 1, 9, omega, logs), (0, runs, 9, few, logs)):
            with pytest.raises(ValueError, match="shapes"):
                ckernel.library.exponents("plain", *given, *wrong)
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.exponents("plain", *given, 0, runs, 9, omega, room)


@pytest.mark.parametrize("points", [3, 20])
def test_many_factors_are_taken_in_portions(monkeypatch: pytest.MonkeyPatch, points: int) -> None:
    """Few points at once, or factors without copies where one point has too many."""
    rng = np.random.default_rng(7)
    factors = [rng.normal(size=(points, 4, 4)) * [8.0, 4.0, 2.0, 1.0] for _ in range(6)]
    whole = c_kernel.graded(factors)
    for most in (9 * 6 * 16, 1):
        monkeypatch.setattr(c_kernel, "ENTRIES_AT_ONCE", most)
        found = c_kernel.graded(factors)
        # Rounding of the order of operations.
        assert max(apart(a, b) for a, b in zip(found, whole, strict=True)) < 1e-10
