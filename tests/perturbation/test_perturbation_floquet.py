"""First-order boundaries against Floquet theory as epsilon tends to 0: every tongue of Lin & Parker's Figs. 3, 5, 6."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from systems import random_rotation, turned_star
from tongues import damping_matrix, first_outside, log_growth, scaled, squared_half_width, train, with_damping

from gearstab.floquet import solve
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

RATIOS = (Fraction(1), Fraction(1, 2), Fraction(3))
FIGURES = {
    "fig3": ((1.5, 1.5), 0.0, 1),
    "fig5 dashed": ((1.5, 1.5), 0.5, 1),
    "fig5 solid": ((1.1, 1.9), 0.9, 1),
    "fig6a": ((1.5, 1.5), 0.0, "3/5"),
    "fig6b": ((1.5, 1.5), 0.0, "1/2"),
}
# (w2+w3)/3 lies 0.0023 from w1+w2: their interaction must be small, and is of the order (epsilon/0.03)^2.
EPSILON = 1.5e-4 * np.array([1.0, 2.0, 3.0, 4.0])


def limit(system: GearSystem, pair: tuple[float, float], nu: float, start: float) -> float:
    """Squared half-width per epsilon^2 as epsilon tends to 0, by a cubic through four epsilons."""
    squares = [squared_half_width(scaled(system, e), pair, nu, start * e)[1] / e**2 for e in EPSILON]
    return float(np.polynomial.Polynomial.fit(EPSILON, squares, 3)(0.0))


@pytest.mark.parametrize("figure", FIGURES)
def test_half_widths_as_epsilon_vanishes(figure: str) -> None:
    system = train(*FIGURES[figure])
    w = mean_modes(system).natural_frequency
    tongues = first_order(system, 3)
    for tongue, half in zip(tongues.index, tongues.half_width, strict=True):
        pair = (w[tongue.mode_p - 1], w[tongue.mode_q - 1])
        found = limit(system, pair, tongue.frequency_ratio, max(half, 0.01))
        if half == 0:
            # A tongue of second order: its squared width per epsilon^2 tends to 0 as epsilon^2 = 2e-8 or faster.
            assert abs(found) < 1e-8, tongue.label
        else:
            assert np.sqrt(found) == pytest.approx(half, rel=1e-4), tongue.label


def test_fifth_harmonic_of_the_first_mesh_counts_at_a_ratio_of_3_to_5() -> None:
    """2 w3/5 of Fig. 6a: the second mesh's third harmonic alone would give 0.0502 instead of 0.0887."""
    system = train(*FIGURES["fig6a"])
    w = mean_modes(system).natural_frequency
    tongues = first_order(system, 3)
    half = tongues.half_width[tongues.label.index("2w3/5")]
    assert np.sqrt(limit(system, (w[2], w[2]), 5.0, 0.05)) == pytest.approx(half, rel=1e-6)
    assert half == pytest.approx(0.0887, abs=1e-4)


def test_figure_7_combination_instability_vanishes_where_first_order_says() -> None:
    """eps2 = 0.3: Floquet's w2 + w3 tongue closes at eps1 = 0.343 as well, and is wide open at the text's 0.23."""
    w = mean_modes(train()).natural_frequency
    epsilon = np.array([0.23, 0.341, 0.342, 0.343, 0.344, 0.345])
    # The half-width passes through zero linearly: its square touches zero.
    found = [squared_half_width(train(epsilon=(e, 0.3)), (w[1], w[2]), 1.0, 0.02)[1] for e in epsilon]
    assert np.sqrt(found[0]) > 0.04
    closing = np.polynomial.Polynomial.fit(epsilon[1:], found[1:], 2).deriv().roots()[0]
    assert closing == pytest.approx(0.343, abs=5e-4)


