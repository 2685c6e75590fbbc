"""Trains of any shape: geometry of the lines of action, splits, idlers, internal gears, loops; batches of them."""

from __future__ import annotations

import copy
from dataclasses import replace
from fractions import Fraction
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
import pytest
from gearbox_trains import gear, mesh, tractor, train, turned
from hypothesis import given
from hypothesis import strategies as st

from gearstab.gears.geometry import Gear
from gearstab.gears.mesh_stiffness import mesh_stiffness
from gearstab.gears.pair import Pair
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.systems import build
from gearstab.systems.kinematics import TrainError

ANGLES = st.floats(-pi, pi)
SENSES = st.sampled_from(["counter-clockwise", "clockwise"])
ALPHA = radians(20)


def spin(sense: str) -> int:
    return 1 if sense == "counter-clockwise" else -1


def centre(system: Any, driver: int, driven: int, internal: bool = False) -> float:
    """Distance of the axes of two gears of a mesh, by its base radii."""
    g = system.meshes[0].direction
    return float(abs(abs(g[driver]) - abs(g[driven]) if internal else abs(g[driver]) + abs(g[driven])) / cos(ALPHA))


@given(psi=ANGLES, sense=SENSES, kind=st.sampled_from(["external", "driven", "driver"]))
def test_turning_a_pair_as_one_body_does_not_deflect_its_teeth(psi: float, sense: str, kind: str) -> None:
    ring = gear("b", 60, internal=True, inertia=0.1, mass=1.0)
    rotors = [gear("a", 20), gear("b", 41) if kind == "external" else ring]
    if kind == "driver":
        rotors.reverse()
    names = [rotor["name"] for rotor in rotors]
    system = build(train(
        rotors, [mesh("m", *names, position=psi)], input={"rotor": names[0], "sense": sense}
    ))  # fmt: skip
    distance = centre(system, 0, 1, kind != "external")
    places = {names[0]: 0j, names[1]: distance * np.exp(1j * psi)}
    same = -1 if kind == "external" else 1
    spins = {names[0]: spin(sense), names[1]: same * spin(sense)}
    motion = turned(system, places, spins)
    assert abs(system.meshes[0].direction @ motion) < 1e-15


def test_the_force_of_a_mesh_turns_the_driven_gear_and_parts_external_gears() -> None:
    for sense in ("counter-clockwise", "clockwise"):
        system = build(
            train([gear("a", 20), gear("b", 41)], [mesh("m", "a", "b")], input={"rotor": "a", "sense": sense})
        )
        # The driven gear stands to the right: the force on it, 20 degrees off the tangent, points away and along the
        # motion of the driver's rightmost tooth.
        force_on_driven = -system.meshes[0].direction[4:6]
        np.testing.assert_allclose(force_on_driven, [sin(ALPHA), spin(sense) * cos(ALPHA)], atol=1e-15)


def test_a_pinion_pushes_its_ring_away_and_a_ring_its_pinion_inwards() -> None:
    ring = gear("b", 60, internal=True, inertia=0.1, mass=1.0)
    driven = build(train([gear("a", 20), ring], [mesh("m", "a", "b", position=pi)]))
    # The ring's centre stands to the left of the pinion's, the teeth in mesh to the right.
    np.testing.assert_allclose(-driven.meshes[0].direction[4:6], [sin(ALPHA), cos(ALPHA)], atol=1e-15)
    driver = build(train([ring, gear("a", 20)], [mesh("m", "b", "a")]))
    np.testing.assert_allclose(-driver.meshes[0].direction[4:6], [-sin(ALPHA), cos(ALPHA)], atol=1e-15)


