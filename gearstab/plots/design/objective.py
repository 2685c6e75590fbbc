"""The objective of a design: over two variables, with the optimum and its margins, and after a step of each one."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import mesh_numbers
from gearstab.plots.drawing.style import GROWTH, LINE, new_figure, new_panels, write_legend, write_title
from gearstab.plots.drawing.text import axis_label, bracketed, fitted, path_words, plain, short_label
from gearstab.plots.kinds import Kind
from gearstab.plots.view import Request

Array = np.ndarray

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
    """An objective with its unit: that of the quantity, or of the sum that all objectives are."""
    name = str(data["objective"].values[place])
    units = dict(zip(data["quantity"].values, data["quantity_units"].values, strict=True)) if "quantity" in data else {}
    return plain(name.replace("_", " ")) + bracketed(
        str(units.get(name, data["objective_optimum"].attrs.get("units", "1")))
    )


LINES = 7
"""Contour lines."""


def draw_contour(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """One panel for each pair of variables, or the one of ``x`` and ``y``: ``cells``, ``optimum``, ``margins``."""
    data = design_of(tree)
    if "scan_objective" not in data:
        raise PlotError("this design has no map of its objective: it needs two continuous variables")
    pairs = chosen(data, request)
    alone = len(pairs) == 1
    wide = request.wide("single" if alone else "double")
    columns = min(len(pairs), 3 if wide else 2)
    height = 0.9 if alone else (0.34 if wide else 0.52) * ceil(len(pairs) / columns) + 0.02
    figure, panels = new_panels(request, height, len(pairs), columns, "single" if alone else "double")
    values = [table for *_, table in pairs]
    low, high = min(np.nanmin(v) for v in values), max(np.nanmax(v) for v in values)
    artists: dict[str, Any] = {"cells": [], "optimum": [], "margins": []}
    for ax, (x, y, table) in zip(panels, pairs, strict=True):
        draw_panel(ax, tree, data, x, y, table, (float(low), float(high)), artists)
    width = 0.62 * figure.get_figwidth() / columns
    for ax in panels:
        ax.set_xlabel(fitted(ax.get_xlabel(), width, 8.5), linespacing=0.95)
        ax.set_ylabel(fitted(ax.get_ylabel(), width, 8.5), linespacing=0.95)
    figure.colorbar(artists["cells"][0], ax=panels, label=objective_label(data), pad=0.01)
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


CONTOUR = Kind("contour", "objective of a design over two variables, with the optimum and its margins", draw_contour)


COLOURS = (GIVEN, OPTIMUM)
WORDS = ("5 % of its bounds lower", "5 % higher")


def draw_tornado(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """Two bars for each variable, ``lower`` and ``higher``, the largest change on top."""
    data = design_of(tree)
    if "step_objective" not in data:
        raise PlotError("this design has no continuous variables, of which a step could be taken")
    known = np.flatnonzero(np.isfinite(data["step_objective"].values).any(axis=1))
    best = float(np.ravel(data["objective_optimum"].values)[0])
    change = data["step_objective"].values[known] - best
    order = np.argsort(np.nanmax(np.abs(change), axis=1), kind="stable")
    figure = new_figure(request, (0.28 + 0.11 * len(known), 0.14 + 0.06 * len(known)))
    ax = figure.add_subplot()
    place = np.arange(len(known), dtype=float)
    bars = [
        ax.barh(place + 0.19 - 0.38 * k, np.nan_to_num(change[order, k]), left=best, height=0.34, color=COLOURS[k],
                label=plain(WORDS[k]))
        for k in range(2)
    ]  # fmt: skip
    ax.axvline(best, color=LINE, linewidth=0.8)
    names = [symbol_of(tree, str(data["variable"].values[known[k]])) for k in order]
    texts = [str(data["optimum_text"].values[known[k]]) for k in order]
    ax.set_yticks(place, [f"{name} = {plain(text)}" for name, text in zip(names, texts, strict=True)])
    ax.tick_params(axis="y", which="both", length=0)
    ax.set_xlabel(objective_label(data))
    write_legend(figure, bars)
    write_title(figure, tree, request)
    return figure, {"lower": bars[0], "higher": bars[1]}


TORNADO = Kind("tornado", "what a step of each variable of a design does to its objective", draw_tornado)
