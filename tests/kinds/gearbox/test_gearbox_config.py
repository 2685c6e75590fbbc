"""Gearboxes in configurations: what can be swept, and one line for every mistake."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gearbox_trains import RPM
from scenes import scene_text, written

from gearstab.config import ConfigError, Problem, load
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.sweep import plan, run
from gearstab.systems import build
from gearstab.systems.kinematics import TrainError

GOOD = scene_text("gearbox_config")


def loaded(folder: Path, text: str = GOOD, *overrides: str) -> Any:
    path = written(folder, text)
    return load(path, overrides)


def problems(folder: Path, old: str, new: str) -> list[Problem]:
    assert old in GOOD
    with pytest.raises(ConfigError) as caught:
        loaded(folder, GOOD.replace(old, new, 1))
    return caught.value.problems


MESH = "{name: m, gears: [pinion, gear], damping_ratio: 0.02}"


REST = "  mesh_frequency: [1000, 2000]\nmethods: {floquet: {}}\n"


@pytest.mark.parametrize("axis", ["damping_ratio: [0.0, 0.1]", "damping_ratio: [0.0]"])
def test_only_axes_that_matter_are_named(tmp_path: Path, axis: str) -> None:
    """The pinion cannot mesh whatever the damping is, unless its profile shift changes as well."""
    both = f"  rotors.pinion.profile_shift: [0.0, -3.0]\n  {axis}\n{REST}"
    (found,) = problems(tmp_path, GOOD[GOOD.index("  input_speed") :], both)
    assert "(at rotors.pinion.profile_shift = -3.0)" in found.message
    never = GOOD.replace("teeth: 19", "teeth: 19, profile_shift: -3.0")
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, never[: never.index("  input_speed")] + f"  {axis}\n{REST}")
    assert "(at" not in str(caught.value)


def test_a_train_that_cannot_be_built_says_where() -> None:
    """Where an axis is too long to look at every point, a sweep ends with this line."""
    assert str(TrainError(("meshes", 0), "no involute", "change the teeth")) == (
        "system.meshes.0: no involute; change the teeth"
    )


def test_a_width_is_asked_for_where_the_teeth_are_to_give_the_stiffness(tmp_path: Path) -> None:
    bare = GOOD.replace(', face_width: "20 mm"', "").replace("teeth: 19,", "teeth: 19, inertia: 1.0e-4, mass: 0.1,")
    bare = bare.replace("teeth: 48,", "teeth: 48, inertia: 1.0e-3, mass: 1.0,")
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, bare)
    (problem,) = caught.value.problems
    assert "face_width" in f"{problem.path} {problem.hint}"
    assert "mean_stiffness" in problem.hint
    loaded(tmp_path, bare.replace(MESH, MESH[:-1] + ", mean_stiffness: 3.0e+8}"))
    loaded(tmp_path, bare.replace(MESH, MESH[:-1] + ", single_pair_stiffness: 2.0e+8}"))


def test_the_input_speed_is_an_axis_in_rpm(tmp_path: Path) -> None:
    config = loaded(tmp_path)
    (axis,) = config.axes
    assert (axis.name, axis.units, axis.long_name) == ("input_speed", "rad/s", "input speed")
    speeds = np.linspace(600, 3000, 7) * RPM
    np.testing.assert_allclose(axis.values, speeds, rtol=1e-13)
    # The driver of the first mesh turns with the input: 19 cycles a turn.
    np.testing.assert_allclose(axis.assignments[0].values, 19 * speeds, rtol=1e-13)
    assert axis.assignments[0].path == ("mesh_frequency",)


def test_a_sweep_over_the_input_speed_is_one_over_the_mesh_frequency(tmp_path: Path) -> None:
    trees = []
    for name, axis in (
        ("speed", None),
        ("frequency", f"mesh_frequency: {(19 * np.linspace(600, 3000, 7) * RPM).tolist()}"),
    ):
        text = GOOD if axis is None else GOOD.replace('input_speed: {start: "600 rpm", stop: "3000 rpm", num: 7}', axis)
        config = loaded(
            tmp_path, text.replace("{floquet: {}}", "{floquet: {}, response: {}, boundaries: {tolerance: 1.0e-6}}")
        )
        out = tmp_path / f"{name}.h5"
        run(plan(config), out)
        trees.append(open_result(out))
    by_speed, by_frequency = trees
    np.testing.assert_allclose(
        by_speed["floquet/growth_rate"].values, by_frequency["floquet/growth_rate"].values, rtol=1e-9
    )
    np.testing.assert_allclose(
        by_speed["response/dynamic_load_factor"].values, by_frequency["response/dynamic_load_factor"].values, rtol=1e-9
    )
    assert by_speed["floquet/growth_rate"].dims == ("input_speed",)
    _, artists = draw(by_speed, "speeds")
    np.testing.assert_allclose(artists["lines"][0].get_xdata(), np.linspace(600, 3000, 7))  # as typed
    _, artists = draw(by_speed, "curve")
    np.testing.assert_allclose(artists["lines"][0].get_ydata(), by_speed["floquet/growth_rate"].values)


def test_the_input_speed_sets_that_of_lubricated_friction_too(tmp_path: Path) -> None:
    law = MESH[:-1] + ", friction: {kind: xu_kahraman, viscosity: 0.01, roughness: 4.0e-7}}"
    config = loaded(tmp_path, GOOD.replace(MESH, law))
    (axis,) = config.axes
    assert [item.path for item in axis.assignments] == [("mesh_frequency",), ("input", "speed")]
    chosen = config.at({"input_speed": np.array([0, 6])})
    np.testing.assert_allclose(chosen["input"]["speed"], [600 * RPM, 3000 * RPM])
    share = build(chosen).terms[0].stiffness
    assert share is not None
    slow, fast = np.abs(share.value(np.full(2, 0.9)))
    # Oil carries better at speed.
    assert fast < slow


def test_input_speed_is_refused_where_it_has_no_meaning(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="the numbers of teeth are not known"):
        loaded(
            tmp_path,
            GOOD,
            "system={kind: gear_pair, equivalent_mass: 1, "
            "meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]}",
        )
    with pytest.raises(ConfigError) as caught:
        loaded(tmp_path, GOOD.replace("methods:", "  rotors.gear.teeth: [48, 50]\nmethods:"))
    assert "numbers of teeth vary too" in str(caught.value)
    with pytest.raises(ConfigError, match=r"as sweep\.(mesh_frequency|input_speed) does"):
        loaded(tmp_path, GOOD.replace("methods:", "  mesh_frequency: [1, 2]\nmethods:"))


def test_teeth_are_an_axis_of_whole_numbers(tmp_path: Path) -> None:
    text = GOOD.replace(
        'input_speed: {start: "600 rpm", stop: "3000 rpm", num: 7}',
        "mesh_frequency: [2000, 4000]\n  rotors.gear.teeth: [40, 48, 57]",
    )
    config = loaded(tmp_path, text)
    out = tmp_path / "teeth.h5"
    run(plan(config), out)
    tree = open_result(out)
    assert list(tree["floquet/growth_rate"].dims) == ["mesh_frequency", "rotors.gear.teeth"]
    assert np.isfinite(tree["floquet/growth_rate"].values).all()
    with pytest.raises(ConfigError, match="must be a whole number >= 3"):
        loaded(tmp_path, text.replace("[40, 48, 57]", "[40, 48.5]"))
    # A last point that is no gearbox: the message says where on the axis. 19 and 57 teeth: 76 mm without backlash.
    with pytest.raises(ConfigError, match=r"must exceed 0\.0714\d+ m, base to base \(at rotors\.gear\.teeth = 57\)"):
        loaded(tmp_path, text.replace("[40, 48, 57]", "[52, 57]"), "system.meshes.0.centre_distance=0.0713")


NUMBERS = {
    "gears.module": [2e-3, 3e-3],
    "gears.pressure_angle": [0.35, 0.43],
    "gears.addendum": [0.95, 1.05],
    "gears.face_width": [0.02, 0.03],
    "rotors.pinion.profile_shift": [0.0, 0.2],
    "rotors.gear.support.stiffness": [1e8, 3e8],
    "material.young": [2.0e11, 2.1e11],
    "shafts.coupling.stiffness": [1e4, 3e4],
    "outputs.0.torque": [50.0, 80.0],
    "meshes.m.damping_ratio": [0.01, 0.1],
}


@pytest.mark.parametrize("key", NUMBERS)
def test_every_number_of_the_train_is_an_axis(tmp_path: Path, key: str) -> None:
    base = NUMBERS[key]
    config = loaded(tmp_path, GOOD.replace("methods:", f"  {key}: {base}\nmethods:"))
    one, other = (build(config.at({key: np.array([k])})) for k in (0, 1))
    parts = [(s.mass, s.stiffness, s.damping, s.load, s.mean_stiffness_matrix()) for s in (one, other)]
    assert any(not np.array_equal(np.squeeze(a), np.squeeze(b)) for a, b in zip(*parts, strict=True))
