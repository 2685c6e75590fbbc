"""Stiffness levels over the whole grid: reported when and only when a point of the grid has one that cannot exist."""

import math
import re
from itertools import product
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenes import written

from gearstab.config import ConfigError, Problem, load

HEAD = "system:\n  kind: gear_pair\n  equivalent_mass: 1\n"
TAIL = "methods: {perturbation: }\n"

ratios = st.lists(st.floats(1, 3.5).map(lambda c: round(c, 2)), min_size=1, max_size=4)
levels = st.lists(st.floats(0, 1.2).map(lambda v: round(v, 2)), min_size=1, max_size=4)


def problems(folder: Path, text: str) -> list[Problem]:
    path = written(folder, text)
    try:
        load(path)
    except ConfigError as error:
        return error.problems
    return []


def softer(stiffness: str, variation: str, value: float, c: float) -> float:
    """The lowest stiffness of a mesh of mean or greatest stiffness 1, from the two levels themselves."""
    d = c - math.floor(c)
    if stiffness == "max_stiffness":
        if variation == "amplitude":
            return 1 - 2 * value
        return 1 - 2 * value / (1 + 2 * value * (1 - d)) if d else 1 / (1 + 2 * value)
    return 1 - 2 * value * d


@pytest.mark.parametrize("stiffness", ["mean_stiffness", "max_stiffness"])
@pytest.mark.parametrize("variation", ["epsilon", "amplitude"])
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(values=levels, contact_ratios=ratios, cases=st.booleans())
def test_reported_when_a_point_of_the_grid_is_impossible(
    tmp_path: Path, stiffness: str, variation: str, values: list[float], contact_ratios: list[float], cases: bool
) -> None:
    if cases:  # pairs of values on one axis
        points = list(dict.fromkeys(zip(values, contact_ratios, strict=False)))
        entries = "".join(f"  - {{{variation}: {v}, contact_ratio: {c}}}\n" for v, c in points)
        sweep = f"sweep:\n  case:\n{entries}"
    else:
        points = list(product(values, contact_ratios))
        sweep = f"sweep: {{{variation}: {values}, contact_ratio: {contact_ratios}}}\n"
    lowest = min(softer(stiffness, variation, v, c) for v, c in points)
    if abs(lowest) < 1e-9:
        return  # rounding decides
    # The base values, on no point of the grid, do not count.
    text = f"{HEAD}  meshes: [{{{stiffness}: 1, {variation}: 5, contact_ratio: 1.5}}]\n{sweep}{TAIL}"
    found = problems(tmp_path, text)
    assert bool(found) == (lowest < 0)
    assert all("'mesh' has the softer level" in p.message for p in found)


@pytest.mark.parametrize(
    ("mesh", "path", "limit"),
    [
        ("mean_stiffness: 2, epsilon: 0.9, contact_ratio: 1.75", "epsilon", "0.666667 = 1/(2 d), d = 0.75"),
        ("max_stiffness: 2, epsilon: 5, contact_ratio: 2.25", "epsilon", "2 = 1/(2 d), d = 0.25"),
        ("mean_stiffness: 2, amplitude: 3, contact_ratio: 1.5", "amplitude", "2 = mean_stiffness/(2 d), d = 0.5"),
        ("max_stiffness: 2, amplitude: 1, contact_ratio: 1.5", "amplitude", "1 = max_stiffness/2"),
    ],
)
def test_the_largest_admissible_variation(tmp_path: Path, mesh: str, path: str, limit: str) -> None:
    (found,) = problems(tmp_path, f"{HEAD}  meshes: [{{{mesh}}}]\n")
    assert (found.line, found.path) == (4, f"system.meshes.0.{path}")
    assert found.message.endswith(f"is below {limit}")
    assert "allow_negative_stiffness: true" in found.hint
    below = re.sub(rf"{path}: [^,]*", f"{path}: {0.999 * float(limit.split()[0])}", mesh)
    assert problems(tmp_path, f"{HEAD}  meshes: [{{{below}}}]\n") == []


def test_the_place_is_that_of_the_value_to_blame(tmp_path: Path) -> None:
    mesh = "{mean_stiffness: 1, epsilon: 0.8, contact_ratio: 1.5}"
    sweep = "sweep:\n  contact_ratio:\n    - 1.2\n    - 1.9\n    - 1.5\n"
    (found,) = problems(tmp_path, f"{HEAD}  meshes: [{mesh}]\n{sweep}{TAIL}")
    assert (found.line, found.path) == (8, "sweep.contact_ratio.1")


def test_negative_levels_where_they_are_asked_for(tmp_path: Path) -> None:
    allowed = HEAD + "  allow_negative_stiffness: true\n"
    assert not problems(tmp_path, allowed + "  meshes: [{mean_stiffness: 1, epsilon: 3, contact_ratio: 1.5}]\n")
    # The mean must stay positive: with k_max kept it reaches zero at k_a = k_max/(2 (1 - d)).
    text = "  meshes: [{max_stiffness: 1, amplitude: 1.3, contact_ratio: 1.6}]\n"
    (found,) = problems(tmp_path, allowed + text)
    assert found.message.endswith("is below 1.25 = max_stiffness/(2 (1 - d)), d = 0.6")
    assert not problems(tmp_path, allowed + text.replace("1.3", "1.2"))


def test_exact_ratios_beside_other_values(tmp_path: Path) -> None:
    text = """\
system:
  kind: two_stage
  inertias: [1, 1, 1]
  input_shaft_stiffness: 1
  tooth_ratio: 1
  meshes: [{mean_stiffness: 1, epsilon: 0.5, contact_ratio: 1.5}, {mean_stiffness: 1, epsilon: 0.5, contact_ratio: 1.5}]
sweep:
  case: [{tooth_ratio: 1, contact_ratio: 1.5}, {tooth_ratio: 3/5, contact_ratio: 1.6}]
methods: {perturbation: }
"""
    assert not problems(tmp_path, text)


def test_a_rigid_and_a_small_body_are_no_mistake(tmp_path: Path) -> None:
    """A free train has a zero eigenvalue, and inertias in kg m^2 beside masses in kg differ by many decades."""
    text = """\
system:
  kind: matrices
  mass: [[1000, 0], [0, 1.0e-13]]
  stiffness: [[0, 0], [0, 0]]
  meshes: [{direction: [1, -1], mean_stiffness: 1, epsilon: 0.5, contact_ratio: 1.5}]
"""
    assert not problems(tmp_path, text)
