"""The compiled kernel against its form in NumPy, high precision and itself, at every level of vector instructions."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import mpmath as mp
import numpy as np
import numpy_kernel
import pytest
from oracle import plain
from oracle import solve as reference
from scipy.linalg import eig
from systems import KINDS, chain, damped_patterns, patterns, system, two_stage

from gearstab import ckernel
from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.floquet.kernel import c_kernel, decision, threads
from gearstab.floquet.kernel.decision import DOUBTFUL, STABLE, UNSTABLE
from gearstab.floquet.segments.pattern import prepare
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

LEVELS = ckernel.library.levels()
POINTS = 203  # a multiple of no vector's length
FEW = 61  # for which polynomials never pay


@pytest.fixture(params=LEVELS)
def level(request, monkeypatch):
    monkeypatch.setenv("GEARSTAB_SIMD", request.param)
    return request.param


def compare_growth(found, expected, chosen):
    """1e-9: unstable points are at least 1e-3 away from a double multiplier, where rounding errors of 1e-14 times
    the condition of the product, some 1e2 here, grow by 1e3."""
    np.testing.assert_allclose(found[chosen], expected[chosen], rtol=1e-9, atol=1e-9)


def differ_on_thresholds(pattern, omega, verdict, expected):
    """In how many points one of two kernels is in doubt; all of them must lie on a threshold."""
    differ = (verdict == DOUBTFUL) != (expected == DOUBTFUL)
    for row in np.flatnonzero(differ.any(axis=1)):
        assert np.all(on_a_threshold(pattern, row, omega[row, differ[row]]))
    return differ.sum()


def on_a_threshold(pattern, row, omega):
    """Whether a quantity that decides whether points are in doubt is within a factor of two of its threshold."""
    matrix, scale = numpy_kernel.propagate(pattern, row, omega)
    s = np.atleast_2d(numpy_kernel.coefficients(matrix))
    size = np.maximum(1.0, np.abs(s).max(axis=0) / 3.0)
    powers = np.arange(len(s) + 1)[::-1]
    coefficients = np.concatenate([np.ones((1, s.shape[1])), s * (-1.0) ** np.arange(1, len(s) + 1)[:, None]])
    edges = [np.abs((2.0 * sign) ** powers @ coefficients) / size for sign in (1, -1)]
    ratios = [edge / decision.EDGE_NOISE for edge in edges] + [size / decision.LARGEST]
    if len(s) > 1:
        discriminant = np.abs(numpy_kernel.scaled_discriminant(s))
        ratios += [discriminant / decision.DISCRIMINANT_NOISE, discriminant / decision.GROWTH_NOISE]
    return (np.abs(np.log2(np.array(ratios))) < 1).any(axis=0) | (scale > 0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3])
def test_closed_form_is_that_of_numpy(level, n, kind):
    for pattern, omega in patterns(system(n, kind, 0), POINTS):
        verdict, growth = c_kernel.scan(pattern, omega)
        expected, reference_growth = numpy_kernel.scan(pattern, omega)
        # The same polynomial with other rounding errors: only what lies on a threshold of doubt may differ.
        sure = (verdict != DOUBTFUL) & (expected != DOUBTFUL)
        np.testing.assert_array_equal(verdict[sure], expected[sure])
        assert differ_on_thresholds(pattern, omega, verdict, expected) < 0.01 * omega.size
        compare_growth(growth, reference_growth, sure)
        assert np.all(growth[verdict != UNSTABLE] == 0)


def test_thresholds_are_those_of_numpy(monkeypatch):
    """Given others by less than a factor of two, the kernels differ, and on the thresholds only."""
    count = 0
    monkeypatch.setattr(c_kernel, "LIMITS", (*(1e6 * np.array(c_kernel.LIMITS[:3])), *c_kernel.LIMITS[3:]))
    for name in ("EDGE_NOISE", "DISCRIMINANT_NOISE", "GROWTH_NOISE"):
        monkeypatch.setattr(decision, name, 1.5e6 * getattr(decision, name))
    for n in (1, 2, 3):
        for pattern, omega in patterns(system(n, "generic", 0), 2003):
            count += differ_on_thresholds(
                pattern, omega, c_kernel.scan(pattern, omega)[0], numpy_kernel.scan(pattern, omega)[0]
            )
    assert count > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [*range(1, 9)])
def test_solutions_agree(level, n, kind):
    item, omega = system(n, kind, 1), np.geomspace(0.2, 8, 41)
    found = solve(item, omega)
    growth, stable = numpy_kernel.stability(item, omega)
    np.testing.assert_array_equal(found.stable, stable)
    np.testing.assert_allclose(found.growth_rate, growth, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("n", [4, 5, 8])
def test_more_coordinates_leave_little_in_doubt(level, n):
    for pattern, omega in patterns(system(n, "generic", 2), POINTS):
        verdict, _ = c_kernel.scan(pattern, omega)
        assert np.mean(verdict == DOUBTFUL) < 0.05
        assert {STABLE, UNSTABLE} <= set(verdict.ravel())


@pytest.mark.parametrize("level", LEVELS[-1:], indirect=True)
def test_thirty_three_coordinates(level):
    item = chain(33, 5)
    ((pattern, omega),) = patterns(item, 19, 0.4, 5.0)
    found = c_kernel.traces(pattern, omega)[0]
    values = np.linalg.eigvals(numpy_kernel.monodromy(pattern, 0, omega[0])[0])
    # Each rho is that of two multipliers; 1e-10: the condition of 66 eigenvalues of a matrix of norm 1e2.
    rho = values + 1 / values
    distance = np.abs(found[:, :, None] - rho[:, None, :]).min(axis=2)
    assert distance.max() < 1e-10 * np.abs(rho).max()
    ours = solve(item, np.linspace(0.4, 5, 19))
    growth, stable = numpy_kernel.stability(item, np.linspace(0.4, 5, 19))
    np.testing.assert_array_equal(ours.stable, stable)
    np.testing.assert_allclose(ours.growth_rate, growth, atol=1e-10)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("kind", ["generic", "negative stiffness", "rigid"])
def test_all_exponents(level, n, kind):
    item, omega = system(n, kind, 3), np.geomspace(0.3, 7, 23)
    found = solve(item, omega, exponents=True).exponents
    expected = numpy_kernel.exponents(item, omega)
    turn = 2 * np.pi / (2 * np.pi * float(item.common_period()[0]) / omega)[None, :, None, None]
    shift = found[..., :, None].imag - expected[..., None, :].imag
    apart = np.hypot(found[..., :, None].real - expected[..., None, :].real, shift - turn * np.rint(shift / turn))
    # An exponent near a collision moves with the root of rounding errors, 1e-7. Those of rigid bodies are not compared.
    assert apart.min(axis=-2).max() < 1e-6
    assert np.median(apart.min(axis=-2)) < 1e-13


def two_meshes(ratio):
    return build(two_stage(ratio, contact_ratio=(1.47, 1.64), phasing=0.13))


@cache
def exact_rho(ratio, omega):
    return [value + 1 / value for value in reference(plain(two_meshes(ratio)), omega).multipliers]


@pytest.mark.parametrize("ratio", [Fraction(1), Fraction(3, 5)], ids=str)
def test_rho_in_high_precision(level, ratio):
    """1e-13 of rho for Omega >= 0.1, against 40 digits; relative where rho is large."""
    (pattern,) = prepare(two_meshes(ratio))
    omegas = np.array([0.1, 0.57, 1.93, 6.1])
    found = c_kernel.traces(pattern, omegas[None] / pattern.elastic.rate[0])[0]
    for omega, rho in zip(omegas, found, strict=True):
        exact = exact_rho(ratio, float(omega))
        for value in rho:
            assert min(abs(mp.mpc(value) - r) / max(1, abs(r)) for r in exact) < 1e-13


def oscillator(level_low, level_high):
    """One coordinate with two levels of stiffness, half a period each."""
    mean, swing = 0.5 * (level_low + level_high), level_high - level_low
    mesh = Mesh("m", np.array([1.0]), mean, 0.5 * swing / mean, Rectangular(1.5))
    return GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,))


def test_rotations_in_high_precision(level):
    """A steady oscillator: rho = 2 cos(2 pi w/Omega). The phase, not the cosine, limits the accuracy: it takes
    three roundings of 1.1e-16 each (w, the rate, the period)."""
    item = oscillator(1.7, 1.7)
    omega = np.concatenate([np.geomspace(1e-3, 50, 400), 1.7**0.5 / np.arange(0.25, 5, 0.25)])
    (pattern,) = prepare(item)
    found = c_kernel.traces(pattern, omega[None] / pattern.elastic.rate[0])[0, :, 0].real
    with mp.workdps(40):
        turns = [mp.sqrt(mp.mpf(1.7)) / mp.mpf(w) for w in omega]
        expected = [2 * mp.cos(2 * mp.pi * t) for t in turns]
        error = np.array([float(abs(mp.mpf(a) - b)) for a, b in zip(found, expected, strict=True)])
    assert np.all(error < 4e-16 + 2 * 2 * np.pi * np.array(turns, dtype=float) * 5e-16)


def test_growing_and_free_segments_in_high_precision(level):
    """A level below zero (cosh, sinh) or exactly zero (1, t) beside one above: Meissner's formula, complex roots."""
    for low in (-0.6, -1e-9, 0.0):
        item = oscillator(low, 2.0)
        low_, high_ = (mp.mpf(float(v)) for v in sorted(prepare(item)[0].stiffness[0, :, 0, 0]))
        (pattern,) = prepare(item)
        omega = np.geomspace(0.3, 8, 100) / pattern.elastic.rate[0]
        found = c_kernel.traces(pattern, omega[None])[0, :, 0].real
        for w, value in zip(omega, found, strict=True):
            with mp.workdps(40):
                t, a, b = mp.pi / mp.mpf(w), mp.sqrt(mp.mpc(low_)), mp.sqrt(mp.mpc(high_))
                sine = t if low_ == 0 else mp.sin(a * t) / a
                exact = 2 * mp.cos(a * t) * mp.cos(b * t) - (low_ + high_) * sine * mp.sin(b * t) / b
                # Errors are relative to the growth in the soft half, exp(|a| t).
                assert abs(mp.re(exact) - mp.mpf(value)) < 1e-14 * (1 + t) * mp.exp(abs(mp.im(a)) * t)


