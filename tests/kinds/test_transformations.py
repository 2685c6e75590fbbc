"""A system in other coordinates or units moves as the same system does, whatever drives it and varies in it."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
from driven import FORCE, PULSES, train, with_friction

from gearstab.floquet import solve
from gearstab.floquet.frequencies.per_mesh import alone, groups
from gearstab.response import steady_state
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

OMEGA = 1.31
SKEW = np.array([[0.0, 0.3, -0.2], [-0.3, 0.0, 0.4], [0.2, -0.4, 0.0]])


def system() -> GearSystem:
    """With a load, forces, transmission errors, terms of both sorts and a damping matrix that is not symmetric."""
    base = with_friction(train(Fraction(1, 2)), Rectangular(1.6))
    # One term with both functions too: units of stiffness and damping differ.
    both = replace(base.terms[0], damping=base.terms[1].damping)
    return replace(base, forces=(FORCE, PULSES), damping=base.damping + SKEW, terms=(both, base.terms[1]))


def test_in_other_coordinates() -> None:
    basis = np.array([[1.0, 0.4, 0.0], [0.2, -0.8, 0.5], [0.1, 0.3, 1.2]])
    other = system().projected(basis, ("a", "b", "c"))
    assert other.coordinates == ("a", "b", "c")
    q, y = (steady_state(one, OMEGA, 10) for one in (system(), other))
    # Condition numbers of modes and of I - M are of order 10: a few hundred roundings.
    np.testing.assert_allclose(y.displacement @ basis.T, q.displacement, atol=1e-12)
    np.testing.assert_allclose(y.mesh_force, q.mesh_force, atol=1e-12)


def test_in_other_units() -> None:
    """Lengths stay; forces are in units of the stiffness and times in units of sqrt(mass/stiffness)."""
    mass, stiffness = np.array(2.5), np.array(1.7)
    time = np.sqrt(mass / stiffness)
    other = system().scaled(mass, stiffness)
    assert other.dimensionless == ("mass", "time")
    q, y = steady_state(system(), OMEGA, 10), steady_state(other, OMEGA * float(time), 10)
    np.testing.assert_allclose(y.displacement, q.displacement, atol=1e-12)
    np.testing.assert_allclose(y.velocity, q.velocity * time, atol=1e-12)
    np.testing.assert_allclose(y.mesh_force * stiffness, q.mesh_force, atol=1e-12)
    np.testing.assert_allclose(y.time * time, q.time, rtol=1e-14)


def test_the_mean_system_decays_as_its_eigenvalues_say_at_all_speeds() -> None:
    one = system()
    growth = solve(one.averaged(), np.array([0.7, 1.3, 2.9])).growth_rate[0]
    # Of the terms only the damping has a mean, of 0.05.
    damping = one.damping + 0.05 * sum(np.outer(term.left, term.right) for term in one.terms)
    below = -np.linalg.solve(one.mass, np.hstack([one.mean_stiffness_matrix(), damping]))
    values = np.linalg.eigvals(np.vstack([np.eye(3, 6, 3), below]))
    np.testing.assert_allclose(growth, values.real.max(), rtol=1e-10)


def test_one_frequency_varies_and_the_others_keep_their_mean() -> None:
    first = groups(system())[0]
    own = alone(system(), first)
    assert [np.any(mesh.epsilon) for mesh in own.meshes] == [True, False]
    assert all(ratio == 1 for ratio in own.frequency_ratios)


def test_without_what_drives_it() -> None:
    assert system().forced
    assert not system().undriven().forced
