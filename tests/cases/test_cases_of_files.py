"""Cases whose stiffness or matrices lie in a file: units and names of a header, matrices of bearings."""

from __future__ import annotations

import runpy
import time
from pathlib import Path

import numpy as np
import pytest
from scenes import ROOT, ran, succeeds
from scipy.io import savemat

import gearstab as gs
from gearstab import ckernel
from gearstab.config import ConfigError, load
from gearstab.errors import DoubtWarning
from gearstab.floquet.frequencies import chosen
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.sweep import forecast, plan
from gearstab.sweep.compute import compute

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


# --- sweeps that take long: what is foretold, and the cheaper way for two measured meshes


@pytest.fixture
def two_measured(tmp_path: Path) -> Path:
    """The configuration of two measured meshes with its files, noisy samples of a smooth stiffness."""

    def rise(z: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-z / 0.015))

    generator, phase = np.random.default_rng(5), np.arange(720) / 720
    level = rise(phase) * (1 - rise(phase - 0.6)) + rise(phase - 1.0)
    values = (1.5e8 + 0.9e8 * level + 0.1e8 * np.sin(2 * np.pi * phase)) * (1 + 0.01 * generator.standard_normal(720))
    generator.permutation(720)
    few = np.unique(np.r_[0, np.sort(generator.choice(720, 200, replace=False))])
    (tmp_path / "k").mkdir()
    for name, kept in (("frac", np.arange(720)), ("nonuni", few)):
        table = np.c_[phase[kept], values[kept]]
        np.savetxt(tmp_path / "k" / f"{name}.csv", table, "%.10g", ",", header="phase,stiffness", comments="")
    (tmp_path / "b22.yaml").write_text((CASES / "b22_long_sampled.yaml").read_text())
    return tmp_path / "b22.yaml"


def test_auto_takes_the_cheaper_way(two_measured: Path) -> None:
    # A common period of 37 cycles has 26,397 exponentials; the window of a Lyapunov exponent as many for each of the
    # 500/0.62 = 804 cycles of its own.
    strategy = chosen(plan(load(two_measured)).base, "auto")
    assert strategy.name == "common_period"
    assert strategy.period is not None
    assert strategy.period.segments > strategy.affordable


@pytest.mark.slow
def test_two_measured_meshes(two_measured: Path) -> None:
    found = gs.sweep(gs.load(two_measured, {"sweep.mesh_frequency": ["2500 Hz", "7600 Hz"]}), jobs=1)
    # An independent Magnus integration of fourth order on 47,961 pieces.
    np.testing.assert_allclose(found["floquet"]["growth_rate"], [-45.58037156, -41.4684575], rtol=0, atol=1e-6)


LONG = [
    "a4_steady_state_never_ends", "a7_dry_run_too_low", "dry_run_estimate", "slow_gearbox", "slow_terms_8dof",
    "singular_R999_plain",
]  # fmt: skip