@pytest.mark.parametrize("n", [1, 3, 5])
def test_growth_beyond_the_range_of_doubles(level, n):
    item = system(n, "negative stiffness", 4)
    item = replace(item, stiffness=0.01 * item.stiffness)
    omega = np.geomspace(0.0007, 0.02, 11)
    found = solve(item, omega)
    assert (found.growth_rate * 2 * np.pi / omega).max() > np.log(np.finfo(float).max)
    np.testing.assert_allclose(found.growth_rate, numpy_kernel.stability(item, omega)[0], rtol=1e-10)
    assert np.all(found.status[found.growth_rate * 2 * np.pi / omega > 200] & STATUS_FLAGS["rescaled"])


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_long_periods(level, n):
    """Frequency ratio 101/100: more than 400 segments."""
    base = system(n, "generic", 5, epsilon=0.1)
    first, second = base.meshes
    item = replace(base, meshes=(first, replace(second, frequency_ratio=Fraction(101, 100))))
    assert len(prepare(item)[0].states) > 400
    omega = np.linspace(0.5, 3, 21)
    found = solve(item, omega)
    growth, stable = numpy_kernel.stability(item, omega)
    np.testing.assert_array_equal(found.stable, stable)
    # 400 segments, each adding its rounding errors to a growth of up to 1e2 a period.
    np.testing.assert_allclose(found.growth_rate, growth, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("points", [0, 1, 2, 7, 8, 9])
@pytest.mark.parametrize("n", [1, 3, 4])
def test_any_number_of_points(level, n, points):
    ((pattern, omega), *_) = patterns(system(n, "one mesh", 6), 33)
    whole = c_kernel.scan(pattern, omega)
    part = c_kernel.scan(pattern, omega[:, :points])
    np.testing.assert_array_equal(part[0], whole[0][:, :points])
    # Newton's steps of more than three coordinates go on until all points of a vector have done.
    np.testing.assert_allclose(part[1], whole[1][:, :points], rtol=0 if n <= 3 else 1e-12, atol=0)
    assert c_kernel.monodromy(pattern, 0, omega[0, :points])[0].shape == (points, 2 * n, 2 * n)
    assert c_kernel.traces(pattern, omega[:, :points]).shape == (len(omega), points, n)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_point_has_the_same_bits_beside_any_others(level, n):
    """Where all are propagated; rows of many points, see test_stretches.py."""
    ((pattern, omega), *_) = patterns(system(n, "one mesh", 6), FEW)
    whole = c_kernel.scan(pattern, omega)
    some = np.random.default_rng(5).permutation(FEW)[:23]
    for found, expected in zip(c_kernel.scan(pattern, omega[:, some]), whole, strict=True):
        np.testing.assert_array_equal(found, expected[:, some])


@pytest.mark.parametrize("kind", ["generic", "negative stiffness", "free state"])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_monodromy_of_mixed_rows(level, n, kind):
    for pattern, omega in patterns(system(n, kind, 7), 12):
        rows = np.arange(omega.size) % len(omega)
        asked = omega[rows, np.arange(omega.size) // len(omega)]
        matrix, scale = c_kernel.monodromy(pattern, rows, asked)
        expected, expected_scale = numpy_kernel.monodromy(pattern, rows, asked)
        size = np.abs(expected).max(axis=(1, 2), keepdims=True)
        np.testing.assert_allclose(matrix / size, expected / size, atol=1e-12)
        np.testing.assert_allclose(scale, expected_scale, atol=1e-12)


def rounding(pattern, generator, omega):
    """Bound on the error of ln max |lambda|, ``(r, P)``: the condition of the largest multiplier times eps a segment.

    An error E of M moves a multiplier by |y^H E x|/(|y^H x| |lambda|), and a double one by its root, at most 1e-7. The
    largest error seen, 42 of these units, and ten times as much for other processors.
    """
    found = np.empty(omega.shape)
    for row, matrices in enumerate(numpy_kernel.products_damped(pattern, generator, omega)[0]):
        for k, matrix in enumerate(matrices):
            values, left, right = eig(matrix, left=True)
            first = np.abs(values).argmax()
            product = np.abs(np.vdot(left[:, first], right[:, first])) * np.abs(values[first])
            found[row, k] = np.linalg.norm(matrix) / max(product, np.finfo(float).tiny)
    return np.minimum(1e-7, 420 * np.finfo(float).eps * len(pattern.states) * found)


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("kind", ["generic", "negative stiffness", "rigid", "no excitation", "one mesh", "ratios"])
@pytest.mark.parametrize("damping", [1e-7, 1e-3, 0.1, 3.0])
def test_general_damping(level, n, kind, damping):
    for pattern, generator, omega in damped_patterns(system(n, kind, 8, damping), 31):
        growth, scale = c_kernel.scan_damped(pattern, generator, omega)
        expected, expected_scale = numpy_kernel.scan_damped(pattern, generator, omega)
        error = np.abs(growth - expected) / np.maximum(1.0, np.abs(expected))
        assert np.all(error < rounding(pattern, generator, omega))
        # The size of the matrix is told in other coordinates, whose condition is limited to 1e4.
        assert np.abs(scale - expected_scale).max() < 2 * np.log(1e4)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_equal_decay_of_all_multipliers(level, n):
    """All multipliers of one modulus, the hardest for root squaring: nearly uniform damping, stable points."""
    base = system(n + 1, "generic", 9, epsilon=0.05)
    item = GearSystem(base.mass, base.stiffness, base.meshes, 0.03 * base.mass + 1e-11 * base.stiffness)
    for pattern, generator, omega in damped_patterns(item, 800):
        growth, _ = c_kernel.scan_damped(pattern, generator, omega)
        expected, _ = numpy_kernel.scan_damped(pattern, generator, omega)
        assert np.all(np.abs(growth - expected) < rounding(pattern, generator, omega))


def test_long_decay_does_not_underflow(level):
    """Multipliers of exp(-1e4)."""
    for pattern, generator, omega in damped_patterns(system(3, "generic", 10, 2.0), 9, low=2e-4):
        growth, _ = c_kernel.scan_damped(pattern, generator, omega)
        expected, _ = numpy_kernel.scan_damped(pattern, generator, omega)
        assert growth.min() < -700
        np.testing.assert_allclose(growth, expected, rtol=1e-10)


def test_critical_damping_goes_the_way_of_numpy(level):
    """A double eigenvalue of the generator, which no eigenvectors span."""
    mesh = Mesh("m", np.array([1.0, 0.0]), 1.0, 0.0, Rectangular(1.5))
    item = GearSystem(np.eye(2), np.diag([0.0, 4.0]), (mesh,), np.diag([2.0, 0.1]))
    ((pattern, generator, omega),) = damped_patterns(item, 5)
    assert not generator.well_conditioned.any()
    growth, _ = c_kernel.scan_damped(pattern, generator, omega)
    np.testing.assert_allclose(growth, numpy_kernel.scan_damped(pattern, generator, omega)[0], rtol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_threads_change_nothing(level, n, monkeypatch):
    monkeypatch.setattr(threads, "WORTH_A_THREAD", 1.0)
    ((pattern, omega), *_) = patterns(system(n, "one mesh", 11), POINTS)
    one = c_kernel.scan(pattern, omega, 1)
    for count in (2, 3, 8):
        for a, b in zip(c_kernel.scan(pattern, omega, count), one, strict=True):
            assert a.tobytes() == b.tobytes()
    ((damped_pattern, generator, asked), *_) = damped_patterns(system(n, "one mesh", 12, 0.05), POINTS)
    alone = c_kernel.scan_damped(damped_pattern, generator, asked, 1)[0]
    assert c_kernel.scan_damped(damped_pattern, generator, asked, 3)[0].tobytes() == alone.tobytes()


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_numbers_that_are_none_harm_no_neighbour(level, n):
    """Frequencies that are no numbers share vectors with others; these keep their digits, those are in doubt."""
    rng = np.random.default_rng(n)
    for pattern, omega in patterns(system(n, "generic", 13), POINTS):
        spoiled, bad = omega.copy(), rng.random(omega.shape) < 0.2
        spoiled[bad] = rng.choice([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-320, 1e308], bad.sum())
        (verdict, growth), (expected, reference_growth) = (c_kernel.scan(pattern, asked) for asked in (spoiled, omega))
        np.testing.assert_array_equal(verdict[~bad], expected[~bad])
        # Newton's steps go on until all lanes have done: a trace 2 cosh(growth) differs by some 50 eps.
        change, least = np.abs(growth - reference_growth)[~bad], reference_growth[~bad]
        assert np.all(change * np.minimum(least, 1.0) <= 2e-14 * np.maximum(least, 1.0))
        assert np.all(verdict[np.isnan(spoiled)] == DOUBTFUL)
        c_kernel.scan_traces(pattern, spoiled, interpolate=True)
    for pattern, generator, omega in damped_patterns(system(n, "generic", 13, 0.05), POINTS):
        spoiled, bad = omega.copy(), rng.random(omega.shape) < 0.2
        spoiled[bad] = rng.choice([np.nan, np.inf, 0.0], bad.sum())
        state = np.ascontiguousarray(pattern.states)
        growth = [scanned(pattern, generator, state, given) for given in (omega, spoiled)]
        # Where root squaring leaves a point to QR, whose vectors hold what comes.
        np.testing.assert_allclose(growth[1][~bad], growth[0][~bad], rtol=1e-9, atol=1e-9)


def scanned(pattern, generator, state, omega):
    """Growth of a damped pattern by the compiled kernel alone, without what it leaves to NumPy."""
    values, basis, inverse = generator.real_modes
    given = c_kernel.damped_arguments(pattern.cycles, values, pattern.fractions, state, *pattern.pairs(inverse, basis))
    growth, scale = np.empty(omega.shape), np.empty(omega.shape)
    asked = np.ascontiguousarray(omega)
    ckernel.library.scan_damped(ckernel.simd(), *given, 0, len(omega), omega.shape[1], asked, growth, scale)
    return growth
