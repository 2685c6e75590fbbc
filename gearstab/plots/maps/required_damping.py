"""The damping that suppresses instability, over two axes: colours, contour lines and names of the tongues."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gearstab.errors import PlotError
from gearstab.plots.drawing import grid
from gearstab.plots.drawing.style import GROWTH, LIGHT, LINE
from gearstab.plots.drawing.text import axis_label
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps.stability_map import whole_map
from gearstab.plots.view import MapView, Request

Array = np.ndarray
Artists = dict[str, Any]

NAME = "required_damping"
LEVELS = 8
"""Contour lines, about."""


def words(dataset: xr.Dataset) -> str:
    """Label of the colour bar."""
    what = "damping factor" if dataset.attrs.get("of") == "factor" else "damping ratio"
    return axis_label(NAME, f"required {what}", "1")


def draw_map(ax: Axes, view: MapView, data: xr.DataArray, norm: Normalize | None = None) -> Artists:
    """Draw one map into a frame: ``cells`` (white where none is required), ``failed`` (hatched: none was found),
    ``contours`` (None where the grid is a line, has an axis of labels or is all of one value) and ``note`` (where no
    point requires any).
    """
    values = view.cut(data, view.y.name, view.x.name).astype(float)
    failed = ~np.isfinite(values)
    shown = np.ma.masked_where(failed | (values <= 0), values)
    top = float(np.ma.max(shown)) if shown.count() else 1.0
    colours = norm or Normalize(0.0, top)
    artists: Artists = {
        "cells": grid.draw_cells(ax, view.x, view.y, shown, GROWTH, colours),
        "failed": grid.draw_failed(ax, view.x, view.y, failed),
        "reason": "none found",
        "contours": None,
        "note": None,
    }
    if not shown.count():
        text = "no damping is required" if not failed.any() else "no damping in the range is enough"
        artists["note"] = ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", color="#6e6e6e")
    elif min(values.shape) > 1 and view.x.numeric and view.y.numeric:
        x, y = view.x.ascending, view.y.ascending
        levels = [v for v in MaxNLocator(LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, top) if 0 < v < top]
        if levels:
            # Light lines on the dark half of the colours.
            line = [LINE if colours(level) < 0.5 else LIGHT for level in levels]
            artists["contours"] = ax.contour(
                x, y, np.ma.masked_invalid(values), levels=levels, colors=line, linewidths=0.5, zorder=2
            )
    grid.frame(ax, view.x, view.y)
    return artists


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_map`, ``names`` and ``colour_bar``.

    Raises PlotError without required damping, and if an axis is left over.
    """
    if NAME not in tree.children:
        raise PlotError("this result holds no required damping (methods.required_damping was not run)")
    dataset = tree[NAME].to_dataset()
    data = dataset[NAME]

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        return draw_map(ax, view, tree[NAME].to_dataset()[NAME]), words(dataset)

    return whole_map(tree, request, dataset, data, painted)


def _suits(contents: Contents) -> bool:
    other = contents.growth or contents.holds("response") or not contents.holds(NAME)
    return contents.by_itself and not other and len(contents.own(NAME)) == 2


KIND = Kind("required-damping", "damping that suppresses instability, over two axes", draw, _suits)
