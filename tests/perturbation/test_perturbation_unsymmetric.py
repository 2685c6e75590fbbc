"""First-order boundaries with friction and mesh damping that varies, against exact ones as epsilon tends to 0."""

from __future__ import annotations

import numpy as np
import pytest

from gearstab.floquet.boundaries import boundaries
from gearstab.perturbation import first_order
from gearstab.perturbation.unsymmetric import first_order_edges
from gearstab.system import GearSystem, Mesh, PeriodicTerm
from gearstab.waveforms import Rectangular, Scaled

G = np.array([0.7, 0.7])
WAVE = Rectangular(1.5)


def pair(epsilon: float, friction: float) -> GearSystem:
    """Two modes whose damping and friction, means included, are of the order of epsilon."""
    profiles = Scaled(WAVE, 0.3 * epsilon, 1.2 * epsilon), Scaled(Rectangular(1.3), 0.02 * epsilon, 0.5 * epsilon)
    term = PeriodicTerm("friction", friction * np.array([0.3, -0.2]), np.array([1.0, 0.4]), *profiles, lag=0.15)
    mesh = Mesh("mesh", G, np.array(1.0), np.array(epsilon), WAVE)
    damping = 2 * epsilon * np.diag([0.03, 0.09])
    return GearSystem(np.eye(2), np.diag([1.0, 3.0]), (mesh,), damping, terms=(term,))


@pytest.mark.parametrize(("p", "q"), [(1, 1), (1, 2), (2, 2)])
def test_exact_edges_tend_to_those_of_first_order(p: int, q: int) -> None:
    errors = []
    for epsilon in (0.02, 0.01, 0.005):
        expected = np.array(first_order_edges(pair(epsilon, 1.0), p, q))
        found = boundaries(pair(epsilon, 1.0), expected.mean() - epsilon, expected.mean() + epsilon)
        assert len(found.row) == 1
        errors.append(np.abs([found.lower[0], found.upper[0]] - expected).max() / epsilon)
    # Relative to the width, which is some epsilon, the error is of first order.
    assert errors[0] < 0.02
    assert errors[2] < 0.3 * errors[0] + 1e-6


def test_friction_shifts_a_tongue_of_unequally_damped_modes() -> None:
    """The theory would fail the test above without the imaginary part: the shift is much larger than its tolerance."""
    alone, rubbed = (np.array(first_order_edges(pair(0.01, f), 1, 2)) for f in (0.0, 1.0))
    assert abs(rubbed.mean() - alone.mean()) > 0.05 * np.ptp(alone)


def test_symmetric_systems_are_those_of_the_other_theory() -> None:
    system = pair(0.05, 0.0)
    table = first_order(GearSystem(system.mass, system.stiffness, system.meshes, system.damping), 3)
    for k, tongue in enumerate(table.index):
        own = first_order_edges(system, tongue.mode_p, tongue.mode_q, tongue.harmonic)
        np.testing.assert_allclose(own, table.boundary_frequency[k], rtol=1e-12)
