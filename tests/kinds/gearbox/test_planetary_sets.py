"""Planetary sets in a gearbox: exact references of six trains, the kind planetary, equilibrium, and what cannot be."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML
from scenes import DATA, problems, read, scene_text

from gearstab.floquet import solve
from gearstab.info import speeds
from gearstab.info import train as info_train
from gearstab.mesh import speed_factors
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.symmetry import natural_modes, phase_step, type_names
from gearstab.systems import build
from gearstab.systems.gearbox.train import Train

TEXT = (DATA / "reference_trains.json").read_text()
TRAINS = json.loads(re.sub(r'"(\w+)\.(\w+)"', r'"\1 \2"', TEXT))["trains"]
"""Bodies are called ``one sun``: names have no dots."""
STIFF = {"mean_stiffness": 3.0e8, "epsilon": 0.1, "contact_ratio": 1.5}


def as_text(system: dict[str, Any], **sections: Any) -> str:
    from io import StringIO

    stream = StringIO()
    YAML().dump({"system": system, **sections}, stream)
    return stream.getvalue()


def configured(train: dict[str, Any], rule: str) -> dict[str, Any]:
    """A reference train as a section ``system``, each member a rotor; planets that do not fit equally are assembled."""
    system: dict[str, Any] = {
        "kind": "gearbox", "gears": {"module": 0.002, "pressure_angle": "20 deg", "face_width": 0.02},
        "rotors": [], "planetary_sets": [], "meshes": [], "shafts": [], "input": {"rotor": train["input"]},
    }  # fmt: skip
    for stage in train["stages"]:
        teeth = stage["teeth"]
        name = {part: f"{stage['name']} {part}" for part in (*teeth, "carrier")}
        if stage["kind"] == "parallel":
            system["rotors"] += [{"name": name[part], "teeth": teeth[part]} for part in ("pinion", "wheel")]
            system["meshes"].append({"name": stage["name"], "gears": [name["pinion"], name["wheel"]], **STIFF})
            continue
        held = [part for part in ("sun", "ring", "carrier") if name[part] in train["held"]]
        system["rotors"] += [
            {"name": name["sun"], "teeth": teeth["sun"]}, {"name": name["carrier"], "inertia": 0.01},
            {"name": name["ring"], "teeth": teeth["ring"], "internal": True},
        ]  # fmt: skip
        planets = {"count": teeth["planets"], "teeth": teeth["planet"]}
        if (teeth["sun"] + teeth["ring"]) % teeth["planets"]:
            planets["angles"] = "assemble"
        system["planetary_sets"].append({
            "name": stage["name"], **{part: name[part] for part in ("sun", "ring", "carrier")}, "planets": planets,
            "meshes": {"sun": STIFF, "ring": STIFF}, "phases": {"rule": rule}, **({"held": held[0]} if held else {}),
        })  # fmt: skip
    for k, ends in enumerate(train["connections"]):
        system["shafts"].append({"name": f"s{k}", "between": ends, "stiffness": 1.0e6})
    return system


@pytest.mark.parametrize("train", TRAINS, ids=lambda train: train["name"])
def test_speeds_frequencies_and_lags_are_those_of_the_reference(tmp_path: Path, train: dict[str, Any]) -> None:
    p = read(tmp_path, as_text(configured(train, "pitch_point"))).system
    found = Train(p)
    speeds = {body.replace(".", " "): str(speed) for body, speed in found.speeds.items()}
    assert speeds == train["speeds_over_input"]
    meshes = {mesh.name: mesh for mesh in found.meshes}
    system = {mesh.name: mesh for mesh in build(p).meshes}
    ratios = [Fraction(ratio) for ratio in train["frequency_ratios_to_first"]]
    for stage, mesh, ratio in zip(train["stages"], train["meshes"], ratios, strict=True):
        if stage["kind"] == "parallel":
            assert system[stage["name"]].frequency_ratio == ratio
            continue
        for n, lag in enumerate(mesh["gamma_sn_lag"], start=1):
            own, ring = (meshes[f"{stage['name']}.{kind}.{n}"] for kind in ("sun", "ring"))
            assert own.lag == Fraction(lag)
            assert system[own.name].frequency_ratio == system[ring.name].frequency_ratio == ratio
            if stage["teeth"]["ring"] == stage["teeth"]["sun"] + 2 * stage["teeth"]["planet"]:
                # Of standard teeth the lag between pitch points is exact but for the rounding of PlanetSet, 1e-12.
                assert float(ring.lag) % 1 == pytest.approx(float(Fraction(mesh["gamma_rn_lag"][n - 1])), abs=1e-12)
    cycles = Fraction(train["meshes"][0]["mesh_frequency_per_input_speed"])
    assert found.cycles == cycles


@pytest.mark.parametrize("train", TRAINS, ids=lambda train: train["name"])
def test_info_tells_ratios_lags_and_the_common_period_of_the_reference(tmp_path: Path, train: dict[str, Any]) -> None:
    """As ``info --json`` writes it: fractions as text."""
    sweep = {"mesh_frequency": [100.0, 200.0]}
    config = read(tmp_path, as_text(configured(train, "pitch_point"), sweep=sweep, methods={"perturbation": {}}))
    system = build(config.system)
    found = {"train": info_train.facts(config, system), "common_period": speeds.common_period(system)}
    found = json.loads(json.dumps(found))
    rotors = {rotor["name"]: rotor["speed_ratio"] for rotor in found["train"]["rotors"]}
    rotors |= {f"{item['name']} planet": item["planet_speed_ratio"] for item in found["train"]["sets"]}
    assert rotors == train["speeds_over_input"]
    meshes = {mesh["name"]: mesh for mesh in found["train"]["meshes"]}
    period = found["common_period"]
    assert period["in_periods_of_omega"] == float(train["common_period_in_cycles_of_first_mesh"])
    counts = train["cycles_of_each_mesh_in_common_period"]
    for stage, mesh, ratio, cycles in zip(
        train["stages"], train["meshes"], train["frequency_ratios_to_first"], counts, strict=True
    ):
        names = [stage["name"]]
        if stage["kind"] == "planetary":
            names = [f"{stage['name']}.sun.{n + 1}" for n in range(len(mesh["gamma_sn_lag"]))]
            assert [meshes[name]["lag"] for name in names] == mesh["gamma_sn_lag"]
        for name in names:
            assert meshes[name]["order"] == mesh["mesh_frequency_per_input_speed"]
            assert meshes[name]["frequency_ratio"] == ratio
            assert period["mesh_cycles"][name] == int(cycles)


BODIES = ("sun", "ring", "carrier")
R_B = {body: 0.001 * z * np.cos(np.deg2rad(20)) for body, z in (("sun", 29), ("planet", 20), ("ring", 69))}
ALONE = {
    "masses": {"sun": 0.7, "ring": 3.1, "carrier": 1.9, "planet": 0.4},
    "inertias": {"sun": 0.5, "ring": 2.9, "carrier": 2.2, "planet": 0.3},
    "supports": {"sun": 2.0e7, "ring": 5.0e8, "carrier": 4.0e8, "planet": 2.0e8, "sun_rotation": 3.0e6,
                 "ring_rotation": 7.0e8, "carrier_rotation": 1.0e6},
}  # fmt: skip
MESHES = {"sun": {"epsilon": 0.4, "damping": 40.0}, "ring": {"single_pair_stiffness": 2.5e8}}


def alone(driving: str, held: str, sense: str) -> dict[str, Any]:
    """A planetary gear of 29/20/69 teeth, 7 planets out of phase."""
    return {
        "kind": "planetary", "planets": 7, "ring": {"kind": "rigid"}, **ALONE, "meshes": MESHES, "damping_ratio": 0.003,
        "gears": {"module": 0.002, "pressure_angle": "20 deg", "face_width": 0.02},
        "teeth": {"sun": 29, "planet": 20, "ring": 69}, "input": driving, "fixed": held, "sense": sense,
    }  # fmt: skip


def in_a_train(driving: str, held: str, sense: str) -> dict[str, Any]:
    """The same as a gearbox of one set: angles in the place of lengths."""
    radius = R_B | {"carrier": 0.001 * (29 + 20)}
    rotors: list[dict[str, Any]] = [
        {
            "name": body, "mass": ALONE["masses"][body],
            "inertia": float(ALONE["inertias"][body] * radius[body] ** 2),
            "support": {"stiffness": ALONE["supports"][body],
                        "torsional_stiffness": float(ALONE["supports"][f"{body}_rotation"] * radius[body] ** 2)},
        } | ({} if body == "carrier" else {"teeth": 29 if body == "sun" else 69, "internal": body == "ring"})
        for body in BODIES
    ]  # fmt: skip
    (other,) = {*BODIES} - {driving, held}
    planets = {
        "count": 7, "teeth": 20, "mass": 0.4, "inertia": float(0.3 * radius["planet"] ** 2),
        "support": {"stiffness": ALONE["supports"]["planet"]},
    }  # fmt: skip
    return {
        "kind": "gearbox", "gears": {"module": 0.002, "pressure_angle": "20 deg", "face_width": 0.02},
        "rotors": rotors, "damping_ratio": 0.003, "input": {"rotor": driving, "sense": sense},
        "outputs": [{"rotor": other}],
        "planetary_sets": [{"name": "set", **{body: body for body in BODIES}, "held": held, "planets": planets,
                            "meshes": MESHES}],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("driving", "held", "sense"),
    [("sun", "ring", "counter-clockwise"), ("carrier", "ring", "clockwise"), ("ring", "sun", "counter-clockwise"),
     ("sun", "carrier", "clockwise")],
)  # fmt: skip
def test_a_train_of_one_set_is_the_planetary_gear(tmp_path: Path, driving: str, held: str, sense: str) -> None:
    """To 1e-10, as promised to users; both are sums of the same energies, in other coordinates."""
    systems = []
    for section in (alone(driving, held, sense), in_a_train(driving, held, sense)):
        config = read(
            tmp_path, as_text(section, sweep={"input_speed": ["600 rpm", "900 rpm"]}, methods={"floquet": {}})
        )
        systems.append((build(config.system), config.axes[0].mesh_frequency))
    (one, speeds), (other, same_speeds) = systems
    assert speeds is not None
    assert same_speeds is not None
    np.testing.assert_allclose(same_speeds.values, speeds.values, rtol=1e-14)
    first, second = mean_modes(one), mean_modes(other)
    np.testing.assert_allclose(second.natural_frequency, first.natural_frequency, rtol=1e-10)
    assert type_names(other, natural_modes(other)).count("translational, set") == type_names(
        one, natural_modes(one)
    ).count("translational")
    for k, mesh in enumerate(one.meshes):
        assert float(other.meshes[k].lag) % 1 == pytest.approx(float(mesh.lag) % 1, abs=1e-12)
        assert float(other.meshes[k].mean_stiffness) == pytest.approx(float(mesh.mean_stiffness), rel=1e-12)
    omega = np.linspace(0.3, 2.1, 60) * float(first.natural_frequency[-3])
    growth, again = solve(one, omega).growth_rate, solve(other, omega).growth_rate
    assert growth.max() > 0
    np.testing.assert_allclose(again, growth, rtol=0, atol=1e-10 * float(first.natural_frequency[-1]))


SPACED = [f"{360 / 98 * step:.12g} deg" for step in (0, 13, 29, 41, 56, 70, 84)]
"""Unequal places where 29 and 69 teeth fit."""


@pytest.mark.parametrize(
    ("of_gear", "of_set", "of_planets"),
    [({"angles": SPACED}, {}, {"angles": SPACED}),
     ({"carrier_speed": "from_teeth"}, {"carrier_speed": "from_teeth"}, {}),
     ({"angles": SPACED, "carrier_speed": "from_teeth"}, {"carrier_speed": "from_teeth"}, {"angles": SPACED}),
     ({"phases": {"sun_ring": 0.3}}, {"phases": {"sun_ring": 0.3}}, {})],
    ids=["unequal angles", "turning carrier", "both", "phase of the ring"],
)  # fmt: skip
@pytest.mark.parametrize(("driving", "held"), [("sun", "ring"), ("ring", "sun")])
def test_so_it_is_with_unequal_angles_and_a_turning_carrier(
    tmp_path: Path, driving: str, held: str, of_gear: dict[str, Any], of_set: dict[str, Any],
    of_planets: dict[str, Any],
) -> None:  # fmt: skip
    """The growth of both to 1e-10 of the largest frequency; matrices that turn act on the same motions."""
    gear, train = alone(driving, held, "counter-clockwise"), in_a_train(driving, held, "counter-clockwise")
    gear |= of_gear
    train["planetary_sets"][0] |= of_set
    train["planetary_sets"][0]["planets"] |= of_planets
    one, other = (read(tmp_path, as_text(section)).system.build() for section in (gear, train))
    first, second = mean_modes(one), mean_modes(other)
    np.testing.assert_allclose(second.natural_frequency, first.natural_frequency, rtol=1e-10)
    for k, mesh in enumerate(one.meshes):
        assert float(other.meshes[k].lag) % 1 == pytest.approx(float(mesh.lag) % 1, abs=1e-12)
    assert len(one.rotations) == len(other.rotations) == len(of_set.keys() & {"carrier_speed"})
    omega = np.linspace(0.3, 2.1, 25) * float(first.natural_frequency[-3])
    growth, again = solve(one, omega).growth_rate, solve(other, omega).growth_rate
    assert growth.max() > 0
    np.testing.assert_allclose(again, growth, rtol=0, atol=1e-10 * float(first.natural_frequency[-1]))


TWO = scene_text("planetary_sets_two")


SET = scene_text("planetary_sets_set")
PAIR_BESIDE = "  meshes: [{name: pair, gears: [wheel, pinion]}]\n"


def test_the_load_goes_through_all_meshes_by_virtual_work(tmp_path: Path) -> None:
    system = build(read(tmp_path, TWO).system)
    force = dict(zip((mesh.name for mesh in system.meshes), static_mesh_force(system), strict=True))
    lever = 0.001 * np.cos(np.deg2rad(20))
    ratio = 1 + 78 / 30
    for name, torque, planets in (("first", 12.0, 4), ("second", 12.0 * ratio, 3)):
        for kind in ("sun", "ring"):
            for n in range(1, planets + 1):
                # The force of the sun's torque on N meshes; the planets are free, so that the ring's carry the same.
                assert force[f"{name}.{kind}.{n}"] == pytest.approx(torque / (30 * lever) / planets, rel=1e-7)
    assert force["pair"] == pytest.approx(12.0 * ratio**2 / (25 * lever), rel=1e-7)
    assert np.count_nonzero(mean_modes(system).rigid) == 1


def test_modes_are_named_by_the_set_that_they_belong_to(tmp_path: Path) -> None:
    """Supported sun and carrier: three pairs of translational modes, and planet modes of four planets; the second set
    moves its sun alone, with planets fixed on a carrier that only turns.
    """
    system = build(read(tmp_path, TWO).system)
    kinds = type_names(system, natural_modes(system))
    counted = {kind: kinds.count(kind) for kind in set(kinds) if "," in kind}
    assert [symmetry.name for symmetry in system.symmetries] == ["first", "second"]
    # x, y of sun and carrier and a pair of each planet coordinate; one of each for T = 2 of four planets.
    assert counted == {"translational, first": 2 * 2 + 3 * 2, "planet, first": 3, "translational, second": 2 + 2}


def test_blocks_of_two_sets_are_those_found_without_their_symmetries(tmp_path: Path) -> None:
    from dataclasses import replace

    from gearstab.floquet.dispatch import reduction

    config = read(tmp_path, TWO.replace("input: {", "damping_ratio: 0.01\n  input: {"))
    system = build(config.system)
    declared, found = reduction(system), reduction(replace(system, symmetries=()))
    assert sorted(part.size for part in declared.parts) == sorted(part.size for part in found.parts)
    assert len(declared.parts) > 2


def test_the_damping_ratio_of_a_set_may_follow_the_stiffness(tmp_path: Path) -> None:
    """Its mean is the damping that does not follow."""
    system, found = configured(TRAINS[0], "entry"), []
    for follows in (False, True):
        for item in system["planetary_sets"]:
            damped = STIFF | {"damping_ratio": 0.05, "damping_follows_stiffness": follows}
            item["meshes"] = {"sun": damped, "ring": dict(damped)}
        found.append(build(read(tmp_path, as_text(system)).system))
    constant, varying = found[0].damping_matrix, found[1].averaged()
    mean = sum(term.damping.value(np.zeros(())) * np.outer(term.left, term.right) for term in varying.terms)
    # Sums of some ten products, in another order.
    np.testing.assert_allclose(varying.damping_matrix + mean, constant, rtol=0, atol=1e-14 * np.abs(constant).max())


def test_the_sun_of_a_set_is_no_remedy_for_the_other_meshes_of_a_train(tmp_path: Path) -> None:
    """A pair beside one set in phase: its waves have no lags that follow from the sun's teeth."""
    beside = SET.replace("    - {name: other, between: [carrier, pinion], stiffness: 1.0e5}\n", PAIR_BESIDE)
    alone, pair = (phase_step(build(read(tmp_path, text).system)) for text in (SET, beside))
    assert (alone, pair) == (0, None)


