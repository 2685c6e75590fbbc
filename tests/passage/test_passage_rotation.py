"""Run-ups and tolerances of systems with matrices that act with a speed of rotation."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import integrated_along, train

import gearstab as gs
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.passage.propagator import growth, motion
from gearstab.propagation.path import Path
from gearstab.rotation import Rotation
from gearstab.systems import build

GYROSCOPIC = np.array([[0.0, 0.6, -0.2], [-0.6, 0.0, 0.4], [0.2, -0.4, 0.0]])


def test_exact_growth_is_that_of_integration() -> None:
    # A quick ramp: the Euler force takes 0.028 away.
    turning = Rotation(
        Fraction(-1, 2), gyroscopic=GYROSCOPIC, circulatory=0 * GYROSCOPIC, centripetal=-0.03 * np.eye(3)
    )
    system, path = replace(train().undriven(), rotations=(turning,)), Path.ramp(1.2, 2.4, 0.05)
    expected = integrated_along(system, path, np.array([0.0, path.time[-1]]), np.eye(6))[-1]
    weight = np.zeros((6, 6))
    weight[:3, :3] = np.linalg.cholesky(system.mean_stiffness_matrix()).T
    weight[3:, 3:] = np.linalg.cholesky(system.mass).T
    through = float(np.log(np.linalg.norm(weight @ expected @ np.linalg.inv(weight), 2)))
    # Magnus steps work to about 1e-9.
    assert growth(motion(system), path).through == pytest.approx(through, abs=1e-7)


def test_the_rate_changes_at_the_knots_of_a_path() -> None:
    turning = Rotation(Fraction(-1, 2), gyroscopic=GYROSCOPIC)
    system = replace(train().undriven(), rotations=(turning,))
    bent = Path(np.array([0.0, 3.3, 7.1]), np.array([1.2, 1.9, 1.5]))
    whole = growth(motion(system), bent).through
    fine = Path(np.linspace(0.0, 7.1, 72), np.interp(np.linspace(0.0, 7.1, 72), bent.time, bent.mesh_frequency))
    # 3.3 and 7.1 are among the knots of the other one, whose rates are the same.
    assert growth(motion(system), fine).through == pytest.approx(whole, abs=1e-7)


SYSTEM = {
    "kind": "matrices",
    "mass": [[1, 0], [0, 1]],
    "stiffness": [[1, 0], [0, 1.6]],
    "damping_ratio": 0.002,
    "rotation": {"speed_ratio": "1/8", "gyroscopic": [[0, -2], [2, 0]], "centripetal": [[-1, 0], [0, -1]]},
    "meshes": [{"name": "mesh", "direction": [0.8, 0.6], "mean_stiffness": 1.0, "epsilon": 0.1, "contact_ratio": 1.45}],
}
SWEEP = {"mesh_frequency": {"start": 3.4, "stop": 3.9, "num": 6}}


def test_a_slow_passage_gains_the_integral_of_the_growth_rate() -> None:
    found = gs.sweep(load({"system": SYSTEM, "sweep": SWEEP, "methods": {"passage": {"rate": 2e-4}}}), jobs=1)[
        "passage"
    ]
    gained = float(np.ravel(found["growth"])[0])
    omega = np.linspace(3.4, 3.9, 2001)
    rate = solve(build(load({"system": SYSTEM}).system), omega)
    integral = np.trapezoid(np.maximum(rate.growth_rate[0], 0.0), omega) / 2e-4
    # The trapezoidal rule is off by the roots at both edges.
    assert gained == pytest.approx(integral, rel=1e-3)
    assert abs(float(np.ravel(found["growth_exact"])[0]) - gained) <= float(np.ravel(found["growth_error"])[0])


def test_tolerances_are_those_of_samples() -> None:
    parameters = {"meshes.0.epsilon": {"uniform": [0.02, 0.2]}}
    options = {"samples": 64, "sobol": False, "parameters": parameters}
    whole = {"system": SYSTEM, "sweep": SWEEP, "methods": {"tolerance": options, "floquet": {}}}
    found = gs.sweep(load(whole), jobs=1)
    wide, narrow = (
        solve(build(load({"system": SYSTEM | {"meshes": [SYSTEM["meshes"][0] | {"epsilon": e}]}}).system),
              np.linspace(3.4, 3.9, 6)).stable[0]
        for e in (0.2, 0.02)
    )  # fmt: skip
    probability = np.ravel(found["tolerance"]["probability"])
    assert np.all(probability[wide == 1] == 0)
    assert np.all(probability[narrow == 0] == 1)
    assert np.any((probability > 0.1) & (probability < 0.9))
