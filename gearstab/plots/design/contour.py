"""The objective over two variables, with the optimum and its margins."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.design.dataset import OPTIMUM, design_of, label_of, objective_label
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import GROWTH, LINE, new_figure
from gearstab.plots.drawing.text import fitted
from gearstab.plots.kinds import Kind
from gearstab.plots.view import Request

Array = np.ndarray
LINES = 7
"""Contour lines."""


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """One panel for each pair of variables, or the one of ``x`` and ``y``: ``cells``, ``optimum``, ``margins``."""
    data = design_of(tree)
    if "scan_objective" not in data:
        raise PlotError("this design has no map of its objective: it needs two continuous variables")
    pairs = chosen(data, request)
    alone = len(pairs) == 1
    wide = request.wide("single" if alone else "double")
    columns = min(len(pairs), 3 if wide else 2)
    rows = ceil(len(pairs) / columns)
    height = 0.9 if alone else (0.34 if wide else 0.52) * rows + 0.02
    figure = new_figure(request, height, "single" if alone else "double")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    values = [table for *_, table in pairs]
    low, high = min(np.nanmin(v) for v in values), max(np.nanmax(v) for v in values)
    artists: dict[str, Any] = {"cells": [], "optimum": [], "margins": []}
    for ax, (x, y, table) in zip(panels, pairs, strict=False):
        draw_panel(ax, tree, data, x, y, table, (float(low), float(high)), artists)
    for ax in panels[len(pairs) :]:
        ax.set_visible(False)
    width = 0.62 * figure.get_figwidth() / columns
    for ax in panels[: len(pairs)]:
        ax.set_xlabel(fitted(ax.get_xlabel(), width, 8.5), linespacing=0.95)
        ax.set_ylabel(fitted(ax.get_ylabel(), width, 8.5), linespacing=0.95)
    figure.colorbar(artists["cells"][0], ax=list(panels), label=objective_label(data), pad=0.01)
    write_legend(figure, [artists["optimum"][0], artists["margins"][0]])
    write_title(figure, tree, request)
    return figure, artists


def chosen(data: xr.Dataset, request: Request) -> list[tuple[str, str, Array]]:
    """(variable along x, along y, objective over both) of each panel. Raises PlotError for a pair without a map."""
    stored = [
        (str(a), str(b), table)
        for a, b, table in zip(data["scanned"].values, data["other_scanned"].values, data["scan_objective"].values,
                               strict=True)
    ]  # fmt: skip
    known = stored + [(b, a, table.T) for a, b, table in stored]
    wanted = [p for p in known if request.x in (None, p[0]) and request.y in (None, p[1])]
    if request.x is None and request.y is None:
        return stored
    if not wanted:
        there = listed(f"{a}, {b}" for a, b, _ in stored)
        raise PlotError(f"no map over x = {request.x}, y = {request.y}; there is one over {there}")
    return wanted


def draw_panel(
    ax: Axes,
    tree: xr.DataTree,
    data: xr.Dataset,
    x: str,
    y: str,
    table: Array,
    limits: tuple[float, float],
    artists: dict[str, Any],
) -> None:
    """Cells, contour lines, the optimum and how far each variable may move by itself."""
    own = [data.sel(variable=name) for name in (x, y)]
    places = [
        float(item["lower_bound"]) + (float(item["upper_bound"]) - float(item["lower_bound"])) * data["place"].values
        for item in own
    ]
    shown = np.ma.masked_invalid(table)
    low, high = limits
    cells = ax.pcolormesh(*places, shown, cmap=GROWTH, vmin=low, vmax=high, shading="gouraud", rasterized=True)
    if np.ptp(shown.compressed()) > 0:
        ax.contour(*places, shown, levels=LINES, colors=LINE, linewidths=0.4)
    (x_best, x_room), (y_best, y_room) = (
        (float(item["optimum"]), [[float(item["margin_lower"])], [float(item["margin_upper"])]]) for item in own
    )
    ax.errorbar(x_best, y_best, y_room, x_room, color="white", elinewidth=2.0, capsize=0, zorder=3)
    bars = ax.errorbar(
        x_best, y_best, y_room, x_room, color=OPTIMUM, elinewidth=1.0, capsize=2, zorder=4, label="room to move"
    )
    (star,) = ax.plot(
        x_best,
        y_best,
        marker="*",
        color=OPTIMUM,
        linestyle="none",
        markeredgecolor="white",
        markersize=8,
        zorder=5,
        label="optimum",
    )
    star.set_clip_on(False)
    ax.set_xlabel(label_of(tree, data, x))
    ax.set_ylabel(label_of(tree, data, y))
    artists["cells"].append(cells)
    artists["optimum"].append(star)
    artists["margins"].append(bars)


KIND = Kind("contour", "objective of a design over two variables, with the optimum and its margins", draw)
