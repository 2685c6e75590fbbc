"""The spectrogram of a run-up: amplitudes of the mesh forces over frequency and speed, crossed by the orders."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from gearstab.errors import PlotError
from gearstab.plots.axes import group_of, units_of
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import GROWTH, LINE, new_figure
from gearstab.plots.drawing.text import bracketed, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.motions.response import refuse_selections
from gearstab.plots.view import Request
from gearstab.results.display import FACTOR, SHOWN_SCALE, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

VARIABLE = "mesh_force_spectrogram"
DECADES = 3.0
"""Amplitudes below this many decades under the largest one stay white."""
SHOWN = 3e-2
"""The frequency axis ends where nothing above this part of the largest amplitude follows."""
MOST_LINES = 12
"""Harmonics of a mesh that are drawn."""
ROOM = 0.07
"""Numbers of harmonics are no nearer to each other than this part of the width."""


def read_ramp(tree: xr.DataTree, variable: str) -> tuple[xr.DataArray, str]:
    """A variable over the speed of a run-up, and the name of that axis. Raises PlotError if the result has none."""
    dataset = group_of(tree, "response")
    if variable not in dataset:
        raise PlotError("this result holds no run-up: give respond.ramp, and a run of more than a few cycles")
    data = dataset[variable]
    axis = next(str(dim) for dim in data.dims if dim in SPEEDS)
    if data.sizes[axis] < 2 or data.sizes.get("frequency", 2) < 2 or not np.isfinite(data.values).any():
        raise PlotError("this run-up holds no values over several speeds and frequencies: there is nothing to draw")
    return data, axis


def speed_label(speed: xr.DataArray) -> str:
    """``mesh frequency (rad/s)`` or ``input speed (rpm)``."""
    return str(speed.name).replace("_", " ") + bracketed(units_of(speed))


def chosen_meshes(data: xr.DataArray, request: Request) -> list[int]:
    """Positions of the meshes to draw. Raises PlotError for a selection of anything else."""
    wanted = request.select.get("mesh")
    refuse_selections(request, [data.isel({d: 0 for d in data.dims if d != "mesh"})], "time")
    meshes = [str(name) for name in data.coords["mesh"].values]
    if wanted is not None and wanted not in meshes:
        raise PlotError(f"mesh has no value {wanted!r}; its values: {', '.join(meshes)}")
    return list(range(len(meshes))) if wanted is None else [meshes.index(wanted)]


def mesh_ratios(tree: xr.DataTree, count: int) -> Array:
    """Frequency of each mesh over that of the first one."""
    ratios = group_of(tree, "response").attrs.get("frequency_ratios", np.ones(count))
    return np.atleast_1d(np.asarray(ratios, dtype=float))


def draw_orders(ax: Axes, speeds: Array, factor: float, end: float) -> list[Any]:
    """Lines along the harmonics of a mesh, numbered where they leave the frame.

    speeds: both ends of the axis. factor: frequency of the mesh, in units of the frequency axis, over the speed.
    """
    low, high = speeds
    lines, last = [], -np.inf
    for s in range(1, MOST_LINES + 1):
        if s * factor * low >= end:
            break
        lines += ax.plot([s * factor * low, s * factor * high], [low, high], color=LINE, linewidth=0.35, alpha=0.6)
        x, y = min(s * factor * high, end), min(high, end / (s * factor))
        if y == high and x - last < ROOM * end:
            continue
        last = x
        above = y == high
        ax.annotate(
            f"{s}", (x, y), xytext=(0, 2) if above else (2, 0), textcoords="offset points", fontsize=6.5,
            ha="center" if above else "left", va="bottom" if above else "center", annotation_clip=False,
        )  # fmt: skip
    return lines


def draw_modes(tree: xr.DataTree, axes: list[Axes], end: float, unit: float) -> list[Any]:
    """Dotted lines at the natural frequencies of the mean system; unit: of the frequency axis, in rad/s."""
    frequencies = group_of(tree, "modes")["natural_frequency"].values / unit
    inside = frequencies[(frequencies > 0) & (frequencies < end)]
    return [ax.axvline(w, color=LINE, linewidth=0.5, linestyle=(0, (1, 2))) for ax in axes for w in inside]


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a map per mesh: ``cells``, ``orders`` and ``modes``. Raises PlotError without a run-up."""
    data, axis = read_ramp(tree, VARIABLE)
    chosen, speed, frequency = chosen_meshes(data, request), data.coords[axis], data.coords["frequency"]
    values = [np.asarray(data.isel(mesh=k).transpose(axis, "frequency").values, dtype=float) for k in chosen]
    largest = max(float(v.max()) for v in values) or 1.0
    heard = np.flatnonzero(np.max([v.max(axis=0) for v in values], axis=0) >= SHOWN * largest)
    last = min(int(heard.max(initial=1)) + 1, frequency.size - 1)
    end, unit = float(frequency.values[last]), float(frequency.attrs.get(SHOWN_SCALE, 1.0))
    figure = new_figure(request, (0.62 * len(chosen) + 0.2, 0.36 * len(chosen) + 0.12))
    axes = list(np.ravel(figure.subplots(len(chosen), 1, sharex=True, squeeze=False)))
    norm, rising = LogNorm(largest * 10**-DECADES, largest), np.argsort(speed.values)
    colours = GROWTH.with_extremes(under="white")
    ratios = mesh_ratios(tree, data.sizes["mesh"])
    cells, lines = [], []
    for ax, k, own in zip(axes, chosen, values, strict=True):
        x, y = frequency.values[: last + 1], speed.values[rising]
        shown = own[rising][:, : last + 1]
        cells.append(ax.pcolormesh(x, y, shown, norm=norm, cmap=colours, shading="nearest", rasterized=True))
        ends = y[[0, -1]]
        lines += draw_orders(ax, ends, float(ratios[k]) * float(speed.attrs.get(FACTOR, 1.0)) / unit, end)
        ax.set(xlim=(0.0, end), ylim=tuple(ends))
        ax.set_ylabel(speed_label(speed))
        name = plain(str(data.coords["mesh"].values[k]))
        ax.text(0.98, 0.03, name, transform=ax.transAxes, ha="right", va="bottom")
    marks = draw_modes(tree, axes, end, unit)
    axes[-1].set_xlabel(r"frequency $\omega$" + bracketed(units_of(frequency)))
    bar = figure.colorbar(cells[0], ax=axes, extend="min")
    bar.set_label("amplitude of the mesh force" + bracketed(units_of(data)))
    bar.outline.set_linewidth(0.5)
    for line, words in ((lines[:1], "harmonics of the mesh, numbered"), (marks[:1], "natural frequencies")):
        for one in line:
            one.set_label(words)
    write_legend(figure, [*lines[:1], *marks[:1]])
    write_title(figure, tree, request)
    return figure, {"cells": cells, "orders": lines, "modes": marks, "colour_bar": bar}


KIND = Kind(
    "waterfall", "spectrogram of a run-up over frequency and speed", draw,
    lambda c: not c.axes and c.holds("response") and VARIABLE in c.tree["response"].data_vars,
)  # fmt: skip
