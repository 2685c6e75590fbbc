"""Second-order boundaries: exact expansions, sums term by term, and what must not change them."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import mathieu_a, mathieu_b
from systems import COSINE, oscillator, random_rotation, turned_star
from tongues import scaled, train
from waves import ALL, IDS

from gearstab.mesh import Mesh
from gearstab.modal import modal_damping_matrix
from gearstab.perturbation import PERTURBATION_FLAGS, Tongues, first_order, second_order
from gearstab.system import GearSystem
from gearstab.waveforms import WAVEFORMS, Rectangular, Waveform
from gearstab.waveforms.fourier import Fourier


def edges(tongues: Tongues, label: str) -> np.ndarray:
    return tongues.boundary_frequency[tongues.label.index(label)]


# ---- exact expansions


@pytest.mark.parametrize("wave", [COSINE, Fourier(np.ones(1), np.zeros(1))], ids=["cosine", "sine"])
def test_series_of_mathieus_characteristic_values(wave: Waveform) -> None:
    """a_1, b_1 = 1 +- q - q^2/8, a_2 = 4 + 5 q^2/12, b_2 = 4 - q^2/12, a_3, b_3 = 9 + q^2/16 (McLachlan 1947, 2.151).

    With a = (2/Omega)^2 and q = epsilon a these are Omega as below. The second-order boundary is that polynomial.
    """
    epsilon = np.array([1e-6, 1e-3, 0.1, 0.4])
    found = second_order(oscillator(wave, epsilon), 3)
    e2 = epsilon**2
    # Four operations on numbers near 1 round by a few 1e-16.
    assert_allclose(edges(found, "2w1"), [2 - epsilon - e2 / 8, 2 + epsilon - e2 / 8], rtol=2e-15)
    assert_allclose(edges(found, "w1"), [1 - 5 * e2 / 6, 1 + e2 / 6], rtol=2e-15)
    assert_allclose(edges(found, "2w1/3"), [2 / 3 * (1 - 9 * e2 / 32)] * 2, rtol=2e-15)
    # Widths keep their digits: that of the secondary region is of second order, 1e-12 here.
    assert_allclose(found.half_width[found.label.index("w1")], e2 / 2, rtol=1e-12)
    assert_array_equal(found.half_width[found.label.index("2w1/3")], 0.0)


def test_mathieus_transition_curves_to_third_order() -> None:
    """Against scipy's characteristic values the error is of third order, and of fourth at the secondary region."""
    epsilon = np.array([0.02, 0.04, 0.08])
    found = second_order(oscillator(COSINE, epsilon), 2)
    for m, label, order in ((1, "2w1", 3), (2, "w1", 4)):
        error = []
        for k, e in enumerate(epsilon):
            exact = sorted(_on_ray(value, m, e) for value in (mathieu_a, mathieu_b))
            error.append(np.abs(edges(found, label)[:, k] - exact).max())
        slopes = np.diff(np.log(error)) / np.log(2)
        # The next term tilts the slope by a part of epsilon.
        assert_allclose(slopes, order, atol=0.2)


def _on_ray(value: object, m: int, epsilon: float) -> float:
    """Omega = 2/sqrt(a) where a = a_m(epsilon a), by iteration that contracts by a part of epsilon."""
    a = float(m * m)
    for _ in range(60):
        a = float(value(m, epsilon * a))
    return 2 / np.sqrt(a)


@pytest.mark.parametrize("c", [1.5, 1.3, 1.01, 2.75])
def test_meissners_equation(c: float) -> None:
    """The two branches of each edge, written down in closed form, leave an error of third order in epsilon.

    2 cos(w1 t1) cos(w2 t2) - (w1/w2 + w2/w1) sin(w1 t1) sin(w2 t2) = 2 (-1)^s factors into them (McLachlan 1947).
    """
    epsilon = 1e-3 * np.array([1.0, 2.0, 4.0])
    found = second_order(oscillator(Rectangular(c), epsilon), 4)
    for tongue, lower_upper in zip(found.index, found.boundary_frequency, strict=True):
        for side in (0, 1):
            miss = [_miss(lower_upper[side, k], e, c % 1, tongue.harmonic) for k, e in enumerate(epsilon)]
            # Third order with coefficients of 1, and rounding.
            assert np.all(np.abs(miss) < 3 * epsilon**3 + 5e-16), tongue.label


def _miss(omega: float, epsilon: float, duty: float, s: int) -> float:
    """How far Omega is from the nearest edge: the branches by Newton's method in Omega."""
    best = np.inf
    for branch in (0, 1):
        x = omega
        for _ in range(8):
            value, slope = _branch(x, epsilon, duty, s, branch), 1e-7
            derivative = (
                _branch(x + slope, epsilon, duty, s, branch) - _branch(x - slope, epsilon, duty, s, branch)
            ) / (2 * slope)
            x -= value / derivative
        best = min(best, abs(x - omega))
    return best


