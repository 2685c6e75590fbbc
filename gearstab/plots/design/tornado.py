"""Which variable matters: what a step of each one, by itself, does to the objective."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearstab.errors import PlotError
from gearstab.plots.design.dataset import GIVEN, OPTIMUM, design_of, objective_label, symbol_of
from gearstab.plots.drawing.heading import write_title
from gearstab.plots.drawing.style import LINE, new_figure
from gearstab.plots.kinds import Kind
from gearstab.plots.view import Request

COLOURS = (GIVEN, OPTIMUM)
WORDS = ("5 % of its bounds lower", "5 % higher")


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, dict[str, Any]]:
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
                label=WORDS[k])
        for k in range(2)
    ]  # fmt: skip
    ax.axvline(best, color=LINE, linewidth=0.8)
    names = [symbol_of(tree, str(data["variable"].values[known[k]])) for k in order]
    texts = [str(data["optimum_text"].values[known[k]]) for k in order]
    ax.set_yticks(place, [f"{name} = {text}" for name, text in zip(names, texts, strict=True)])
    ax.tick_params(axis="y", which="both", length=0)
    ax.set_xlabel(objective_label(data))
    figure.legend(handles=bars, loc="outside lower center", ncols=2)
    write_title(figure, tree, request)
    return figure, {"lower": bars[0], "higher": bars[1]}


KIND = Kind("tornado", "what a step of each variable of a design does to its objective", draw)
