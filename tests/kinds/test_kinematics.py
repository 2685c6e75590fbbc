"""Exact speeds and mesh frequencies of epicyclic trains, against a reference in fractions; trains that cannot turn."""

import json
from fractions import Fraction
from typing import Any

import pytest
from scenes import DATA

from gearstab.system import shared_period
from gearstab.systems.kinematics import MeshMotion, Relation, TrainError, Undetermined, alike, solve

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
    rules += [alike(*ends, ("shafts",)) for ends in train["connections"]]
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
