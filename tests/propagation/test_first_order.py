"""The first-order form against the equations of motion in physical coordinates, and how a batch is flattened."""

from dataclasses import replace

import numpy as np
import pytest

from gearstab.mesh import Mesh
from gearstab.propagation.elastic import elastic_forms
from gearstab.propagation.first_order import bases
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

MASS, STIFFNESS = np.diag([1.0, 0.3, 4.0]), np.diag([0.5, 0.0, 0.0])
FIRST, SECOND = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
LEVELS = np.array([1.3, 0.6])


def train(mean_stiffness: np.ndarray | float = 1.0, grounded: bool = True, damping: float = 0.02) -> GearSystem:
    meshes = (
        Mesh("first", FIRST, np.asarray(mean_stiffness), np.asarray(0.3), Rectangular(1.5)),
        Mesh("second", SECOND, np.asarray(0.8), np.asarray(0.3), Rectangular(1.4)),
    )
    drag = damping * (np.outer(FIRST, FIRST) + 2 * np.outer(SECOND, SECOND))
    return GearSystem(MASS, STIFFNESS if grounded else 0 * STIFFNESS, meshes, drag)


def physical(system: GearSystem) -> np.ndarray:
    """A of (q, q') with the mesh stiffnesses LEVELS."""
    stiffness = system.stiffness_matrix(list(LEVELS))
    below = -np.linalg.solve(system.mass, np.hstack([stiffness, system.damping]))
    return np.vstack([np.eye(3, 6, 3), below])


@pytest.mark.parametrize("grounded", [True, False])
def test_all_modes_move_as_the_physical_coordinates_do(grounded: bool) -> None:
    system = train(grounded=grounded)
    (basis,) = bases(system, whole=True)
    rate = basis.generator(LEVELS[None])[0] * basis.rate[0]
    x = np.random.default_rng(1).standard_normal(basis.size)
    state = np.concatenate([basis.outlet[0] @ x, basis.speed[0] @ x])
    expected = physical(system) @ state
    found = np.concatenate([basis.outlet[0] @ rate @ x, basis.speed[0] @ rate @ x])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("grounded", [True, False])
def test_forms_of_stability_and_response_have_the_exponents_of_the_elastic_motion(grounded: bool) -> None:
    """Without its rigid-body motion, whose exponents are two zeros; natural frequencies weight only one of the two."""
    system = train(grounded=grounded)
    (basis,), (elastic_form,) = bases(system), elastic_forms(system)
    expected = np.sort_complex(np.linalg.eigvals(physical(system)))
    elastic = expected[np.abs(expected) > 1e-6]
    assert len(elastic) == basis.size == elastic_form.size == (6 if grounded else 4)
    for matrix, rate in (
        (basis.generator(LEVELS[None])[0], basis.rate[0]),
        (elastic_form.generators(LEVELS), elastic_form.rate),
    ):
        np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(matrix) * rate), elastic, atol=1e-13)


def test_an_undamped_rigid_body_mode_stays_out_and_a_damped_one_has_its_velocity() -> None:
    loose = train(grounded=False)
    (basis,) = bases(loose)
    assert basis.undamped_rigid.shape == (1, 3, 1)
    held = replace(loose, damping=loose.damping + np.diag([0.1, 0.0, 0.0]))
    (basis,) = bases(held)
    assert basis.undamped_rigid.shape == (1, 3, 0)
    assert basis.size == 5


def test_a_batch_is_flattened_row_by_row() -> None:
    system = train(np.arange(1.0, 7.0).reshape(2, 3))
    assert (train().rows, system.rows) == (1, 6)
    np.testing.assert_array_equal(system.flat(system.meshes[0].mean_stiffness), np.arange(1.0, 7.0))
    np.testing.assert_array_equal(system.flat(np.array([[1.0], [2.0]])), [1, 1, 1, 2, 2, 2])
    assert system.flat(MASS, 2).shape == (6, 3, 3)
    assert system.operating_points(np.array([1.0, 2.0])).shape == (6, 2)
    points = np.arange(12.0).reshape(6, 2)
    np.testing.assert_array_equal(system.operating_points(points), points)
