"""Every walk of the page, from an empty folder: its files are saved, its commands run, its results are there."""

from __future__ import annotations

import json
import re
import runpy
import shlex
import shutil
from fractions import Fraction
from pathlib import Path
from typing import get_args

import h5py
import matplotlib.pyplot as plt
import pytest
from scenes import CONFIGS, DOCS, TRAIN, ran, refused, succeeds

import gearstab as gs
from gearstab.config.document import CODES, Code

PAGE = (DOCS / "guide" / "walks.md").read_text()
WALKS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S))
PROMISED = {
    "A reducer to a report": ["reducer.png", "reducer.html"],
    "A stiffness of your own to a figure": ["figure.pdf"],
    "A wind turbine to its unstable speeds": ["turbine.png"],
    "Finite element matrices to a map": ["train.png"],
}


LONG = {"A reducer to a report"}
"""Walks that take half a minute of processor time; the tests of reports go the same way with smaller trains."""


@pytest.mark.parametrize("walk", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in WALKS])
def test_a_walk_leads_where_it_says(walk: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r"as `([\w.]+)`:\n\n```\w+\n(.*?)^```$", WALKS[walk], re.M | re.S):
        (tmp_path / name).write_text(text)
    (commands,) = re.findall(r"^```sh\n(.*?)^```$", WALKS[walk], re.M | re.S)
    for line in commands.splitlines():
        program, *words = shlex.split(line)
        if program == "python":
            runpy.run_path(words[0])
            continue
        done = succeeds(*words)
        if words[0] == "check":
            assert "valid" in done.stdout
        if words[0] == "info":
            assert "Dangerous speeds" in done.stdout
    assert all((tmp_path / name).stat().st_size > 5_000 for name in PROMISED[walk])


def test_every_walk_is_run() -> None:
    assert list(WALKS) == list(PROMISED)


# --- the examples of the page on Python run, one after the other as a reader would type them


API = (DOCS / "api.md").read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```$", API, re.M | re.S)


def test_every_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(CONFIGS / "lin_parker_2002", tmp_path / "configs" / "lin_parker_2002")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in BLOCKS:
        if "from ross" in block:  # tests/exchange/test_ross.py runs it where ROSS is installed
            continue
        exec(compile(block, "docs/api.md", "exec"), names)
    plt.close("all")
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert (tmp_path / "pair.h5").exists()


def test_every_public_function_is_on_the_page() -> None:
    assert [name for name in gs.__all__ if f"`gs.{name}(" not in API and f"`gs.{name}`" not in API] == []


def test_codes_of_mistakes_are_listed() -> None:
    assert dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", API, re.M)) == CODES
    assert set(get_args(Code)) == set(CODES)


# --- page on first steps: its commands run, its names are those of a result


FIRST = (DOCS / "first_steps.md").read_text()
SWEPT = TRAIN + (
    "sweep:\n  mesh_frequency: [4.0, 5.0, 6.0]\n  epsilon: [0.1, 0.3]\nmethods: {floquet: {}, boundaries: {}}\n"
)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", FIRST, re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a result, as the first block of the page makes it."""
    path = tmp_path_factory.mktemp("steps")
    (path / "train.yaml").write_text(SWEPT)
    succeeds("sweep", path / "train.yaml", "-o", path / "results" / "train.h5")
    return path


def test_the_first_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in blocks("sh")[0].splitlines():
        words, _, target = line.partition("#")[0].partition(">")
        command = shlex.split(words)[1:]
        few = ["--set", "sweep.mesh_frequency.num=5", "--set", "sweep.epsilon.num=2"] if command[0] == "sweep" else []
        done = succeeds(*command, *few)
        if target:
            Path(target.strip()).write_text(done.stdout)
    assert Path("results/train.png").exists()


def test_the_exports_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    lines = [line.partition("#")[0] for block in blocks("sh") for line in block.splitlines() if " export " in line]
    assert len(lines) == 2
    for line in lines:
        succeeds(*shlex.split(line)[1:])
    assert {"mesh_frequency", "epsilon", "growth_rate"} <= set(Path("train.csv").read_text().splitlines()[0].split(","))


def test_names_and_dimensions_of_the_matlab_snippet_are_those_of_a_result(folder: Path) -> None:
    (snippet,) = blocks("matlab")
    names = re.findall(r"h5read\(file, '([^']+)'\)", snippet)
    assert names == ["/mesh_frequency", "/epsilon", "/floquet/growth_rate", "/boundaries/boundary_frequency"]
    with h5py.File(folder / "results" / "train.h5") as file:
        growth, edges = file["/floquet/growth_rate"], file["/boundaries/boundary_frequency"]
        assert growth.shape[::-1] == (2, 3)  # epsilon x mesh_frequency, as MATLAB lists dimensions
        assert edges.shape[::-1][:2] == (2, 2)  # epsilon x side x tongue
        assert all(name in file for name in names)


# --- the page that leads from a drawing to a report: its file is valid, its commands run, its numbers are right


DRIVETRAIN = (DOCS / "guide" / "drivetrain.md").read_text()
(CONFIG,) = re.findall(r"^```yaml\n(.*?)^```$", DRIVETRAIN, re.M | re.S)
COMMANDS = "".join(re.findall(r"^```sh\n(.*?)^```$", DRIVETRAIN, re.M | re.S)).splitlines()


@pytest.fixture
def winch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "winch.yaml").write_text(CONFIG)
    return tmp_path


@pytest.mark.slow  # half a minute; a reducer goes the same way above
def test_the_walk_from_the_drawing_to_the_report(winch: Path) -> None:
    for line in COMMANDS:
        succeeds(*shlex.split(line)[1:])
    assert {line.split()[1] for line in COMMANDS} == {"check", "info", "sweep", "plot", "report"}
    assert all((winch / name).stat().st_size > 10_000 for name in ("map.png", "campbell.png", "winch.html"))
    assert "Stable in the whole operating range" in (winch / "winch.html").read_text()


def test_the_numbers_of_the_page(winch: Path) -> None:
    """Willis: a pair 21/64, a set 24/96 whose ring is held."""
    pair, carrier = Fraction(-21, 64), Fraction(24, 24 + 96)
    drum, sun = 1500 * abs(pair) * carrier, abs(pair)
    assert f"{float(drum):.2f} rpm at the drum" in DRIVETRAIN
    of_set = 24 * sun * (1 - carrier)
    assert f"{float(of_set * 25):.1f} Hz" in DRIVETRAIN
    assert f"{Fraction(21) / of_set} times as" in DRIVETRAIN.replace("\n", " ")
    meshes = {mesh["name"]: mesh for mesh in json.loads(ran("info", "winch.yaml", "--json").stdout)["meshes"]}
    first = Fraction(meshes["first"]["frequency_ratio"]) / Fraction(meshes["set.sun.1"]["frequency_ratio"])
    assert first == Fraction(21) / of_set


@pytest.mark.parametrize(
    ("right", "wrong"), [("teeth: 96", "teeth: 97"), ("held: ring, ", "")], ids=["assembly", "nothing held"]
)
def test_the_slips_of_the_page(winch: Path, right: str, wrong: str) -> None:
    (winch / "winch.yaml").write_text(CONFIG.replace(right, wrong))
    said = refused("check", "winch.yaml")
    (line,) = said.splitlines()
    assert line in [own.strip() for own in DRIVETRAIN.splitlines()], line
