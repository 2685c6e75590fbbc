"""Designs of which none is better than another in everything, each pair of objectives, with labels."""

from __future__ import annotations

from itertools import combinations
from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError
from gearstab.plots.design.dataset import GIVEN, NAME, OPTIMUM, design_of, symbol_of
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import LINE, new_figure
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.view import Request

Array = np.ndarray
LABELLED = 8
"""Designs with a number and their values."""


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
    """The front: ``fronts`` of each pair of objectives, ``labels``, and the ``list`` of labelled designs."""
    data = design_of(tree)
    if "design_objective" not in data:
        raise PlotError("this design has one objective; give design.minimise a list of them for a Pareto front")
    objectives = data["design_objective"].values
    pairs = list(combinations(range(objectives.shape[1]), 2))
    picked = labelled(objectives)
    columns = min(3, ceil(np.sqrt(len(pairs) + 1)))
    rows = ceil((len(pairs) + 1) / columns)
    figure = new_figure(request, 0.1 + 0.4 * rows * 2 / columns, "double")
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False))
    artists: dict[str, Any] = {"fronts": [], "labels": [], "marks": {}}
    for ax, (i, j) in zip(axes, pairs, strict=False):
        draw_pair(ax, data, i, j, picked, artists)
    for ax in axes[len(pairs) :]:
        ax.set_axis_off()
    last = axes[len(pairs)]
    artists["list"] = last.text(0.0, 1.0, listed(tree, data, picked), va="top", fontsize=6.5, linespacing=1.35,
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
    ax.margins(0.08)
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
            str(int(data["design"].values[k])), (objectives[k, i], objectives[k, j]), xytext=(3, 3),
            textcoords="offset points", fontsize=7,
        )  # fmt: skip
        artists["labels"].append(text)
    artists["fronts"].append(line)
    ax.set_xlabel(names[i].replace("_", " "))
    ax.set_ylabel(names[j].replace("_", " "))


def listed(tree: xr.DataTree, data: xr.Dataset, picked: Array) -> str:
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


KIND = Kind("pareto", "designs of several objectives, of which none is better in everything", draw, _suits)