@pytest.mark.parametrize("name", LONG)
def test_no_time_is_told_that_no_sample_bears_out(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing ends in time, and a kernel that looks stops it."""
    planned = plan(load(CASES / f"{name}.yaml", (), needs=("sweep", "methods")))
    start = time.thread_time()
    found = forecast.estimate(planned, 1, budget=0.05)
    # Samples look at the clock every 0.05 s of a call; what is built before is no part of them.
    assert time.thread_time() - start < 5
    for method in found.methods:
        assert (method.seconds is None) == method.time.startswith("not known (a sample took more than ")
        assert method.seconds is None or method.seconds > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dry_run_estimate", "slow_gearbox", "slow_terms_8dof", "a7_dry_run_too_low"])
def test_a_time_that_is_told_is_right_within_a_factor_of_three(name: str) -> None:
    planned = plan(load(CASES / f"{name}.yaml", (), needs=("sweep", "methods")))
    told = {method.name: method.seconds for method in forecast.estimate(planned, 1).methods}
    with ckernel.using(threads=1):
        for layout in planned.layouts:
            seconds = told[layout.method.name]
            if seconds is None or seconds < 0.1:
                continue
            start = time.thread_time()
            for block in layout.blocks():
                compute(planned, block)
            assert 1 / 3 < (time.thread_time() - start) / seconds < 3, layout.method.name


# --- an override of a parameter that the sweep sets anyway is said in one line


CASE = ROOT / "tests" / "cases" / "e1_axis_and_set.yaml"
TIE = "{targets: [epsilon, damping_ratio], values: [0.1, 0.2]}"
ALL, SOME = "[{epsilon: 0.1}, {epsilon: 0.2}]", "[{epsilon: 0.1}, {contact_ratio: 1.5}]"


def test_the_axis_wins_and_says_so() -> None:
    found = succeeds("check", CASE, "--set", "epsilon=0.2")
    assert found.stderr.splitlines() == [
        "warning: --set epsilon: system.meshes.0.epsilon: has no effect on the sweep, whose axis epsilon sets it "
        "(got 0.2); set sweep.epsilon instead"
    ]
    found = ran("check", CASE, "--set", "sweep.epsilon=[0.2]", "--set", "damping_ratio=0.03")
    assert (found.exit_code, found.stderr) == (0, "")


def test_from_python() -> None:
    with pytest.warns(DoubtWarning, match="override epsilon: .* has no effect on the sweep"):
        gs.load(CASE, epsilon=0.2)


@pytest.mark.parametrize(
    ("axis", "name", "without"),
    [
        (TIE, "epsilon", True),
        (TIE, "damping_ratio", True),
        (TIE, "contact_ratio", False),
        (ALL, "meshes.0.epsilon", True),
        (SOME, "epsilon", False),  # the value of the second case
        (SOME, "contact_ratio", False),
    ],
)
def test_ties_and_cases(axis: str, name: str, without: bool) -> None:
    sweep = f"sweep={{mesh_frequency: [1, 2], together: {axis}}}"
    for overrides in ([sweep, f"{name}=0.05"], [f"{name}=0.05", sweep]):
        if name == "contact_ratio":
            overrides = [text.replace("0.05", "1.3") for text in overrides]
        found = [problem.path for problem in load(CASE, overrides).doubts if problem.code == "set_twice"]
        assert len(found) == without
        assert not found or found[0].endswith(name)


def test_a_section_gives_base_values_as_a_file_does() -> None:
    mesh = "meshes=[{mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.15}]"
    assert load(CASE, [mesh, "sweep.epsilon={start: 0, stop: 0.3, num: 3}"]).doubts == ()


# --- results held in memory, written by other programs, or with nothing in them


def test_d2_a_result_that_xarray_saved_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(CASES / "d2_to_netcdf.py"))
    for words in (["info", "pair.nc"], ["plot", "pair.nc"], ["export", "pair.nc", "-o", "pair.csv"]):
        done = ran(*words)
        assert (done.exit_code, "ResultError" in done.output) == (0, False), done.output
    # 21 mesh frequencies and three values of epsilon, with a line of names.
    assert len((tmp_path / "pair.csv").read_text().splitlines()) == 64
    assert (tmp_path / "pair.png").read_bytes().startswith(b"\x89PNG")


def test_a2_the_diagram_of_a_sweep_without_a_region_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "a2.h5"
    succeeds("sweep", CASES / "a2_campbell_no_region.yaml", "-o", out, "-q")
    with open_result(out) as tree:
        assert tree["boundaries"].sizes["tongue"] == 0
        (panel,) = draw(tree, "campbell", dpi=50)[1]["panels"]
    # The natural frequency at 1 and three orders that meet it, with nothing that grows.
    assert [line.get_ydata()[0] for line in panel["modes"]] == [pytest.approx(1.0, abs=1e-12)]
    assert len(panel["orders"]) >= 3
    assert not any(mark for mark in panel["regions"].values())
    assert panel["bands"] is None


def test_plot_zero_size_a_run_that_turns_back_at_once_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "pair.h5"
    succeeds("respond", CASES / "plot_zero_size.yaml", "-o", out)
    succeeds("plot", out, "-o", tmp_path / "pair.png")
    with open_result(out) as tree:
        assert (np.diff(tree["response"]["cycle"]) < 0).all()
        _, artists = draw(tree, dpi=50)
        assert artists["deflection"] is not None
        samples = tree["response"].sizes["time"]
        assert len(artists["deflection"].get_xdata()) == samples == 126
