"""The uncoupled Mathieu equations against scipy's Mathieu functions, Floquet theory and the paper's conclusions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scenes import CONFIGS, plain
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, eigh_tridiagonal
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b
from systems import oscillator
from tongues import scaled, train

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order, uncoupled
from gearstab.perturbation.mathieu import characteristic_values
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier, Rectangular, Sampled, ToothPair, Trapezoidal
from gearstab.waveforms.tooth_pair import parabolic


@given(st.integers(1, 12), st.floats(0, 1))
def test_characteristic_values_are_those_of_the_recurrence_at_their_q(m: int, kappa: float) -> None:
    """The same curves the usual way: eigenvalues a of the tridiagonal Fourier matrix at a given q."""
    found = characteristic_values(np.asarray(kappa), m)
    assert found[1] <= found[0] * (1 + 1e-14)
    for which, value in enumerate(found):
        q, r = kappa * value, np.arange(m % 2, 90, 2, dtype=float)
        diagonal, beside = r**2, np.full(len(r) - 1, q)
        if m % 2:
            diagonal[0] += -q if which else q
            order = (m - 1) // 2
        elif which:
            diagonal, beside, order = diagonal[1:], beside[1:], m // 2 - 1
        else:
            beside[0] *= np.sqrt(2)
            order = m // 2
        assert value == pytest.approx(eigh_tridiagonal(diagonal, beside)[0][order], rel=1e-11)


@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.2, 0.35])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_characteristic_values_lie_on_scipys_curves(m: int, kappa: float) -> None:
    # Orders and q where scipy's functions hold 1e-12; at m = 5, q = 20.87 they jump to another curve.
    a, b = characteristic_values(np.asarray(kappa), m)
    assert a == pytest.approx(mathieu_a(m, kappa * a), rel=1e-11)
    assert b == pytest.approx(mathieu_b(m, kappa * b), rel=1e-11)


def test_published_transition_curves() -> None:
    """b_1(0.5) = 0.470654354934 and a_1(0.5) = 1.466766842516 (Abramowitz & Stegun, chapter 20, convention a, q)."""
    assert characteristic_values(np.asarray(0.5 / 1.466766842516), 1)[0] == pytest.approx(1.466766842516, rel=1e-11)
    assert characteristic_values(np.asarray(0.5 / 0.470654354934), 1)[1] == pytest.approx(0.470654354934, rel=1e-11)


def test_boundaries_are_periodic_solutions_of_the_modal_equation() -> None:
    """On a boundary, integrating u'' + [w^2 + 2 h cos Omega t] u = 0 over one period gives the trace +-2."""
    system = train((1.47, 1.57), 0.4, epsilon=(0.3, 0.2))
    tongues = uncoupled(system, 3)
    modes = mean_modes(system)
    average = 0.5 * (1.47 + 1.57)
    for tongue, edges in zip(tongues.index, tongues.boundary_frequency, strict=True):
        p = tongue.mode_p - 1
        force = (0.3 * modes.mesh_deflection[p, 0] ** 2 + 0.2 * modes.mesh_deflection[p, 1] ** 2) * 2 / np.pi
        force *= abs(np.sin(np.pi * average))
        for omega in edges:

            def slope(t: float, y: np.ndarray, omega: float = omega, force: float = force, p: int = p) -> list:
                pull = modes.squared_frequency[p] + 2 * force * np.cos(omega * t)
                return [y[1], -pull * y[0], y[3], -pull * y[2]]

            end = solve_ivp(slope, (0, 2 * np.pi / omega), [1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            assert end[0] + end[3] == pytest.approx(2 * (-1) ** tongue.harmonic, abs=1e-9)


def test_identical_meshes_in_phase_agree_with_first_order() -> None:
    """Where its assumptions hold, the primary regions tend to those of first-order perturbation as epsilon vanishes."""
    system = scaled(train((1.4, 1.4)), 1e-4)
    mathieu, scales = uncoupled(system, 1), first_order(system, 1)
    for label in ("2w1", "2w2", "2w3"):
        half = scales.half_width[scales.label.index(label)]
        assert mathieu.half_width[mathieu.label.index(label)] == pytest.approx(half, rel=1e-6)


def test_it_knows_no_phasing_and_no_combinations() -> None:
    """Fig. 8: the method gives the same regions for h = 0 and 0.4, true ones differ; point A is inside both times."""
    kept = [{"name": n, "max_stiffness": 1.0, "amplitude": 0.3, "contact_ratio": c} for n, c in MESHES]
    cases = [train(meshes=[kept[0], {**kept[1], "phasing": h}]) for h in (0.0, 0.4)]
    first, second = (uncoupled(case, 2) for case in cases)
    assert_array_equal(first.boundary_frequency, second.boundary_frequency)
    assert {t.kind for t in first.index} == {"primary", "secondary"}
    lower, upper = first.boundary_frequency[first.label.index("2w3")]
    assert lower < 4.2 < upper
    k = first_order(cases[0], 1).label.index("2w3")
    inside = [edge[0] < 4.2 < edge[1] for edge in (first_order(c, 1).boundary_frequency[k] for c in cases)]
    assert inside == [True, False]


MESHES = (("first", 1.47), ("second", 1.57))


def test_integer_average_contact_ratio_leaves_the_roots() -> None:
    tongues = uncoupled(train((1.9, 2.1), epsilon=(0.2, 0.2)), 3)
    assert_allclose(tongues.boundary_frequency[:, 0], tongues.center_frequency, rtol=1e-12)
    assert_allclose(tongues.half_width, 0, atol=1e-12)


def test_meshes_of_different_frequency_are_taken_apart() -> None:
    tongues = uncoupled(train(tooth_ratio="1/2", epsilon=(0.0, 0.2)), 1)
    assert tongues.label == ("2w1", "2w2", "2w3", "2w1 (second)", "2w2 (second)", "2w3 (second)")
    assert_allclose(tongues.half_width[:3], 0, atol=1e-12)
    one = uncoupled(train(epsilon=(0.0, 0.2)), 1)
    # One frequency: the average of both contact ratios, 1.5 as well; two frequencies: twice as fast in Omega.
    assert_allclose(2 * tongues.boundary_frequency[3:], one.boundary_frequency, rtol=1e-12)


def test_batches_and_rigid_modes() -> None:
    k0, epsilon = np.array([0.0, 0.5])[:, None], np.array([0.1, 0.2, 0.3])
    batch = uncoupled(train((1.3, 1.5), epsilon=(epsilon, 0.1), input_shaft_stiffness=k0), 2)
    assert batch.boundary_frequency.shape == (6, 2, 2, 3)
    assert np.isnan(batch.boundary_frequency[batch.label.index("2w1"), :, 0]).all()
    single = uncoupled(train((1.3, 1.5), epsilon=(0.2, 0.1)), 2)
    assert_allclose(batch.boundary_frequency[:, :, 1, 1], single.boundary_frequency, rtol=1e-13)


def test_other_waves_have_no_contact_ratio_to_average() -> None:
    mesh = Mesh("mesh", np.ones(1), np.asarray(1.0), np.asarray(0.1), object())
    with pytest.raises(ValueError, match="rectangular"):
        uncoupled(GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,)), 1)


# --- transition curves of Mathieu and Hill: characteristic values of scipy, and Hill's method in Fourier space


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
