"""Which variable of a result a figure shows."""

from __future__ import annotations

import numpy as np
import xarray as xr

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import swept_groups, units_of
from gearstab.plots.drawing.text import axis_label

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
