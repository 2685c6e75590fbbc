"""All waveforms keep one contract, checked against quadrature and dense sampling for the whole table."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waves import ALL, CASES, IDS, IRREGULAR, LEVELS, RATIOS, arch, at_torque, flat, pieces

from gearstab.waveforms import WAVEFORMS, Constant, Fourier, Rectangular, Sampled, Scaled, Tooth, ToothPair, Trapezoidal
from gearstab.waveforms.tooth import Piecewise, stacked
from gearstab.waveforms.tooth_pair import parabolic

each = pytest.mark.parametrize(("name", "wave"), ALL, ids=IDS)

BATCHES = {
    "rectangular": Rectangular(np.array([[1.0, 1.3, 2.6]])),
    "trapezoidal": Trapezoidal(np.array([1.0, 1.3, 2.6]), np.array([[0.0], [0.1], [0.8]])),
    "fourier": Fourier(np.array([[[0.3, 0.0]], [[0.0, 0.0]]]), np.array([[0.5, 0.1], [0.0, 0.0], [0.0, 0.2]])),
    "sampled": Sampled(IRREGULAR, LEVELS * np.array([1.0, 1.5])[:, None, None] + np.arange(3.0)[:, None] ** 2, "cubic"),
    "table": at_torque(np.array([[1.0, 1.3, 2.0], [1.1, 1.5, 1.9]])),
    "pair": ToothPair(np.array([1.0, 1.3, 2.6]), parabolic(np.array([[1.0], [0.55]]))),
    "tooth": Tooth(stacked([pieces(f, 0.0, d) for f in (arch, flat) for d in (0.1, 0.6)], (2, 2))),
}


def edges(wave):
    """0, 1 and the distinct breakpoints between them."""
    points = np.concatenate([[0.0, 1.0], np.ravel(wave.breakpoints())])
    return np.unique(points)


def quadrature(wave, weight, panels=12):
    """Integral of w times an oscillating weight over a period, by Gauss's rule between the breakpoints."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    total = 0.0
    for a, b in pairwise(edges(wave)):
        cuts = np.linspace(a, b, panels + 1)
        x = 0.5 * (cuts[:-1, None] + cuts[1:, None]) + 0.5 * np.diff(cuts)[:, None] * nodes
        total += np.sum(0.5 * np.diff(cuts)[:, None] * weights * wave.value(x) * weight(x))
    return total


def dense(wave):
    """Phases all over the period, close to both sides of the breakpoints too."""
    points = edges(wave)
    inner = [np.append(np.linspace(a, b, 400)[1:-1], b - 1e-9 * (b - a)) for a, b in pairwise(points)]
    return np.sort(np.concatenate([points[:-1], *inner]))


def test_the_cases_cover_the_table() -> None:
    assert set(CASES) == set(BATCHES) == set(WAVEFORMS)
    for name, wave in ALL:
        assert type(wave) is WAVEFORMS[name]


@each
def test_period_is_one(name, wave) -> None:
    x = dense(wave)
    x = x[np.min(np.abs(x[:, None] - edges(wave)), axis=1) > 1e-9]  # 5 + x is rounded to 1e-15
    for shift in (-3, 1, 5):
        np.testing.assert_allclose(wave.value(x + shift), wave.value(x), atol=1e-11)


@each
def test_mean_is_zero(name, wave) -> None:
    assert abs(quadrature(wave, np.ones_like)) < 1e-14


@each
def test_breakpoints_lie_in_the_period(name, wave) -> None:
    points = wave.breakpoints()
    assert np.all((points >= 0) & (points < 1))


@each
def test_no_kink_between_breakpoints(name, wave) -> None:
    """On a piece w is analytic: a polynomial through Chebyshev points meets it everywhere, to rounding."""
    for a, b in pairwise(edges(wave)):
        cuts = np.linspace(a, b, 5)
        for c, d in pairwise(cuts):
            if d - c < 1e-13:
                continue
            t = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
            fit = np.polynomial.chebyshev.chebfit(t, wave.value(0.5 * (c + d) + 0.5 * (d - c) * t), 31)
            s = np.linspace(-0.999, 0.999, 57)
            found = np.polynomial.chebyshev.chebval(s, fit)
            np.testing.assert_allclose(wave.value(0.5 * (c + d) + 0.5 * (d - c) * s), found, atol=2e-12)