def _branch(omega: float, epsilon: float, duty: float, s: int, branch: int) -> float:
    """Solutions even or odd about the middles of both segments: each branch of Meissner's condition by itself."""
    w1, w2 = np.sqrt(1 + 2 * epsilon * (1 - duty)), np.sqrt(1 - 2 * epsilon * duty)
    one, two = w1 * np.pi * duty / omega, w2 * np.pi * (1 - duty) / omega
    if s % 2 == 0:
        first, second = (np.cos(one) * np.sin(two), np.sin(one) * np.cos(two))
        return w2 * first + w1 * second if branch else w1 * first + w2 * second
    first, second = np.cos(one) * np.cos(two), np.sin(one) * np.sin(two)
    return w2 * first - w1 * second if branch else w1 * first - w2 * second


def test_sums_over_harmonics_are_right_to_ten_digits() -> None:
    """The shift of 2 w1 of Meissner's equation with w1 = 1: a sum over a million harmonics, one by one, in closed form.

    S = sum_k |z_k|^2/(1 - (1 + 2 k)^2) over k but 0 and -1, |z_k| = 2 |sin(k pi d)|/(k pi): the middle of the
    region lies at 2 - epsilon^2 (|z_1|^2/4 + S), here with epsilon = 1, which shows all digits of the shift.
    """
    k = np.arange(1, 1_000_001)
    for duty in (0.5, 0.3, 0.07):
        z2 = (2 * np.sin(np.pi * duty * k) / (np.pi * k)) ** 2
        total = np.sum(z2[::-1] / (-4.0 * k * (k + 1))[::-1]) + np.sum(z2[1:][::-1] / (-4.0 * k * (k - 1))[1:][::-1])
        middle = edges(second_order(oscillator(Rectangular(1 + duty), 1.0), 1), "2w1").mean()
        # Rounding of the root, some 1e-15, and what the estimate of the harmonics beyond 2048 leaves, some 1e-14.
        assert middle - 2 == pytest.approx(-z2[0] / 4 - total, rel=0, abs=1e-13)


# ---- known numbers


def test_secondary_region_that_first_order_misses() -> None:
    """w3 of Lin & Parker's train, c1 = c2 = 1.5: zero to first order, 0.121 wide by Floquet at epsilon = 0.3."""
    found = second_order(scaled(train(), 0.3), 2)
    assert found.half_width[found.label.index("w3")] == pytest.approx(0.0605, rel=0.01)
    lower, upper = found.first_order_boundary[found.label.index("w3")]
    assert upper == lower


def test_first_order_is_kept_beside_it() -> None:
    system = scaled(train((1.3, 1.6), 0.2, "3/5"), 0.2)
    one, two = first_order(system, 3), second_order(system, 3)
    count = len(one.index)
    assert two.index[:count] == one.index
    assert_array_equal(two.first_order_boundary[:count], one.boundary_frequency)
    assert_array_equal(two.center_frequency[:count], one.center_frequency)
    # What follows are sums and differences of the two mesh frequencies, 1 and 5/3, with at most three harmonics in all.
    others = {round(3 * t.frequency_ratio) for t in two.index[count:]}
    assert others == {1, 2, 7, 8, 11, 13}
    assert_array_equal(two.first_order_boundary[count:, 0], two.center_frequency[count:])
    assert one.boundary_error is None
    assert np.isfinite(two.boundary_error[~np.isnan(two.boundary_frequency)]).all()


def test_integer_contact_ratios_leave_the_roots() -> None:
    system = scaled(train((1.0, 2.0), 0.3), 0.3)
    found = second_order(system, 3)
    assert_array_equal(found.half_width, 0.0)
    assert_array_equal(found.boundary_frequency, first_order(system, 3).boundary_frequency)
    assert_array_equal(found.boundary_error, 0.0)


def test_second_order_fades_as_epsilon_squared() -> None:
    """Without noise down to epsilon = 1e-7, where the shift of the root is below its last digit."""
    small = np.array([1e-7, 1e-5, 1e-3])
    found = second_order(scaled(train((1.3, 1.5), 0.1), small), 2)
    first = first_order(train((1.3, 1.5), 0.1), 2).half_width[:, None]
    clear = (found.status[:, -1] == 0) & (first[:, 0] > 1e-3)
    assert clear.sum() > 8
    part = (found.half_width - small * first)[clear] / small**2
    # What second order adds to the width over epsilon^2 is a constant, but for the third-order terms of |B - T|.
    assert_allclose(part[:, 1], part[:, 2], rtol=0.02, atol=1e-3)
    # At 1e-7 the rounding of a width of 1e-8 is 1e-24, that is 1e-10 of epsilon^2.
    assert_allclose(part[:, 0], part[:, 1], rtol=1e-4, atol=1e-5)


