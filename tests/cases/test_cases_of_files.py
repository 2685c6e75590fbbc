"""Cases whose stiffness or matrices lie in a file: units and names of a header, matrices of bearings."""

from pathlib import Path

import numpy as np
import pytest
from scenes import ROOT
from scipy.io import savemat

import gearstab as gs
from gearstab.config import ConfigError

CASES = ROOT / "tests" / "cases"


def case(folder: Path, name: str) -> Path:
    """Return a copy of a case, which finds its files in the folder."""
    copy = folder / f"{name}.yaml"
    copy.write_text((CASES / copy.name).read_text())
    return copy


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """Return a folder with a measured stiffness, as fractions and N/m and with other units in the header."""
    random = np.random.default_rng(5)
    degrees = np.arange(720) * 0.5
    phase = degrees / 360

    def rise(x: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-x / 0.015))

    pairs = rise(phase) * (1 - rise(phase - 0.6)) + rise(phase - 1.0)
    smooth = 1.5e8 + 0.9e8 * pairs + 0.1e8 * np.sin(2 * np.pi * phase)
    stiffness = smooth * (1 + 0.01 * random.standard_normal(720))
    (tmp_path / "k").mkdir()
    for name, header, columns in (
        ("frac", "phase,stiffness", [phase, stiffness]),
        ("units", "phase [-],stiffness [N/um]", [phase, stiffness * 1e-6]),
    ):
        rows = np.column_stack(columns)
        np.savetxt(tmp_path / f"k/{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.10g")
    return tmp_path


def test_a_measured_stiffness_and_the_same_in_other_units(measured: Path) -> None:
    plain, scaled = (gs.build(gs.load(case(measured, name))) for name in ("b03_measured_k", "b03u_header_units"))
    # The mode is at 24140 rad/s, in four digits.
    assert np.sqrt(plain.meshes[0].mean_stiffness / 0.35) == pytest.approx(24140, abs=0.5)
    # Both files have ten digits.
    np.testing.assert_allclose(scaled.meshes[0].waveform.stiffness, plain.meshes[0].waveform.stiffness, rtol=1e-9)
    assert scaled.meshes[0].amplitude == pytest.approx(float(plain.meshes[0].amplitude), rel=1e-9)


def test_regions_of_a_measured_stiffness(measured: Path) -> None:
    found = gs.boundaries(case(measured, "b03u_header_units"), 2 * np.pi * 6500, 2 * np.pi * 9000)
    assert found.label.tolist() == ["2w1"]
    # Growth beside these edges was checked by Runge-Kutta to 2e-13.
    edges = found.boundary_frequency[0] / (2 * np.pi)
    np.testing.assert_allclose(edges, [7091.25402851, 8258.98923789], rtol=1e-6)


def test_a_header_of_other_columns_is_one_line(tmp_path: Path) -> None:
    pitch = 2 * np.pi / 19
    rows = [f"{angle:.6f},{1e8 * (1.6 + 0.6 * (angle < pitch / 2))}" for angle in np.arange(40) / 40 * pitch]
    (tmp_path / "k_rad.csv").write_text("\n".join(["angle_rad,k_N_per_m", *rows]))
    with pytest.raises(ConfigError) as caught:
        gs.load(case(tmp_path, "b1_csv_in_rad"))
    (problem,) = caught.value.problems
    assert problem.path == "system.meshes.0.waveform.file"
    assert 'the header "angle_rad, k_N_per_m" names no column phase and stiffness' in problem.message
    assert "a phase is a fraction of the mesh period" in problem.hint


def test_two_rotors_on_journal_bearings(tmp_path: Path) -> None:
    size = 40
    mass, stiffness = np.diag(np.r_[np.full(20, 2.0), np.full(20, 5.0)]), np.zeros((size, size))
    for start, value in ((0, 2e8), (20, 4e8)):
        for k in range(start, start + 18):
            stiffness[np.ix_([k, k + 2], [k, k + 2])] += value * np.array([[1, -1], [-1, 1]])
    damping = 1e-5 * stiffness
    for k in range(0, size, 2):
        damping[k, k + 1], damping[k + 1, k] = damping[k, k + 1] + 3.0, damping[k + 1, k] - 3.0
    for k in (2, 16, 22, 36):
        stiffness[k : k + 2, k : k + 2] += [[8e7, 4e7], [-6e7, 1.2e8]]
        damping[k : k + 2, k : k + 2] += [[2e4, 3e3], [3e3, 3e4]]
    savemat(tmp_path / "rotor.mat", {"M": mass, "C": damping, "K": stiffness})
    system = gs.build(case(tmp_path, "d3_mat_file"), {"meshes.mesh.epsilon": [0.0]})
    g = np.zeros(size)
    g[[8, 9, 28, 29]] = 0.342, 0.940, -0.342, -0.940
    # At constant stiffness the growth is that of the whole unsymmetric matrices, by another solver.
    inverse = np.diag(1 / np.diag(mass))
    whole = stiffness + 3e8 * np.outer(g, g)
    state = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ whole, -inverse @ damping]])
    found = gs.floquet(system, 2 * np.pi * 500.0).growth_rate
    assert system.size == size
    assert len(system.terms) == 48
    assert float(np.ravel(found)[0]) == pytest.approx(np.linalg.eigvals(state).real.max(), rel=1e-6)