@each
def test_continuous_from_the_right(name, wave) -> None:
    points = np.unique(np.append(np.ravel(wave.breakpoints()), 0.0))
    gap = np.diff(np.append(points, 1.0)).min()
    # The steepest ramp of the cases rises by 1 over 1e-3.
    step = min(1e-13, 0.5 * gap)
    np.testing.assert_allclose(wave.value(points), wave.value(points + step), atol=1e-9)


@each
def test_piecewise_constant_says_so(name, wave) -> None:
    constant = all(np.ptp(wave.value(np.linspace(a, b, 9)[1:-1])) < 1e-15 for a, b in pairwise(edges(wave)))
    assert constant or not wave.piecewise_constant


@each
def test_extremes_are_those_of_dense_samples(name, wave) -> None:
    low, high = wave.extremes()
    values = wave.value(dense(wave))
    scale = max(np.ptp(values), 1e-30)
    # Samples miss an extremum by up to 1/800 of a piece, and so a parabola by less than 1e-4 of the peak-to-peak.
    assert values.min() - 1e-4 * scale <= low <= values.min() + 1e-14
    assert values.max() - 1e-14 <= high <= values.max() + 1e-4 * scale


@each
def test_peak_to_peak_is_one(name, wave) -> None:
    if name == "fourier":
        return
    size = np.ptp(wave.extremes())
    overlap = name == "trapezoidal" and not wave.ramp <= wave.stiff_fraction <= 1 - wave.ramp
    if name in ("sampled", "table"):
        assert abs(size - np.any(np.diff(wave.stiffness))) < 1e-14
    elif name == "pair":
        still = wave.shape.constant and wave.contact_ratio in (1.0, 2.0)
        assert abs(size - (not still)) < 1e-14
    elif name == "tooth":
        assert abs(size - (np.size(np.unique(wave.stiffness.coefficients)) > 1)) < 1e-14
    elif wave.contact_ratio in (1.0, 2.0):
        assert size == 0
        assert not np.any(wave.value(np.linspace(0, 1, 101)))
    elif overlap:
        assert (size > 0) == (wave.ramp < 1)
        assert size < 1 + 1e-15
    else:
        assert abs(size - 1) < 1e-15


@each
@pytest.mark.parametrize("order", [1, 2, 3, 7, 20])
def test_fourier_coefficients_are_those_of_quadrature(name, wave, order) -> None:
    a, b = wave.fourier(order)
    assert abs(a - 2 * quadrature(wave, lambda x: np.sin(2 * np.pi * order * x))) < 1e-12
    assert abs(b - 2 * quadrature(wave, lambda x: np.cos(2 * np.pi * order * x))) < 1e-12


@pytest.mark.parametrize("name", WAVEFORMS)
def test_a_batch_is_its_entries(name) -> None:
    wave = BATCHES[name]
    shape = wave.batch
    assert len(shape) == 2
    low, high = wave.extremes()
    a, b = wave.fourier(3)
    for found in (low, high, a, b, wave.value(0.3)):
        assert np.shape(found) == shape
    points = np.broadcast_to(wave.breakpoints(), (*shape, wave.breakpoints().shape[-1]))
    x = np.linspace(-1.3, 2.2, 41)
    values = wave.value(x.reshape(-1, 1, 1))
    for index in np.ndindex(*shape):
        one = entry(wave, index)
        assert one.batch == ()
        # Sums over pieces are taken in another order.
        own = np.broadcast_to(values, (41, *shape))[(slice(None), *index)]
        np.testing.assert_allclose(own, one.value(x), atol=1e-14)
        np.testing.assert_allclose([low[index], high[index]], one.extremes(), atol=1e-15)
        np.testing.assert_allclose([a[index], b[index]], one.fourier(3), atol=1e-15)
        np.testing.assert_array_equal(points[index], one.breakpoints())


