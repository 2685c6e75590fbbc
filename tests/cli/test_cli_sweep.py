"""``gearstab sweep`` and ``gearstab export`` as a user calls them."""

from __future__ import annotations

import csv
import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import code, opened, scene_text

from gearstab.cli import messages
from gearstab.cli.messages import Messages, reporter
from gearstab.cli.terminal import tell
from gearstab.results import open_result
from gearstab.sweep import pool
from gearstab.sweep.progress import Bar

CONFIG = scene_text("cli_sweep")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "train.yaml").write_text(CONFIG)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_result_goes_where_nothing_else_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "train.yaml") == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"{Path('results/train.h5')}: 20 points")
    assert said.err.count("\n") == 1
    assert [p.name for p in (folder / "results").iterdir()] == ["train.h5"]


def test_overrides_and_output(folder: Path) -> None:
    assert code("sweep", "train.yaml", "-o", "a/b.h5", "--set", "sweep.epsilon=[0.2]", "-j", "1", "-q") == 0
    with open_result(folder / "a" / "b.h5") as tree:
        assert tree["floquet"]["growth_rate"].shape == (2, 5, 1)


@pytest.mark.parametrize(("options", "most"), [((), 10), (("--fail-fast",), 1), (("--keep-going",), None)])
def test_how_many_failures_are_borne(
    folder: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], most: int | None
) -> None:
    def fail(*ignored: object) -> None:
        broken.append(ignored)
        raise MemoryError

    broken: list[object] = []
    monkeypatch.setattr(pool, "compute", fail)
    # 24 single systems are 24 blocks of a method that takes long.
    monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", 1)
    grid = ["--set", "sweep.epsilon={start: 0.1, stop: 0.3, num: 24}"]
    assert code("sweep", "train.yaml", "-j", "1", "-q", *grid, *options) == 1
    assert len(broken) == most if most else len(broken) > 40


def test_quiet_says_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "train.yaml", "-q") == 0
    assert capsys.readouterr() == ("", "")


def test_a_finished_result_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "train.yaml", "-q") == 0
    for flag in ([], ["--resume"]):
        capsys.readouterr()
        assert code("sweep", "train.yaml", *flag) == 0
        assert "already complete" in capsys.readouterr().err
    assert code("sweep", "train.yaml", "--overwrite") == 0
    assert "20 points" in capsys.readouterr().err


def test_another_result_is_not_overwritten(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "train.yaml", "-q") == 0
    assert code("sweep", "train.yaml", "--set", "sweep.epsilon=[0.2]") == 2
    said = capsys.readouterr().err
    assert "another configuration" in said
    assert said.count("\n") == 1
    assert code("sweep", "train.yaml", "--set", "sweep.epsilon=[0.2]", "--overwrite", "-q") == 0


def test_a_dry_run_prints_and_writes_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "train.yaml", "--dry-run") == 0
    said = capsys.readouterr()
    assert said.err == ""
    for text in ("mesh_frequency", "in phase, h = 0; against", "20 of 4 systems", "floquet", "memory", "file", "time"):
        assert text in said.out
    assert [p.name for p in folder.iterdir()] == ["train.yaml"]


@pytest.mark.parametrize(
    "args",
    [["missing.yaml"], ["train.yaml", "--set", "sweep.epsilom=[1]"], ["train.yaml", "-o", "train.yaml"],
     ["train.yaml", "-j", "0"]],
    ids=["no file", "wrong override", "output is no result", "no jobs"],
)  # fmt: skip
def test_a_users_mistake_is_code_2_and_nothing_is_written(
    folder: Path, capsys: pytest.CaptureFixture[str], args: list[str]
) -> None:
    assert code("sweep", *args) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err
    assert "Traceback" not in said.err
    assert [p.name for p in folder.iterdir()] == ["train.yaml"]
    assert (folder / "train.yaml").read_text() == CONFIG


def test_a_configuration_without_sweep_cannot_be_swept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "train.yaml").write_text(CONFIG[: CONFIG.index("sweep:")])
    assert code("sweep", "train.yaml") == 2
    assert "sweep" in capsys.readouterr().err


def test_a_bar_is_drawn_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert isinstance(reporter(), Messages)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert isinstance(reporter(), Bar)
    monkeypatch.setattr(messages, "is_quiet", lambda: True)
    assert isinstance(reporter(), Messages)


def test_the_bar_counts(capsys: pytest.CaptureFixture[str]) -> None:
    bar = Bar(tell)
    bar.begin("floquet", 100, 40, None, 20)
    bar.advance(0, 10, 0)
    bar.advance(60, 15, 0)
    assert bar._progress is not None
    task = bar._progress.tasks[0]
    bar.end()
    assert task.completed == 100
    assert task.fields["unstable"] == "25.0 % unstable"


