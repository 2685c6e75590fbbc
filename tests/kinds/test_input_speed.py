"""Input speeds of the kinds whose teeth are known, against the kinematics of rolling circles."""

import json
from fractions import Fraction
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import DATA, problems, read, scene_text, written

from gearstab.system import shared_period
from gearstab.systems import section
from gearstab.systems.kinematics import MeshMotion, Relation, TrainError, Undetermined, solve
from gearstab.systems.planetary.parts import Turning

RPM = np.pi / 30
SWEEP = 'sweep: {input_speed: {start: "600 rpm", stop: "1200 rpm", num: 3}}\nmethods: {floquet: {}}\n'
MESH = "mean_stiffness: 3.0e8, epsilon: 0.3, contact_ratio: 1.6"
PAIR = f"system: {{kind: gear_pair, equivalent_mass: 0.5, teeth: [20, 63], load: 1000, meshes: [{{{MESH}}}]}}\n"
GEARS = (
    "system: {kind: gear_pair, teeth: [24, 96], inertias: [2.89e-3, 0.7402], torsional_stiffness: [1430, 2780], "
    "contact_ratio: 1.7, torque: 21.05, damping_ratio: 0.1}\n"
)
TRAIN = (
    "system: {kind: two_stage, inertias: [1, 0.3, 4], input_shaft_stiffness: 5.0e7, teeth: [17, 34, 21, 50], load: "
    f"[100, 0, -50], damping_ratio: 0.01, meshes: [{{{MESH}}}, {{{MESH}}}]}}\n"
)
PLANETARY = scene_text("input_speed_planetary")


@pytest.mark.parametrize(
    ("system", "per_turn"),
    [(PAIR, 20), (GEARS, 24), (TRAIN, 17), (PLANETARY, 28 * 68 / 96), (PLANETARY + "  input: carrier\n", 68),
     (PLANETARY + "  fixed: carrier\n", 28), (PLANETARY + "  input: ring\n  fixed: carrier\n", 68)],
)  # fmt: skip
def test_the_mesh_frequency_of_an_input_speed(tmp_path: Path, system: str, per_turn: float) -> None:
    (axis,) = read(tmp_path, system + SWEEP).axes
    assert axis.mesh_frequency is not None
    np.testing.assert_allclose(axis.mesh_frequency.values, np.array([600, 900, 1200]) * RPM * per_turn, rtol=1e-14)
    assert (axis.typed_units, axis.long_name) == ("rpm", "input speed")


@pytest.mark.parametrize(("driving", "fixed"), list(permutations(("sun", "carrier", "ring"), 2)))
def test_planets_roll_without_slip(driving: str, fixed: str) -> None:
    """The velocities of a planet's points of contact, sun and ring side, are those of the sun and of the ring.

    Radii are teeth; unknown speeds sun, carrier, ring, planet from the two contacts, the drive and the fixed body.
    """
    z_s, z_p, z_r = 28.0, 20.0, 68.0
    order = ["sun", "carrier", "ring", "planet"]
    arm = z_s + z_p
    rows = [[-z_s, arm, 0, -z_p], [0, arm, -z_r, z_p]]
    rows += [[float(name == body) for name in order] for body in (driving, fixed)]
    speed = dict(zip(order, np.linalg.solve(rows, [0, 0, 1, 0]), strict=True))
    passing = abs(z_s * (speed["sun"] - speed["carrier"]))  # teeth of the sun past a planet's centre
    assert passing == pytest.approx(abs(z_r * (speed["ring"] - speed["carrier"])), rel=1e-12)
    motion = Turning.of(section({"kind": "planetary", "input": driving, "fixed": fixed}), z_s, z_r)
    assert motion is not None
    assert float(motion.cycles) == pytest.approx(passing, rel=1e-12)


def test_the_teeth_of_a_train_give_its_ratio(tmp_path: Path) -> None:
    config = read(tmp_path, TRAIN + SWEEP)
    assert config.tree["system"]["tooth_ratio"] == "34/21"
    same = read(tmp_path, TRAIN.replace("teeth:", "tooth_ratio: 34/21, teeth:") + SWEEP)
    assert same.system["tooth_ratio"] == config.system["tooth_ratio"]


@pytest.mark.parametrize("system", [PAIR, TRAIN])
def test_a_response_at_an_input_speed_is_that_at_its_mesh_frequency(tmp_path: Path, system: str) -> None:
    teeth = 20 if system is PAIR else 17
    config = read(tmp_path, f'{system}respond: {{input_speed: "900 rpm", steady_state: true}}')
    assert config.respond is not None
    assert config.respond.mesh_frequency == pytest.approx(900 * RPM * teeth, rel=1e-14)
    assert config.tree["respond"]["mesh_frequency"] == config.respond.mesh_frequency