def test_an_angle_inside_an_axis_at_which_teeth_do_not_fit_is_told_at_its_point(tmp_path: Path) -> None:
    """Both ends of the axis fit, and so do the other planets, whose angles are no batch."""
    planets = 'count: 3, teeth: 24, angles: [0, "120 deg", "240 deg"]'
    axis = {"targets": ["planetary_sets.1.planets.angles.1"], "values": ["120 deg", 125, "140 deg"]}
    sweep = json.dumps({"mesh_frequency": [100.0, 200.0], "a": axis})
    text = TWO.replace("count: 3, teeth: 24", planets) + f"sweep: {sweep}\nmethods: {{floquet: {{}}}}\n"
    (found,) = problems(tmp_path, text)
    assert found.path == "system.planetary_sets.1.planets.angles"
    assert "the teeth of planet 2 do not fit" in found.message
    assert "(at a = 125.0)" in found.message
    assert found.hint == 'plain numbers are radians: write "125 deg"'


def test_a_supported_member_is_in_one_frame(tmp_path: Path) -> None:
    """Coordinates of a set turn with its carrier, those of a pair do not."""
    text = TWO.replace("{name: gear, teeth: 25}", "{name: gear, teeth: 25}\n    - {name: idler, teeth: 31}").replace(
        "meshes: [{name: pair", "meshes: [{name: side, gears: [sun, idler]}, {name: pair"
    )
    (found,) = problems(tmp_path, text)
    assert found.path == "system.rotors.1.support"
    assert "turns with its carrier" in found.message


