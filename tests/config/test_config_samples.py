"""Samples that cannot vary, negative ones, loads of one number, and waveforms along axes."""

from pathlib import Path

import numpy as np
import pytest
from scenes import scene_text

from gearstab.config import Config, ConfigError, load
from gearstab.systems import build

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
