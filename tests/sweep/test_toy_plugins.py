"""To add a method or a figure is one file and one line: toy ones, each in this file, go through a whole sweep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from gearstab import plots
from gearstab.config import load
from gearstab.config.model.fields import Section
from gearstab.errors import PlotError
from gearstab.methods import METHODS, POINTS, Outcome
from gearstab.methods.base import Method
from gearstab.plots import Kind
from gearstab.plots.axes import Request
from gearstab.results import open_result
from gearstab.results.variables import GRID, Variable
from gearstab.sweep import plan, run
from gearstab.system import Array

CONFIG = """
title: Toy
system:
  kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0.5
  tooth_ratio: 1
  meshes:
    - {name: first, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {name: second, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
sweep:
  epsilon: [0.1, 0.2]
  mesh_frequency: [1.0, 2.0, 3.0]
methods: {floquet: {}}
"""


class ToyOptions(Section):
    """The mesh frequency to a power."""

    power: float = 2.0


class Toy(Method):
    """Needs no theory."""

    name = "toy"
    Options = ToyOptions
    frequency = POINTS

    def variables(self) -> tuple[Variable, ...]:
        return (Variable("toy_power", (GRID,), "f8", "1", "mesh frequency to a power"),)

    def run(self, mesh_frequency: Array) -> Outcome:
        rows = int(np.prod(self.system.batch, dtype=int))
        return Outcome({"toy_power": np.broadcast_to(mesh_frequency**self.options.power, (rows, mesh_frequency.size))})

    def cost(self) -> float:
        return 1.0


def swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "toy.yaml").write_text(CONFIG)
    monkeypatch.setitem(METHODS, "toy", Toy)
    config = load(tmp_path / "toy.yaml")
    options = SimpleNamespace(chosen=("floquet", "toy"), floquet=config.methods.floquet, toy=ToyOptions())
    run(plan(replace(config, methods=options)), tmp_path / "toy.h5", jobs=1)
    return tmp_path / "toy.h5"


def test_a_method_of_one_class_goes_from_plan_to_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = open_result(swept(tmp_path, monkeypatch))
    assert tree["toy"]["toy_power"].dims == ("epsilon", "mesh_frequency")
    np.testing.assert_array_equal(tree["toy"]["toy_power"].values, [[1.0, 4.0, 9.0]] * 2)
    assert tree["toy"].attrs["power"] == 2.0


def draw_toy(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, object]]:
    if "floquet" not in tree.children:
        raise PlotError("this result holds no growth rates")
    return Figure(), {"drawn": True}


def test_a_figure_of_one_object_is_drawn_by_its_name_and_where_it_suits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = open_result(swept(tmp_path, monkeypatch))
    assert plots.default_kind(tree, Request()) == "map"
    monkeypatch.setitem(plots.KINDS, "toy", Kind("toy", "nothing", draw_toy, lambda c: c.holds("toy")))
    assert plots.default_kind(tree, Request()) == "toy"
    assert plots.draw(tree)[1]["drawn"]