def test_angles_of_planets_follow_the_teeth(tmp_path: Path) -> None:
    """Five planets of 108 places: the nearest to equal ones, and lags by the places."""
    p = read(tmp_path, TWO.replace("count: 4", "count: 5, angles: assemble", 1)).system
    train = Train(p)
    steps = [turn * 108 for turn in train.sets[0].turns]
    assert steps == [0, 22, 43, 65, 86]
    lags = [mesh.lag for mesh in train.meshes[:5]]
    # Planets of a sun that drives turn clockwise: gamma_sn = z_s psi_n/2 pi.
    assert lags == [30 * step / 108 % 1 for step in steps]
    assert [symmetry.name for symmetry in build(p).symmetries] == ["second"]


def spinning(parameters: dict[str, float]) -> dict[str, Any]:
    """The gear of Lin & Parker 1999 as a set: any teeth, since only I/r^2 and pressure angles matter."""
    z = {"sun": 30, "planet": 24, "ring": 78}
    alpha = parameters["alpha_s"]
    radius = {gear: 0.0015 * number * np.cos(alpha) for gear, number in z.items()} | {"carrier": 0.0015 * 54}
    number = {member: member[0] for member in (*BODIES, "planet")}

    def body(member: str) -> dict[str, Any]:
        key = number[member]
        torsion = parameters.get(f"k_{key}u", 0.0) * radius[member] ** 2
        support = {"stiffness": parameters[f"k_{key}"]} | ({"torsional_stiffness": float(torsion)} if torsion else {})
        own = {"mass": parameters[f"m_{key}"], "inertia": float(parameters[f"I_{key}"] * radius[member] ** 2)}
        return {**own, "support": support}

    rotors = [{"name": member, **body(member)} | ({} if member == "carrier" else {"teeth": z[member]})
              for member in BODIES]  # fmt: skip
    rotors[1]["internal"] = True
    mesh = {"epsilon": 0.1, "contact_ratio": 1.5}
    return {
        "kind": "gearbox", "gears": {"module": 0.003, "pressure_angle": alpha, "face_width": 0.02}, "rotors": rotors,
        "input": {"rotor": "carrier"},
        "planetary_sets": [{
            "name": "set", **{body: body for body in BODIES}, "held": "ring", "carrier_speed": "from_teeth",
            "planets": {"count": int(parameters["planets"]), "teeth": 24, **body("planet")},
            "meshes": {"sun": mesh | {"mean_stiffness": parameters["k_sp"]},
                       "ring": mesh | {"mean_stiffness": parameters["k_rp"]}},
        }],
    }  # fmt: skip


