"""Fourier coefficients of profiles against the discrete Fourier transform and series known in closed form."""

import numpy as np
import pytest

from gearstab.waveforms import Constant, Fourier, Product, Profile, Rectangular, Scaled, Trapezoidal
from gearstab.waveforms.profile import harmonic
from gearstab.waveforms.tooth import Piecewise

RATIOS = np.array([1.3, 1.5, 1.62])
PROFILES: dict[str, Profile] = {
    "constant": Constant(0.7),
    "scaled": Scaled(Rectangular(RATIOS), 0.2, np.array([0.5, -1.0, 2.0])),
    "a wave as it is": Trapezoidal(1.4, 0.1),
    "product": Product(Scaled(Rectangular(RATIOS), 1.0, 0.6), Scaled(Trapezoidal(1.7, 0.2), -0.4, 1.0)),
    "product of series": Product(
        Scaled(Fourier((0.3, 0.1), (0.2, -0.4)), 1.0, 0.5), Fourier((0.1, 0.0, 0.2), (0.6, 0.2, 0.3))
    ),
    "pieces": Piecewise(np.array([0.0, 0.3, 0.3, 0.8]), np.arange(12.0).reshape(4, 3) - 4),
}


@pytest.mark.parametrize("name", PROFILES)
def test_coefficients_against_sums_over_samples(name: str) -> None:
    """Midpoints of 20,000 intervals: wrong by 1/20,000 of a jump at most, and not where jumps fall between them."""
    profile = PROFILES[name]
    count = 20_000
    x = (np.arange(count) + 0.5) / count
    values = np.broadcast_to(profile.value(x.reshape(-1, *[1] * len(profile.batch))), (count, *profile.batch))
    for s in (0, 1, 2, 3, 7):
        expected = np.tensordot(np.exp(-2j * np.pi * s * x) / count, values, axes=1)
        found = harmonic(profile, s)
        assert found.shape == profile.batch
        np.testing.assert_allclose(found, expected, atol=2e-7 * np.abs(values).max())


def test_products_of_series_are_convolutions() -> None:
    """To rounding: of 1 + (sin x + cos 2x)/2 and cos x, x = 2 pi phase."""
    profile = Product(Scaled(Fourier((1.0, 0.0), (0.0, 1.0)), 1.0, 0.5), Fourier((0.0,), (1.0,)))
    # cos x + sin(2x)/4 + (cos x + cos 3x)/4
    expected = [0, 0.625, -0.125j, 0.125, 0, 0]
    np.testing.assert_allclose([harmonic(profile, s) for s in range(6)], expected, atol=1e-15)


def test_harmonics_that_are_missing_are_exactly_zero() -> None:
    wave = Rectangular(1.5)
    for profile in (wave, Scaled(wave, 0.1, 3.0), Product(Scaled(wave, 1.0, 1.0), Constant(2.0))):
        assert [harmonic(profile, s) != 0 for s in range(1, 7)] == [True, False] * 3
