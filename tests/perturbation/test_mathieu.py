"""Transition curves of Mathieu and Hill: characteristic values of scipy, and Hill's method in Fourier space."""

import numpy as np
import pytest
from scenes import CONFIGS, plain
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b
from systems import oscillator

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier, Rectangular, Sampled, ToothPair, Trapezoidal
from gearstab.waveforms.tooth_pair import parabolic

CONFIG = CONFIGS / "waveforms" / "mathieu.yaml"
START, STOP = 0.35, 3.5


def mathieu(epsilon) -> GearSystem:
    """The gear pair of the configuration: a = 4/Omega^2, q = epsilon a."""
    p = plain(load(CONFIG).system)
    return build(p | {"meshes": [p["meshes"][0] | {"epsilon": np.asarray(epsilon, dtype=float)}]})


def on_the_ray(characteristic, order: int, epsilon: float) -> float:
    """The Omega at which a = a_m(epsilon a), or b_m."""

    def miss(a: float) -> float:
        return a - characteristic(order, epsilon * a)

    trial = np.linspace(0.3 * order**2, 2 * order**2 + 1, 200)
    sign = np.sign([miss(a) for a in trial])
    (k,) = np.flatnonzero(sign[1:] != sign[:-1])
    a = brentq(miss, trial[k], trial[k + 1], xtol=1e-15, rtol=1e-15)
    assert abs(miss(a)) < 1e-12 * a  # and no jump of scipy's, which mistakes a_m for other orders at q > 17
    return float(2 / np.sqrt(a))


def edges(system: GearSystem, start: float, stop: float, tolerance: float):
    """(edges, stored tolerances) of all regions of a single system, ascending; without those at the ends."""
    found = boundaries(system, start, stop, tolerance=tolerance)
    place = np.stack([found.lower, found.upper])
    error = np.stack([found.tolerance * found.lower, found.tolerance * found.upper])
    inside = ~found.cut.T
    order = np.argsort(place[inside])
    return place[inside][order], error[inside][order]


@pytest.mark.parametrize("epsilon", [0.05, 0.3, 0.45])
def test_boundaries_are_mathieus_characteristic_values(epsilon: float) -> None:
    curves = [on_the_ray(f, m, epsilon) for m in (1, 2, 3, 4, 5) for f in (mathieu_a, mathieu_b)]
    expected = np.sort(curves).reshape(-1, 2)
    # Narrower ones may be left out; these five tongues lie above START, all others below.
    expected = np.sort(expected[np.diff(expected)[:, 0] > 1e-6 * expected[:, 0]].ravel())
    found, error = edges(mathieu(epsilon), START, STOP, 1e-12)
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    # The stored tolerance holds, with 1e-14 for the characteristic values.
    assert np.all(np.abs(found - expected) <= error + 1e-14)


def trace(system: GearSystem, omega):
    """tr M at mesh frequencies ``(P,)``, from the characteristic exponents."""
    found = solve(system, omega, exponents=True, tolerance=1e-12)
    return np.exp(found.exponents[0] * 2 * np.pi / omega[:, None]).sum(axis=-1).real


@pytest.mark.parametrize(
    ("a", "q"), [(0.470654354934, 0.5), (1.466766842516, 0.5), (mathieu_a(2, 3.0), 3.0), (mathieu_b(3, 8.0), 8.0)]
)
def test_edges_beyond_positive_stiffness(a: float, q: float) -> None:
    """b_1(0.5) and a_1(0.5) as tabulated, and points where the stiffness turns negative: 2 q > a."""
    system = mathieu(q / a)
    expected = 2 / np.sqrt(a)
    # An entire function of 1/Omega: twelve values beside the edge give it to rounding; on it multipliers are doubtful.
    nodes = np.cos((np.arange(12) + 0.5) * np.pi / 12)
    inverse = (1 + 0.05 * nodes) / expected
    fit = np.polynomial.Chebyshev.fit(inverse * expected - 1, trace(system, 1 / inverse), 11)
    level = 2.0 if fit(0.0) > 0 else -2.0
    place = brentq(lambda x: fit(x) - level, -0.01, 0.01, xtol=1e-15)
    # The tabulated digits.
    assert abs(place) < 1e-10


