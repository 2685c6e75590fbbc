"""``methods.branches`` in a sweep: what the result holds, the figure, the jumps in ``info``, and what is refused."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from backlash_pairs import CASES, pair
from scenes import opened, ran, scene_text, succeeds, written

from gearstab import plots
from gearstab.bench.costs import branch_cost
from gearstab.config import load
from gearstab.errors import ResultError
from gearstab.info import result
from gearstab.info.result import jumps
from gearstab.results import open_result
from gearstab.results.display import in_display_units
from gearstab.results.export import export
from gearstab.results.read import branches_of
from gearstab.sweep import plan, run
from gearstab.sweep.compute import compute
from gearstab.sweep.storage.store import fits

SYSTEM = scene_text("branches_method_system")
CONFIG = scene_text("branches_method_config")


def configured(folder: Path, text: str) -> Path:
    path = written(folder, text, "branches.yaml")
    return path


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result of two systems, each in a block of its own, in two processes."""
    folder = tmp_path_factory.mktemp("branches")
    prepared = plan(load(configured(folder, CONFIG)))
    assert [block.shape for block in prepared.layout("branches").blocks()] == [(1,), (1,)]
    out = folder / "branches.h5"
    run(prepared, out, jobs=2)
    return out


@pytest.fixture(scope="module")
def tree(swept: Path) -> xr.DataTree:
    return opened(swept)


def test_the_result_holds_the_branches_of_every_system(tree: xr.DataTree) -> None:
    data = branches_of(tree)
    assert data["mesh_frequency"].dims == ("branch", "meshes.mesh.epsilon", "point")
    assert data["multipliers"].dims == ("branch", "meshes.mesh.epsilon", "point", "multiplier")
    assert data.sizes["branch"] == 1
    row = data.sel({"meshes.mesh.epsilon": 0.3}).isel(branch=0)
    assert (int(row["period"]), int(row["parent"])) == (1, -1)
    omega = row["mesh_frequency"].values
    there = np.isfinite(omega)
    assert ((row["stable"].values >= 0) == there).all()
    assert np.isfinite(omega[there]).all()
    assert np.isnan(omega[~there]).all()
    folds = np.sort(omega[row["event"].values == 1])
    known = [p["mesh_frequency"] for p in CASES[0]["special_points"] if 0.55 < p["mesh_frequency"] < 1]
    np.testing.assert_allclose(folds, np.sort(known), atol=1e-11)
    # Where a motion grazes, and the next lap misses the flank, the derivative has a kink, which is told as an error.
    assert (row["multiplier_error"].values[there & (row["event"].values != 4)] < 1e-8).all()
    assert (row["residual"].values[there] < 1e-11).all()
    largest = np.abs(row["multipliers"].values[:, 0])
    assert ((largest[there] < 1) == (row["stable"].values[there] == 1)).all()
    # The whole branch is one: ends at both ends of the range.
    status = row["status"].values[there]
    assert (status[0] & 1, status[-1] & 1) == (1, 1)


def test_branches_are_cut_with_xarray_beside_other_groups(tmp_path: Path) -> None:
    """The axis of the sweep and the mesh frequencies of motions have one name: neither is in the other's way."""
    methods = "  branches: {start: [linear], at: [1.3], points: 20}\n  floquet: {}\n"
    head = SYSTEM + "sweep: {mesh_frequency: {start: 1.2, stop: 1.4, num: 3}}\nmethods:\n"
    out = tmp_path / "two.h5"
    run(plan(load(configured(tmp_path, head + methods))), out, jobs=1)
    with xr.open_datatree(out, engine="h5netcdf") as found:
        data = found["branches"].to_dataset()
        first = data.isel(branch=0, point=slice(0, 2))["mesh_frequency"]
        assert first.dims == ("point",)
        assert float(first[0]) == 1.2
        assert found["branches"].isel(branch=0)["stable"].dims == ("point",)
        floquet = found["floquet"].to_dataset().sel(mesh_frequency=1.3, method="nearest")
        assert int(floquet["stable"]) == 1
        np.testing.assert_allclose(found["mesh_frequency"], [1.2, 1.3, 1.4])
        _, artists = plots.draw(found, "branches")
        assert artists["lines"]
        assert plots.draw(found, "curve")[1]