@given(psi=st.lists(ANGLES, min_size=3, max_size=3), sense=SENSES)
def test_turning_a_whole_train_as_one_body_does_not_deflect_any_teeth(psi: list[float], sense: str) -> None:
    names = ["a", "idler", "c", "d", "e"]
    teeth = [20, 33, 27, 19, 44]
    rotors = [gear(name, z) for name, z in zip(names, teeth, strict=True)]
    meshes = [mesh("1", "a", "idler", position=psi[0]), mesh("2", "idler", "c", position=psi[1]),
              mesh("3", "d", "e", position=psi[2])]  # fmt: skip
    shaft = {"name": "s", "between": ["c", "d"], "stiffness": 1e5}
    system = build(train(rotors, meshes, shafts=[shaft], input={"rotor": "a", "sense": sense}))
    places, spins = {"a": 0j}, {"a": spin(sense)}
    for name, before, driver, angle in (("idler", "a", 0, psi[0]), ("c", "idler", 1, psi[1])):
        places[name] = places[before] + 1e-3 * (teeth[driver] + teeth[driver + 1]) * np.exp(1j * angle)
        spins[name] = -spins[before]
    places["d"], spins["d"] = places["c"], spins["c"]
    places["e"], spins["e"] = places["d"] + 1e-3 * (19 + 44) * np.exp(1j * psi[2]), -spins["d"]
    motion = turned(system, places, spins)
    for item in system.meshes:
        assert abs(item.direction @ motion) < 1e-15


def test_an_idler_changes_the_sense_and_not_the_ratio() -> None:
    rotors = [gear("a", 20), gear("idler", 33), gear("c", 40)]
    p = train(rotors, [mesh("1", "a", "idler"), mesh("2", "idler", "c")], outputs=[{"rotor": "c", "torque": 100.0}])
    system = build(p)
    assert [item.frequency_ratio for item in system.meshes] == [1, 1]
    forces = static_mesh_force(system)
    # The same force goes through both meshes: torque of the output over its base radius.
    np.testing.assert_allclose(forces, 100 / (2e-3 * 20 * cos(ALPHA)), rtol=1e-9)
    assert system.load is not None
    np.testing.assert_allclose(system.load[:3], [50.0, 0.0, -100.0])


def test_outputs_without_torque_share_the_power() -> None:
    rotors = [gear("a", 20), gear("b", 40), gear("c", 60)]
    p = train(rotors, [mesh("1", "a", "b"), mesh("2", "a", "c", position=pi)], outputs=[{"rotor": "b"}, {"rotor": "c"}])
    p["input"]["torque"] = 10.0
    system = build(p)
    assert system.load is not None
    np.testing.assert_allclose(system.load[:3], [10.0, -10.0, -15.0])
    # The input's torque in halves on its two meshes; their supports only shift both.
    np.testing.assert_allclose(static_mesh_force(system), 5 / (2e-3 * 10 * cos(ALPHA)), rtol=1e-9)


def split(teeth: int) -> dict[str, Any]:
    """Power on two ways between two gears, closed in a loop through the output gear; teeth: of the last gear of one."""
    rotors = [gear(name, z) for name, z in (("in", 20), ("a", 40), ("b", 40), ("c", 18), ("d", teeth), ("out", 54))]
    meshes = [mesh("1a", "in", "a"), mesh("1b", "in", "b", position=pi),
              mesh("2a", "c", "out"), mesh("2b", "d", "out", position=pi)]  # fmt: skip
    shafts = [{"name": f"s{x}", "between": [x, y], "stiffness": 1e5} for x, y in (("a", "c"), ("b", "d"))]
    return train(rotors, meshes, shafts=shafts, outputs=[{"rotor": "out", "torque": 300.0}])


def test_a_split_that_closes_shares_the_load_and_one_that_does_not_jams() -> None:
    system = build(split(18))
    forces = static_mesh_force(system)
    np.testing.assert_allclose(
        forces, np.repeat([300 / 6 / (2e-3 * 10), 300 / (2e-3 * 27)], 2) / 2 / cos(ALPHA), rtol=1e-9
    )
    assert np.count_nonzero(mean_modes(system).rigid) == 1
    assert [item.frequency_ratio for item in system.meshes] == [1, 1, Fraction(9, 20), Fraction(9, 20)]
    with pytest.raises(TrainError, match="jams here: no speeds of in, a, c, b, d, out meet all"):
        build(split(19))


