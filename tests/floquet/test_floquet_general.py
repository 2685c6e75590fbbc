"""Floquet analysis of systems with periodic terms that need not be symmetric, against independent routes."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from driven import integrated
from random_trains import light_train
from scenes import scene_text, succeeds
from systems import DAMPING, G1, G2, MASS, SHAFT, WITH_TERMS, Smooth, friction, train, with_terms

from gearstab.ckernel import exponentials
from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.floquet.dispatch import reduction
from gearstab.floquet.general import analyse
from gearstab.floquet.truncation import modes_basis, neglected
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import modal_damping_matrix
from gearstab.system import GearSystem
from gearstab.waveforms import Constant, Rectangular, Scaled

OMEGA = np.linspace(0.35, 7.0, 23)[None]


@pytest.mark.parametrize("damping", [None, DAMPING])
@pytest.mark.parametrize("stiffness", [SHAFT, 0 * SHAFT])
def test_symmetric_systems_agree_with_the_exact_solver(damping, stiffness):
    # With a free train (a rigid-body mode) both leave the rigid motion out; damping on M drives it, on meshes does not.
    system = with_terms(damping, stiffness)
    ours, exact = analyse(system, OMEGA, exponents=True), solve(system, OMEGA, exponents=True)
    np.testing.assert_array_equal(ours.stable, exact.stable)
    # Products of some 16 exponentials, whose growth per period is right to 1e-14 of the largest multiplier; close
    # to an edge multipliers depend on it by the square root.
    np.testing.assert_allclose(ours.growth_rate, exact.growth_rate, atol=2e-8)
    by_size = [np.sort(found.exponents.real, axis=-1) for found in (ours, exact)]
    np.testing.assert_allclose(*by_size, atol=2e-8)


def test_a_mesh_may_be_written_as_a_term():
    system = with_terms(DAMPING)
    mesh = system.meshes[1]
    wave = Scaled(mesh.waveform, mesh.mean_stiffness, 2 * mesh.epsilon)
    term = PeriodicTerm("second", G2, G2, wave, None, mesh.frequency_ratio, mesh.lag)
    other = replace(system, meshes=system.meshes[:1], terms=(term,))
    np.testing.assert_allclose(
        analyse(other, OMEGA).growth_rate, analyse(system, OMEGA).growth_rate, rtol=1e-12, atol=1e-14
    )


def test_a_free_train_that_drives_itself_grows_fastest_as_a_whole():
    """With D = -2 a M, q = exp(a t) y takes the damping out of stable motions; the train as a whole grows as
    exp(2 a t), since K does not hold it."""
    a, free = 0.01, train(0.1, shaft=0.0)
    # A term too small to count makes it a system of the first-order form.
    term = PeriodicTerm("nothing", G1, G1, Constant(1e-300))
    system = replace(free, damping=-2 * a * free.mass, terms=(term,))
    omega = np.array([1.3, 3.1, 6.4])
    # The stiffness of y is less by a^2 M: 1 % in Omega is more than that moves any edge.
    assert (solve(free, np.outer(omega, [0.99, 1.0, 1.01]).ravel()).stable == 1).all()
    found = solve(system, omega, exponents=True)
    np.testing.assert_array_equal(found.stable, 0)
    np.testing.assert_allclose(found.growth_rate, 2 * a, rtol=1e-9)
    np.testing.assert_allclose(np.sort(found.exponents.real, axis=-1)[..., -2], a, rtol=1e-9)


@pytest.mark.parametrize("name", WITH_TERMS)
@pytest.mark.parametrize("omega", [0.9, 2.7])
def test_growth_agrees_with_integration(name, omega):
    system = WITH_TERMS[name]
    found = analyse(system, np.array([[omega]]), exponents=True, tolerance=1e-11)
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    matrix = integrated(system, omega, np.eye(2 * system.size), period)
    expected = np.log(np.abs(np.linalg.eigvals(matrix)).max()) / period
    # DOP853 at 1e-12 over a few hundred steps.
    assert found.growth_rate[0, 0] == pytest.approx(expected, abs=1e-9)
    assert not np.any(found.status & STATUS_FLAGS["not_converged"])


@pytest.mark.parametrize("name", WITH_TERMS)
def test_sum_of_the_exponents_is_minus_the_mean_trace_of_the_damping(name):
    # det M = exp(-int tr(M^-1 C) dt), Liouville.
    system = WITH_TERMS[name]
    found = analyse(system, OMEGA, exponents=True)
    trace = 0.0 if system.damping is None else np.trace(np.linalg.solve(system.mass, system.damping))
    x = (np.arange(20000) + 0.5) / 20000
    for term in system.terms:
        if term.damping is not None:
            along = term.right @ np.linalg.solve(system.mass, term.left)
            trace += along * float(np.mean(term.damping.value(x)))
    # 1e-13: rounding of the small multipliers (none below 1e-3 here), the mean of jumps is exact on this grid.
    np.testing.assert_allclose(found.exponents.real.sum(axis=-1), -trace, atol=1e-9)


@pytest.mark.parametrize("name", ["piecewise constant friction", "damping that follows the stiffness"])
def test_what_is_constant_between_jumps_is_exact(name):
    # Jumps of two functions fall on one instant, 5.6e-17 of a period apart: nothing varies in between.
    found = analyse(WITH_TERMS[name], OMEGA)
    # Rounding of up to 27 steps, and of exponentials of exponents of a norm of some hundreds together.
    assert found.error_estimate.max() < 1e-12
    assert not found.status.any()


def test_friction_that_drives_the_rigid_body_does_not_change_the_other_multipliers():
    # A free train: r deflects no mesh, friction acts on it (left has a part along M r) but K r = 0.
    free = with_terms(None, 0 * SHAFT, [friction(Scaled(Rectangular(1.3), 0.05, 0.3))])
    found = analyse(free, OMEGA, exponents=True)
    # Elastic coordinates by hand: any basis Z of the complement of r in the sense of M.
    r = np.array([1.0, -1.0, 1.0])
    basis = np.linalg.svd((MASS @ r)[None])[2][1:].T
    part = replace(
        free,
        mass=basis.T @ MASS @ basis,
        stiffness=basis.T @ free.stiffness @ basis,
        meshes=tuple(replace(mesh, direction=basis.T @ mesh.direction) for mesh in free.meshes),
        terms=tuple(replace(term, left=basis.T @ term.left, right=basis.T @ term.right) for term in free.terms),
    )
    expected = analyse(part, OMEGA, exponents=True)
    np.testing.assert_allclose(found.growth_rate, expected.growth_rate, atol=1e-10)
    assert np.sum(np.abs(found.exponents) == 0, axis=-1).min() >= 2
    assert found.growth_rate.max() > 1e-3


def test_rows_of_a_batch_are_solved_as_single_systems_are():
    size = np.array([0.0, 0.2, 0.4])
    one = [with_terms(DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, s))]) for s in size]
    every = with_terms(DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, size))])
    together = analyse(every, np.tile(OMEGA, (3, 1)))
    for r, system in enumerate(one):
        # Products of stacks of another shape may be summed in another order.
        alone = analyse(system, OMEGA).growth_rate[0]
        np.testing.assert_allclose(together.growth_rate[r], alone, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_estimates_are_honest(tolerance):
    system = with_terms(DAMPING, terms=[friction(Smooth(0.1, 0.3), Smooth(0.02, 0.01))])
    omega = np.linspace(0.5, 5.0, 40)[None]
    found = analyse(system, omega, tolerance=tolerance)
    truth = analyse(system, omega, tolerance=1e-13)
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    error = np.abs(np.expm1((found.growth_rate - truth.growth_rate) * period))
    error *= np.exp(np.minimum(truth.growth_rate * period, 0.0))
    assert not np.any(found.status & STATUS_FLAGS["not_converged"])
    assert np.all(error <= found.error_estimate + 1e-13)
    seen = error > 1e-13
    assert not seen.any() or np.median(found.error_estimate[seen] / error[seen]) < 100


def test_what_no_number_of_steps_reaches_is_flagged():
    """A tolerance beyond rounding, and one that is reached."""
    for tolerance in (1e-16, 1e-9):
        found = solve(WITH_TERMS["smooth friction"], np.array([0.9, 2.1]), tolerance=tolerance)
        flagged = (found.status & STATUS_FLAGS["not_converged"]) > 0
        np.testing.assert_array_equal(flagged, found.error_estimate > tolerance)
        assert flagged.all() == (tolerance < 1e-12)


def test_long_periods_neither_overflow_nor_underflow():
    system = with_terms(0.5 * MASS + DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, 0.3))])
    found = analyse(system, np.array([[1e-4]]))
    assert np.isfinite(found.growth_rate).all()
    assert found.stable[0, 0] == 1
    driven = with_terms(-0.5 * MASS, terms=[friction(Scaled(Rectangular(1.3), 0.05, 0.3))])
    assert analyse(driven, np.array([[1e-4]])).growth_rate[0, 0] > 0.2


def test_multipliers_on_one_circle_are_found():
    # Sweeps of the QR algorithm may go in circles there: a quarter of these points had no result.
    system, _, _ = light_train(1047)
    found = solve(system, 3.4881346277723235 * (1 + np.linspace(-1e-4, 1e-4, 101)))
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.growth_rate, -7.5133e-8, rtol=1e-4)


def test_exponentials_of_any_size():
    rng = np.random.default_rng(7)
    matrices = rng.standard_normal((12, 5, 5)) * np.logspace(-9, 1.5, 12)[:, None, None]
    with mp.workdps(40):
        truth = [np.array(mp.expm(mp.matrix(matrix.tolist())).tolist(), dtype=float) for matrix in matrices]
    for ours, exact, matrix in zip(exponentials(matrices), truth, matrices, strict=True):
        # Scaling and squaring: eps times the norm of the matrix.
        assert np.abs(ours - exact).max() <= 2e-15 * (1 + np.abs(matrix).sum()) * np.abs(exact).max()
    assert np.isnan(exponentials(np.full((1, 2, 2), np.inf))).all()


def test_the_report_says_that_a_system_with_terms_is_solved_as_a_whole():
    free = with_terms(None, 0 * SHAFT, [friction(Scaled(Rectangular(1.3), 0.05, 0.3))])
    found = reduction(free)
    assert found.rigid == (1,)
    assert [part.modes for part in found.parts] == [(2, 3)]
    assert found.text() == "1 mode of rigid bodies dropped; one block of 2 modes"
    # A term that the rigid-body motion feels leaves none.
    felt = with_terms(None, 0 * SHAFT, [friction(Scaled(Rectangular(1.3), 0.05, 0.3), right=[1.0, 0.0, 0.0])])
    assert reduction(felt).rigid == ()


def test_a_restriction_keeps_the_terms():
    system = with_terms(DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, 0.4), Constant(0.02))])
    basis = modes_basis(system, [1, 2, 3])
    # All modes: another basis of the same space.
    whole, same = (analyse(one, OMEGA).growth_rate for one in (system, system.projected(basis)))
    np.testing.assert_allclose(same, whole, rtol=1e-9, atol=1e-11)
    assert neglected(system, basis) == 0
    # The friction couples modes 1 and 3 more than the meshes do.
    pair = modes_basis(system, [1, 2])
    assert neglected(system, pair) > neglected(replace(system, terms=()), pair)


TERMS = scene_text("floquet_general_terms")
GYROSCOPIC = """\
  terms:
    - {name: to, left: [1, 0], right: [0, 1], damping: {mean: 0.2}}
    - {name: fro, left: [0, 1], right: [1, 0], damping: {mean: -0.2}}
