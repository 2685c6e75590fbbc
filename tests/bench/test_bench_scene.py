"""Scenes of the benchmark: systems without their rigid-body modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
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


def test_a_system_without_rigid_modes_stays_as_it_is() -> None:
    whole = train(input_shaft_stiffness=0.5)
    assert without_rigid_modes(whole) is whole


def test_rigid_modes_stay_where_damping_couples_them() -> None:
    whole = replace(train(), damping=np.diag([0.1, 0.0, 0.0]))
    assert without_rigid_modes(whole) is whole
