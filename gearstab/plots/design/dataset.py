"""Parts that the figures of a design share."""

from __future__ import annotations

import xarray as xr

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import mesh_numbers
from gearstab.plots.drawing.text import axis_label, path_words, short_label, unit_text

NAME = "design"
GIVEN, OPTIMUM = "#8a8a8a", "#0b6fa4"
"""Colours of the given design and of the best one."""


def design_of(tree: xr.DataTree) -> xr.Dataset:
    """Return the group of a design result. Raises PlotError for other results."""
    if NAME not in tree.children:
        raise PlotError(f"this result holds no design; it holds {listed(tree.children)}")
    return tree[NAME].to_dataset()


def label_of(tree: xr.DataTree, data: xr.Dataset, variable: str) -> str:
    """Label of the axis of a variable: its name in words, with the symbol that it has."""
    unit = str(data["variable_units"].sel(variable=variable).values)
    return axis_label(variable, path_words(variable), unit, mesh_numbers(tree))


def symbol_of(tree: xr.DataTree, variable: str) -> str:
    """The symbol of a variable, or its name."""
    return short_label(variable, mesh_numbers(tree))


def objective_label(data: xr.Dataset, place: int = 0) -> str:
    """An objective with its unit."""
    units = data["objective_optimum"].attrs.get("units", "1")
    unit = unit_text(str(units))
    return str(data["objective"].values[place]).replace("_", " ") + (f" ({unit})" if unit else "")
