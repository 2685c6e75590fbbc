"""Helical gears in trains: screws, thrusts, planetary sets, axes of the helix angle, the spur limit, and mistakes."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians, tan
from typing import Any

import numpy as np
import pytest
from scenes import ROOT, read, succeeds
from test_planetary_sets import alone, as_text, in_a_train

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.info.train import facts
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.gearbox.train import Train
from gearstab.waveforms import Helical, Rectangular, Tooth

CASES = ROOT / "tests" / "cases"
SUPPORT = {"stiffness": 3.0e8, "axial_stiffness": 2.0e8}
BETA, ALPHA = radians(20), radians(20)
TEETH = {"waveform": {"kind": "tooth"}}
TANGENT = tan(BETA) * cos(np.arctan(tan(ALPHA) / cos(BETA)))  # tan beta_b


def pair(
    sense: str = "counter-clockwise", internal: int | None = None, hand: str | None = "right", **mesh: Any
) -> dict:
    """One pair between a motor and a machine; internal: which of both gears is."""
    teeth = [81, 24] if internal == 0 else [24, 81]
    rotors: list[dict[str, Any]] = [
        {"name": name, "teeth": z, "inertia": 0.01, "mass": 5.0, "support": dict(SUPPORT), "internal": internal == k}
        for k, (name, z) in enumerate(zip(("driver", "driven"), teeth, strict=True))
    ]
    if hand is not None:
        rotors[0]["hand"] = hand
    return {
        "kind": "gearbox", "rotors": rotors,
        "gears": {"module": 0.003, "pressure_angle": "20 deg", "helix_angle": "20 deg", "face_width": 0.02},
        "meshes": [{"name": "mesh", "gears": ["driver", "driven"], "position": 0.3, **mesh}],
        "input": {"rotor": "driver", "torque": 100.0, "sense": sense}, "outputs": [{"rotor": "driven"}],
    }  # fmt: skip


def built(system: dict[str, Any], tmp_path) -> GearSystem:
    return build(read(tmp_path, as_text(system)).system)


KINDS = pytest.mark.parametrize(
    ("sense", "internal", "hand"),
    [(sense, internal, hand) for sense in ("counter-clockwise", "clockwise") for internal in (None, 0, 1)
     for hand in ("right", "left")],
)  # fmt: skip


@KINDS
def test_a_gear_that_screws_along_its_teeth_deflects_none(tmp_path, sense, internal, hand) -> None:
    """Turned by phi counter-clockwise, a right-handed screw advances by phi r/tan beta along z."""
    p = pair(sense, internal, hand)
    system = built(p, tmp_path)
    train = Train(read(tmp_path, as_text(p)).system)
    place = {name: k for k, name in enumerate(system.coordinates)}
    (mesh,) = system.meshes
    for k, name in enumerate(("driver", "driven")):
        gear = train.rotors[k]
        right = 1 if gear["hand"] == "right" else -1
        radius = 0.0015 / cos(BETA) * gear["teeth"]
        motion = np.zeros(system.size)
        motion[place[name]] = train.signs[name] * 0.01
        motion[place[f"{name}.z"]] = right * 0.01 * radius / tan(BETA)
        assert abs(mesh.direction[place[name]]) > 0.03
        assert mesh.direction @ motion == pytest.approx(0, abs=1e-15)
    both = np.zeros(system.size)
    both[[place["driver.z"], place["driven.z"]]] = 1.0
    assert mesh.direction @ both == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(np.abs(mesh.direction[[place["driver.z"], place["driven.z"]]]), TANGENT, rtol=1e-12)
    hands = {("right", False): "left", ("left", False): "right"}.get((hand, internal is not None), hand)
    assert train.rotors[1]["hand"] == hands


@KINDS
def test_supports_carry_the_thrust(tmp_path, sense, internal, hand) -> None:
    """A right-handed gear that drives counter-clockwise is pushed along z, by F tan beta_b; its mate the other way."""
    p = pair(sense, internal, hand)
    system = built(p, tmp_path)
    (force,) = np.abs(static_mesh_force(system))
    stiffness = system.mean_stiffness_matrix()
    rigid = mean_modes(system).rigid
    shifted = np.linalg.lstsq(stiffness, np.asarray(system.load), rcond=1e-13)[0]
    assert rigid.sum() == 1
    thrust = [2.0e8 * shifted[list(system.coordinates).index(f"{name}.z")] for name in ("driver", "driven")]
    towards = (1 if sense == "counter-clockwise" else -1) * (1 if hand == "right" else -1)
    np.testing.assert_allclose(thrust, [towards * force * TANGENT, -towards * force * TANGENT], rtol=1e-9)
    found = told(p, tmp_path)[0]
    assert found["axial_force"] == pytest.approx(thrust[0], rel=1e-9)
    assert found["total_contact_ratio"] == pytest.approx(found["contact_ratio"] + found["overlap_ratio"])
    assert found["overlap_ratio"] == pytest.approx(0.02 * np.sin(BETA) / (pi * 0.003))


def told(system: dict[str, Any], tmp_path) -> list[dict[str, Any]]:
    """Facts of the meshes that ``info`` lists."""
    config = read(tmp_path, as_text(system))
    found = facts(config, build(config.system))
    assert found is not None
    return found["meshes"]


def test_a_rectangular_wave_has_ramps_of_the_overlap_ratio_and_a_tooth_wave_is_the_stiffness(tmp_path) -> None:
    (mesh,) = built(pair(), tmp_path).meshes
    assert isinstance(mesh.waveform, Helical)
    (teeth,) = built(pair(waveform={"kind": "tooth"}), tmp_path).meshes
    assert isinstance(teeth.waveform, Tooth)
    train = Train(read(tmp_path, as_text(pair())).system)
    (stiffness,) = train.pair_teeth[0].stiffness
    overlap = float(train.pair_teeth[0].pairs[0].overlap_ratio)
    assert mesh.waveform.ramp == pytest.approx(overlap)
    np.testing.assert_allclose(teeth.mean_stiffness, stiffness.mean, rtol=1e-13)
    np.testing.assert_allclose(teeth.mean_stiffness, mesh.mean_stiffness, rtol=1e-12)
    x = np.linspace(0, 1, 50)
    whole = teeth.mean_stiffness * (1 + 2 * teeth.epsilon * teeth.waveform.value(x))
    np.testing.assert_allclose(whole, stiffness.curve.value(x), rtol=1e-10)
    # Its levels are those of the transverse section: the curve differs by what the teeth vary between the jumps.
    rectangular = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x))
    np.testing.assert_allclose(rectangular, whole, rtol=0.03)


def test_a_mesh_of_given_numbers_is_averaged_too(tmp_path) -> None:
    given = {"mean_stiffness": 3.0e8, "epsilon": 0.3, "contact_ratio": 1.5}
    (mesh,) = built(pair(**given), tmp_path).meshes
    assert (mesh.mean_stiffness, mesh.epsilon, mesh.waveform.contact_ratio) == (3.0e8, 0.3, 1.5)
    assert float(np.ptp(mesh.waveform.extremes())) < 1


def test_the_spur_limit(tmp_path) -> None:
    spur, near = pair(), pair()
    spur["gears"] = spur["gears"] | {"helix_angle": 0}
    near["gears"] = near["gears"] | {"helix_angle": "1e-10 deg"}
    one, two = built(spur, tmp_path), built(near, tmp_path)
    np.testing.assert_allclose(one.mean_stiffness_matrix(), two.mean_stiffness_matrix(), rtol=1e-9, atol=1e-3)
    x = np.linspace(0.001, 0.999, 333)
    np.testing.assert_allclose(one.meshes[0].waveform.value(x), two.meshes[0].waveform.value(x), atol=1e-9)


def test_an_axis_of_the_helix_angle_passes_from_spur_to_helical(tmp_path) -> None:
    text = as_text(pair(waveform={"kind": "tooth"}), methods={"floquet": {}})
    text += "sweep:\n  mesh_frequency: [1000, 2000]\n  gears.helix_angle: [0 deg, 12 deg, 27.9 deg]\n"
    config = read(tmp_path, text)
    three = build(config.at({"gears.helix_angle": np.arange(3)}))
    x = np.linspace(0, 1, 40)[:, None]
    for k, beta in enumerate(("0 deg", "12 deg", "27.9 deg")):
        one = pair(waveform={"kind": "tooth"})
        one["gears"] = one["gears"] | {"helix_angle": beta}
        single = built(one, tmp_path)
        np.testing.assert_allclose(three.mean_stiffness_matrix()[k], single.mean_stiffness_matrix(), rtol=1e-12)
        found = three.meshes[0].waveform.value(x)[:, k]
        np.testing.assert_allclose(found, single.meshes[0].waveform.value(x[:, 0]), atol=1e-9)


def test_speeds_of_the_input_are_mesh_frequencies_of_helical_gears_too(tmp_path) -> None:
    """The helix angle is a text with a unit where the speed of an axis is converted."""
    system = pair(hand=None)
    system["rotors"][0]["helix_angle"] = "-20 deg"
    text = as_text(system, sweep={"input_speed": ["600 rpm", "900 rpm"]}, methods={"floquet": {}})
    axis = read(tmp_path, text).axes[0]
    np.testing.assert_allclose(axis.mesh_frequency.values, 24 * np.array([600, 900]) * pi / 30, rtol=1e-14)


def test_growth_is_that_of_many_spur_meshes_side_by_side(tmp_path) -> None:
    """Thin slices as meshes of their own, each with its lag: staircases in place of ramps, of an error of 1/n^2."""
    p = pair()
    p["gears"] = p["gears"] | {"helix_angle": "4 deg"}
    system = built(p, tmp_path)
    (mesh,) = system.meshes
    lead = list(mean_modes(system).natural_frequency)
    omega = np.concatenate([2 * w * np.linspace(0.98, 1.02, 9) for w in lead[-2:]])
    growth = solve(system, omega).growth_rate
    assert growth.max() > 100
    errors = []
    for n in (10, 40):
        slices = tuple(
            replace(
                mesh, name=f"slice{k}", mean_stiffness=mesh.mean_stiffness / n,
                waveform=Rectangular(mesh.waveform.contact_ratio), lag=float(mesh.waveform.ramp) * (k + 0.5) / n,
            )
            for k in range(n)
        )  # fmt: skip
        errors.append(np.max(np.abs(solve(replace(system, meshes=slices), omega).growth_rate - growth)))
    assert errors[0] < 0.05 * growth.max()
    assert errors[1] < errors[0] / 8


def test_undercut_and_tips_that_collide_are_told_of_helical_teeth(tmp_path) -> None:
    """13 teeth at 20 degrees count as 13/cos^3(beta) = 15.7: less than 17.1."""
    system = pair()
    system["rotors"][0]["teeth"] = 13
    (undercut,) = (n for n in told(system, tmp_path)[0]["notices"] if n["name"] == "undercut")
    angle = np.arctan(tan(ALPHA) / cos(BETA))
    assert undercut["limit"] == pytest.approx(
        1.25 - 0.25 / (1 - np.sin(ALPHA)) * (1 - np.sin(angle)) - 6.5 / cos(BETA) * np.sin(angle) ** 2, rel=1e-12
    )
    assert undercut["text"].startswith("undercut, the profile shift is 0 and should be at least 0.1049")
    close = pair(internal=1)
    close["rotors"][0]["teeth"] = 75
    found = {notice["name"]: notice["text"] for notice in told(close, tmp_path)[0]["notices"]}
    assert "the tips collide" in found["trochoid_interference"]


# ---- planetary sets


def helical_set(sense: str = "counter-clockwise") -> dict[str, Any]:
    system = in_a_train("sun", "ring", sense)
    system["gears"] = system["gears"] | {"helix_angle": "15 deg"}
    for rotor in system["rotors"]:
        rotor["support"] = rotor["support"] | {"axial_stiffness": 5.0e7}
    return system


@pytest.mark.parametrize("sense", ["counter-clockwise", "clockwise"])
def test_members_of_a_set_that_screw_along_their_teeth_deflect_none(tmp_path, sense) -> None:
    p = helical_set(sense)
    system = built(p, tmp_path)
    train = Train(read(tmp_path, as_text(p)).system)
    place = {name: k for k, name in enumerate(system.coordinates)}
    directions = np.stack([mesh.direction for mesh in system.meshes])
    signs = {"sun": 1, "ring": -1}
    for member, sign in signs.items():
        motion = np.zeros(system.size)
        radius = 0.001 / cos(radians(15)) * {"sun": 29, "ring": 69}[member]
        motion[place[member]] = train.signs[member] * 0.01
        motion[place[f"{member}.z"]] = sign * 0.01 * radius / tan(radians(15))
        np.testing.assert_allclose(directions @ motion, 0, atol=1e-15)
    along = np.zeros(system.size)
    along[[place[f"{member}.z"] for member in ("sun", "ring", "carrier")]] = 1.0
    np.testing.assert_allclose(directions @ along, 0, atol=1e-15)
    assert np.count_nonzero(directions[:, place["sun.z"]]) == 7
    # The carrier takes its planets along.
    assert system.mass[place["carrier.z"], place["carrier.z"]] == pytest.approx(1.9 + 7 * 0.4)
    found = told(p | {"outputs": [{"rotor": "carrier", "torque": 50.0}]}, tmp_path)
    # The sun drives, right-handed; the planets turn against it on the carrier and drive the ring, left-handed.
    towards = 1 if sense == "counter-clockwise" else -1
    assert [np.sign(mesh["axial_force"]) for mesh in found] == [towards] * 14


@pytest.mark.parametrize("meshes", [{"sun": {}, "ring": {}}, {"sun": TEETH, "ring": TEETH}], ids=["trapezoid", "tooth"])
def test_a_helical_set_agrees_with_the_kind_planetary(tmp_path, meshes) -> None:
    """Waves and lags: inertias and supports are given in other forms."""
    single, train = (section("sun", "ring", "counter-clockwise") for section in (alone, in_a_train))
    single |= {"meshes": meshes, "gears": single["gears"] | {"helix_angle": "15 deg"}}
    train["gears"] = train["gears"] | {"helix_angle": "15 deg"}
    train["planetary_sets"][0]["meshes"] = meshes
    one, two = built(single, tmp_path), built(train, tmp_path)
    teeth = {mesh.name.split(".")[1]: mesh.teeth for mesh in Train(read(tmp_path, as_text(train)).system).meshes}
    for left, right in zip(one.meshes, two.meshes, strict=True):
        np.testing.assert_allclose(left.mean_stiffness, right.mean_stiffness, rtol=1e-12)
        x = np.linspace(0, 1, 30)
        np.testing.assert_allclose(left.waveform.value(x), right.waveform.value(x), atol=1e-12)
        assert float(left.lag) % 1 == pytest.approx(float(right.lag) % 1, abs=1e-12)
        (stiffness,) = teeth[right.name.split(".")[1]].stiffness
        np.testing.assert_allclose(left.mean_stiffness, stiffness.mean, rtol=1e-12)
        own = getattr(left.waveform, "total_contact_ratio", getattr(left.waveform, "contact_ratio", None))
        assert float(own) == pytest.approx(stiffness.pair.total_contact_ratio)


# ---- a user's own


def test_a_helical_reducer_with_signed_helix_angles_is_built() -> None:
    train = Train(load(CASES / "a1_helical.yaml").system)
    pairs = [train.pair_teeth[k].pairs[0] for k in (0, 1)]
    first = 0.028 * np.sin(radians(23)) / (pi * 0.00175)
    assert [one.overlap_ratio for one in pairs] == pytest.approx([first, 0.04 * np.sin(BETA) / (pi * 0.0025)])
    succeeds("check", CASES / "a1_helical.yaml")