def test_a_rotor_left_alone_is_named() -> None:
    p = train([gear("a", 20), gear("b", 40), gear("c", 30)], [mesh("m", "a", "b")])
    with pytest.raises(TrainError) as caught:
        build(p)
    assert caught.value.where == ("rotors", 2)
    assert "is not connected" in str(caught.value)


def test_a_torsional_two_stage_train_is_that_of_lin_and_parker() -> None:
    radii = [1e-3 * z * cos(ALPHA) for z in (20, 40, 50)]
    inertias = [2e-4, 5e-3, 1e-2]
    rotors = [gear(n, z, inertia=j, support=None) for n, z, j in zip("abc", (20, 40, 50), inertias, strict=True)]
    found = build(train(rotors, [mesh("first", "a", "b"), mesh("second", "b", "c", epsilon=0.2, lag=-0.3)]))
    expected = build({
        "kind": "two_stage", "inertias": [j / r**2 for j, r in zip(inertias, radii, strict=True)],
        "input_shaft_stiffness": 0.0, "tooth_ratio": Fraction(1), "damping_ratio": 0.0,
        "meshes": [mesh("first", "a", "b"), mesh("second", "b", "c", epsilon=0.2, phasing=0.3)],
    })  # fmt: skip
    modes, others = mean_modes(found), mean_modes(expected)
    np.testing.assert_allclose(modes.natural_frequency[1:], others.natural_frequency[1:], rtol=1e-12)
    shares, theirs = np.abs(modes.mesh_deflection), np.abs(others.mesh_deflection)
    np.testing.assert_allclose(shares[1:], theirs[1:], rtol=1e-9)
    for one, other in zip(found.meshes, expected.meshes, strict=True):
        # A phasing is a lead.
        assert float(one.lag - other.lag) % 1 == pytest.approx(0.0, abs=1e-15)
        assert one.frequency_ratio == other.frequency_ratio


def test_shafts_by_their_dimensions_and_dampers_of_their_own() -> None:
    rotors = [{"name": "motor", "inertia": 0.2}, gear("a", 20), gear("b", 30)]
    shaft = {
        "name": "s",
        "between": ["motor", "a"],
        "diameter": 0.03,
        "bore": 0.01,
        "length": 0.2,
        "damping_ratio": 0.1,
    }
    system = build(train(rotors, [mesh("m", "a", "b")], shafts=[shaft]))
    k = 80e9 * pi * (0.03**4 - 0.01**4) / 32 / 0.2
    assert system.stiffness[0, 1] == pytest.approx(-k, rel=1e-14)
    j1, j2 = 0.2, float(system.mass[1, 1])
    # No mesh has damping: the shaft's counts once.
    assert system.damping is not None
    assert system.damping[0, 1] == pytest.approx(-0.2 * np.sqrt(k * j1 * j2 / (j1 + j2)), rel=1e-13)
    disc = pi * 7850 * 0.02 * 0.02**2
    assert j2 == pytest.approx(disc * 0.02**2 / 2, rel=1e-13)


def test_an_internal_pair_with_a_measured_stiffness() -> None:
    ring = gear("ring", 60, internal=True, inertia=0.1, mass=1.0)
    link = {"name": "m", "gears": ["a", "ring"], "single_pair_stiffness": 2e8}
    system = build(train([gear("a", 20), ring], [link]))
    pair = Pair(
        Gear(20, 2e-3, face_width=0.02), Gear(60, 2e-3, face_width=0.02, internal=True),
    )  # fmt: skip
    c = pair.contact_ratio
    assert 1 < c < 2 or 2 < c < 3
    assert float(system.meshes[0].waveform.contact_ratio) == pytest.approx(c, rel=1e-12)
    # One pair of 200 N/um all along its path: the mean is c of them.
    assert float(system.meshes[0].mean_stiffness) == pytest.approx(c * 2e8, rel=1e-12)
    assert float(system.meshes[0].lowest_stiffness) == pytest.approx(np.floor(c) * 2e8, rel=1e-12)
    # Without it that of the teeth, on a rigid rim or on one that is held at its outer radius.
    rigid, held = (
        build(train([gear("a", 20), ring | rim], [{"name": "m", "gears": ["a", "ring"]}]))
        for rim in ({}, {"bore_radius": 0.07})
    )
    assert float(rigid.meshes[0].mean_stiffness) == pytest.approx(mesh_stiffness(pair).mean, rel=1e-12)
    elastic = replace(pair, wheel=replace(pair.wheel, bore_radius=0.07))
    assert float(held.meshes[0].mean_stiffness) == pytest.approx(mesh_stiffness(elastic).mean, rel=1e-12)
    assert held.meshes[0].mean_stiffness < 0.9 * rigid.meshes[0].mean_stiffness


