"""Drivetrains of ``configs/drivetrains``: ratios, frequencies, what ``info`` says, axes of teeth, helices, spin."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import CONFIGS, problems, read, written
from test_planetary_sets import TWO

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.info import label_text, meshes_text
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


def test_the_helix_calms_the_reducer_of_an_electric_car() -> None:
    """At 14,550 rpm spur teeth double one motion of the first stage; its tongue closes below 4 degrees."""
    config = load(CONFIGS / "drivetrains/ev_reducer.yaml")
    system = build(config.at({"gears.helix_angle": np.array([0, 2, 8, 16])}))
    growth = solve(system, np.array([14550 * 23 * 2 * np.pi / 60]), tolerance=1e-6).growth_rate[:, 0]
    assert growth[0] > growth[1] > growth[2] > growth[3]
    assert growth[0] > 800
    assert growth[3] < 0
    mesh = system.meshes[0].direction
    along = [k for k, name in enumerate(system.coordinates) if name.endswith(" 1.z")]
    np.testing.assert_allclose(mesh[0, along], 0, atol=1e-15)
    assert np.all(np.abs(mesh[3, along]) > 0.1)


def test_the_carrier_of_the_helicopter_splits_its_translational_modes() -> None:
    """By W/2 phi_1^T G phi_2 each way, first order in the speed (Lin & Parker 1999)."""
    config = load(CONFIGS / "drivetrains/helicopter.yaml")
    system = build(config.system)
    modes = mean_modes(system)
    frequency = modes.natural_frequency
    pairs = [k for k in range(1, system.size - 1) if abs(frequency[k + 1] / frequency[k] - 1) < 1e-9]
    lowest = pairs[0]
    (rotation,) = system.rotations
    shapes = modes.shapes[:, lowest : lowest + 2]
    coupling = abs(float(shapes[:, 0] @ rotation.gyroscopic @ shapes[:, 1]))
    carrier = 8000 * 2 * np.pi / 60 * 36 / 126
    assert carrier * coupling / 2 > 0.03 * frequency[lowest]


def test_without_variation_nothing_grows() -> None:
    """Mean stiffness alone; undamped, so that any asymmetry of the matrices would show."""
    system = build(load(NREL, ["sweep.damping_factor=[0]"]).system)
    calm = replace(system, damping=None, meshes=tuple(replace(m, epsilon=np.zeros(())) for m in system.meshes[:12]))
    omega = np.linspace(50.0, 2000.0, 12)
    assert np.abs(solve(calm, omega).growth_rate).max() < 1e-8 * mean_modes(calm).natural_frequency[-1]


def test_info_shows_the_train_with_speeds_torques_and_mesh_frequencies(tmp_path: Path) -> None:
    text = TWO.replace("torque: 12}", "torque: 12, speed: 3000 rpm}")
    path = written(tmp_path, text, "two.yaml")
    found = describe(load(path))["train"]
    lines = info_train.drawing(found).splitlines()
    assert lines[0] == "motor: 3000 rpm, 0.05 kg m^2, drives with 12 N m"
    # Relative to the carrier, at 833.33 rpm, 30 teeth of the sun turn at 2166.67 rpm; planets turn at -1875 rpm.
    assert "set first, 30/24/78, 4 planets, planets -1875 rpm, 1083.3 Hz (65000 rpm)" in "\n".join(lines)
    assert sum("held" in line for line in lines) == 2
    first = found["sets"][0]
    assert first["torques"] == pytest.approx({"sun": 12.0, "ring": 12.0 * 2.6, "carrier": -12.0 * 3.6})
    mesh = {item["name"]: item for item in found["meshes"]}
    assert mesh["first.sun.2"]["lag"] == "1/2"
    assert (mesh["first.sun.2"]["order"], mesh["first.sun.2"]["relative_to"]) == ("65/3", "carrier")
    assert (mesh["second.sun.1"]["frequency_ratio"], mesh["pair"]["relative_to"]) == ("5/18", None)


def test_meshes_of_sets_are_said_in_short() -> None:
    both = [f"one.{kind}.{n}" for kind in ("sun", "ring") for n in (1, 2)]
    assert meshes_text([*both, "pair", "two.ring.1", "two.ring.2"]) == "one, pair, two.ring"
    assert label_text(f"2w7/5 ({'+'.join(both)}) & (w1+w2)/3") == "2w7/5 (one) & (w1+w2)/3"
    assert label_text("2w3 (first+second)") == "2w3 (first+second)"


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
