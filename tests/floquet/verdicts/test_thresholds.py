"""Thresholds of decision: what is counted as rounding error, and what is not any more."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from systems import COSINE, G1, G2, Smooth, train

from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.floquet.kernel import decision
from gearstab.floquet.stability import decided
from gearstab.mesh import PeriodicTerm

NOTHING = PeriodicTerm("nothing", G1, G1, stiffness=Smooth(0.0, 0.0))


def pair(half_distance, form, growth=0.0):
    """A symplectic matrix of two multipliers exp(i (1 +- half_distance)) of opposite signature, and their conjugates,
    whose eigenvectors have the Krein form +-form, and how wrong it was made to move them off the circle by ``growth``.

    Two oscillators of one frequency in resonance 1:-1 (Hamiltonian H = w (q1 p2 - q2 p1) + eta |q|^2/2 + mu |p|^2/2 in
    z = q1 + i q2, w = p1 + i p2): eigenvalues i (w +- (eta mu)^(1/2)). An imaginary part of mu makes it no Hamiltonian.
    """
    eta = 2 * half_distance / form
    mu = half_distance**2 / eta * (1 + 2j * growth / half_distance)
    inner = np.exp(1j) * expm(np.array([[0.0, mu], [-eta, 0.0]]))
    return np.kron(inner.real, np.eye(2)) + np.kron(inner.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))


@pytest.mark.parametrize(
    ("form", "growth", "distance"), [(3e-5, 3e-9, 300.0), (1e-3, 1e-8, 50.0)],
    ids=["form just above that of a double multiplier", "neighbour just beyond the cluster"],
)  # fmt: skip
def test_simple_multipliers_wrong_by_little_are_stable(form, growth, distance):
    """Multipliers of one signature cannot leave the circle: that they seem to, by far more than the matrix is wrong,
    tells of eigenvectors that are almost parallel, and of nothing else."""
    matrix = pair(0.5 * distance * growth, form, growth)
    found = np.log(np.abs(np.linalg.eigvals(matrix)).max())
    assert found == pytest.approx(growth, rel=0.05)
    stable, excess, krein = decision.conservative(matrix[None])
    assert krein[0]
    assert stable[0]
    assert excess[0] == 0


def test_opposite_multipliers_as_near_as_their_error_are_unstable():
    """The error that moves them off the circle hides whether they have met; each alone has a definite form."""
    growth = 1e-8
    stable, excess, krein = decision.conservative(pair(growth, 1e-3, growth)[None])
    assert krein[0]
    assert not stable[0]
    assert excess[0] == pytest.approx(growth, rel=0.5)


def test_growth_within_the_threshold_is_none():
    growth, stable = decided(np.array([-3.0, -0.5, 0.0, 0.9, 1.0, 1.1, 3.0]), np.array(2.0), 1.0)
    np.testing.assert_array_equal(stable, [1, 1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(growth, [-1.5, -0.25, 0.0, 0.0, 0.0, 0.55, 1.5])


@pytest.mark.parametrize("growth", [3e-9, 1e-7, 1e-5])
def test_a_pair_that_has_met_is_unstable(growth):
    # eta mu < 0: the pair parts at a right angle to the circle.
    inner = np.exp(1j) * expm(np.array([[0.0, growth], [growth, 0.0]]))
    matrix = np.kron(inner.real, np.eye(2)) + np.kron(inner.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))
    stable, excess, _ = decision.conservative(matrix[None])
    assert not stable[0]
    assert excess[0] == pytest.approx(growth, rel=1e-3)


WAYS = {
    "jumps": (),
    "smooth": (replace(COSINE, cos=np.array([0.5])),) * 2,
    "terms": (),
}


@pytest.mark.parametrize("way", WAYS)
def test_damped_growth_above_rounding_is_instability(way):
    """Growth by 4e-10 a period is unstable, and decay by it is stable: rounding leaves less than 1e-10.

    q = exp(-a t) y turns M y'' + D y' + K y = 0 into M q'' + (D + 2 a M) q' + (K + a D + a^2 M) q = 0.
    """
    omega, free = np.array([5.4]), train(0.45, waves=WAYS[way] or None)
    drag, terms = 0.01 * np.outer(G1, G1) + 0.005 * np.outer(G2, G2), (NOTHING,) if way == "terms" else ()

    def at(a):
        stiffness, damping = free.stiffness + a * drag + a * a * free.mass, drag + 2 * a * free.mass
        return solve(replace(free, stiffness=stiffness, damping=damping, terms=terms), omega, tolerance=1e-12)

    period, growth = 2 * np.pi / omega[0], float(at(0.0).growth_rate[0, 0])
    assert growth > 0.01
    for left, stable in ((4e-10, 0), (-4e-10, 1)):
        assert at(growth - left / period).stable[0, 0] == stable


def test_large_and_small_damped_matrices_are_said_to_be_scaled():
    """Multipliers beyond 2^200, or all below its inverse, with damping, are marked; the others are not."""
    bit = STATUS_FLAGS["rescaled"]
    drag = np.diag([0.02, 0.01, 0.05])
    for system, omega, scaled in (
        (train(2.5, damping=drag), 0.003, True),
        (train(2.5, damping=drag), 1.3, False),
        (train(0.1, damping=20 * drag), 0.003, True),
        (train(0.1, damping=drag), 1.3, False),
    ):
        found = solve(system, np.array([omega]))
        assert (np.abs(found.growth_rate[0, 0]) * 2 * np.pi / omega > 140) == scaled
        assert bool(found.status[0, 0] & bit) == scaled
