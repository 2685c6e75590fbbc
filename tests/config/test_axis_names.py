"""Names of axes of cases and ties: nothing that a result has already, and nothing that HDF5 cannot hold."""

from __future__ import annotations

import json
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from scenes import scene_text, succeeds, written

import gearstab as gs
from gearstab.config import ConfigError, load
from gearstab.config.model import evenly
from gearstab.config.sections.sweep import GROUPS
from gearstab.results import open_result
from gearstab.results.variables.responses import taken_names

SCENE = scene_text("axis_names")
CASES = "%s: [{label: a, contact_ratio: 1.5}, {label: b, contact_ratio: 1.6}]"
TIE = "%s: {targets: [contact_ratio, epsilon], values: [[1.5, 1.6], [0.2, 0.3]]}"


def scene(folder, axis, name):
    text = SCENE if name != "mesh_frequency" else SCENE.replace("  mesh_frequency: [1.5, 2.0, 2.5]\n", "")
    return written(folder, text.replace("sweep:", f"sweep:\n  {axis % json.dumps(name)}"), "scene.yaml")


def test_what_results_hold_is_known():
    """Some of each kind: dimensions, coordinates and variables of methods and of responses."""
    known = {"tongue", "dof", "mesh", "label", "growth_rate", "contacts", "evaluations", "threshold", "event", "holder"}
    assert known <= taken_names()


@pytest.mark.parametrize("name", sorted(taken_names() | set(GROUPS)))
def test_names_of_results_are_taken(tmp_path, name):
    for axis in (CASES, TIE):
        with pytest.raises(ConfigError) as caught:
            load(scene(tmp_path, axis, name))
        (problem,) = caught.value.problems
        assert problem.path == f"sweep.{name}"
        assert problem.line == 6


@pytest.mark.parametrize("name", ["", " ", " a", "a/b", ".", "..", "a\nb", "a\x00b", "n" * 101], ids=repr)
def test_names_that_no_file_can_hold(tmp_path, name):
    with pytest.raises(ConfigError) as caught:
        load(scene(tmp_path, CASES, name))
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("name", ["mesh_frequency", "input_speed"])
@pytest.mark.parametrize("axis", [CASES, TIE], ids=["cases", "tie"])
def test_speeds_are_axes_of_their_own(tmp_path, name, axis):
    path = scene(tmp_path, axis, name)
    path.write_text(path.read_text().replace("  mesh_frequency: [1.5, 2.0, 2.5]\n", ""))
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert f"sweep.{name}" in {problem.path for problem in caught.value.problems}


NAMES = ["case", "a case", "Größe", "5", "a.b", "_nc", "phony_dim_0", "units", "epsilon", "sel"]


@pytest.mark.parametrize(("name", "axis"), [*((name, CASES) for name in NAMES), ("tie", TIE), ("a.b", TIE)])
def test_other_names_give_results_that_can_be_opened(tmp_path, name, axis):
    path, out = scene(tmp_path, axis, name), tmp_path / "out.h5"
    succeeds("sweep", path, "-o", out, "-j", "1")
    with open_result(out) as tree:
        assert tree["floquet"]["growth_rate"].dims == (name, "mesh_frequency")
        assert tree["boundaries"]["boundary_frequency"].dims == ("tongue", "side", name)
    succeeds("export", out, "-o", tmp_path / "out.csv")


# --- evenly spaced axes hold the decimal numbers that a user would type, not what rounding makes of them


PAIR = {
    "kind": "gear_pair", "equivalent_mass": 1.0,
    "meshes": [{"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}],
}  # fmt: skip


@pytest.mark.parametrize("axis", [{"start": 0, "stop": 1, "step": 0.1}, {"start": 0, "stop": 1, "num": 11}])
def test_tenths_are_tenths(axis: dict[str, float]) -> None:
    sweep = {"mesh_frequency": [1.0], "epsilon": axis}
    config = gs.load({"system": PAIR | {"allow_negative_stiffness": True}, "sweep": sweep, "methods": {"floquet": {}}})
    values = next(a for a in config.axes if a.name == "epsilon").values
    assert [repr(float(v)) for v in values] == [repr(k / 10) for k in range(11)]


@pytest.mark.parametrize(
    ("start", "step", "count"), [("0.35", "0.05", 134), ("-1", "0.1", 21), ("1e5", "0.1", 1000), ("1e-5", "3e-7", 300)]
)
def test_every_value_is_the_nearest_double_of_the_decimal(start: str, step: str, count: int) -> None:
    exact = [float(Decimal(start) + k * Decimal(step)) for k in range(count)]
    values = evenly(float(start), Decimal(step), 1, count)
    assert values is not None
    assert values.tolist() == exact
    values = evenly(exact[0], Decimal(repr(exact[-1])) - Decimal(repr(exact[0])), count - 1, count)
    assert values is not None
    assert values.tolist() == exact


def test_values_between_decimals_are_rounded_once() -> None:
    values = evenly(0.1, Decimal("0.6"), 8, 9)
    assert values is not None
    assert values.tolist() == [float(Fraction(1, 10) + k * Fraction(6, 80)) for k in range(9)]
    assert evenly(0.1, Decimal("0.6"), 7, 8) is None  # sevenths are no decimals: NumPy's values


@pytest.mark.parametrize(("start", "change"), [(np.pi, "1"), (1e-300, "1"), (0.0, "1e-30"), (1e15, "1e-5")])
def test_numbers_of_too_many_digits_are_left_to_floating_point(start: float, change: str) -> None:
    assert evenly(start, Decimal(change), 10, 11) is None
