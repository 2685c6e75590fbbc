"""The probability of instability over two axes, with the contours on which a limit can be drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearstab.errors import PlotError
from gearstab.plots.drawing import grid
from gearstab.plots.drawing.style import GROWTH, LIGHT, LINE
from gearstab.plots.drawing.text import number_text
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps.stability_map import whole_map
from gearstab.plots.view import MapView, Request

Array = np.ndarray
Artists = dict[str, Any]

GROUP, NAME = "tolerance", "probability"
LEVELS = (0.01, 0.1, 0.5, 0.9)
"""Levels of the contours without --level."""
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1, 1.5)))


def draw_map(ax: Axes, view: MapView, data: xr.DataArray, levels: tuple[float, ...] = LEVELS) -> Artists:
    """Draw one map into a frame: ``cells`` (white where all samples are stable), ``failed`` (hatched), ``limits`` (None
    where the grid is a line or has an axis of labels) with their ``entries`` in the legend, and ``note`` (where all
    samples are stable everywhere).
    """
    values = view.cut(data, view.y.name, view.x.name).astype(float)
    failed = ~np.isfinite(values)
    shown = np.ma.masked_where(failed | (values <= 0), values)
    artists: Artists = {
        "cells": grid.draw_cells(ax, view.x, view.y, shown, GROWTH, Normalize(0.0, 1.0)),
        "failed": grid.draw_failed(ax, view.x, view.y, failed),
        "limits": None,
        "entries": [],
        "note": None,
    }
    if not shown.count() and not failed.any():
        text = "no sample is unstable"
        artists["note"] = ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", color="#6e6e6e")
    elif min(values.shape) > 1 and view.x.numeric and view.y.numeric:
        x, y = view.x.ascending, view.y.ascending
        crossed = [level for level in levels if (values < level).any() and (values > level).any()]
        if crossed:
            dashes = [DASHES[levels.index(level) % len(DASHES)] for level in crossed]
            # Light lines on the dark half of the colours.
            colours = [LINE if level < 0.5 else LIGHT for level in crossed]
            lines: Artists = {"colors": colours, "linewidths": 0.6, "linestyles": dashes, "zorder": 2}
            artists["limits"] = ax.contour(x, y, np.ma.masked_invalid(values), levels=crossed, **lines)
            artists["entries"] = [
                Line2D([], [], color=LINE, linewidth=0.6, linestyle=dash, label=f"{number_text(100 * level)} %")
                for level, dash in zip(crossed, dashes, strict=True)
            ]
    grid.frame(ax, view.x, view.y)
    return artists


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_map`, ``names`` and ``colour_bar``.

    Raises PlotError without probabilities, and if an axis is left over.
    """
    if GROUP not in tree.children:
        raise PlotError("this result holds no probabilities (methods.tolerance was not run)")
    dataset = tree[GROUP].to_dataset()
    data = dataset[NAME]
    levels = tuple(sorted(request.levels)) or LEVELS

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        return draw_map(ax, view, tree[GROUP].to_dataset()[NAME], levels), "probability of instability"

    return whole_map(tree, request, dataset, data, painted)


def _suits(contents: Contents) -> bool:
    other = contents.growth or contents.holds("response") or not contents.holds(GROUP)
    return contents.by_itself and not other and len(contents.own(GROUP)) == 2


KIND = Kind("probability", "probability of instability over two axes, with lines of given probability", draw, _suits)