def test_a_table_has_a_row_for_every_motion(swept: Path, tree: xr.DataTree, tmp_path: Path) -> None:
    data = branches_of(tree)
    table = tmp_path / "table.csv"
    rows, (note,) = export(swept, table, io.BytesIO())
    read = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
    motions = data["stable"].values >= 0
    assert rows == len(read) == np.count_nonzero(motions)
    np.testing.assert_array_equal(read["mesh_frequency"], data["mesh_frequency"].values[motions])
    assert set(read["branch"]) == {0}
    assert "multipliers_real, multipliers_imag" in note
    rows, _ = export(swept, table, io.BytesIO(), over="branch,point,multiplier", select={"branch": "0"})
    read = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
    assert rows == 2 * np.count_nonzero(motions)
    own = read["multipliers_real"] + 1j * read["multipliers_imag"]
    np.testing.assert_array_equal(own, data["multipliers"].values[motions].ravel())


def test_a_killed_run_goes_on_where_it_was(tree: xr.DataTree, tmp_path: Path) -> None:
    """By SIGKILL, which no process can heed, with the branches of one system in a file and those of the next begun."""
    configured(tmp_path, CONFIG)
    soon = "from gearstab.sweep.storage import store; store.MOST_SECONDS = 0.0"
    code = f"{soon}; from gearstab.__main__ import main; main()"
    command = [sys.executable, "-c", code, "sweep", "branches.yaml", "-o", "out.h5", "-j", "1", "-q"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment)
    while not list((tmp_path / "out.h5.parts").rglob("*.part")):
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    assert process.wait() != 0
    assert not (tmp_path / "out.h5").exists()
    again = subprocess.run(command[:-1], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert "going on with 1 of 2 blocks" in again.stderr
    with open_result(tmp_path / "out.h5") as found:
        xr.testing.assert_identical(branches_of(found).load(), branches_of(tree))


def test_the_figure_has_dashes_marks_and_arrows(tree: xr.DataTree) -> None:
    assert plots.default_kind(tree, plots.Request()) == "branches"
    _, artists = plots.draw(tree, select={"meshes.mesh.epsilon": "0.3"})
    dashed = [line for line in artists["lines"] if line.get_linestyle() == "--"]
    solid = [line for line in artists["lines"] if line.get_linestyle() == "-"]
    assert (len(solid), len(dashed)) == (3, 2)
    folds, _ = artists["marks"]  # the second: grazing motions
    assert len(folds.get_xdata()) == 4
    data = branches_of(tree).sel({"meshes.mesh.epsilon": 0.3})
    jump, landing = data["jump"].values, data["landing_branch"].values
    assert len(artists["arrows"]) == np.count_nonzero((jump != 0) & (landing >= 0)) == 4
    # Unstable parts go from fold to fold.
    for line in dashed:
        ends = np.asarray(line.get_xdata(), dtype=float)[[0, -1]]
        assert set(ends) <= set(np.asarray(folds.get_xdata(), dtype=float))
    assert len(plots.draw(tree)[1]["lines"]) > len(artists["lines"])
    with pytest.raises(plots.PlotError, match="no variable 'event' along branches"):
        plots.draw(tree, "branches", variable="event")


def test_info_names_the_jumps(swept: Path) -> None:
    facts = result.describe(swept)
    rows = [jump for jump in facts["jumps"] if jump["at"]["meshes.mesh.epsilon"] == 0.3]
    assert [round(jump["value"], 4) for jump in rows] == [0.6164, 0.6828, 0.7586, 0.7915]
    assert [jump["direction"] for jump in rows] == ["falling", "falling", "rising", "rising"]
    assert rows[0]["after"] < rows[0]["before"]
    assert rows[-1]["after"] > rows[-1]["before"]
    text = result.report(facts)
    assert re.search(r"0\.791468 +rising", text)


def test_frequencies_typed_in_hertz_jump_in_hertz(tree: xr.DataTree) -> None:
    """Motions keep their mesh frequency in rad/s where the axis of the same name is shown in Hz."""
    axis = tree.coords["mesh_frequency"]
    typed = axis.assign_attrs(units="rad/s", display_units="Hz", display_scale=2 * np.pi)
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    groups["/"] = groups["/"].assign_coords(mesh_frequency=typed)
    shown = in_display_units(xr.DataTree.from_dict(groups))
    np.testing.assert_allclose(shown.coords["mesh_frequency"], axis / (2 * np.pi), rtol=1e-13)
    plain, found = jumps(tree), jumps(shown)
    assert {jump["unit"] for jump in found} == {"Hz"}
    expected = [jump["value"] / (2 * np.pi) for jump in plain]
    np.testing.assert_allclose([jump["value"] for jump in found], expected, rtol=1e-13)
    _, artists = plots.draw(shown, select={"meshes.mesh.epsilon": "0.3"})
    drawn = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in artists["lines"]])
    low, high = axis.values[[0, -1]] / (2 * np.pi)
    assert np.nanmin(drawn) >= low * (1 - 1e-12)
    assert np.nanmax(drawn) <= high * (1 + 1e-12)
    assert np.ptp(drawn) > 0.9 * (high - low)