def entry(wave, index):
    """One entry of a batch, from its parameters."""
    if isinstance(wave, Rectangular):
        return Rectangular(float(np.broadcast_to(wave.contact_ratio, wave.batch)[index]))
    if isinstance(wave, Trapezoidal):
        return Trapezoidal(*(float(np.broadcast_to(p, wave.batch)[index]) for p in (wave.contact_ratio, wave.ramp)))
    if isinstance(wave, Sampled):
        return Sampled(wave.phase, wave.stiffness[index], wave.interpolation)
    if isinstance(wave, ToothPair):
        pieces = np.broadcast_to(wave.shape.coefficients, (*wave.batch, *wave.shape.coefficients.shape[-2:]))
        own = replace(wave.shape, coefficients=pieces[index])
        return ToothPair(float(np.broadcast_to(wave.contact_ratio, wave.batch)[index]), own)
    if isinstance(wave, Tooth):
        return Tooth(Piecewise(wave.stiffness.edges[index], wave.stiffness.coefficients[index]))
    sizes = (*wave.batch, np.shape(wave.sin)[-1])
    return Fourier(*(np.broadcast_to(p, sizes)[index] for p in (wave.sin, wave.cos)))


@settings(deadline=None, max_examples=100)
@given(st.floats(1, 5), st.floats(0, 1), st.floats(-2, 2))
def test_a_trapezoid_is_the_mean_of_the_rectangle_over_its_ramp(c, r, x) -> None:
    """Against the antiderivative of the rectangular wave, which is continuous and of period 1 as its mean is zero."""
    d = c - np.floor(c)

    def antiderivative(y):
        y = y - np.floor(y)
        return (1 - d) * y if y < d else d * (1 - y)

    if r < 1e-6:  # the difference quotient would lose more than six digits
        return
    expected = (antiderivative(x + r / 2) - antiderivative(x - r / 2)) / r
    assert abs(Trapezoidal(c, r).value(x) - expected) < 1e-9


def test_a_trapezoid_without_ramps_is_the_rectangle() -> None:
    x = np.linspace(-1, 2, 3001)
    for c in RATIOS:
        wave, other = Trapezoidal(c, 0.0), Rectangular(c)
        np.testing.assert_allclose(wave.value(x), other.value(x), atol=1e-15)
        np.testing.assert_allclose(wave.extremes(), other.extremes(), atol=1e-15)
        np.testing.assert_allclose(wave.fourier(5), other.fourier(5), atol=1e-15)


def test_extremes_of_a_series_have_closed_forms() -> None:
    # cos x + cos(2 x)/2: w' = -sin x (1 + 2 cos x), so 3/2 at 0 and -3/4 at x = 2 pi/3.
    np.testing.assert_allclose(Fourier(np.zeros(2), np.array([1.0, 0.5])).extremes(), [-0.75, 1.5], atol=1e-15)
    # a sin x + b cos x
    np.testing.assert_allclose(Fourier(np.array([3.0]), np.array([4.0])).extremes(), [-5.0, 5.0], rtol=1e-15)
    # The harmonic of order 30 alone, behind 29 that vanish.
    high = np.zeros(30)
    high[-1] = 2.0
    np.testing.assert_allclose(Fourier(np.zeros(30), high).extremes(), [-2.0, 2.0], rtol=1e-13)


def test_extremes_of_a_series_scale_with_it_down_to_the_smallest_numbers() -> None:
    shape = np.array([[0.5, 0.25], [0.0, 0.5]]), np.array([[0.0, -0.25], [0.5, 0.0]])
    for factor in (2.0**-1020, 2.0**-1072):
        low, high = Fourier(*(part * factor for part in shape)).extremes()
        whole = Fourier(*shape).extremes()
        # 2^-1074 is the spacing of the smallest numbers: products and sums of four are within a few of it.
        np.testing.assert_allclose(low / factor, whole[0], atol=4 * 2.0**-1074 / factor, rtol=1e-14)
        np.testing.assert_allclose(high / factor, whole[1], atol=4 * 2.0**-1074 / factor, rtol=1e-14)


def test_a_scaled_profile_and_a_constant() -> None:
    wave = Trapezoidal(np.array([1.3, 1.6]), 0.2)
    x = np.linspace(0, 1, 5)[:, None]
    scaled = Scaled(wave, np.array([[2.0], [3.0], [4.0]])[:, None], 0.5)
    assert scaled.batch == (3, 1, 2)
    assert scaled.piecewise_constant is False
    np.testing.assert_allclose(scaled.value(0.3)[1, 0], 3.0 + 0.5 * wave.value(0.3))
    np.testing.assert_array_equal(scaled.breakpoints(), wave.breakpoints())
    level = Constant(np.array([1.0, 2.0]))
    assert level.piecewise_constant is True
    np.testing.assert_array_equal(level.value(x), np.broadcast_to([1.0, 2.0], (5, 2)))
    assert level.breakpoints().shape == (2, 0)