def test_package_floquet_agrees_just_inside_and_outside() -> None:
    """The package's own Floquet flags on both sides of first-order edges, at an epsilon small enough for them."""
    system = scaled(train((1.3, 1.6), 0.2, "1/2"), 1e-3)
    tongues = first_order(system, 2)
    lower, upper = tongues.boundary_frequency[:, 0], tongues.boundary_frequency[:, 1]
    # Tongues near each other and second-order shifts move an edge by some epsilon, that is 1e-3, of the width.
    wide = tongues.half_width > 1e-5
    assert wide.sum() > 10
    margin = 0.05 * tongues.half_width
    inside = np.stack([lower + margin, upper - margin])[:, wide]
    outside = np.stack([lower - margin, upper + margin])[:, wide]
    assert not solve(system, inside.ravel()).stable.any()
    assert solve(system, outside.ravel()).stable.all()


# ---- damping


def damped_half_width(system: GearSystem, center: float, half: float) -> float:
    """From the two zeros of the growth at a finite epsilon, bracketed around the first-order edges."""
    edges = []
    for sign in (-1, 1):
        inner, outer = center + 0.7 * sign * half, center + 1.4 * sign * half
        edges.append(brentq(lambda x: log_growth(system, x), inner, outer, xtol=1e-14, rtol=1e-14))
    return 0.5 * (edges[1] - edges[0])


DAMPINGS = {
    "modal, equal": ("modal", [0.02, 0.02, 0.02]),
    "modal, unequal": ("modal", [0.005, 0.03, 0.08]),
    "mesh": ("mesh", [0.02, 0.1]),
    "general": ("matrix", [[0.05, 0.01, 0.0], [0.01, 0.02, -0.01], [0.0, -0.01, 0.2]]),
}


@pytest.mark.parametrize("name", DAMPINGS)
@pytest.mark.parametrize("figure", ["fig5 dashed", "fig6b"])
def test_damped_half_widths_as_epsilon_and_damping_vanish(name: str, figure: str) -> None:
    """Epsilon and damping proportional to one small number; open tongues only."""
    system = train(*FIGURES[figure])
    damping = damping_matrix(system, *DAMPINGS[name])
    tongues = first_order(replace(system, damping=damping), 1)
    checked = 0
    for k, tongue in enumerate(tongues.index):
        half = tongues.half_width[k]
        if half == 0 or tongue.label in {"w1+w2", "(w1+w2)/2"}:  # too near to (w2+w3)/3 and its like, see EPSILON
            continue
        small = np.array([0.5e-3, 1e-3, 2e-3])
        center = tongues.center_frequency[k]
        per = [damped_half_width(with_damping(system, damping, e), center, half * e) / e for e in small]
        found = np.polynomial.Polynomial.fit(small, per, 2)(0.0)
        assert found == pytest.approx(half, rel=1e-4), tongue.label
        checked += 1
    assert checked >= 3


def test_closed_tongues_are_stable_and_open_at_their_threshold() -> None:
    system = train((1.4, 1.5), 0.3)
    damping = damping_matrix(system, "modal", [0.05, 0.2, 0.1])
    tongues = first_order(replace(system, damping=damping), 1)
    assert (tongues.threshold > 1).any()
    assert (tongues.threshold < 1).any()
    small = 1e-3
    for k, center in enumerate(tongues.center_frequency):
        closed = np.isnan(tongues.boundary_frequency[k]).all()
        assert closed == (tongues.threshold[k] > 1) == (tongues.half_width[k] == 0)
        # Just above the threshold the centre is unstable, just below stable, at first order in the small number.
        for factor, sign in ((1.02, 1), (0.98, -1)):
            tuned = replace(scaled(system, small * factor * tongues.threshold[k]), damping=damping * small)
            assert np.sign(log_growth(tuned, center)) == sign, tongues.label[k]


