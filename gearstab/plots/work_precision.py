"""Work-precision diagram: time per point against true error, one line per method (``/bench``)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.drawing.style import CASES, new_frame, write_legend, write_title
from gearstab.plots.kinds import Kind
from gearstab.plots.view import Request

Artists = dict[str, Any]

FLOOR = 1e-17
"""Errors that came out as exactly zero are drawn here, below the rounding error of the growth."""
MARKERS = "ospDv^<>X"


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are ``lines``, one per method. Raises PlotError without benchmark results."""
    if "bench" not in tree.children:
        raise PlotError(f"this result holds no benchmark; it holds {listed(tree.children)}")
    if not (np.isfinite(tree["bench"]["error"]) & np.isfinite(tree["bench"]["seconds"])).any():
        raise PlotError("no method of this benchmark has an error and a time: there is nothing to draw")
    figure, ax = new_frame(request, (0.95, 0.6))
    lines = draw_methods(ax, tree["bench"].to_dataset())
    write_legend(figure, lines, ax=request.ax)
    write_title(figure, tree, request)
    return figure, {"lines": lines}


def draw_methods(ax: Axes, dataset: xr.Dataset) -> list[Any]:
    """Exact methods as single large marks, integrators as lines through their tolerances."""
    lines = []
    methods = dataset["method"].values.astype(str)
    for k, name in enumerate(dict.fromkeys(methods)):
        part = dataset.isel(setting=np.flatnonzero(methods == name))
        exact = part.sizes["setting"] == 1
        (line,) = ax.plot(
            np.maximum(part["error"].values, FLOOR),
            part["seconds"].values,
            color=CASES[k % len(CASES)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=6 if exact else 3,
            linestyle="none" if exact else ("-" if "unbroken" not in name else "--"),
            label=name,
        )
        lines.append(line)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.invert_xaxis()
    ax.set_xlabel("largest error of the growth in one period")
    ax.set_ylabel("time per point (s)")
    ax.grid(True, which="major", linewidth=0.3, color="#c8c8c8")
    return lines


KIND = Kind(
    "work-precision",
    "time against error of the methods of a benchmark",
    draw,
    lambda c: not c.axes and c.holds("bench"),
)