# ---- invariance


@settings(max_examples=8)
@given(st.floats(-3, 3), st.sampled_from([1, "3/5"]))
def test_time_origin_does_not_matter(shift: float, tooth_ratio: str | int) -> None:
    system = scaled(train((1.3, 1.6), 0.2, tooth_ratio), 0.2)
    moved = [replace(m, lag=m.lag + shift * float(m.frequency_ratio)) for m in system.meshes]
    found, later = second_order(system, 2), second_order(replace(system, meshes=tuple(moved)), 2)
    # Phases of two thousand harmonics, each with a rounding error of 1e-13 of its own.
    assert_allclose(later.boundary_frequency, found.boundary_frequency, rtol=1e-10)
    assert_allclose(later.half_width, found.half_width, rtol=1e-9, atol=1e-11)


def test_batches_are_rows_put_together() -> None:
    """Rows that share their sums (epsilon alone) and rows that do not, with a rigid-body mode among them, damped."""
    k0, epsilon = np.array([0.0, 0.5, 2.0])[:, None], np.array([0.0, 0.1, 0.2])
    every = {"epsilon": (epsilon, epsilon), "input_shaft_stiffness": k0}
    batch = second_order(train((1.4, 1.5), 0.2, damping_ratio=0.01, **every), 2)
    for i in range(3):
        for j in range(3):
            values = {"epsilon": (epsilon[j], epsilon[j]), "input_shaft_stiffness": k0[i, 0]}
            single = second_order(train((1.4, 1.5), 0.2, damping_ratio=0.01, **values), 2, modes=[1, 2, 3])
            assert single.index == batch.index
            for name in ("half_width", "boundary_frequency", "threshold", "status"):
                expected = getattr(single, name)
                assert_allclose(getattr(batch, name)[..., i, j], expected, rtol=1e-11, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("damping", [None, np.diag([0.01, 0.03, 0.02, 0.05])], ids=["undamped", "damped"])
def test_basis_of_a_degenerate_pair_does_not_matter(damping: np.ndarray | None) -> None:
    plain = second_order(turned_star(np.eye(4), damping), 2)
    assert np.isfinite(plain.half_width[plain.label.index("2w2")])
    for seed in range(3):
        turned = second_order(turned_star(random_rotation(seed), damping), 2)
        # Where multipliers meet, rounding parts them by its square root; bisection stops at a millionth of the growth.
        assert_allclose(turned.boundary_frequency, plain.boundary_frequency, rtol=1e-10)
        assert_allclose(turned.half_width, plain.half_width, rtol=1e-8, atol=1e-10)
        assert_array_equal(turned.status, plain.status)


def test_two_equal_oscillators_side_by_side_are_one() -> None:
    """Groups of two modes that do not act on each other give what each gives alone, closed form against eigenvalues."""
    directions = np.eye(2)
    for damping in (None, 0.02):
        meshes = tuple(
            Mesh(f"m{k}", directions[k], np.asarray(1.0), np.asarray(0.2), Rectangular(1.3), lag=0.2 * k)
            for k in (0, 1)
        )
        friction = None if damping is None else damping * np.eye(2)
        pair = second_order(GearSystem(np.eye(2), np.zeros((2, 2)), meshes, friction), 2)
        alone = second_order(oscillator(Rectangular(1.3), 0.2, damping=damping), 2)
        for label in ("2w1", "w1"):
            # Second-order terms in sigma are taken at different detunings: a difference of third order.
            assert_allclose(edges(pair, label), edges(alone, label), rtol=5e-4, err_msg=label)


def test_frequencies_that_share_nothing_are_the_limit_of_those_that_share_little() -> None:
    """sqrt(2) against 99/70: what the 99th harmonic of one mesh and the 70th of the other share is below 1e-4."""
    system = scaled(train((1.3, 1.6), 0.2, "1/2"), 0.2)
    near = replace(system, meshes=(system.meshes[0], replace(system.meshes[1], frequency_ratio=Fraction(99, 70))))
    far = replace(system, meshes=(system.meshes[0], replace(system.meshes[1], frequency_ratio=99 / 70)))
    one, other = second_order(near, 2), second_order(far, 2)
    # Sums and differences of frequencies are given only where the ratio is exact.
    count = len(other.index)
    assert [t.label for t in one.index[:count]] == [t.label for t in other.index]
    clear = other.status == 0
    assert clear.sum() > 10
    assert_allclose(one.boundary_frequency[:count][clear], other.boundary_frequency[clear], rtol=1e-6)


# ---- what is said of the boundaries


def test_nearly_coincident_tongues_are_reported() -> None:
    """(w2+w3)/3 lies 0.0023 from w1+w2, with mode 2 in both: no boundary, and a large error where it is only near."""
    found = second_order(scaled(train(), np.array([1e-4, 0.1, 0.3])), 3)
    status = found.status[found.label.index("(w2+w3)/3")]
    assert status[0] == 0
    assert np.all(status[1:] & PERTURBATION_FLAGS["coincident_tongues"])
    assert np.isnan(edges(found, "(w2+w3)/3")[:, 1:]).all()
    near = found.label.index("w1+w2")
    assert found.status[near, 2] == PERTURBATION_FLAGS["not_converged"]
    assert found.boundary_error[near, 0, 2] > found.half_width[near, 2]
    assert found.status[found.label.index("2w3"), 2] == 0


def test_damping_closes_tongues_and_leaves_some_without_end() -> None:
    system = scaled(train((1.3, 1.5), 0.1, damping_ratio=0.01), np.array([0.02, 0.3]))
    found = second_order(system, 2)
    closed = (found.status & PERTURBATION_FLAGS["closed_by_damping"]) > 0
    assert closed.sum() > 5
    alone = closed & ((found.status & PERTURBATION_FLAGS["coincident_tongues"]) == 0)
    assert_array_equal(found.half_width[alone], 0.0)
    assert np.isnan(np.moveaxis(found.boundary_frequency, 1, -1)[closed]).all()
    # A threshold is the first of them: T against B may close a tongue again at a greater epsilon.
    assert closed[found.threshold > 1].all()
    opened = scaled(train((1.3, 1.5), 0.1, damping_ratio=0.01), 0.3 * found.threshold[:, 1])
    again = second_order(opened, 2)
    # At its threshold a tongue is about to open.
    assert_allclose(np.diagonal(again.threshold), 1.0, rtol=1e-6)


def test_one_damped_mode_of_two_has_no_boundary() -> None:
    mesh = Mesh("mesh", np.array([1.0, 0.5]), np.asarray(0.5), np.asarray(0.2), Rectangular(1.4))
    system = GearSystem(np.diag([1.0, 2.0]), np.diag([1.0, 3.0]), (mesh,))
    damping = modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), np.array([0.0, 0.02]))
    found = second_order(replace(system, damping=damping), 1)
    k = found.label.index("w1+w2")
    assert found.status[k] == PERTURBATION_FLAGS["no_boundary"]
    assert found.half_width[k] == np.inf
    assert np.isnan(found.boundary_frequency[k]).all()
    assert np.isfinite(found.boundary_frequency[found.label.index("2w1")]).all()