"""


@pytest.mark.parametrize("command", ["sweep", "dry run", "info"])
@pytest.mark.parametrize(
    "text",
    [
        TERMS.replace("sweep:", f"{GYROSCOPIC}sweep:"),
        TERMS.replace("1.6}", "1.6, damping: 0.02, damping_follows_stiffness: true}"),
    ],
)
def test_commands_take_terms_beside_rectangular_waves(tmp_path, text, command):
    (tmp_path / "case.yaml").write_text(text)
    path, out = str(tmp_path / "case.yaml"), str(tmp_path / "out.h5")
    arguments = {"sweep": ["sweep", path, "-o", out], "dry run": ["sweep", path, "--dry-run"], "info": ["info", path]}
    result = succeeds(*arguments[command])
    if command == "info":
        assert "With its damping, the means of its terms and held rotations it moves so" in result.output


class TestStrongDamping:
    """Multipliers e^-50 to e^-750 of the largest, of which a product in double precision knows nothing."""

    @pytest.mark.parametrize(("ratio", "omega"), [(0.3, 0.1), (0.9, 0.5), (0.9, 0.1)])
    def test_damping_written_as_a_term(self, ratio, omega):
        """A constant symmetric term is damping, of which exponents are found state by state."""
        system, direction = with_terms(), np.array([0.3, -0.1, 0.2])
        modal = modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), np.full(3, ratio))
        term = PeriodicTerm("damping", direction, direction, None, Constant(0.2))
        ours = solve(replace(system, damping=modal, terms=(term,)), np.array([omega]), exponents=True)
        added = modal + 0.2 * np.outer(direction, direction)
        exact = solve(replace(system, damping=added), np.array([omega]), exponents=True)
        period = 10 * np.pi / omega
        assert np.ptp(exact.exponents.real) * period > 100
        by_size = [np.sort(found.exponents.real, axis=None) for found in (ours, exact)]
        np.testing.assert_allclose(*by_size, rtol=0, atol=1e-11 / period)

    @pytest.mark.parametrize("profile", [Scaled(Rectangular(1.3), 0.05, 0.4), Smooth(0.1, 0.2)])
    def test_exponents_of_friction_add_up_to_the_trace(self, profile):
        """Liouville: the sum is -tr M^-1 C, as friction on positions has no part in it."""
        system = with_terms(terms=[friction(profile)])
        modal = modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), np.full(3, 0.5))
        found = solve(replace(system, damping=modal), np.array([0.2, 0.7]), exponents=True)
        trace = -np.trace(np.linalg.solve(system.mass, modal))
        np.testing.assert_allclose(found.exponents.sum(axis=-1), trace, rtol=1e-12)

    @pytest.mark.parametrize("omega", [0.03, 0.4])
    def test_a_single_coordinate_against_50_digits(self, omega):
        """An overdamped pair whose damping follows its stiffness, with friction: two states of half a period each."""
        wave = Rectangular(1.5)
        mesh = Mesh("mesh", np.ones(1), np.array(1.0), np.array(0.3), wave)
        drag = PeriodicTerm("drag", np.ones(1), np.ones(1), Scaled(wave, 0.05, 0.4), Scaled(wave, 0.5, 1.0))
        system = GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,), 6 * np.eye(1), terms=(drag,))
        (found,) = solve(system, np.array([omega]), exponents=True).exponents.reshape(1, 2)
        with mp.workdps(50 + int(40 / omega)):
            product, period = mp.eye(2), 2 * mp.pi / mp.mpf(omega)
            for half in (mp.mpf(1) / 2, -mp.mpf(1) / 2):
                stiffness = 1 + 2 * mp.mpf(0.3) * half + mp.mpf(0.05) + mp.mpf(0.4) * half
                product = mp.expm(mp.matrix([[0, 1], [-stiffness, -6.5 - half]]) * period / 2) * product
            expected = sorted(float(mp.log(mp.re(value)) / period) for value in mp.eig(product)[0])
        assert (expected[1] - expected[0]) * 2 * np.pi / omega > 80
        np.testing.assert_allclose(np.sort(found.real), expected, rtol=1e-13)
