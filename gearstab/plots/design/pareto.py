"""Designs of which none is better than another in everything, each pair of objectives, with labels."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError
from gearstab.plots.design.dataset import GIVEN, NAME, OPTIMUM, design_of, symbol_of
from gearstab.plots.drawing.heading import write_title
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
    figure = new_figure(request, 0.5, "double")
    axes = figure.subplots(1, len(pairs) + 1, squeeze=False, width_ratios=[1.0] * len(pairs) + [0.9])[0]
    artists: dict[str, Any] = {"fronts": [], "labels": []}
    for ax, (i, j) in zip(axes, pairs, strict=False):
        draw_pair(ax, data, i, j, picked, artists)
    axes[-1].set_axis_off()
    artists["list"] = axes[-1].text(0.0, 1.0, listed(tree, data, picked), va="top", fontsize=6.5, linespacing=1.35,
                                    transform=axes[-1].transAxes)  # fmt: skip
    write_title(figure, tree, request)
    return figure, artists


def labelled(objectives: Array) -> Array:
    """At most LABELLED designs, spread over the front."""
    return np.unique(np.linspace(0, len(objectives) - 1, min(LABELLED, len(objectives))).round().astype(int))


def draw_pair(ax: Axes, data: xr.Dataset, i: int, j: int, picked: Array, artists: dict[str, Any]) -> None:
    """The front over two of the objectives, the given design and the compromise."""
    objectives, names = data["design_objective"].values, [str(name) for name in data["objective"].values]
    order = np.argsort(objectives[:, i], kind="stable")
    (line,) = ax.plot(objectives[order, i], objectives[order, j], color=LINE, marker="o", markersize=2.5, linewidth=0.6)
    near = np.ptp(objectives[:, [i, j]], axis=0) + np.max(objectives[:, [i, j]], axis=0)
    for name, colour, marker in (("objective_initial", GIVEN, "s"), ("objective_optimum", OPTIMUM, "*")):
        point = np.ravel(data[name].values)
        if not np.all(point[[i, j]] <= near):
            # Far off, where it would press the front into a corner; the list tells where.
            continue
        words = "given" if marker == "s" else "compromise"
        ax.plot(point[i], point[j], color=colour, marker=marker, linestyle="none", markersize=7, label=words, zorder=3)
    for k in picked:
        text = ax.annotate(
            str(int(data["design"].values[k])), (objectives[k, i], objectives[k, j]), xytext=(3, 3),
            textcoords="offset points", fontsize=7,
        )  # fmt: skip
        artists["labels"].append(text)
    artists["fronts"].append(line)
    ax.set_xlabel(names[i].replace("_", " "))
    ax.set_ylabel(names[j].replace("_", " "))
    ax.legend(loc="best")


def listed(tree: xr.DataTree, data: xr.Dataset, picked: Array) -> str:
    """The labelled designs by their values, a line or two each."""
    names = [symbol_of(tree, str(name)) for name in data["variable"].values]
    lines = []
    for k in picked:
        values = [f"{name} = {value:.4g}" for name, value in zip(names, data["design_value"].values[k], strict=True)]
        rows = [", ".join(values[start : start + 3]) for start in range(0, len(values), 3)]
        lines.append(f"{int(data['design'].values[k])}:  " + "\n      ".join(rows))
    given = ", ".join(f"{value:.4g}" for value in np.ravel(data["objective_initial"].values))
    return "\n".join([*lines, "", f"given: {', '.join(map(str, data['objective'].values))} = {given}"])


def _suits(contents: Contents) -> bool:
    return contents.holds(NAME) and "design_objective" in contents.tree[NAME].data_vars


KIND = Kind("pareto", "designs of several objectives, of which none is better in everything", draw, _suits)
