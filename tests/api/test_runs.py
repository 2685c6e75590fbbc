"""Sweeps and responses in memory are what the commands write, and leave nothing behind."""

from __future__ import annotations

import inspect
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sweep_faults
import xarray as xr
from scenes import CONFIGS, ROOT, scene_text, succeeds, written

import gearstab as gs
from gearstab.api import runs
from gearstab.errors import DoubtWarning, PlotError, RequestError
from gearstab.results import open_result
from gearstab.sweep import Reporter, forecast, plan
from gearstab.sweep.forecast import estimate
from gearstab.sweep.progress import Bar

SWEPT = scene_text("runs_swept")
OF_THE_RUN = {"created", "config_file"}
"""Attributes that tell two runs apart."""


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, and the current one."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.chdir(folder)
    return folder


def same(one: xr.DataTree, other: xr.DataTree) -> None:
    """Equal groups, variables, values, types and attributes."""
    assert one.groups == other.groups
    for path in one.groups:
        mine, theirs = one[path].to_dataset(inherit=False), other[path].to_dataset(inherit=False)
        xr.testing.assert_equal(mine, theirs)
        types = [{name: v.dtype for name, v in group.variables.items()} for group in (mine, theirs)]
        assert types[0] == types[1]
        for name, variable in mine.variables.items():
            assert str(variable.attrs) == str(theirs[name].attrs)
        assert {k: v for k, v in mine.attrs.items() if k not in OF_THE_RUN}.keys() == theirs.attrs.keys() - OF_THE_RUN
        for key in mine.attrs.keys() - OF_THE_RUN:
            assert np.array_equal(mine.attrs[key], theirs.attrs[key]), key


def test_a_sweep_is_the_file_of_the_command(tmp_path: Path, empty: Path) -> None:
    config = written(tmp_path, SWEPT)
    succeeds("sweep", config, "-o", tmp_path / "out.h5", "--set", "meshes.second.contact_ratio=1.4")
    tree = gs.sweep(gs.load(config, {"meshes.second.contact_ratio": 1.4}), jobs=1)
    with open_result(tmp_path / "out.h5") as file:
        same(tree, file)
    assert Path(tree.attrs["config_file"]) == Path("../case.yaml")
    assert list(empty.iterdir()) == []


def test_a_response_is_the_file_of_the_command(tmp_path: Path, empty: Path) -> None:
    config = CONFIGS / "oh_grosh_barber_2005" / "fig4a.yaml"
    few = {"respond.cycles": 3}
    succeeds("respond", config, "-o", tmp_path / "out.h5", "--set", "respond.cycles=3")
    tree = gs.respond(gs.load(config, few))
    with open_result(tmp_path / "out.h5") as file:
        same(tree, file)
    assert list(empty.iterdir()) == []


def test_a_design_is_the_file_of_the_command(tmp_path: Path, empty: Path) -> None:
    wanted = {"range": {"mesh_frequency": [1.5, 2.5]}, "variables": {"contact_ratio": {"values": [1.5, 1.8]}}}
    pair = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0}
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    wanted |= {"minimise": "instability_width"}
    data = {"title": "A pair", "system": pair | {"meshes": [mesh]}, "design": wanted}
    config = written(tmp_path, json.dumps(data))
    succeeds("design", config, "-o", tmp_path / "out.h5")
    tree = gs.design(config)
    with open_result(tmp_path / "out.h5") as file:
        same(tree, file)
    # sin(0.8 pi) is less than sin(0.5 pi): the region at 2 w1 shrinks with the first harmonic.
    assert tree["design"]["optimum"].item() == 1.8


def test_data_are_as_good_as_a_file(tmp_path: Path) -> None:
    config = written(tmp_path, SWEPT)
    data = gs.load(config).document.data
    data["sweep"]["mesh_frequency"] = np.linspace(4.0, 6.0, 7)
    tree = gs.sweep(data)
    assert "config_file" not in tree.attrs
    xr.testing.assert_equal(tree["floquet"].to_dataset(), gs.sweep(config)["floquet"].to_dataset())


def test_a_large_sweep_is_not_begun_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = gs.load(written(tmp_path, SWEPT), {"sweep.epsilon": [0.1], "methods.boundaries": None})
    monkeypatch.setattr(forecast, "MOST_POINTS", 13)
    with pytest.raises(RequestError, match=r"^the sweep is large: 14 points; pass confirmed=True to begin it$"):
        gs.sweep(config)
    assert gs.sweep(config, confirmed=True)["floquet"]["stable"].size == 14


