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
TERM = "lag: 0}\n  terms: [{name: friction, left: [1, 1], right: [1, 0], stiffness: {mean: 0.1}}]"
SMOOTH = "lag: 0, waveform: {kind: trapezoidal, ramp: 0.1}}"
LOADED = "lag: 0}\n  load: [1, 0]\n  forces: [{direction: [1, 0], sin: [1]}]"
ONLY = "supports only periodic mesh stiffness, and this system also has friction"


def said(line: int, path: str, message: str) -> str:
    return f"train.yaml:{line}: methods.{path}: {message}\n"


CASES = [
    ("lag: 0}", "floquet: {block: 1}", said(11, "floquet.block",
     "the system has no cyclic symmetry, and so no types of mesh deflection (got 1); name modes instead")),
    ("lag: 0}", "floquet: {modes: [3]}", said(11, "floquet.modes",
     "there is no mode 3 (got [3]); name modes from 1 to 2")),
    (IRRATIONAL, "floquet: {frequencies: common_period}", said(11, "floquet.frequencies",
     'mesh frequencies of irrational ratio have no common period (got "common_period"); choose per_mesh or lyapunov')),
    (IRRATIONAL, "floquet: {exponents: true}", said(11, "floquet.exponents",
     "are not defined without a common period (lyapunov was chosen) (got true); remove it")),
    (IRRATIONAL, "boundaries: {}", said(11, "boundaries",
     "mesh frequencies of irrational ratio have no common period; remove it, or give exact ratios")),
    (TERM, "perturbation:\n    order: 2", said(13, "perturbation.order",
     f"{ONLY} (got 2); choose order: 1, which takes these too")),
    (SMOOTH, "uncoupled: {}", said(11, "uncoupled",
     "averages the contact ratios of rectangular waves, which b does not have; use floquet instead")),
    ("lag: 0}", "required_damping: {of: factor}", said(11, "required_damping.of",
     'there is no damping to multiply (got "factor"); give the system damping, or choose of: damping_ratio')),
    (IRRATIONAL, "required_damping:\n    frequencies: common_period", said(12, "required_damping.frequencies",
     'mesh frequencies of irrational ratio have no common period (got "common_period"); choose per_mesh or auto')),
    ("lag: 0}", "response: {}", said(11, "response",
     "nothing drives the system; remove it, or give a load (a gearbox: torques of input or outputs), forces or "
     "transmission errors")),
    (LOADED, "response: {cycles: 30}", said(13, "response.cycles",
     "no mesh has backlash (got 30); remove it, or give a mesh backlash")),
    (LOADED.replace("lag: 0}", "lag: 0, backlash: 0.1}"), "response: {cycles: 30, discard: 40}",
     said(13, "response.discard", "leaves nothing of 30 cycles (got 40); discard less, or give more cycles")),
]  # fmt: skip


@pytest.mark.parametrize("command", ["check", "sweep"])
@pytest.mark.parametrize(("more", "method", "lines"), CASES, ids=[f"{c[1]} {c[0][:9]}" for c in CASES])
def test_what_does_not_fit_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, more: str, method: str, lines: str
) -> None:
    monkeypatch.chdir(tmp_path)
    text = TRAIN.replace("MORE", more)
    Path("train.yaml").write_text(text.replace("METHOD", method))
    done = ran(command, "train.yaml")
    assert (done.exit_code, done.stdout, done.stderr) == (2, "", lines)
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