def test_the_body_of_an_internal_gear_is_its_rim() -> None:
    ring = gear("ring", 60, internal=True, bore_radius=0.07)
    system = build(train([gear("a", 20), ring], [{"name": "m", "gears": ["a", "ring"]}]))
    mass = pi * 7850 * 0.02 * (0.07**2 - 0.06**2)
    assert float(system.mass[1, 1]) == pytest.approx(mass * (0.07**2 + 0.06**2) / 2, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"teeth": 20, "module": 3e-3}, "the base pitches differ"),
        ({"profile_shift": 1.4}, "pointed teeth"),
        ({"addendum": 0.2}, "contact breaks off: contact ratio 0\\."),
    ],
)
def test_gears_that_cannot_mesh_are_named_with_the_number(changes: dict[str, Any], message: str) -> None:
    rotors = [gear("a", 20) | changes, gear("b", 40, addendum=changes.get("addendum", 1.0))]
    with pytest.raises(TrainError, match=message) as caught:
        build(train(rotors, [{"name": "m", "gears": ["a", "b"]}]))
    assert caught.value.where == ("meshes", 0)


SWEPT = {
    "module": np.array([2.0e-3, 2.5e-3, 3.0e-3]),
    "pressure_angle": np.radians([20.0, 22.0, 25.0]),
    "face_width": np.array([0.01, 0.02, 0.03]),
    "addendum": np.array([0.9, 1.0, 1.1]),
}


@pytest.mark.parametrize("key", [*SWEPT, "profile_shift", "density", "lubricant"])
def test_a_batch_is_the_same_as_its_members(key: str) -> None:
    """First stage of the tractor gearbox, with everything from the teeth."""
    base = tractor()
    base |= {"rotors": base["rotors"][:3], "meshes": base["meshes"][:1], "shafts": base["shafts"][:1]}
    base["outputs"] = [{"rotor": "gear2", "torque": 60.0}]
    for item in base["meshes"]:
        del item["mean_stiffness"], item["epsilon"], item["contact_ratio"]
        item["friction"] = {"kind": "xu_kahraman", "viscosity": 1e-2, "roughness": 0.4e-6}

    def changed(pick: Any) -> dict[str, Any]:
        p = copy.deepcopy(base)
        if key in SWEPT:
            p["gears"] = p["gears"] | {key: pick(SWEPT[key])}
            if key == "face_width":
                for rotor in p["rotors"]:
                    rotor.pop("face_width", None)
        elif key == "density":
            p["material"] = {"density": pick(np.array([2700.0, 7850.0, 8000.0]))}
        elif key == "lubricant":
            p["meshes"][0]["friction"]["viscosity"] = pick(np.array([5e-3, 1e-2, 5e-2]))
        else:
            p["rotors"][1]["profile_shift"] = pick(np.array([0.1, 0.19, 0.3]))
        return p

    many = build(changed(lambda values: values))
    assert many.batch == (3,)
    x = np.array([0.05, 0.4, 0.8])
    for k in range(3):
        one = build(changed(lambda values, k=k: values[k]))
        for found, expected in (
            (many.mass, one.mass), (many.mean_stiffness_matrix(), one.mean_stiffness_matrix()),
            (many.damping, one.damping),
        ):  # fmt: skip
            all_of_them = np.broadcast_to(np.asarray(found), (3, many.size, many.size))
            # Sums of a few entries, in another order.
            np.testing.assert_allclose(all_of_them[k], np.asarray(expected), rtol=1e-12, atol=1e-6)
        for whole, single in zip(many.terms, one.terms, strict=True):
            assert whole.stiffness is not None
            assert single.stiffness is not None
            values = np.broadcast_to(whole.stiffness.value(np.broadcast_to(x[:, None], (3, 3))), (3, 3))
            np.testing.assert_allclose(values[:, k], single.stiffness.value(x), rtol=1e-9, atol=1e-6)


