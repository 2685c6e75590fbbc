"""Bounds of mesh forces from one frequency at a time, against the steady state over the common period."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import train

from gearstab.response.linear.one_at_a_time import force_bounds
from gearstab.response.linear.speeds import speed_response
from gearstab.response.linear.steady import STATUS_FLAGS
from gearstab.system import GearSystem

SPEEDS = np.array([0.83, 1.4, 2.63])


def with_ratio(ratio: Fraction, size: float = 1.0) -> GearSystem:
    """A train whose second mesh has a frequency of its own; its variations and errors by a factor."""
    system = train()
    meshes = []
    for mesh, own in zip(system.meshes, (Fraction(1), ratio), strict=True):
        error = mesh.transmission_error
        error = error if error is None else replace(error, sin=error.sin * size, cos=error.cos * size)
        meshes.append(
            replace(mesh, frequency_ratio=own, epsilon=np.asarray(mesh.epsilon) * size, transmission_error=error)
        )
    forces = tuple(replace(force, direction=force.direction * size) for force in system.forces)
    return replace(system, meshes=tuple(meshes), forces=forces)


def test_a_single_frequency_is_exact() -> None:
    system = with_ratio(Fraction(1))
    system = replace(system, forces=tuple(replace(f, frequency_ratio=Fraction(1)) for f in system.forces))
    found, exact = force_bounds(system, SPEEDS), speed_response(system, SPEEDS, 100)
    # Both take polynomials between samples, of other distances.
    np.testing.assert_allclose(found.load_factor, exact.dynamic_load_factor, rtol=1e-5)
    parting = np.any(found.least < 0, axis=2)
    np.testing.assert_array_equal(parting, (exact.status & STATUS_FLAGS["separation"]) != 0)


@pytest.mark.parametrize("size", [0.05, 0.01])
def test_deviations_of_two_frequencies_add_up_to_first_order(size: float) -> None:
    """15 cycles of one and 11 of the other nearly meet in all phases: what is left is of the second order."""
    system = with_ratio(Fraction(15, 11), size)
    found, exact = force_bounds(system, SPEEDS), speed_response(system, SPEEDS, 100)
    scale = found.static[:, None]
    upwards, downwards = found.load_factor - 1, 1 - found.least / scale
    second = 20 * size**2
    assert np.all(exact.dynamic_load_factor - 1 < upwards + second)
    # The first mesh carries its load on the other flank, where the least force is none of those of a response.
    assert np.all((1 - exact.mesh_force_min / scale < downwards + second)[..., 1])
    # A fifteenth of a period apart at most, peaks fall by 1 - cos(pi/15), some 2 %, or to the corner of a jump.
    assert np.all(exact.dynamic_load_factor - 1 > 0.8 * upwards - second)
