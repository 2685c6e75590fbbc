"""Options of methods that do not fit the system: one line each, at its place, by `check` as by `sweep`."""

from pathlib import Path

import pytest
from scenes import ran, written

TRAIN = """\
system:
  kind: matrices
  mass: [[1, 0], [0, 2]]
  stiffness: [[1, 0], [0, 1]]
  meshes:
    - {name: a, direction: [1, -1], mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {name: b, direction: [1, 1], mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5, MORE
sweep:
  mesh_frequency: [1.0, 2.0]
methods:
  METHOD
"""
IRRATIONAL = "frequency_ratio: 0.70710678, exact: false}"


@pytest.mark.parametrize("command", ["check", "sweep"])
def test_what_does_not_fit_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """What else does not fit stands in the tables of mistakes."""
    monkeypatch.chdir(tmp_path)
    written(tmp_path, TRAIN.replace("MORE", IRRATIONAL).replace("METHOD", "floquet: {exponents: true}"), "train.yaml")
    done = ran(command, "train.yaml")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("train.yaml:11: methods.floquet.exponents: are not defined without a common period")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["train.yaml"]


def test_an_override_is_named_in_place_of_a_line(tmp_path: Path) -> None:
    path = written(tmp_path, TRAIN.replace("MORE", "lag: 0}").replace("METHOD", "floquet: {}"), "train.yaml")
    done = ran("check", path, "--set", "methods.floquet.block=2")
    assert done.exit_code == 2
    assert done.stderr.startswith("--set methods.floquet.block: methods.floquet.block: the system has no cyclic")
    assert done.stderr.endswith("(got 2); name modes instead\n")


def test_bench_names_the_place(tmp_path: Path) -> None:
    path = written(tmp_path, TRAIN.replace("MORE", IRRATIONAL).replace("METHOD", "floquet: {}"), "train.yaml")
    done = ran("bench", path, "-o", tmp_path / "out.h5")
    assert done.exit_code == 2
    assert f"{path}:7: system.meshes.1.frequency_ratio: bench: mesh frequencies of irrational ratio" in done.stderr
    text = TRAIN.replace("MORE", "lag: 0}").replace("METHOD", "perturbation: {}")
    path.write_text(text.replace("mesh_frequency: [1.0, 2.0]", "epsilon: [0.1, 0.2]"))
    done = ran("bench", path, "-o", tmp_path / "out.h5")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert f"{path}:8: sweep.mesh_frequency: is missing, which bench needs; add mesh_frequency: " in done.stderr