def test_a_computed_wave_and_its_reductions() -> None:
    rotors = [gear("a", 19), gear("b", 48)]

    def one(**more: Any) -> Any:
        return build(train(rotors, [{"name": "m", "gears": ["a", "b"], **more}])).meshes[0]

    pair = Pair(Gear(19, 2e-3, face_width=0.02), Gear(48, 2e-3, face_width=0.02))
    curve = mesh_stiffness(pair)
    whole = one(waveform={"kind": "tooth"}, lag=0.1)
    x = np.linspace(0, 1, 41)
    stiffness = whole.mean_stiffness + 2 * whole.amplitude * whole.waveform.value(x)
    np.testing.assert_allclose(stiffness, curve.curve.value(x), rtol=1e-12)
    assert float(whole.lag) == 0.1
    few = one(waveform={"kind": "tooth", "harmonics": 3})
    for s in (1, 2, 3):
        np.testing.assert_allclose(few.waveform.fourier(s), whole.waveform.fourier(s), rtol=1e-12)
    assert np.hypot(*few.waveform.fourier(4)) == 0
    first = one(reduction="first harmonic")
    amplitude = 2 * first.amplitude * np.hypot(*first.waveform.fourier(1))
    assert amplitude == pytest.approx(curve.harmonic(1) * curve.mean, rel=1e-9)
    low, high = curve.levels
    levels = one()
    assert float(levels.lowest_stiffness) == pytest.approx(low, rel=1e-9)
    assert float(levels.lowest_stiffness + 2 * levels.amplitude) == pytest.approx(high, rel=1e-9)
    softer = one(double_contact_factor=0.76)
    assert float(softer.lowest_stiffness) == pytest.approx(low, rel=1e-9)
    assert float(softer.lowest_stiffness + 2 * softer.amplitude) == pytest.approx(0.76 * high, rel=1e-9)


def test_waves_with_levels_of_their_own_keep_them() -> None:
    rotors = [gear("a", 19), gear("b", 48)]
    sampled = {"kind": "sampled", "phase": [0.0, 0.5], "stiffness": [2e8, 4e8]}
    item = build(train(rotors, [{"name": "m", "gears": ["a", "b"], "waveform": sampled}])).meshes[0]
    assert float(item.mean_stiffness) == pytest.approx(3e8)
    assert float(item.lowest_stiffness) == pytest.approx(2e8)
    parabolic = {"kind": "pair", "shape": "parabolic"}
    item = build(train(rotors, [{"name": "m", "gears": ["a", "b"], "waveform": parabolic}])).meshes[0]
    pair = Pair(Gear(19, 2e-3, face_width=0.02), Gear(48, 2e-3, face_width=0.02))
    assert float(item.mean_stiffness) == pytest.approx(mesh_stiffness(pair).mean, rel=1e-9)
    # At the entry of a pair: two ends of parabolas and a part of the way up, by hand with s = 1/c.
    ends, c = 0.55, pair.contact_ratio
    value = lambda z: 1 - (1 - ends) * (2 * z - 1) ** 2  # noqa: E731
    mean = c * (1 - (1 - ends) / 3)
    expected = (value(0.0) + value(1 / c)) / mean
    found = 1 + 2 * item.epsilon * item.waveform.value(np.array(1e-12))
    assert float(found) == pytest.approx(expected, rel=1e-9)
