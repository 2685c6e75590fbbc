"""The page on pipelines: its programs and rules make a table of many configurations, and again what changed only."""

import csv
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from scenes import DOCS

PAGE = (DOCS / "guide" / "pipelines.md").read_text()
KEPT = ("17_41", "17_42")


def block(name: str) -> str:
    """The first block of code behind the name of its file."""
    return re.split(r"^```\w+\n", PAGE[PAGE.index(f"`{name}`") :], maxsplit=1, flags=re.M)[1].partition("```")[0]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the page, with two of its five hundred configurations."""
    for name in ("train.yaml", "variants.py", "summary.py", "Makefile", "Snakefile"):
        (tmp_path / name).write_text(block(name))
    monkeypatch.chdir(tmp_path)
    runpy.run_path("variants.py")
    assert len(list((tmp_path / "configs").iterdir())) == 500
    for path in (tmp_path / "configs").iterdir():
        if path.stem not in KEPT:
            path.unlink()
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


def table(project: Path) -> dict[str, float]:
    """Shares of unstable points by name."""
    with (project / "summary.csv").open() as file:
        return {row["name"]: float(row["share_unstable"]) for row in csv.DictReader(file)}


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_makes_what_is_missing_or_out_of_date(project: Path) -> None:
    run(project, "make")
    before = table(project)
    assert tuple(before) == KEPT
    assert "up to date" in run(project, "make")
    # An outcome is lost, as where make was killed, and a configuration has changed.
    (project / "outcomes" / "17_41.json").unlink()
    changed = project / "configs" / "17_42.yaml"
    changed.write_text(changed.read_text().replace("damping_ratio: 0.01", "damping_ratio: 0.5"))
    os.utime(changed, (changed.stat().st_atime, (project / "summary.csv").stat().st_mtime + 10))
    assert run(project, "make").count("gearstab sweep") == 2
    assert table(project) == before | {"17_42": 0.0}
    assert before["17_42"] > 0


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("snakemake") is None, reason="needs snakemake, which gearstab does not")
def test_snakemake_makes_what_is_out_of_date(project: Path) -> None:
    run(project, "snakemake", "-c", "2", "--quiet", "all")
    assert tuple(table(project)) == KEPT
    assert "Nothing to be done" in run(project, "snakemake", "-c", "2")
    changed = project / "configs" / "17_42.yaml"
    changed.write_text(changed.read_text().replace("0.5]", "0.4]"))
    again = run(project, "snakemake", "-c", "2")
    assert re.findall(r"^    output: (\S+),", again, re.M) == ["results/17_42.h5"]
