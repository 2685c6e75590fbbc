"""Maps with contour lines: the damping that suppresses instability, and the probability of instability."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gearstab.errors import PlotError
from gearstab.plots.drawing import grid
from gearstab.plots.drawing.style import GROWTH, LIGHT, LINE
from gearstab.plots.drawing.text import axis_label, number_text, plain
from gearstab.plots.kinds import PROBABILITY as NAME
from gearstab.plots.kinds import REQUIRED, Contents, Kind
from gearstab.plots.maps.stability_map import whole_map
from gearstab.plots.view import MapView, Request

Array = np.ndarray
Artists = dict[str, Any]

TOLERANCE = "tolerance"
"""The group of probabilities."""
DAMPING_LEVELS = 8
"""Contour lines of required damping, about."""
LEVELS = (0.01, 0.1, 0.5, 0.9)
"""Probabilities at which lines are drawn without --level."""
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1, 1.5)))


def draw_contours(
    ax: Axes, view: MapView, data: xr.DataArray, levels: Sequence[float], top: float, nothing: tuple[str, str]
) -> Artists:
    """Draw one map into a frame: ``cells`` (white where the value is zero), ``failed`` (hatched), ``contours`` (None
    where the grid is a line, has an axis of labels or crosses no level) and ``note`` (where no value is above zero).

    levels: of the lines, light on the dark half of the colours; top: the value of the last colour. nothing: the note,
    and the one where some points have no value.
    """
    values = view.cut(data, view.y.name, view.x.name).astype(float)
    failed = ~np.isfinite(values)
    shown = np.ma.masked_where(failed | (values <= 0), values)
    artists: Artists = {
        "cells": grid.draw_cells(ax, view.x, view.y, shown, GROWTH, Normalize(0.0, top)),
        "failed": grid.draw_failed(ax, view.x, view.y, failed),
        "contours": None,
        "note": None,
    }
    crossed = [level for level in levels if (values < level).any() and (values > level).any()]
    if not shown.count():
        words = nothing[int(failed.any())]
        artists["note"] = ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", color="#6e6e6e")
    elif crossed and min(values.shape) > 1 and view.x.numeric and view.y.numeric:
        x, y = view.x.ascending, view.y.ascending
        colours = [LINE if level < 0.5 * top else LIGHT for level in crossed]
        line: Artists = {"levels": crossed, "colors": colours, "linewidths": 0.5, "zorder": 2}
        artists["contours"] = ax.contour(x, y, np.ma.masked_invalid(values), **line)
    grid.frame(ax, view.x, view.y)
    return artists


def draw_damping(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_contours`, ``names`` and ``colour_bar``.

    Raises PlotError without required damping, and if an axis is left over.
    """
    if REQUIRED not in tree.children:
        raise PlotError("this result holds no required damping (methods.required_damping was not run)")
    dataset = tree[REQUIRED].to_dataset()
    what = "damping factor" if dataset.attrs.get("of") == "factor" else "damping ratio"
    nothing = "no damping is required", "no damping in the range is enough"

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        data = tree[REQUIRED].to_dataset()[REQUIRED]
        values = view.cut(data, view.y.name, view.x.name)
        top = float(np.max(values[np.isfinite(values)], initial=0.0)) or 1.0
        ticks = MaxNLocator(DAMPING_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, top)
        artists = draw_contours(ax, view, data, [float(v) for v in ticks if 0 < v < top], top, nothing)
        return artists | {"reason": "none found"}, axis_label(REQUIRED, f"required {what}", "1")

    return whole_map(tree, request, dataset, dataset[REQUIRED], painted)


def draw_probability(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_contours`, the ``entries`` of lines in the legend,
    ``names`` and ``colour_bar``.

    Raises PlotError without probabilities, and if an axis is left over.
    """
    if TOLERANCE not in tree.children:
        raise PlotError("this result holds no probabilities (methods.tolerance was not run)")
    dataset = tree[TOLERANCE].to_dataset()
    levels = tuple(sorted(request.levels)) or LEVELS

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        data = tree[TOLERANCE].to_dataset()[NAME]
        artists = draw_contours(ax, view, data, levels, 1.0, ("no sample is unstable", ""))
        entries = []
        if (drawn := artists["contours"]) is not None:
            dashes = [DASHES[levels.index(level) % len(DASHES)] for level in drawn.levels]
            drawn.set_linestyle(dashes)
            entries = [
                Line2D([], [], color=LINE, linewidth=0.6, linestyle=dash, label=plain(f"{number_text(100 * level)} %"))
                for level, dash in zip(drawn.levels, dashes, strict=True)
            ]
        return artists | {"entries": entries}, "probability of instability"

    return whole_map(tree, request, dataset, dataset[NAME], painted)


def _alone(contents: Contents, group: str) -> bool:
    """Return whether a group over two axes is what a sweep holds, without growth rates and responses."""
    other = contents.growth or contents.holds("response") or not contents.holds(group)
    return contents.by_itself and not other and len(contents.own(group)) == 2


REQUIRED_DAMPING = Kind(
    "required-damping", "damping that suppresses instability, over two axes", draw_damping,
    lambda contents: _alone(contents, REQUIRED),
)  # fmt: skip
PROBABILITY = Kind(
    "probability", "probability of instability over two axes, with lines of given probability", draw_probability,
    lambda contents: _alone(contents, TOLERANCE),
)  # fmt: skip