def test_a_range_that_takes_nothing_is_estimated(tmp_path: Path) -> None:
    """No multipliers meet between mesh frequencies so close: the account of the search is zero."""
    text = SWEPT.replace("start: 4.0, stop: 6.0", "start: 5.9, stop: 6.0").replace("floquet: {exponents: true}, ", "")
    found = estimate(plan(gs.load(written(tmp_path, text), {"sweep.epsilon": np.arange(200) / 2000})))
    assert found.seconds > 0


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs signals of POSIX")
def test_an_interrupt_is_one_of_python_and_ends_all_processes(tmp_path: Path) -> None:
    folder = tmp_path / "told"
    folder.mkdir()
    (folder / "hold").write_text("3")
    config = written(tmp_path, sweep_faults.CONFIG)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    command = [sys.executable, str(ROOT / "tests/reference/sweep_faults.py"), str(config), "memory", "2", str(folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": str(temporary)}
    process = subprocess.Popen(
        command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    while not (folder / "log").exists() or len((folder / "log").read_text().split()) < 4:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said.splitlines()[-1:]) == (130, ["KeyboardInterrupt"]), said
    workers = {int(pid) for pid in (folder / "processes").read_text().split()} - {process.pid}
    assert len(workers) == 2
    for pid in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    assert [path for path in temporary.iterdir() if path.name.startswith("gearstab")] == []


def test_who_sees_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(runs.reporter(True), Bar)
    assert type(runs.reporter(False)) is Reporter
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False, raising=False)
    assert type(runs.reporter(None)) is Reporter
    monkeypatch.setitem(sys.modules, runs.NOTEBOOK, sys)
    assert isinstance(runs.reporter(None), Bar)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> xr.DataTree:
    config = written(tmp_path_factory.mktemp("plots"), SWEPT)
    return gs.sweep(gs.load(config, {"sweep.case": [{"label": "one", "phasing": 0.5}]}))


def test_a_figure_goes_into_a_frame_of_the_user(tree: xr.DataTree) -> None:
    figure, (left, right) = plt.subplots(1, 2)
    assert gs.plot(tree, kind="map", ax=left) is figure
    assert gs.plot(tree, kind="curve", ax=right, select={"epsilon": 0.2}) is figure
    assert figure.get_layout_engine() is None
    assert figure.get_suptitle() == ""
    assert left.get_xlabel().startswith("mesh frequency")
    assert right.lines
    # The growth rates of the map are those of the result, stable points masked.
    expected = tree["floquet"]["growth_rate"].squeeze("case").transpose("epsilon", "mesh_frequency").values
    shown = np.ma.filled(left.images[0].get_array(), 0.0)
    np.testing.assert_array_equal(shown, np.where(expected > 0, expected, 0.0))
    plt.close(figure)


def test_kinds_of_several_frames_take_none(tree: xr.DataTree) -> None:
    figure, ax = plt.subplots()
    with pytest.raises(PlotError, match="leave ax out"):
        gs.plot(tree, kind="modes", ax=ax)
    plt.close(figure)


def test_a_figure_of_a_file_is_that_of_the_tree(tree: xr.DataTree, tmp_path: Path) -> None:
    config = written(tmp_path, SWEPT)
    single = ["--set", 'sweep.case=[{"label": "one", "phasing": 0.5}]']
    succeeds("sweep", config, "-o", tmp_path / "out.h5", *single)
    for name, source in (("file", tmp_path / "out.h5"), ("tree", tree)):
        gs.plot(source, dpi=50).savefig(tmp_path / f"{name}.png", metadata={"Software": None})
    assert (tmp_path / "file.png").read_bytes() == (tmp_path / "tree.png").read_bytes()


def test_doubts_are_warnings() -> None:
    gear = {"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": 3.0}
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    with pytest.warns(DoubtWarning, match=r"^configuration: system.damping_ratio: 3 "):
        gs.load({"system": gear | {"meshes": [mesh]}})


# --- ``import gearstab`` is cheap, and its functions keep their names beside the rooms of the package


HEAVY = {"numpy", "scipy", "pydantic", "h5py", "xarray", "matplotlib", "rich", "pint", "joblib", "ruamel", "click"}


def modules_after(code: str) -> set[str]:
    command = [sys.executable, "-c", f"import sys\n{code}\nprint(*{{n.split('.')[0] for n in sys.modules}})"]
    return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())


def test_the_import_brings_nothing_with_it() -> None:
    assert not HEAVY & modules_after("import gearstab\ngearstab.__version__\ndir(gearstab)")


def test_a_figure_is_not_needed_to_load() -> None:
    assert not {"matplotlib", "xarray", "joblib"} & modules_after("import gearstab\ngearstab.load")


@pytest.mark.parametrize("name", gs.__all__)
def test_public_functions_are_there_and_say_what_they_do(name: str) -> None:
    function = getattr(gs, name)
    assert inspect.isfunction(function)
    first = (inspect.getdoc(function) or "").splitlines()[0]
    assert first.endswith(".") or ";" in first
    hints = inspect.signature(function)
    assert hints.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not inspect.Parameter.empty for p in hints.parameters.values())
    assert name in dir(gs)


@pytest.mark.parametrize("name", ["design", "floquet", "perturbation", "sweep"])
def test_a_room_of_the_same_name_does_not_take_its_place(name: str) -> None:
    room = import_module(f"gearstab.{name}")
    assert inspect.ismodule(room)
    assert inspect.isfunction(getattr(gs, name))


def test_what_is_not_there_is_said() -> None:
    with pytest.raises(AttributeError, match="no attribute 'sweeep'"):
        gs.sweeep  # noqa: B018
