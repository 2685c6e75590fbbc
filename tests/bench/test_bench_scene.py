"""Scenes of the benchmark: systems without their rigid-body modes."""

from dataclasses import replace

import numpy as np
import pytest
from planetary_gears import SUPPORTS, parameters, with_epsilon
from systems import two_stage

from gearstab.bench import without_rigid_modes
from gearstab.floquet import solve
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build


def train(**changes: object) -> GearSystem:
    meshes = {"epsilon": (0.3, 0.2), "contact_ratio": (1.4, 1.7), "phasing": 0.2, "second": {"damping": 0.01}}
    return build(two_stage(**{"mean_stiffness": (1.0, 1.2), "input_shaft_stiffness": 0.0} | meshes | changes))


@pytest.mark.parametrize("damping", [{}, {"damping_ratio": 0.01}])
def test_stability_is_that_of_the_whole_system(damping: dict[str, float]) -> None:
    whole = train(**damping)
    elastic = without_rigid_modes(whole)
    assert elastic.size == whole.size - 1
    omega = np.linspace(0.5, 7.0, 200)
    # The same exponents from matrices of another size: rounding of two products, a few 1e-14.
    np.testing.assert_allclose(solve(elastic, omega).growth_rate, solve(whole, omega).growth_rate, atol=1e-12)
    frequency = mean_modes(whole).natural_frequency
    np.testing.assert_allclose(mean_modes(elastic).natural_frequency, frequency[1:], rtol=1e-13)


def test_a_planetary_gear_keeps_its_symmetry() -> None:
    """A turn of the planets takes the elastic modes into one another: it is an isometry of their energies."""
    supports = SUPPORTS | {"carrier_rotation": 0.0, "sun_rotation": 0.0}
    whole = build(with_epsilon(parameters(harmonics=1, supports=supports), 0.2))
    elastic = without_rigid_modes(whole)
    assert elastic.size < whole.size
    (symmetry,) = elastic.symmetries
    turn = symmetry.turn
    for matrix in (elastic.mass, elastic.stiffness_matrix([mesh.mean_stiffness for mesh in elastic.meshes])):
        np.testing.assert_allclose(turn.T @ matrix @ turn, matrix, atol=1e-10 * np.abs(matrix).max())
    np.testing.assert_allclose(np.linalg.matrix_power(turn, symmetry.order), np.eye(elastic.size), atol=1e-10)
    omega = np.linspace(0.3, 2.0, 40) * mean_modes(elastic).natural_frequency[-1]
    found = solve(elastic, omega).growth_rate
    assert found.max() > 0
    np.testing.assert_allclose(found, solve(whole, omega).growth_rate, atol=1e-10 * found.max())


def test_a_system_without_rigid_modes_stays_as_it_is() -> None:
    whole = train(input_shaft_stiffness=0.5)
    assert without_rigid_modes(whole) is whole


def test_rigid_modes_stay_where_damping_couples_them() -> None:
    whole = replace(train(), damping=np.diag([0.1, 0.0, 0.0]))
    assert without_rigid_modes(whole) is whole