def test_commensurate_natural_frequencies() -> None:
    """w = 1, 2, 3: resonances coincide exactly, divisors vanish, and nothing but those tongues is affected."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    direction = np.array([0.3, 0.4, 0.2])
    mesh = Mesh("mesh", direction, np.asarray(1.0), np.asarray(0.1), Rectangular(1.3))
    stiffness = turn @ np.diag([1.0, 4.0, 9.0]) @ turn.T - np.outer(direction, direction)
    found = second_order(GearSystem(np.eye(3), stiffness, (mesh,)), 1)
    # At Omega = 2 the second harmonic joins modes 1 and 3, the first joins mode 1 at -1 with itself and with mode 3.
    disturbed = (found.status & PERTURBATION_FLAGS["coincident_tongues"]) > 0
    assert found.label[:6] == ("2w1", "w1+w2", "w1+w3", "2w2", "w2+w3", "2w3")
    assert_array_equal(disturbed[:6], [True, False, False, False, False, False])
    assert np.isnan(found.boundary_frequency[disturbed]).all()
    assert np.isfinite(found.boundary_frequency[~disturbed]).all()
    assert np.isfinite(found.boundary_error[~disturbed]).all()


@pytest.mark.parametrize("wave", [ALL[IDS.index(f"{name}0")][1] for name in WAVEFORMS], ids=WAVEFORMS)
def test_any_waveform_is_its_fourier_series(wave: Waveform) -> None:
    """All harmonics of a wave, the greater part of them by the series in 1/k, against its first 300 one by one."""
    series = np.array([wave.fourier(s) for s in range(1, 301)]).reshape(300, 2)
    whole = second_order(oscillator(wave, 0.3), 2)
    cut = second_order(oscillator(Fourier(series[:, 0], series[:, 1]), 0.3), 2)
    # What is left out of a wave with jumps is 1/(3 300^3) = 1e-8 of its first term.
    assert_allclose(whole.boundary_frequency, cut.boundary_frequency, rtol=0, atol=2e-9)