def test_one_undamped_mode_of_two_is_unstable_far_from_resonance() -> None:
    """Infinite half-width: with mode 3 damped and mode 2 not, w2 + w3 is unstable ten undamped widths away."""
    system = train(phasing=0.5)
    damping = damping_matrix(system, "modal", [0.0, 0.0, 0.05])
    tongues = first_order(replace(system, damping=damping), 1)
    k = tongues.label.index("w2+w3")
    assert tongues.half_width[k] == np.inf
    assert tongues.threshold[k] == 0
    assert np.isnan(tongues.boundary_frequency[k]).all()
    undamped = first_order(system, 1).half_width[k]
    small = 1e-3
    for away in (-10, -3, 0, 3, 10):
        omega = tongues.center_frequency[k] + away * undamped * small
        assert log_growth(with_damping(system, damping, small), omega) > 0
    # Mode 2 alone is undamped: 2 w2 has its undamped width.
    k = tongues.label.index("2w2")
    assert tongues.half_width[k] == pytest.approx(first_order(system, 1).half_width[k], rel=1e-12)


# ---- repeated frequencies


@pytest.mark.parametrize("label", ["2w2", "w1+w2", "w2+w4", "w2", "2w4"])
def test_tongues_of_a_degenerate_pair(label: str) -> None:
    system = turned_star(random_rotation(1))
    tongues = first_order(system, 2)
    k = tongues.label.index(label)
    center, half = tongues.center_frequency[k], tongues.half_width[k]
    # The edge found lies within (1e-7/period)^2/half of the true one, far below 1e-4 of the width.
    small = np.array([1e-3, 2e-3, 3e-3])
    per = []
    for e in small:
        edges = [first_outside(scaled(system, e), center, center + sign * 3 * half * e) for sign in (-1, 1)]
        per.append(0.5 * (edges[1] - edges[0]) / e)
    assert np.polynomial.Polynomial.fit(small, per, 2)(0.0) == pytest.approx(half, rel=1e-4)


def test_damped_tongues_of_a_degenerate_pair() -> None:
    """General damping couples the two modes of the pair."""
    damping = np.diag([0.004, 0.006, 0.016, 0.01])
    damping[1, 2] = damping[2, 1] = 0.004
    rotation = random_rotation(2)
    tongues = first_order(turned_star(rotation, damping), 1)
    system = turned_star(rotation)
    small = np.array([0.5e-3, 1e-3, 2e-3])
    for label in ("2w2", "w1+w2", "w2+w4"):
        k = tongues.label.index(label)
        center, half = tongues.center_frequency[k], tongues.half_width[k]
        assert half > 0
        turned = rotation.T @ damping @ rotation
        per = [damped_half_width(with_damping(system, turned, e), center, half * e) / e for e in small]
        assert np.polynomial.Polynomial.fit(small, per, 2)(0.0) == pytest.approx(half, rel=1e-4), label


# ---- any matrices


def test_three_meshes_at_three_frequencies() -> None:
    """Five coordinates, ratios 1, 1/2, 3, a contact ratio beyond 2 and lags; two and three meshes share frequencies."""
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(3, 5))
    meshes = tuple(
        Mesh(f"m{k}", directions[k], np.asarray(1.0 + 0.3 * k), np.asarray(1.0), Rectangular(c), r, lag)
        for k, (c, r, lag) in enumerate(zip((1.4, 2.35, 1.7), RATIOS, (0.0, 0.15, 0.6), strict=True))
    )
    factor = rng.normal(size=(5, 5))
    system = GearSystem(np.diag([1.0, 0.8, 1.3, 0.6, 2.0]), factor @ factor.T + np.eye(5), meshes)
    assert system.common_period()[0] == 2
    w = mean_modes(system).natural_frequency
    tongues = first_order(system, 1)
    assert {t.mesh for t in tongues.index} == {"m0+m1", "m1", "m0+m1+m2"}
    gaps = np.abs(np.subtract.outer(tongues.center_frequency, tongues.center_frequency))
    alone = np.sort(gaps, axis=-1)[:, 1] > 0.01
    checked = 0
    for k in np.flatnonzero(alone & (tongues.half_width > 0.01)):
        tongue = tongues.index[k]
        pair = (w[tongue.mode_p - 1], w[tongue.mode_q - 1])
        found = limit(system, pair, tongue.frequency_ratio, tongues.half_width[k])
        assert_allclose(np.sqrt(found), tongues.half_width[k], rtol=1e-4, err_msg=tongue.label)
        checked += 1
    assert checked >= 10