def test_a_naive_pair_is_told_what_it_may_leave_out(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, PAIR.replace("teeth:", "face_width: 20 mm, teeth:") + SWEEP)
    assert problem.path == "system.face_width"
    assert "leave it out" in problem.hint
    found = problems(tmp_path, "system: {kind: gear_pair, teeth: [20, 63], module: 2 mm}\n" + SWEEP)
    (teeth,) = [p for p in found if p.path == "system.teeth"]
    assert "may be left out" in teeth.hint
    assert "kind: gearbox" in teeth.hint


def test_a_resolved_configuration_is_read_again(tmp_path: Path) -> None:
    config = read(tmp_path, TRAIN + SWEEP + 'respond: {input_speed: "900 rpm", steady_state: true}\n')
    again = read(tmp_path, config.resolved)
    assert again.resolved == config.resolved
    assert written(tmp_path, config.resolved).is_file()


# --- exact speeds and mesh frequencies of epicyclic trains, against a reference in fractions; trains that cannot turn


TRAINS = json.loads((DATA / "reference_trains.json").read_text())["trains"]


def meshes(stage: dict[str, Any]) -> list[MeshMotion]:
    name, teeth = stage["name"], stage["teeth"]

    def motion(first: str, second: str, internal: bool, carrier: str = "") -> MeshMotion:
        gears = f"{name}.{first}", f"{name}.{second}"
        return MeshMotion(gears, (teeth[first], teeth[second]), internal, (name,), carrier and f"{name}.{carrier}")

    if stage["kind"] == "parallel":
        return [motion("pinion", "wheel", False)]
    return [motion("sun", "planet", False, "carrier"), motion("planet", "ring", True, "carrier")]


def solved(train: dict[str, Any], turned: bool = False) -> tuple[dict[str, Fraction], list[list[MeshMotion]]]:
    """Speeds, and the meshes of each stage. turned: whether the relations are solved in the opposite order."""
    found = [meshes(stage) for stage in train["stages"]]
    rules = [Relation({train["input"]: 1}, ("input",), 1)]
    rules += [Relation({body: 1}, (body,)) for body in train["held"]]
    rules += [Relation({one: 1, other: -1}, ("shafts",)) for one, other in train["connections"]]
    rules += [mesh.relation for stage in found for mesh in stage]
    return solve(train["speeds_over_input"], rules[::-1] if turned else rules), found


@pytest.mark.parametrize("train", TRAINS, ids=lambda train: train["name"])
@pytest.mark.parametrize("turned", [False, True])
def test_speeds_and_frequencies_are_those_of_the_reference(train: dict[str, Any], turned: bool) -> None:
    speeds, found = solved(train, turned)
    assert {body: str(speed) for body, speed in speeds.items()} == train["speeds_over_input"]
    frequencies = [{mesh.frequency(speeds) for mesh in stage} for stage in found]
    expected = [Fraction(mesh["mesh_frequency_per_input_speed"]) for mesh in train["meshes"]]
    assert frequencies == [{value} for value in expected]
    ratios = [value / expected[0] for value in expected]
    assert [str(ratio) for ratio in ratios] == train["frequency_ratios_to_first"]
    cycles, each = shared_period(list(ratios))
    assert str(cycles) == train["common_period_in_cycles_of_first_mesh"]
    assert [str(number) for number in each] == train["cycles_of_each_mesh_in_common_period"]


def test_planets_turn_as_the_reference_says() -> None:
    for train in TRAINS:
        speeds, found = solved(train)
        for motions, mesh in zip(found, train["meshes"], strict=True):
            if mesh["kind"] == "planetary":
                way = 1 if motions[0].relative(speeds, gear=1) > 0 else -1
                assert way == mesh["planet_turns_relative_to_carrier"]


@pytest.mark.parametrize(("held", "concerned"), [(["one.ring", "one.sun"], "one"), (["two.carrier"], "one.sun")])
def test_a_train_that_jams_names_the_bodies_between_which_it_does(held: list[str], concerned: str) -> None:
    train = TRAINS[0] | {"held": ["one.ring", "two.ring", *held]}
    with pytest.raises(TrainError, match=f"jams here.*{concerned}.*held bodies") as caught:
        solved(train)
    assert len(str(caught.value).splitlines()) == 1
    assert "three" not in str(caught.value)


def test_a_member_that_nothing_holds_is_named() -> None:
    with pytest.raises(Undetermined) as caught:
        solved(TRAINS[0] | {"held": ["one.ring"]})
    assert set(caught.value.bodies) == {"two.sun", "two.ring", "two.planet", "three.pinion", "three.wheel"}


def test_a_second_input_closes_a_differential() -> None:
    mesh = MeshMotion(("sun", "ring"), (30, 70), False, (), "carrier")
    rules = [Relation({"sun": 1}, (), 1), Relation({"ring": 10, "sun": -1}, ()), mesh.relation]
    assert solve(("sun", "ring", "carrier"), rules)["carrier"] == Fraction(37, 100)
