"""Options of methods that do not fit the system: one line each, at its place, by `check` as by `sweep`."""

from pathlib import Path

import numpy as np
import pytest
from scenes import ran, refused, scene_text, written

from gearstab.config import Config, ConfigError, load
from gearstab.systems import build

TRAIN = scene_text("config_methods")
IRRATIONAL = "frequency_ratio: 0.70710678, exact: false}"


@pytest.mark.parametrize("command", ["check", "sweep"])
def test_what_does_not_fit_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """Other things that do not fit stand in the tables of mistakes."""
    monkeypatch.chdir(tmp_path)
    written(
        tmp_path,
        TRAIN.replace("lag: 0}", IRRATIONAL).replace("floquet: {}", "floquet: {exponents: true}"),
        "train.yaml",
    )
    done = ran(command, "train.yaml")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("train.yaml:11: methods.floquet.exponents: are not defined without a common period")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["train.yaml"]


def test_an_override_is_named_in_place_of_a_line(tmp_path: Path) -> None:
    path = written(tmp_path, TRAIN, "train.yaml")
    said = refused("check", path, "--set", "methods.floquet.block=2")
    assert said.startswith("--set methods.floquet.block: methods.floquet.block: the system has no cyclic")
    assert said.endswith("(got 2); name modes instead\n")


def test_bench_names_the_place(tmp_path: Path) -> None:
    path = written(tmp_path, TRAIN.replace("lag: 0}", IRRATIONAL), "train.yaml")
    assert f"{path}:7: system.meshes.1.frequency_ratio: bench: mesh frequencies of irrational ratio" in refused(
        "bench", path, "-o", tmp_path / "out.h5"
    )
    text = TRAIN.replace("floquet: {}", "perturbation: {}")
    path.write_text(text.replace("mesh_frequency: [1.0, 2.0]", "epsilon: [0.1, 0.2]"))
    done = ran("bench", path, "-o", tmp_path / "out.h5")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert f"{path}:8: sweep.mesh_frequency: is missing, which bench needs; add mesh_frequency: " in done.stderr


# --- samples that cannot vary, negative ones, loads of one number, and waveforms along axes


PAIR = scene_text("config_samples")
CONSTANT = "waveform: {kind: sampled, phase: [0, 0.5], stiffness: [3, 3]}"
FROM_FILE = "waveform: {kind: sampled, file: k.csv}"


def loaded(folder: Path, mesh: str, *overrides: str, text: str = PAIR) -> Config:
    (folder / "k.csv").write_text("0, 2\n0.25, 2\n")
    (folder / "case.yaml").write_text(text.replace("MESH", mesh))
    return load(folder / "case.yaml", overrides)


@pytest.mark.parametrize("wave", [CONSTANT, FROM_FILE])
@pytest.mark.parametrize("mesh", ["", "epsilon: 0, ", "amplitude: 0, "])
def test_constant_samples_are_a_constant_stiffness(tmp_path: Path, wave: str, mesh: str) -> None:
    system = build(loaded(tmp_path, mesh + wave).system)
    assert float(system.meshes[0].amplitude) == 0
    assert float(system.meshes[0].mean_stiffness) == (3 if wave == CONSTANT else 2)


def test_samples_that_an_axis_sets_vary(tmp_path: Path) -> None:
    loaded(tmp_path, f"epsilon: 0.3, {CONSTANT}", "sweep.meshes.a.waveform.stiffness.0=[4, 5]")


def test_constant_samples_of_a_term(tmp_path: Path) -> None:
    text = """\
system:
  kind: matrices
  mass: [[1]]
  stiffness: [[1]]
  terms: [{left: [1], right: [1], stiffness: {amplitude: 0.5, WAVE}}]
  meshes: [{direction: [1], mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]
"""
    (tmp_path / "case.yaml").write_text(text.replace("WAVE", CONSTANT))
    with pytest.raises(ConfigError, match=r"case\.yaml:5: system\.terms\.0\.stiffness\.amplitude: the samples"):
        load(tmp_path / "case.yaml")


def test_samples_are_a_shape_where_mean_and_variation_are_given(tmp_path: Path) -> None:
    """Shifted and scaled, also to negative values, they make the same stiffness."""
    numbers = "mean_stiffness: 2, epsilon: 0.3, "
    wave = "waveform: {kind: sampled, phase: [0, 0.3, 0.6], stiffness: [%s]}"
    time = np.linspace(0, 1, 7)
    first, second = (
        build(loaded(tmp_path, numbers + wave % values).system).meshes[0] for values in ("1, 2, 1.5", "-3, -1, -2")
    )
    np.testing.assert_allclose(first.waveform.value(time), second.waveform.value(time), atol=1e-15)
    assert (first.mean_stiffness, first.amplitude) == (second.mean_stiffness, second.amplitude) == (2.0, 0.6)


@pytest.mark.parametrize(("given", "newtons"), [("5", 5.0), ("[5]", 5.0), ('"2 kN"', 2000.0), ("-0.5", -0.5)])
def test_the_load_of_a_gear_pair_is_a_number(tmp_path: Path, given: str, newtons: float) -> None:
    config = loaded(tmp_path, "mean_stiffness: 1, epsilon: 0.3, contact_ratio: 1.5", f"load={given}")
    assert config.system["load"] == [newtons]
    np.testing.assert_array_equal(build(config.system).load, [newtons])
