"""Base of the kinds of figures, the contents of a result that make a kind suit it, and the variable that is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import INNER, FigureAxis, find_axis, sweep_axes, swept_groups, units_of
from gearstab.plots.drawing.text import axis_label
from gearstab.plots.view import Request
from gearstab.results.display import SPEEDS

GROWTH_RATE = "growth_rate"
LOAD_FACTOR = "dynamic_load_factor"
FORCE = "mesh_force_peak"
REQUIRED = "required_damping"
PROBABILITY = "probability"


def find_variable(tree: xr.DataTree, name: str) -> tuple[xr.Dataset, xr.DataArray]:
    """A numeric variable over the axes of the sweep, Floquet's first. Raises PlotError naming those there are."""
    known: list[str] = []
    for group in swept_groups(tree):
        dataset = tree[group].to_dataset()
        if name in dataset.data_vars and dataset[name].dtype.kind in "fiu":
            return dataset, dataset[name]
        known += [str(v) for v in dataset.data_vars if dataset[v].dtype.kind in "fiu" and dataset[v].ndim > 1]
    if name == GROWTH_RATE and known:
        raise PlotError(
            f"this result has no growth rates (methods.floquet was not run); --variable: {listed(dict.fromkeys(known))}"
        )
    raise PlotError(f"no variable {name!r} to draw in this result; there is {listed(dict.fromkeys(known))}")


def default_variable(tree: xr.DataTree) -> str:
    """Growth rates; where there are none the load factor of steady states, the required damping or a probability."""
    held = swept_groups(tree)
    if "floquet" in held or not {"response", REQUIRED, "tolerance"} & set(held):
        return GROWTH_RATE
    if "response" not in held:
        return REQUIRED if REQUIRED in held else PROBABILITY
    dataset = tree["response"].to_dataset()
    return LOAD_FACTOR if LOAD_FACTOR in dataset and np.isfinite(dataset[LOAD_FACTOR].values).any() else FORCE


def colour_label(tree: xr.DataTree, variable: str) -> str:
    """Label of the colour bar."""
    data = find_variable(tree, variable)[1]
    words = "growth rate" if variable == GROWTH_RATE else str(data.attrs.get("long_name", ""))
    return axis_label(variable, words, units_of(data))


@dataclass(frozen=True)
class Contents:
    """Contents of a result, and the axes that a request leaves free."""

    tree: xr.DataTree
    request: Request

    @cached_property
    def axes(self) -> dict[str, FigureAxis]:
        """All axes of a sweep; none in a response over time, a benchmark, or modes alone."""
        return sweep_axes(self.tree)

    @cached_property
    def fixed(self) -> set[str]:
        """Names of the axes that the request fixes. Raises PlotError where there is no such axis."""
        return {find_axis(self.axes, name).name for name in self.request.select}

    @cached_property
    def free(self) -> list[FigureAxis]:
        """The axes of the sweep with several values that are not fixed."""
        return [a for a in self.axes.values() if a.size > 1 and a.name not in {*self.fixed, *INNER}]

    @property
    def parameters(self) -> list[FigureAxis]:
        """Axes along which the mesh frequency does not vary."""
        return [axis for axis in self.free if axis.name not in SPEEDS]

    @property
    def mesh(self) -> list[FigureAxis]:
        """The axis of meshes where it is not fixed, as a list."""
        return [self.axes["mesh"]] if "mesh" in self.axes and "mesh" not in self.fixed else []

    @property
    def over_speed(self) -> bool:
        """Whether one of the free axes is that of the mesh frequency."""
        return len(self.parameters) < len(self.free)

    def holds(self, group: str) -> bool:
        """Whether there is such a group."""
        return group in self.tree.children

    @property
    def growth(self) -> bool:
        """Whether there are growth rates."""
        return self.holds("floquet") and "growth_rate" in self.tree["floquet"].data_vars

    def own(self, group: str) -> list[FigureAxis]:
        """The free axes over which a group stands."""
        return [axis for axis in self.free if axis.name in map(str, self.tree[group].sizes)]

    @cached_property
    def drawn(self) -> list[FigureAxis] | None:
        """The axes of the variable asked for, else of growth rates, responses, required damping or probabilities."""
        if not self.axes:
            return None
        if self.request.variable is not None:
            dims = [self.axes[str(dim)] for dim in find_variable(self.tree, self.request.variable)[1].dims]
            return [axis for axis in dims if axis.name not in self.fixed]
        if self.growth:
            over = set(map(str, self.tree["floquet"]["growth_rate"].dims))
            return [axis for axis in self.free if axis.name in over]
        if self.holds("response"):
            return [*self.own("response"), *self.mesh]
        return next((self.own(name) for name in ("required_damping", "tolerance") if self.holds(name)), None)

    @property
    def dimensions(self) -> int | None:
        """How many of these have several values."""
        return None if self.drawn is None else sum(axis.size > 1 for axis in self.drawn)

    @property
    def by_itself(self) -> bool:
        """Whether a sweep's own figure is asked for, and not one of a certain variable."""
        return bool(self.axes) and self.request.variable is None


Draw = Callable[[xr.DataTree, Request], tuple[Figure, dict[str, Any]]]


@dataclass(frozen=True)
class Kind:
    """A kind of figure: what it shows, how it is drawn, and of what it is the default.

    draw: gives the figure and its artists by name; raises PlotError where the result does not hold what it needs.
    suits: whether it is the figure for these contents, default none; of several kinds the last in the table is.
    decibels: whether it can show amplitudes as levels.
    """

    name: str
    summary: str
    draw: Draw
    suits: Callable[[Contents], bool] = lambda contents: False
    decibels: bool = False
