"""Bounds of mesh forces from one frequency at a time, against the steady state over the common period."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import train

import gearstab as gs
from gearstab.modal import static_mesh_force
from gearstab.response.speeds import force_bounds, speed_response
from gearstab.response.steady import STATUS_FLAGS
from gearstab.system import GearSystem

SPEEDS = np.array([0.83, 1.4, 2.63])
SLOW = np.array([900.0, 5000.0])


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


@pytest.mark.parametrize("turned", [False, True])
def test_a_weak_tooth_counts_to_its_mesh(turned: bool) -> None:
    """On either flank; what the mesh and its tooth do to each other is below the loss of the tooth."""
    q, system = 0.98, {
        "kind": "gearbox",
        "gears": {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"},
        "rotors": [{"name": "a", "teeth": 20, "inertia": 1e-3}, {"name": "b", "teeth": 41, "inertia": 3e-3}],
        "input": {"rotor": "a", "torque": 50.0},
        "outputs": [{"rotor": "b"}],
    }  # fmt: skip
    mesh = {"name": "m", "gears": ["a", "b"], "mean_stiffness": 1e8, "epsilon": 0.1, "contact_ratio": 1.6,
            "damping_ratio": 0.05}  # fmt: skip
    weak, healthy = (
        gs.build({"system": system | {"meshes": [mesh | {"faults": faults}]}})
        for faults in ([{"gear": "a", "factor": q}], [])
    )
    assert len(weak.meshes) == 2
    if turned:
        weak = replace(weak, meshes=tuple(replace(one, direction=-one.direction) for one in weak.meshes))
    found, exact, alone = force_bounds(weak, SLOW), speed_response(weak, SLOW), force_bounds(healthy, SLOW)
    static = float(found.static.squeeze())
    assert np.sign(float(static_mesh_force(weak).squeeze())) == (-1 if turned else 1) * np.sign(static)
    np.testing.assert_allclose(found.greatest, exact.mesh_force_peak, rtol=0, atol=(1 - q) * static)
    # What the tooth adds to the force of a healthy mesh is seen.
    assert np.all(found.greatest - alone.greatest > 0.1 * (1 - q) * static)
