"""Names of axes of cases and ties: nothing that a result has already, and nothing that HDF5 cannot hold."""

from __future__ import annotations

import json

import pytest
from scenes import ran

from gearstab.config import ConfigError, load
from gearstab.config.sections.sweep import GROUPS
from gearstab.results import open_result
from gearstab.results.variables.responses import taken_names

SCENE = """\
system:
  kind: gear_pair
  equivalent_mass: 1.0
  meshes: [{mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}]
sweep:
  AXIS
  mesh_frequency: [1.5, 2.0, 2.5]
methods:
  floquet: {exponents: true}
  perturbation: {}
  boundaries: {}
"""
CASES = "%s: [{label: a, contact_ratio: 1.5}, {label: b, contact_ratio: 1.6}]"
TIE = "%s: {targets: [contact_ratio, epsilon], values: [[1.5, 1.6], [0.2, 0.3]]}"


def scene(folder, axis, name):
    path = folder / "scene.yaml"
    text = SCENE if name != "mesh_frequency" else SCENE.replace("  mesh_frequency: [1.5, 2.0, 2.5]\n", "")
    path.write_text(text.replace("AXIS", axis % json.dumps(name)))
    return path


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
    done = ran("sweep", path, "-o", out, "-j", "1")
    assert done.exit_code == 0, done.output
    with open_result(out) as tree:
        assert tree["floquet"]["growth_rate"].dims == (name, "mesh_frequency")
        assert tree["boundaries"]["boundary_frequency"].dims == ("tongue", "side", name)
    done = ran("export", out, "-o", tmp_path / "out.csv")
    assert done.exit_code == 0, done.output