def test_input_speeds_jump_in_rpm(tmp_path: Path) -> None:
    """An axis in rad/s of the input shaft is told in rpm: 20 teeth."""
    speed = xr.DataArray([10.0, 20.0], dims="input_speed", attrs={"units": "rad/s", "mesh_frequency_factor": 20.0})
    root = xr.Dataset(coords={"input_speed": speed})
    group = xr.Dataset({
        "jump": (("branch", "point"), [[0, 1]]),
        "landing_branch": (("branch", "point"), [[-1, -1]]), "landing_point": (("branch", "point"), [[-1, -1]]),
        "mesh_frequency": (("branch", "point"), [[300.0, 314.159265358979]]),
        "transmission_error_rms": (("branch", "point", "mesh"), [[[1.0], [2.0]]], {"units": "m"}),
    }, coords={"mesh": ["first"]})  # fmt: skip
    (found,) = jumps(xr.DataTree.from_dict({"/": root, "branches": group}))
    assert found["value"] == pytest.approx(150.0)
    assert (found["unit"], found["direction"], found["after"]) == ("rpm", "rising", None)


OVER = scene_text("branches_method_over")


def test_branches_along_another_axis(tmp_path: Path) -> None:
    """Stiffness k and load F = 0.5 k: the pair at the mesh frequency 1.3/sqrt(k), with folds where that is one of its.

    Modes change along the axis, so that states must be brought to those of one system.
    """
    text = SYSTEM.replace("load: [0.5]", "load: [1.0]").replace("backlash: 2.0", "backlash: 4.0") + OVER
    out = tmp_path / "over.h5"
    run(plan(load(configured(tmp_path, text))), out, jobs=1)
    found = opened(out)
    data = branches_of(found)
    assert data["branch_value"].dims == ("mesh_frequency", "branch", "point")
    folds = np.sort(data["branch_value"].values[data["event"].values == 1])
    known = np.array([p["mesh_frequency"] for p in CASES[0]["special_points"] if p["kind"] == "fold"])
    expected = np.sort((1.3 / known) ** 2)
    np.testing.assert_allclose(folds, expected[(expected > 2) & (expected < 4)], rtol=1e-10)
    there = data["stable"].values >= 0
    assert (data["multiplier_error"].values[there & (data["event"].values != 4)] < 1e-8).all()
    _, artists = plots.draw(found)
    marks = artists["marks"][0]  # folds; grazing motions follow
    np.testing.assert_allclose(np.sort(np.asarray(marks.get_xdata(), dtype=float)), folds)
    jumps_found = result.describe(out)["jumps"]
    assert {jump["of"] for jump in jumps_found} == {"scaled"}
    # One leads out of the range.
    assert len(artists["arrows"]) == sum(jump["after"] is not None for jump in jumps_found) == len(jumps_found) - 1


def test_bench_measures_branches() -> None:
    cost = branch_cost(pair(CASES[0]), 0.6, 0.8, points=40, cycles=100)
    assert 0 < cost.motions <= 40
    assert cost.along > 0
    assert cost.on > 0
    assert f"branches: {cost.motions} motions" in cost.text(100)


