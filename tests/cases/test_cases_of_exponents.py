"""Exponents of a free geared shaft line of finite elements whose damping follows the stiffness."""

from __future__ import annotations

import resource
import time
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg

import gearstab as gs

CASE = Path(__file__).parent / "b04_fe_free_rayleigh.yaml"


def shaft(count: int, inertia: float, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    mass, spring = np.zeros((2, count + 1, count + 1))
    for e in range(count):
        mass[e : e + 2, e : e + 2] += inertia / 6 * np.array([[2, 1], [1, 2]])
        spring[e : e + 2, e : e + 2] += stiffness * np.array([[1, -1], [-1, 1]])
    return mass, spring


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """The configuration with its matrices, which the case was written with."""
    (first, k1), (second, k2) = shaft(60, 2e-5, 4e6), shaft(60, 9e-5, 1.5e7)
    first[0, 0] += 0.8
    first[60, 60] += 2e-3
    second[0, 0] += 0.03
    second[60, 60] += 3.0
    scipy.io.mmwrite(tmp_path / "M04.mtx", scipy.linalg.block_diag(first, second), precision=17)
    scipy.io.mmwrite(tmp_path / "K04.mtx", scipy.linalg.block_diag(k1, k2), precision=17)
    (tmp_path / CASE.name).write_text(CASE.read_text())
    return tmp_path / CASE.name


@pytest.mark.slow
def test_exponents_of_122_coordinates(case: Path) -> None:
    start = time.process_time()
    found = gs.sweep(gs.load(case), jobs=1)["floquet"]
    # Less than 2 s for each of the points, where the periodic QR took 4 to 28 s.
    assert time.process_time() - start < 10
    # Its chain of factors held 9 GB.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2e6
    growth = [-0.0101061797, -0.00903544222, -0.00965797448, -0.0397249059, 0.00074281997]
    np.testing.assert_allclose(found["growth_rate"], growth, rtol=0, atol=2e-7)
    # Liouville: the exponents add up to the trace of -M^-1 C, of the damping of the mean stiffness.
    mass, stiffness = (scipy.io.mmread(case.parent / name) for name in ("M04.mtx", "K04.mtx"))
    gauge = np.zeros(122)
    gauge[[60, 61]] = 0.045, -0.115
    stiffness += 3e8 * np.outer(gauge, gauge)
    trace = -2e-7 * np.trace(np.linalg.solve(mass, stiffness))
    np.testing.assert_allclose(found["exponent_real"].sum("exponent"), trace, rtol=1e-10)
