"""Page on first steps: its commands run, its names are those of a result, its rules make figures."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest
from scenes import DOCS, TRAIN, ran

PAGE = (DOCS / "first_steps.md").read_text()
SWEPT = TRAIN + (
    "sweep:\n  mesh_frequency: [4.0, 5.0, 6.0]\n  epsilon: [0.1, 0.3]\nmethods: {floquet: {}, boundaries: {}}\n"
)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a result, as the first block of the page makes it."""
    path = tmp_path_factory.mktemp("steps")
    (path / "train.yaml").write_text(SWEPT)
    assert ran("sweep", path / "train.yaml", "-o", path / "results" / "train.h5").exit_code == 0
    return path


def test_the_first_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in blocks("sh")[0].splitlines():
        words, _, target = line.partition("#")[0].partition(">")
        command = shlex.split(words)[1:]
        few = ["--set", "sweep.mesh_frequency.num=5", "--set", "sweep.epsilon.num=2"] if command[0] == "sweep" else []
        done = ran(*command, *few)
        assert done.exit_code == 0, line
        if target:
            Path(target.strip()).write_text(done.stdout)
    assert Path("results/train.png").exists()


def test_the_exports_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    lines = [line.partition("#")[0] for block in blocks("sh") for line in block.splitlines() if " export " in line]
    assert len(lines) == 2
    for line in lines:
        assert ran(*shlex.split(line)[1:]).exit_code == 0
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


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "configs").mkdir()
    for name in ("one", "two"):
        (tmp_path / "configs" / f"{name}.yaml").write_text(SWEPT)
    return tmp_path


def run(project: Path, *command: str) -> str:
    """Run a program in which ``gearstab`` is this one."""
    tools = project / "bin"
    tools.mkdir(exist_ok=True)
    (tools / "gearstab").write_text(f"#!/bin/sh\nexec '{sys.executable}' -m gearstab \"$@\"\n")
    (tools / "gearstab").chmod(0o755)
    clean = {k: v for k, v in os.environ.items() if k not in {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}}
    found = clean | {"PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, cwd=project, env=found, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_the_rules_of_make_make_what_is_out_of_date(project: Path) -> None:
    (project / "Makefile").write_text(blocks("make")[0])
    run(project, "make")
    assert sorted(path.name for path in (project / "figures").iterdir()) == ["one.png", "two.png"]
    assert "Nothing to be done" in run(project, "make")
    (project / "configs" / "two.yaml").write_text(SWEPT.replace("0.3]", "0.4]"))
    again = run(project, "make")
    assert "configs/two.yaml" in again
    assert "configs/one.yaml" not in again


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("snakemake") is None, reason="needs snakemake, which gearstab does not")
def test_the_rules_of_snakemake_make_figures(project: Path) -> None:
    (project / "Snakefile").write_text(blocks("python")[-1])
    run(project, "snakemake", "-c", "2", "--quiet", "all")
    assert sorted(path.name for path in (project / "figures").iterdir()) == ["one.png", "two.png"]
    assert "Nothing to be done" in run(project, "snakemake", "-c", "2")
    # One rule per map: what belongs to the other configuration stays as it is.
    (project / "configs" / "two.yaml").write_text(SWEPT.replace("0.3]", "0.4]"))
    again = run(project, "snakemake", "-c", "2")
    assert re.findall(r"^    output: (\S+)", again, re.M) == ["results/two.h5", "figures/two.png"]