@pytest.mark.parametrize(
    "text", [CONFIG.replace("start: 0.55", "start: 0.95"), SYSTEM + OVER.replace("start: 2.0", "start: 3.9")]
)
def test_finished_blocks_are_taken_up_again(tmp_path: Path, text: str) -> None:
    """Finished blocks of an interrupted sweep count: its parts hold what they may, where nothing is too."""
    prepared = plan(load(configured(tmp_path, text)))
    block = next(prepared.layout("branches").blocks())
    assert fits(prepared, block, compute(prepared, block))


@pytest.mark.parametrize("options", ["{}", "{start: [linear], period_doubling: follow, points: 2000}"])
def test_the_keys_and_the_variables_of_users(tmp_path: Path, options: str) -> None:
    """Read by h5py and xarray alone: names, dimensions, meanings of events, one period of every branch."""
    head = SYSTEM + "\nsweep: {mesh_frequency: {start: 1.2, stop: 2.4, num: 3}}\nmethods:\n"
    out = tmp_path / "branches.h5"
    run(plan(load(configured(tmp_path, f"{head}  branches: {options}\n"))), out, jobs=1)
    with xr.open_dataset(out, group="branches", engine="h5netcdf") as data, h5py.File(out) as file:
        plain = file["branches"]
        names = ("mesh_frequency", "amplitude_rms", "amplitude_peak", "stable", "multiplier_error", "event")
        assert {data[name].dims for name in names} == {("branch", "point")}
        assert data["multipliers"].dims == ("branch", "point", "multiplier")
        assert data["period"].dims == ("branch",)
        meanings = data["event"].attrs["flag_meanings"].split()
        assert meanings[:5] == ["none", "fold", "period_doubling", "neimark_sacker", "grazing"]
        there = np.isfinite(plain["mesh_frequency"][...])
        largest = np.abs(plain["multipliers"][...]).max(axis=-1)
        assert ((largest[there] < 1) == (plain["stable"][...][there] == 1)).all()
        assert (plain["amplitude_peak"][...] > plain["amplitude_rms"][...])[there].all()
        # The doubling at 1.83 is known; doubled branches repeat themselves every second cycle, and starts find some.
        first = np.flatnonzero(data["event"].values[0] == 2)
        np.testing.assert_allclose(
            np.sort(data["mesh_frequency"].values[0, first]), [1.8314512309, 2.1555813535], atol=1e-9
        )
        if "follow" in options:
            assert 2 in data["period"].values


def test_branches_of_an_older_layout_are_refused() -> None:
    group = xr.Dataset({"branch_frequency": ("point", [1.0]), "kind": ("point", [0])})
    with pytest.raises(ResultError, match="run the sweep again"):
        branches_of(xr.DataTree.from_dict({"/": xr.Dataset(), "branches": group}))


def test_motions_on_branches_are_counted_without_what_is_behind_their_ends(swept: Path) -> None:
    # Their mesh frequencies have the name of an axis of the sweep, over other dimensions.
    told = json.loads(ran("info", swept, "--json").stdout)["outcome"]
    with h5py.File(swept) as file:
        stable = file["branches/stable"][:]
    assert (stable == -1).any()
    assert (told["points"], told["unstable"], told["failed"]) == (np.sum(stable >= 0), np.sum(stable == 0), 0)


def test_complex_values_of_branches_are_compared(swept: Path, tmp_path: Path) -> None:
    succeeds("diff", swept, swept)
    other = tmp_path / "other.h5"
    shutil.copy(swept, other)
    with h5py.File(other, "r+") as file:
        values = file["branches/multipliers"]
        size = np.nanmax(np.abs(values[:]))
        values[...] = values[:] + 0.5j * size
    told = json.loads(ran("diff", swept, other, "--json").stdout)
    differing = {name: value for name, value in told["variables"].items() if value != 0}
    with h5py.File(other) as file:
        largest = np.nanmax(np.abs(file["branches/multipliers"][:]))
    assert differing == {"/branches/multipliers": pytest.approx(0.5 * size / largest, rel=1e-12)}