def exported(*args: str) -> list[dict[str, str]]:
    assert code("export", "results/train.h5", "-o", "out.csv", *args) == 0
    with open("out.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_export_is_tidy_and_exact(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code("sweep", "train.yaml", "-q")
    rows = exported()
    assert len(rows) == 20
    assert list(rows[0]) == [
        "case", "mesh_frequency", "epsilon", "meshes.second.phasing", "growth_rate", "stable", "status",
    ]  # fmt: skip
    growth = opened(folder / "results" / "train.h5")["floquet"]["growth_rate"]
    for row in rows:
        at = {"case": row["case"], "mesh_frequency": float(row["mesh_frequency"]), "epsilon": float(row["epsilon"])}
        assert float(row["growth_rate"]) == float(growth.sel(at))
    assert rows[0]["case"] == "in phase, h = 0"
    assert rows[-1]["meshes.second.phasing"] == "0.5"
    assert "20 rows" in capsys.readouterr().err


def test_export_of_tongues(folder: Path) -> None:
    code("sweep", "train.yaml", "-q")
    rows = exported("--group", "perturbation")
    data = opened(folder / "results" / "train.h5")["perturbation"].to_dataset()
    assert len(rows) == data.sizes["tongue"] * 2 * 2 * 2
    row = next(
        r for r in rows if (r["label"], r["side"], r["case"], r["epsilon"]) == ("2w3", "upper", "against", "0.3")
    )
    tongue = list(data["label"].values).index("2w3")
    expected = data["boundary_frequency"][tongue].sel(side="upper", case="against", epsilon=0.3)
    assert float(row["boundary_frequency"]) == float(expected)


def test_export_takes_what_there_is(folder: Path) -> None:
    code("sweep", "train.yaml", "-q", "--set", "methods={perturbation: {}}")
    assert "boundary_frequency" in exported()[0]


def test_export_in_blocks_is_the_same(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gearstab.results import export

    code("sweep", "train.yaml", "-q")
    whole = exported()
    monkeypatch.setattr(export, "ROWS_AT_ONCE", 3)
    monkeypatch.setattr(export, "BYTES_AT_ONCE", 60)
    assert exported() == whole


def test_missing_numbers_are_empty_cells(folder: Path) -> None:
    methods = "methods={boundaries: {width_floor: 1.0e-3, tolerance: 1.0e-6}}"
    code("sweep", "train.yaml", "-q", "--set", methods, "--set", "sweep.epsilon=[0.0, 0.3]")
    cells = [row["boundary_frequency"] for row in exported()]
    assert "" in cells
    assert np.all(np.isfinite([float(cell) for cell in cells if cell]))


def test_export_to_standard_output(folder: Path) -> None:
    code("sweep", "train.yaml", "-q")
    command = [sys.executable, "-m", "gearstab", "export", "results/train.h5", "-o", "-"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    )
    assert done.stdout.count("\n") == 21
    assert done.stderr == ""


@pytest.mark.parametrize("args", [["results/none.h5", "-o", "x.csv"], ["train.yaml", "-o", "x.csv"],
                                  ["results/train.h5", "-o", "x.csv", "--group", "nothing"],
                                  ["results/train.h5", "-o", "results/train.h5"], ["results/train.h5", "-o", "results"],
                                  ["results/train.h5"]])  # fmt: skip
def test_what_cannot_be_exported(folder: Path, capsys: pytest.CaptureFixture[str], args: list[str]) -> None:
    code("sweep", "train.yaml", "-q")
    before = (folder / "results" / "train.h5").read_bytes()
    assert code("export", *args) == 2
    said = capsys.readouterr().err
    assert said
    assert "Traceback" not in said
    assert (folder / "results" / "train.h5").read_bytes() == before
    assert sorted(p.name for p in folder.rglob("*")) == ["results", "train.h5", "train.yaml"]


@pytest.mark.parametrize("command", ["sweep", "respond", "bench"])
@pytest.mark.parametrize("name", ["train.yaml", "link.h5"])
def test_a_configuration_is_never_overwritten(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, name: str
) -> None:
    (folder / "link.h5").symlink_to("train.yaml")
    options = ["--overwrite"] if command == "sweep" else []
    assert code(command, "train.yaml", "-o", name, *options) == 2
    assert capsys.readouterr().err == f"{name}: is the input itself; choose another output\n"
    assert (folder / "train.yaml").read_text() == CONFIG


@pytest.mark.parametrize("command", ["sweep", "respond", "bench"])
def test_a_foreign_file_is_never_overwritten(folder: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    (folder / "notes.txt").write_text("mine")
    (folder / "train.yaml").write_text(
        f"{CONFIG}respond: {{mesh_frequency: 5, cycles: 2, initial: {{velocity: [1, 0, 0]}}}}\n"
    )
    options = ["--overwrite"] if command == "sweep" else []
    assert code(command, "train.yaml", "-o", "notes.txt", *options) == 2
    said = capsys.readouterr().err
    assert said.startswith("notes.txt: is no result file")
    assert said.count("\n") == 1
    assert (folder / "notes.txt").read_text() == "mine"


def test_a_picture_replaces_neither_configuration_nor_result(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "train.png").write_text(CONFIG)
    assert code("bench", "train.png", "-o", "train.h5") == 2
    assert capsys.readouterr().err.startswith("train.png: is the input itself")
    assert code("bench", "train.yaml", "-o", "other.png") == 2
    assert capsys.readouterr().err.startswith("other.png: is the name of the picture too")
    assert code("sweep", "train.yaml", "-o", "map.h5", "-q") == 0
    (folder / "map.h5").rename("map.png")
    before = (folder / "map.png").read_bytes()
    assert code("plot", "map.png") == 2
    assert capsys.readouterr().err.startswith("map.png: is the input itself")
    assert (folder / "map.png").read_bytes() == before


def test_what_cases_set_carries_its_unit_and_title(folder: Path) -> None:
    case = ", ".join(f"{{label: {k}, inertias.1: 0.{k}, input_shaft_stiffness: 0.{k}}}" for k in (3, 4))
    assert code("sweep", "train.yaml", "-q", "--set", f"sweep.case=[{case}]", "-o", "t.h5") == 0
    with open_result(Path("t.h5")) as tree:
        for group in ("/", "floquet", "perturbation"):
            stiffness, inertia = tree[group]["input_shaft_stiffness"], tree[group]["inertias.1"]
            assert stiffness.attrs["long_name"] not in ("", "input_shaft_stiffness")
            assert stiffness.attrs["units"] == "N/m"
            assert inertia.attrs["long_name"].endswith("[1]")
            assert inertia.attrs["units"] == "kg"
