"""The uncoupled Mathieu equations against scipy's Mathieu functions, Floquet theory and the paper's conclusions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.linalg import eigh_tridiagonal
from scipy.special import mathieu_a, mathieu_b
from tongues import scaled, train

from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order, uncoupled
from gearstab.perturbation.mathieu import characteristic_values
from gearstab.system import GearSystem


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
