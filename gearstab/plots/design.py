"""Figures of a design: its objective over two variables and after a step of each, what it changes, the front."""

from __future__ import annotations

from itertools import combinations
from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import held, mesh_numbers
from gearstab.plots.drawing.style import GROWTH, LINE, SHADE, new_figure, new_panels, write_legend, write_title
from gearstab.plots.drawing.text import axis_label, bracketed, fitted, path_words, plain, short_label, tongue_label
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.view import Request

Array = np.ndarray

NAME = "design"
GIVEN, OPTIMUM = "#8a8a8a", "#0b6fa4"
"""Colours of the given design and of the best one."""


def design_of(tree: xr.DataTree) -> xr.Dataset:
    """Return the group of a design result. Raises PlotError for other results."""
    return held(tree, NAME, "design")


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


GREY = "#6e6e6e"
STATES = {"initial": "given"}
"""Names of states in figures, where they differ from those of the result."""
OBJECTIVES = ("load_factor", "required_damping")
"""Shown instead of the growth rate, which other objectives go with."""
MOST_LABELS = 7
"""Names of regions of a design."""
APART = 0.53
"""Inches between names."""


def draw_before_after(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """The whole figure: ``lines`` of growth rate or objective, ``bars`` of regions and their ``names``, ``range``."""
    data = design_of(tree)
    if "speed_growth_rate" not in data:
        raise PlotError("this design has no growth rates: its meshes have no common period")
    regions = "region_frequency" in data
    aspects, heights = ((1.0, 0.62), [2.2, 1.0]) if regions else ((0.7, 0.5), [1.0])
    figure, axes = new_panels(request, aspects, len(heights), default="double", sharex=True, height_ratios=heights)
    top = axes[0]
    speed, words = data["speed"].values, words_of(data)
    shown = next((name for name in OBJECTIVES if f"speed_{name}" in data), "growth_rate")
    curves = data[f"speed_{shown}"]
    lines = [
        top.plot(speed, curves.values[:, k], color=COLOURS[k], label=word,
                 linewidth=0.8 + 0.3 * k)[0]
        for k, word in enumerate(words)
    ]  # fmt: skip
    top.set_xlim(speed[0], speed[-1])
    top.set_ylabel(axis_label(shown, shown.replace("_", " "), str(curves.attrs.get("units", "1"))))
    artists: dict[str, Any] = {"lines": lines, "bars": [], "names": [], "range": []}
    for ax in axes:
        artists["range"] += [
            ax.axvspan(low, high, color=SHADE, alpha=0.6, zorder=0, linewidth=0)
            for low, high in data["range_frequency"].values[:, :, -1]
        ]
    if regions:
        draw_regions(axes[1], tree, data, artists)
    said = data["speed"].attrs
    name = str(said.get("long_name", "mesh frequency"))
    axes[-1].set_xlabel(axis_label(name.replace(" ", "_"), name, str(said.get("units", "1"))))
    shaded = Patch(facecolor=SHADE, alpha=0.6, label="speeds that count")
    write_legend(figure, [*lines, shaded] if artists["range"] else lines)
    write_title(figure, tree, request)
    return figure, artists


def words_of(data: xr.Dataset) -> list[str]:
    """Names of the designs."""
    return [STATES.get(name, name) for name in data["state"].values.astype(str)]


def draw_regions(ax: Axes, tree: xr.DataTree, data: xr.Dataset, artists: dict[str, Any]) -> None:
    """A row of bars for each design, the widest ones in the frame with their names."""
    edges, labels = data["region_frequency"].values, data["label"].values.astype(str)
    low, high = ax.get_xlim()
    least = 0.002 * (high - low)
    words = words_of(data)
    apart = APART * ax.figure.dpi / ax.get_window_extent().width * (high - low)
    last = len(words) - 1
    for k in range(len(words)):
        here = edges[:, :, k]
        inside = np.flatnonzero((here[:, 1] > low) & (here[:, 0] < high))
        width = np.maximum(here[inside, 1] - here[inside, 0], least)
        # What is too narrow to see is drawn as wide as a line and lower, lest many such regions look like one.
        height = np.where(here[inside, 1] - here[inside, 0] < least, 0.1, 0.34)
        artists["bars"].append(ax.barh(np.full(len(inside), last - k), width, left=here[inside, 0], height=height,
                                       color=COLOURS[k], linewidth=0))  # fmt: skip
        if not len(inside):
            words_there = ax.text(0.5 * (low + high), last - k, "no region", ha="center", va="center", color=GREY)
            artists["names"].append(words_there)
        taken: list[float] = []
        for j in inside[np.argsort(-width, kind="stable")]:
            middle = 0.5 * (max(here[j, 0], low) + min(here[j, 1], high))
            inside_frame = low + 0.5 * apart < middle < high - 0.5 * apart
            if inside_frame and len(taken) < MOST_LABELS and all(abs(middle - x) > apart for x in taken):
                taken.append(middle)
                text = tongue_label(labels[j], mesh_numbers(tree))
                artists["names"].append(ax.text(middle, last + 0.24 - k, text, ha="center", va="bottom", fontsize=6.5))
    ax.set_yticks(range(last, -1, -1), words)
    ax.set_ylim(-0.35, last + 0.72)
    ax.tick_params(axis="y", which="both", length=0)


BEFORE_AFTER = Kind(
    "design",
    "growth rates, or the objective, and regions of the given design and the best one",
    draw_before_after,
    lambda contents: contents.holds(NAME),
)


LABELLED = 8
"""Designs with a number and their values."""


def draw_front(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """The front: ``fronts`` of each pair of objectives, ``labels``, and the ``list`` of labelled designs."""
    data = design_of(tree)
    if "design_objective" not in data:
        raise PlotError("this design has one objective; give design.minimise a list of them for a Pareto front")
    objectives = data["design_objective"].values
    pairs = list(combinations(range(objectives.shape[1]), 2))
    picked = labelled(objectives)
    columns = min(3, ceil(np.sqrt(len(pairs) + 1))) if request.wide("double") else 1
    aspect = 0.1 + (0.8 if columns > 1 else 0.65) * ceil((len(pairs) + 1) / columns) / columns
    figure, axes = new_panels(request, aspect, len(pairs) + 1, columns, "double")
    artists: dict[str, Any] = {"fronts": [], "labels": [], "marks": {}}
    for ax, (i, j) in zip(axes, pairs, strict=False):
        draw_pair(ax, data, i, j, picked, artists)
    last = axes[-1]
    last.set_axis_off()
    artists["list"] = last.text(0.0, 1.0, values_of(tree, data, picked), va="top", fontsize=6.5, linespacing=1.35,
                                transform=last.transAxes)  # fmt: skip
    write_legend(figure, list(artists["marks"].values()))
    write_title(figure, tree, request)
    return figure, artists


def labelled(objectives: Array) -> Array:
    """At most LABELLED designs, spread over the front."""
    return np.unique(np.linspace(0, len(objectives) - 1, min(LABELLED, len(objectives))).round().astype(int))


def draw_pair(ax: Axes, data: xr.Dataset, i: int, j: int, picked: Array, artists: dict[str, Any]) -> None:
    """The front over two of the objectives, the given design and the compromise."""
    objectives, names = data["design_objective"].values, [str(name) for name in data["objective"].values]
    order = np.argsort(objectives[:, i], kind="stable")
    ax.margins(0.12)
    # Of three or more objectives the front is a surface: designs next to each other here need not be so on it.
    (line,) = ax.plot(objectives[order, i], objectives[order, j], color=LINE, marker="o", markersize=2.5, linewidth=0.6,
                      linestyle="-" if len(names) == 2 else "none", label="front")  # fmt: skip
    artists["marks"]["front"] = line
    near = np.ptp(objectives[:, [i, j]], axis=0) + np.max(objectives[:, [i, j]], axis=0)
    for name, colour, marker in (("objective_initial", GIVEN, "s"), ("objective_optimum", OPTIMUM, "*")):
        point = np.ravel(data[name].values)
        if not np.all(point[[i, j]] <= near):
            # Far off, where it would press the front into a corner; the list tells where.
            continue
        words = "given" if marker == "s" else "compromise"
        (artists["marks"][words],) = ax.plot(point[i], point[j], color=colour, marker=marker, linestyle="none",
                                             markersize=7, label=words, zorder=3)  # fmt: skip
    for k in picked:
        text = ax.annotate(
            str(int(data["design"].values[k])), (objectives[k, i], objectives[k, j]), xytext=(4, 3),
            textcoords="offset points", fontsize=7,
        )  # fmt: skip
        artists["labels"].append(text)
    artists["fronts"].append(line)
    ax.set_xlabel(objective_label(data, i))
    ax.set_ylabel(objective_label(data, j))


def values_of(tree: xr.DataTree, data: xr.Dataset, picked: Array) -> str:
    """The labelled designs by their values, a line or two each."""
    names = [symbol_of(tree, str(name)) for name in data["variable"].values]
    lines = []
    for k in picked:
        values = [f"{name} = {value:.4g}" for name, value in zip(names, data["design_value"].values[k], strict=True)]
        rows = [", ".join(values[start : start + 3]) for start in range(0, len(values), 3)]
        lines.append(f"{int(data['design'].values[k])}:  " + "\n      ".join(rows))
    given = zip(data["objective"].values, np.ravel(data["objective_initial"].values), strict=True)
    lines += ["", "given:", *(f"      {str(name).replace('_', ' ')} = {value:.4g}" for name, value in given)]
    return "\n".join(lines)


def _suits(contents: Contents) -> bool:
    return contents.holds(NAME) and "design_objective" in contents.tree[NAME].data_vars


PARETO = Kind("pareto", "designs of several objectives, of which none is better in everything", draw_front, _suits)