def whirl(system: Any, speed: float) -> tuple[np.ndarray, float]:
    """Whirl frequencies of the mean system at a carrier speed, and the largest growth rate."""
    size, zero = system.size, np.zeros((system.size, system.size))
    stiffness, gyroscopic = system.mean_stiffness_matrix(), zero
    for term in (term for rotation in system.rotations for term in rotation.terms()):
        part = float(speed_factors(np.asarray(speed), np.asarray(term.power), np.asarray(term.softening))) * term.matrix
        stiffness, gyroscopic = (stiffness, gyroscopic + part) if term.on_velocity else (stiffness + part, gyroscopic)
    inverse = np.linalg.inv(system.mass)
    state = np.block([[zero, np.eye(size)], [-inverse @ stiffness, -inverse @ gyroscopic]])
    values = np.linalg.eigvals(state)
    return np.sort(values.imag[values.imag > 10.0]), float(values.real.max())


SPINNING = json.loads((DATA / "rotation" / "planetary_carriers.json").read_text())["cases"]


@pytest.mark.parametrize("case", SPINNING, ids=lambda case: case["name"])
def test_whirl_in_the_frame_of_the_carrier_is_that_of_the_reference(tmp_path: Path, case: dict[str, Any]) -> None:
    """Eigenvalues of unsymmetric matrices of entries up to 1e10: rounding is some 1e-8 of them."""
    system = build(read(tmp_path, as_text(spinning(case["parameters"]))).system)
    (rotation,) = system.rotations
    assert rotation.speed_ratio == Fraction(1, 78)
    for at in case["with_pin_preload"]:
        frequencies, growth = whirl(system, at["carrier_speed_rad_s"])
        known = np.array(at["whirl_frequencies_rad_s"])
        np.testing.assert_allclose(frequencies, known[known > 10.0], rtol=1e-7)
        if not at["growing_eigenvalues_re_absim"] and at["eigenvalues_near_zero"] == 0:
            assert growth < 1e-7 * known.max()
