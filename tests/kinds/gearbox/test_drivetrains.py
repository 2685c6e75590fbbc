"""Drivetrains of ``configs/drivetrains``: ratios, frequencies, what ``info`` says, axes of teeth, helices, spin."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gearbox_trains import REFERENCE
from ruamel.yaml import YAML
from scenes import CONFIGS, problems, read, scene_text, written
from test_planetary_sets import TWO

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair
from gearstab.info import train as info_train
from gearstab.info.configuration import describe
from gearstab.info.records import plain
from gearstab.info.tables import label_text, meshes_text
from gearstab.info.text import report
from gearstab.modal import mean_modes
from gearstab.systems import build
from gearstab.systems.gearbox.feasibility import NOTICES
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
    growth = solve(system, np.array([14550 * 23 * 2 * np.pi / 60])).growth_rate[:, 0]
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


# --- ``gearstab info`` of a gearbox: the train drawn, its teeth judged, the energy of its modes shared out


SMALL = scene_text("gearbox_info_small")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("info") / "small.yaml"
    path.write_text(SMALL)
    return describe(load(path))


def test_the_drawing_has_every_rotor_shaft_and_mesh_once_and_closes_loops(small: dict[str, Any]) -> None:
    lines = info_train.drawing(small["train"]).splitlines()
    assert lines[0] == "motor: 3000 rpm, 0.05 kg m^2, drives with 12 N m"
    assert lines[1].startswith("+- coupling, 2e+04 N m/rad -- pinion: z = 10, 3000 rpm, ")
    # Five rotors, and the loop met again from the other side.
    assert len(lines) == 6
    assert sum("(above)" in line for line in lines) == 1
    for name in ("mesh a, 10/40", "mesh b, 10/40", "mesh c, 40/120", "mesh d, 40/120"):
        assert sum(name in line for line in lines) == 1
    assert any("ring: z = 120 internal, -250 rpm, 0.2 kg m^2, takes 144 N m" in line for line in lines)


def test_static_forces_and_velocities_are_those_of_the_torques(small: dict[str, Any]) -> None:
    meshes = {mesh["name"]: mesh for mesh in small["train"]["meshes"]}
    pair = Pair(Gear(10, 2e-3, face_width=0.02), Gear(40, 2e-3, face_width=0.02))
    base = 10e-3 * np.cos(np.radians(20))
    total = meshes["a"]["force"] + meshes["b"]["force"]
    assert total == pytest.approx(12 / base, rel=1e-9)
    assert meshes["a"]["velocity"] == pytest.approx(3000 * np.pi / 30 * 10e-3, rel=1e-12)
    assert meshes["c"]["velocity"] == pytest.approx(meshes["a"]["velocity"], rel=1e-12)
    assert meshes["a"]["contact_ratio"] == pytest.approx(pair.contact_ratio, rel=1e-12)


def test_notices_name_the_gear_and_the_numbers(small: dict[str, Any]) -> None:
    text = info_train.teeth(small["train"])
    # x >= (17.097 - z)/17.097 for the usual rack (to its five digits).
    least = (17.097 - 10) / 17.097
    assert f"warning: mesh a, pinion: undercut, the profile shift is 0 and should be at least {least:.4g}" in text
    found = [notice for mesh in small["train"]["meshes"] for notice in mesh["notices"]]
    pair = Pair(Gear(10, 2e-3, face_width=0.02), Gear(40, 2e-3, face_width=0.02))
    beyond = [n for n in pair.notices if n.name == "interference"]
    assert beyond
    assert {n["name"] for n in found} >= {"undercut", "interference", "fillet_contact"}
    assert all(n["name"] in NOTICES for n in found)
    assert "left: interference, the contact is cut off: its tip would reach" in text


def test_the_energy_of_every_elastic_mode_is_shared_out(small: dict[str, Any]) -> None:
    for mode, share in zip(small["modes"], small["train"]["energy_share"], strict=True):
        if mode["type"] == "rigid-body":
            assert share == {"shafts": None, "supports": None}
            continue
        total = sum(mode["mesh_energy_share"].values()) + share["shafts"] + share["supports"]
        assert total == pytest.approx(1.0, abs=1e-9)


def test_the_report_of_the_tractor_gearbox(root: Path) -> None:
    config = load(root / "configs/kuria_kihiu_2008/gearbox.yaml", ["methods={floquet: {frequencies: per_mesh}}"])
    facts = describe(config, 1)
    json.dumps(plain(facts), allow_nan=False)
    text = report(facts)
    for force in REFERENCE["given_table_II"]["W_static"]:
        assert any(round(mesh["force"]) == force for mesh in facts["train"]["meshes"])
    assert "right wheel: 28.373 rpm, 1 kg m^2, takes 650 N m" in text
    assert "common period  2720 x 2 pi/Omega" in text
    header = next(line for line in text.splitlines() if line.startswith("mode "))
    assert header.split() == [
        "mode", "frequency", "(rad/s)", "Hz", "type", "damping", "ratio",
        *(word for name in ("I", "II", "III", "IVa", "IVb") for word in ("energy", name)), "shafts", "supports",
    ]  # fmt: skip
    # The modes of the meshes, from the modal strain energy: 13 kHz.
    assert all(mode["mesh_energy_share"][mesh] > 0.4 for mode, mesh in zip(
        facts["modes"][28:], ("III", "I", "II", "IVa", "IVa"), strict=True
    ))  # fmt: skip


def test_other_kinds_have_no_train(tmp_path: Path) -> None:
    path = tmp_path / "pair.yaml"
    mesh = {"name": "m", "mean_stiffness": 1.0, "epsilon": 0.1, "contact_ratio": 1.5}
    with path.open("w") as file:
        YAML().dump({"system": {"kind": "gear_pair", "equivalent_mass": 1.0, "meshes": [mesh]}}, file)
    assert describe(load(path))["train"] is None