def hill(wave, epsilon: float, harmonics: int):
    """All Omega with a solution of period T or 2 T, ascending, by Hill's method.

    With x = sum_p c_p exp(i p Omega t) and k = sum_n K_n exp(i n Omega t): p^2 Omega^2 c_p = sum_r K_{p-r} c_r, p whole
    numbers or half-odd ones, a symmetric eigenvalue problem for 1/Omega^2.
    """
    series = np.zeros(4 * harmonics + 1, dtype=complex)
    middle = 2 * harmonics
    series[middle] = 1.0
    for n in range(1, middle + 1):
        a, b = (2 * epsilon * float(part) for part in wave.fourier(n))
        series[middle + n], series[middle - n] = (b - 1j * a) / 2, (b + 1j * a) / 2
    found = []
    for p in (np.arange(-harmonics, harmonics + 1), np.arange(-harmonics, harmonics) + 0.5):
        n = np.rint(p[:, None] - p).astype(int)
        inverse = eigh(np.diag(p**2), series[middle + n], eigvals_only=True)
        found.append(1 / np.sqrt(inverse[inverse > 1e-9 * inverse.max()]))
    return np.sort(np.concatenate(found))


WAVES = {
    # Harmonics end in a series, and fall off as s^-4 for a cubic spline, as s^-2 or s^-1 for kinks and jumps.
    "series": (Fourier(np.array([0.2, 0.0, 0.15]), np.array([0.3, 0.2, 0.0])), 0.3, 40, 1e-10),
    "cubic": (
        Sampled(np.array([0.0, 0.2, 0.35, 0.6, 0.8]), np.array([1.0, 3.0, 2.5, 2.0, 0.5]), "cubic"), 0.25, 150, 1e-10
    ),
    "linear": (Sampled(np.array([0.0, 0.2, 0.35, 0.6]), np.array([1.0, 3.0, 2.5, 2.0])), 0.25, 300, 1e-8),
    "trapezoidal": (Trapezoidal(1.4, 0.3), 0.3, 300, 1e-8),
    "pair": (ToothPair(1.7, parabolic(0.4)), 0.3, 300, 3e-7),
    "rectangular": (Rectangular(1.6), 0.3, 300, 3e-7),
}  # fmt: skip


@pytest.mark.parametrize("name", WAVES)
def test_edges_are_those_of_hills_method(name: str) -> None:
    """Edges of every waveform, through its Fourier coefficients alone."""
    wave, epsilon, harmonics, tolerance = WAVES[name]
    expected = hill(wave, epsilon, harmonics)
    expected = expected[(expected > 0.5) & (expected < 3.0)]
    found, _ = edges(oscillator(wave, epsilon), 0.5, 3.0, 1e-11)
    # Edges of closed tongues coincide: pairs narrower than the error of the truncated series say nothing.
    closed = np.flatnonzero(np.diff(expected) < 3 * tolerance)
    expected = np.delete(expected, np.concatenate([closed, closed + 1]))
    assert len(expected) >= 6
    np.testing.assert_allclose(found, expected, rtol=tolerance)


def test_a_trapezoid_with_short_ramps_is_nearly_the_rectangle() -> None:
    """Meissner's equation is the limit: harmonics change by (s pi r)^2/6, and so do the edges."""
    exact, _ = edges(oscillator(Rectangular(1.5), 0.3), 0.8, 3.0, 1e-12)
    shift = []
    for ramp in (0.02, 0.01):
        found, _ = edges(oscillator(Trapezoidal(1.5, ramp), 0.3), 0.8, 3.0, 1e-12)
        assert len(found) == len(exact)
        shift.append(np.abs(found - exact).max())
    # The next term is of fourth order: (s pi r)^2/20 of this one.
    assert shift[0] / shift[1] == pytest.approx(4.0, rel=0.02)
