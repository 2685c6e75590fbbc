"""Gearboxes of wind turbines in ``configs/drivetrains``: ratios, frequencies, what ``info`` says, axes of teeth."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import CONFIGS, problems, read
from test_planetary_sets import TWO

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.info import train as info_train
from gearstab.info.configuration import describe
from gearstab.modal import mean_modes
from gearstab.systems import build
from gearstab.systems.gearbox.train import Train

NREL, GRC = CONFIGS / "drivetrains/nrel_5mw.yaml", CONFIGS / "drivetrains/grc_750kw.yaml"


@pytest.mark.parametrize(
    ("path", "ratio", "orders"),
    [(NREL, Fraction(4625, 48), [56, Fraction(6975, 19), Fraction(4625, 2)]),
     (GRC, Fraction(13120, 161), [99, Fraction(3280, 7), Fraction(288640, 161)])],
    ids=["nrel", "grc"],
)  # fmt: skip
def test_ratio_and_mesh_frequencies_are_those_of_the_reference(path: Path, ratio: Fraction, orders: list[Any]) -> None:
    train = Train(load(path).system)
    assert abs(train.speeds["generator"]) == ratio
    assert list(dict.fromkeys(mesh.motion.frequency(train.speeds) for mesh in train.meshes)) == orders


def test_the_two_masses_of_the_5_mw_drivetrain_vibrate_at_2_2755_hz() -> None:
    system = build(load(NREL).system)
    frequencies = mean_modes(system).natural_frequency / (2 * np.pi)
    assert frequencies[1] == pytest.approx(2.2755, abs=1e-4)  # the main shaft is as stiff as that, to four digits
    # Turbine against generator on that shaft, and the generator's inertia by the square of the ratio 96.35.
    assert frequencies[2] > 20 * frequencies[1]


def test_without_variation_nothing_grows() -> None:
    """Mean stiffness alone; undamped, so that any asymmetry of the matrices would show."""
    system = build(load(NREL, ["sweep.damping_factor=[0]"]).system)
    calm = replace(system, damping=None, meshes=tuple(replace(m, epsilon=np.zeros(())) for m in system.meshes[:12]))
    omega = np.linspace(50.0, 2000.0, 12)
    assert np.abs(solve(calm, omega).growth_rate).max() < 1e-8 * mean_modes(calm).natural_frequency[-1]


def test_info_shows_the_train_with_speeds_torques_and_mesh_frequencies(tmp_path: Path) -> None:
    text = TWO.replace("torque: 12}", "torque: 12, speed: 3000 rpm}")
    path = tmp_path / "two.yaml"
    path.write_text(text)
    found = describe(load(path))["train"]
    lines = info_train.drawing(found).splitlines()
    assert lines[0] == "motor: 3000 rpm, 0.05 kg m^2, drives with 12 N m"
    # Relative to the carrier, at 833.33 rpm, 30 teeth of the sun turn at 2166.67 rpm; planets turn at -1875 rpm.
    assert "set first, 30/24/78, 4 planets, planets -1875 rpm, 1083.3 Hz" in "\n".join(lines)
    assert sum("held" in line for line in lines) == 2
    first = found["sets"][0]
    assert first["torques"] == pytest.approx({"sun": 12.0, "ring": 12.0 * 2.6, "carrier": -12.0 * 3.6})
    mesh = {item["name"]: item for item in found["meshes"]}
    assert mesh["first.sun.2"]["lag"] == "1/2"
    assert (mesh["first.sun.2"]["order"], mesh["first.sun.2"]["relative_to"]) == ("65/3", "carrier")
    assert (mesh["second.sun.1"]["frequency_ratio"], mesh["pair"]["relative_to"]) == ("5/18", None)


def test_a_short_name_means_the_meshes_of_sets_and_pairs(tmp_path: Path) -> None:
    text = TWO + "sweep: {mesh_frequency: [1000, 2000], epsilon: [0.0, 0.15]}\nmethods: {floquet: {}}\n"
    config = read(tmp_path, text)
    system = build(config.at({"epsilon": np.array([0, 1])}))
    for mesh in system.meshes:
        np.testing.assert_array_equal(mesh.epsilon, [0.0, 0.15])


def test_an_axis_of_teeth_moves_the_set_and_is_refused_where_it_cannot_be_assembled(tmp_path: Path) -> None:
    case = "{label: %s, rotors.sun.teeth: %d, rotors.ring.teeth: %d}"
    sweep = "sweep:\n  mesh_frequency: [1000, 2000]\n  t: [%s, %s]\nmethods: {floquet: {}}\n"
    fits = read(tmp_path, TWO + sweep % (case % ("a", 30, 78), case % ("b", 32, 80)))
    systems = [build(fits.at({"t": np.array(k)})) for k in (0, 1)]
    alone = build(read(tmp_path, TWO.replace("teeth: 30, mass", "teeth: 32, mass", 1).replace("78", "80", 1)).system)
    np.testing.assert_array_equal(systems[1].mass, alone.mass)
    assert [mesh.frequency_ratio for mesh in systems[1].meshes] == [mesh.frequency_ratio for mesh in alone.meshes]
    found = problems(tmp_path, TWO + sweep % (case % ("a", 30, 78), case % ("b", 31, 79)))
    assert [problem.path for problem in found] == ["system.planetary_sets.0.planets.teeth"]
    assert "(z_s + z_r)/N = 110/4" in found[0].message
    assert "t = b" in found[0].message
