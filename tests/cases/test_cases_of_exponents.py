"""Exponents of a free geared shaft line of finite elements whose damping follows the stiffness."""

import resource
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg

import gearstab as gs
from gearstab.floquet import solve
from gearstab.floquet.kernel import factors, levels
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

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


def test_every_speed_takes_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of a coarser line: between 691 and 864 rad/s windows of neighbouring multipliers end at close pairs."""
    (first, k1), (second, k2) = shaft(17, 2e-5, 1.3e6), shaft(17, 9e-5, 5e6)
    first[0, 0] += 0.8
    first[17, 17] += 2e-3
    second[0, 0] += 0.03
    second[17, 17] += 3.0
    gauge = np.zeros(36)
    gauge[[17, 18]] = 0.045, -0.115
    stiffness = scipy.linalg.block_diag(k1, k2)
    damping = 2e-7 * (stiffness + 3e8 * np.outer(gauge, gauge))
    mesh = Mesh("mesh", gauge, 3e8, 0.25, Rectangular(1.62))
    system = GearSystem(scipy.linalg.block_diag(first, second), stiffness, (mesh,), damping)
    omega, long = np.linspace(690.0, 865.0, 36), []
    chains = factors.chains

    def followed(wide: np.ndarray, segments: int, size: int) -> Iterator[tuple[int, np.ndarray]]:
        long.extend(omega[wide[0]] if wide.shape[1] == len(omega) else ())
        return chains(wide, segments, size)

    monkeypatch.setattr(factors, "chains", followed)
    found = solve(system, omega, exponents=True).exponents
    assert found is not None
    assert long == []
    monkeypatch.setattr(levels, "log_multipliers", lambda pattern, generator, row, omega: np.nan)
    # The periodic QR algorithm, right to 1e-14 times its number of factors; windows are right to 1e-9 each.
    expected = solve(system, omega[8:9], exponents=True).exponents
    assert expected is not None
    np.testing.assert_allclose(np.sort(found[0, 8].real), np.sort(expected[0, 0].real), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_exponents_of_122_coordinates(case: Path) -> None:
    start = time.process_time()
    found = gs.sweep(gs.load(case), jobs=1)["floquet"]
    # 0.1 s for each of the points, where the periodic QR took 4 to 28 s.
    assert time.process_time() - start < 5
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
