"""Waves made of samples and of single pairs of teeth: identities, orders of interpolation, published shapes."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gearstab.waveforms import Rectangular, Sampled, ToothPair, Trapezoidal
from gearstab.waveforms.splines import Pieces, interpolate
from gearstab.waveforms.tooth_pair import constant, parabolic


def smooth(x):
    return 20 + 3 * np.sin(2 * np.pi * x) + np.cos(6 * np.pi * x)


def test_samples_are_met() -> None:
    phase = np.array([0.1, 0.2, 0.55, 0.9])
    stiffness = np.array([2.0, 3.0, 1.0, 4.0])
    for kind in ("linear", "cubic"):
        wave = Sampled(phase, stiffness, kind)
        found = wave.mean_stiffness + 2 * wave.amplitude * wave.value(phase)
        np.testing.assert_allclose(found, stiffness, rtol=1e-14)


def test_linear_interpolation_keeps_the_range_of_the_samples() -> None:
    phase, stiffness = np.arange(10) / 10, np.array([1.0] * 5 + [2.0] * 5)
    wave = Sampled(phase, stiffness)
    # Mean of the trapezoidal rule with equal steps; the extremes are the samples'.
    assert wave.mean_stiffness == pytest.approx(1.5, abs=1e-15)
    assert wave.amplitude == pytest.approx(0.5, abs=1e-15)
    np.testing.assert_allclose(wave.extremes(), [-0.5, 0.5], atol=1e-15)


def test_a_cubic_spline_overshoots_at_jumps() -> None:
    wave = Sampled(np.arange(10) / 10, np.array([1.0] * 5 + [2.0] * 5), "cubic")
    peak = wave.mean_stiffness + 2 * wave.amplitude * wave.extremes()[1]
    assert 2.05 < peak < 2.2


@pytest.mark.parametrize(("kind", "order"), [("linear", 2), ("cubic", 4)])
def test_interpolation_converges_with_its_order(kind, order) -> None:
    x = np.linspace(0, 1, 777)
    error = []
    for count in (40, 80):
        phase = np.arange(count) / count + 0.003
        wave = Sampled(phase, smooth(phase), kind)
        error.append(np.max(np.abs(wave.mean_stiffness + 2 * wave.amplitude * wave.value(x) - smooth(x))))
    # Halving the step, the next term of the error is a hundredth of it.
    assert np.log2(error[0] / error[1]) == pytest.approx(order, abs=0.1)


def test_coefficients_of_a_fine_spline_are_those_of_the_function() -> None:
    """The closed form must not lose digits where the pieces are much shorter than the waves."""
    phase = np.arange(2000) / 2000
    wave = Sampled(phase, smooth(phase), "cubic")
    scale = 2 * wave.amplitude
    # The error of the spline, (2 pi 3)^4 h^4/384 = 2e-11 relative.
    np.testing.assert_allclose(np.array(wave.fourier(1)) * scale, [3.0, 0.0], atol=1e-10)
    np.testing.assert_allclose(np.array(wave.fourier(3)) * scale, [0.0, 1.0], atol=1e-10)
    np.testing.assert_allclose(np.array(wave.fourier(2)) * scale, [0.0, 0.0], atol=1e-10)


def test_the_transform_of_pieces_is_that_of_quadrature() -> None:
    pieces = interpolate(np.array([0.0, 0.1, 0.35, 1.0]), np.array([1.0, 3.0, -2.0, 0.5]), "cubic", periodic=False)

    def integral(weight, theta):
        return sum(
            quad(lambda u: float(pieces.value(u)) * weight(theta * u), a, b, epsabs=1e-13, limit=400)[0]
            for a, b in zip(pieces.knots[:-1], pieces.knots[1:], strict=True)
        )

    for theta in (1e-3, 0.9, 1.1, 2 * np.pi * 3.3, 200.0):
        found = pieces.transform(theta)
        assert found.real == pytest.approx(integral(np.cos, theta), abs=1e-12)
        assert found.imag == pytest.approx(-integral(np.sin, theta), abs=1e-12)


def test_constant_samples_have_no_wave() -> None:
    wave = Sampled(np.arange(7) / 7, np.full(7, 1.7e8), "cubic")
    assert wave.amplitude == 0
    assert not np.any(wave.value(np.linspace(0, 1, 50)))
    assert wave.extremes() == (0.0, 0.0)


@pytest.mark.parametrize("c", [1.0, 1.25, 1.9, 2.0, 2.4])
def test_equally_stiff_pairs_make_the_rectangular_wave(c) -> None:
    wave, other = ToothPair(c, constant(3.0)), Rectangular(c)
    assert wave.piecewise_constant
    x = np.linspace(-1, 2, 1234)
    np.testing.assert_allclose(wave.value(x), other.value(x), atol=1e-14)
    np.testing.assert_allclose(wave.fourier(4), other.fourier(4), atol=1e-14)
    np.testing.assert_allclose(wave.extremes(), other.extremes(), atol=1e-14)
    # floor(c) + d of 3.0 on average; 3.0 from peak to peak.
    assert wave.mean_stiffness == pytest.approx(3 * c, rel=1e-15)
    assert wave.amplitude == pytest.approx(0.0 if c in (1.0, 2.0) else 1.5, rel=1e-13)


def test_pairs_that_come_and_go_along_ramps_make_the_trapezoidal_wave() -> None:
    """A pair that is taken up over a ramp of r base pitches and lasts c + r of them, from ramp to ramp."""
    c, r = 1.6, 0.2
    length = c + r
    shape = interpolate(np.array([0.0, r, c, length]) / length, np.array([0.0, 1.0, 1.0, 0.0]), "linear", False)
    wave, other = ToothPair(length, shape), Trapezoidal(c, r)
    x = np.linspace(0, 1, 333)
    # The pair begins half a ramp before the jump of the rectangular wave.
    np.testing.assert_allclose(wave.value(x + r / 2), other.value(x), atol=1e-13)
    np.testing.assert_allclose(wave.extremes(), other.extremes(), atol=1e-14)
    assert wave.mean_stiffness == pytest.approx(c, rel=1e-14)


def test_the_parabola_is_that_of_cai_and_hayashi() -> None:
    """k = (-1.8 u^2 + 1.8 u + 0.55)/0.85 of its mean (1994); two pairs at contact ratio 2 sum to a parabola, too."""
    u = np.linspace(0, 0.999, 50)
    shape = parabolic()
    np.testing.assert_allclose(shape.value(u), -1.8 * u**2 + 1.8 * u + 0.55, atol=1e-15)
    assert shape.integral() == pytest.approx(0.85, abs=1e-15)
    wave = ToothPair(2.0, shape)
    assert wave.mean_stiffness == pytest.approx(1.7, rel=1e-15)
    total = wave.mean_stiffness + 2 * wave.amplitude * wave.value(u)
    np.testing.assert_allclose(total, sum(-1.8 * v**2 + 1.8 * v + 0.55 for v in (u / 2, (u + 1) / 2)), atol=1e-14)


def test_a_triangular_pair_of_contact_ratio_two_is_constant() -> None:
    shape = interpolate(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]), "linear", False)
    wave = ToothPair(2.0, shape)
    assert wave.amplitude == 0
    assert not np.any(wave.value(np.linspace(0, 1, 50)))


def test_a_batch_of_contact_ratios_and_shapes() -> None:
    c = np.array([1.2, 1.7, 2.3])[:, None]
    wave = ToothPair(c, parabolic(np.array([0.3, 0.55]), 2.0))
    assert wave.batch == (3, 2)
    for i, j in np.ndindex(3, 2):
        one = ToothPair(float(c[i, 0]), parabolic([0.3, 0.55][j], 2.0))
        assert wave.mean_stiffness[i, j] == pytest.approx(one.mean_stiffness, rel=1e-14)
        assert wave.amplitude[i, j] == pytest.approx(one.amplitude, rel=1e-13)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.integers(0, 99), min_size=3, max_size=12, unique=True),
    st.lists(st.floats(0.1, 10), min_size=12, max_size=12),
    st.sampled_from(["linear", "cubic"]),
)
def test_any_samples_make_a_wave(places, levels, kind) -> None:
    phase = np.sort(places) / 100
    stiffness = np.array(levels[: len(phase)])
    wave = Sampled(phase, stiffness, kind)
    x = np.arange(5000) / 5000
    values = wave.value(x)
    low, high = wave.extremes()
    assert high - low == pytest.approx(float(np.any(stiffness != stiffness[0])), abs=1e-12)
    assert low - 1e-12 <= values.min()
    assert values.max() <= high + 1e-12
    # The rule of equal steps, exact for lines but for the kinks, of which each costs its jump in slope times h^2/12.
    assert abs(values.mean()) < 1e-4
    found = wave.mean_stiffness + 2 * wave.amplitude * wave.value(phase + 3)
    np.testing.assert_allclose(found, stiffness, rtol=1e-9)
    sine, cosine = wave.fourier(2)
    assert sine == pytest.approx(2 * np.mean(values * np.sin(4 * np.pi * x)), abs=1e-3)
    assert cosine == pytest.approx(2 * np.mean(values * np.cos(4 * np.pi * x)), abs=1e-3)


@settings(deadline=None, max_examples=200)
@given(st.integers(1001, 3999), st.integers(0, 3), st.integers(-3, 3))
@example(2631, 1, -1)
@example(2900, 0, -1)
@example(3900, 1, -1)
def test_kinks_that_coincide_with_jumps_do_no_harm(thousandths, pairs, ulps) -> None:
    """The kink of one pair a few roundings beside the place where another one leaves."""
    c = thousandths / 1000
    place = (c - np.floor(c) + pairs) / c
    if not 0.01 < place < 0.99:
        return
    place += ulps * np.spacing(place)
    wave = ToothPair(c, interpolate(np.array([0.0, place, 1.0]), np.array([1.0, 2.0, 1.0]), "linear", False))
    x = np.concatenate([np.linspace(0, 1, 501), [c - np.floor(c) + h for h in (-1e-9, 0.0, 1e-9)]])
    values = wave.value(x)
    low, high = wave.extremes()
    # Slopes of the shape are below 1/0.01 of its height.
    assert low == pytest.approx(values.min(), abs=1e-6) or low == pytest.approx(wave.value(1 - 1e-9), abs=1e-6)
    assert high == pytest.approx(values.max(), abs=1e-6) or high == pytest.approx(wave.value(1 - 1e-9), abs=1e-6)


def test_pieces_go_on_outside() -> None:
    pieces = Pieces(np.array([0.0, 1.0]), np.array([[1.0, 2.0]]))
    np.testing.assert_allclose(pieces.value(np.array([-1.0, 0.0, 2.0])), [-1.0, 1.0, 5.0])
