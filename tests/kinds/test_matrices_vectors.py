"""Vectors of a model of matrices, written as mappings of what is not zero."""

from pathlib import Path

import numpy as np
import pytest
from scenes import read

from gearstab.config.schema import schema
from gearstab.systems import build

MODEL = """\
system:
  kind: matrices
  {names}
  mass: [[1, 0, 0], [0, 2, 0], [0, 0, 3]]
  stiffness: [[2, -1, 0], [-1, 2, -1], [0, -1, 2]]
  meshes:
    - {{name: m, direction: {direction}, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}}
  terms: [{{name: rub, left: {left}, right: {left}, stiffness: {{mean: 0.1}}}}]
  forces: [{{direction: {left}, sin: [1.0]}}]
  load: {left}
"""


def text(names: str, direction: str, left: str) -> str:
    return MODEL.format(names=names, direction=direction, left=left)


@pytest.mark.parametrize(
    ("names", "direction", "left"),
    [("", "{q1: 1, q3: -2}", "{q2: 0.5}"), ("coordinates: [a, b, c]", "{c: -2, a: 1}", "{b: 0.5}")],
    ids=["default names", "own names"],
)
def test_a_mapping_is_the_list_with_zeros(tmp_path: Path, names: str, direction: str, left: str) -> None:
    short, long = read(tmp_path, text(names, direction, left)), read(tmp_path, text(names, "[1, 0, -2]", "[0, 0.5, 0]"))
    assert short.tree["system"] == long.tree["system"]  # the resolved configuration holds lists
    system = build(short.system)
    np.testing.assert_array_equal(system.meshes[0].direction, [1, 0, -2])
    np.testing.assert_array_equal(system.terms[0].left, [0, 0.5, 0])
    np.testing.assert_array_equal(system.forces[0].direction, [0, 0.5, 0])
    np.testing.assert_array_equal(system.load, [0, 0.5, 0])


def test_matrices_from_a_file_tell_the_size(tmp_path: Path) -> None:
    np.savez(tmp_path / "model.npz", mass=np.eye(40), stiffness=2 * np.eye(40))
    mesh = "{direction: {q40: 1, q7: 0.1}, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}"
    config = read(tmp_path, f"system: {{kind: matrices, file: model.npz, meshes: [{mesh}]}}")
    assert np.flatnonzero(build(config.system).meshes[0].direction).tolist() == [6, 39]


def test_a_unit_is_understood_and_the_schema_knows_mappings(tmp_path: Path) -> None:
    config = read(tmp_path, text("coordinate_units: rad", "{q1: 25 mm, q2: 1}", "[0, 1, 0]"))
    np.testing.assert_allclose(build(config.system).meshes[0].direction, [0.025, 1, 0], rtol=1e-15)
    direction = schema()["$defs"]["MatrixMesh"]["properties"]["direction"]
    assert {form["type"] for form in direction["anyOf"]} == {"array", "object"}
