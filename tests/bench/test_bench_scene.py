"""Scenes of the benchmark: systems without their rigid-body modes."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gearstab.bench import without_rigid_modes
from gearstab.floquet import solve
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build


def train(k0: float, **damping: object) -> GearSystem:
    first = {"name": "first", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.4}
    second = {"name": "second", "mean_stiffness": 1.2, "epsilon": 0.2, "contact_ratio": 1.7, "phasing": 0.2}
    meshes = [first, second | {"damping": 0.01}]
    parameters = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": k0, "meshes": meshes}
    return build(parameters | {"tooth_ratio": Fraction(1)} | damping)


@pytest.mark.parametrize("damping", [{}, {"damping_ratio": 0.01}])
def test_stability_is_that_of_the_whole_system(damping: dict[str, float]) -> None:
    whole = train(0.0, **damping)
    elastic = without_rigid_modes(whole)
    assert elastic.size == whole.size - 1
    omega = np.linspace(0.5, 7.0, 200)
    # The same exponents from matrices of another size: rounding of two products, a few 1e-14.
    np.testing.assert_allclose(solve(elastic, omega).growth_rate, solve(whole, omega).growth_rate, atol=1e-12)
    frequency = mean_modes(whole).natural_frequency
    np.testing.assert_allclose(mean_modes(elastic).natural_frequency, frequency[1:], rtol=1e-13)


def test_a_system_without_rigid_modes_stays_as_it_is() -> None:
    whole = train(0.5)
    assert without_rigid_modes(whole) is whole


def test_rigid_modes_stay_where_damping_couples_them() -> None:
    whole = replace(train(0.0), damping=np.diag([0.1, 0.0, 0.0]))
    assert without_rigid_modes(whole) is whole
