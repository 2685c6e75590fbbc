"""Every walk of the page, from an empty folder: its files are saved, its commands run, its results are there."""

import re
import runpy
import shlex
from pathlib import Path

import pytest
from scenes import DOCS, ran

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
        done = ran(*words)
        assert done.exit_code == 0, f"{line}\n{done.stderr}"
        if words[0] == "check":
            assert "valid" in done.stdout
        if words[0] == "info":
            assert "Dangerous speeds" in done.stdout
    assert all((tmp_path / name).stat().st_size > 5_000 for name in PROMISED[walk])


def test_every_walk_is_run() -> None:
    assert list(WALKS) == list(PROMISED)
