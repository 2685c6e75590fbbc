"""``gearstab info`` of a gearbox: the train drawn, its teeth judged, the energy of its modes shared out."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gearbox_trains import REFERENCE
from ruamel.yaml import YAML
from scenes import scene_text

from gearstab.config import load
from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair
from gearstab.info import plain
from gearstab.info import train as info_train
from gearstab.info.configuration import describe
from gearstab.info.text import report
from gearstab.systems.gearbox.feasibility import NOTICES

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
