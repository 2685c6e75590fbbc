"""Motion with backlash: the deflection of every mesh over the last periods, and its phase plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import group_of, units_of
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.long_line import draw_long_line
from gearstab.plots.drawing.style import CASES, SHADE, new_figure
from gearstab.plots.drawing.text import bracketed, fitted, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.motions.response import refuse_a_moment
from gearstab.plots.view import Request

Array = np.ndarray
Artists = dict[str, Any]

PERIODS = 6
"""Common periods of which the history is drawn, the last ones; more for motions of longer period."""


def read_backlash(tree: xr.DataTree) -> xr.Dataset:
    """The response with backlash. Raises PlotError if the result holds none."""
    dataset = group_of(tree, "response")
    if not {"mesh_deflection", "mesh_velocity", "play"} <= set(map(str, dataset.data_vars)):
        raise PlotError("this result holds no response with backlash, with mesh_deflection, mesh_velocity and play")
    refuse_a_moment(dataset)
    return dataset


def meshes_of(data: xr.Dataset, request: Request) -> list[str]:
    """The meshes with backlash, or the one selected."""
    names = [str(name) for name in data["mesh"].values]
    if request.variable is not None:
        raise PlotError("this figure has fixed panels; --kind response takes --variable")
    for axis, value in request.select.items():
        if axis != "mesh" or value not in names:
            raise PlotError(f"no {axis} {value!r} to select here; mesh is one of {listed(names)}")
    if "mesh" in request.select:
        return [str(request.select["mesh"])]
    width = np.ptp(data["play"].values, axis=1)
    found = [name for name, wide in zip(names, width, strict=True) if wide > 0]
    if not found:
        raise PlotError("no mesh of this response has backlash: there is nothing to draw")
    return found


def settled(data: xr.Dataset) -> Array:
    """Which samples are drawn in the phase plane: those after the beginning that was left out; all without it."""
    time = data["time"].values
    return np.asarray(time >= data.attrs.get("settled_from", 0.0) - 1e-9 * time[-1])


def draw_history(ax: Axes, data: xr.Dataset, mesh: str) -> Any:
    """The last common periods; the play is shaded."""
    time, period = data["time"].values, float(data.attrs["common_period"])
    shown = max(PERIODS, 2 * int(data.attrs.get("period", 0))) * period
    part = time >= time[-1] - shown * (1 + 1e-9)
    one = data.sel(mesh=mesh)
    bands = ax.axhspan(*one["play"].values, color=SHADE, linewidth=0, zorder=0.4, label="no teeth in contact")
    line = draw_long_line(ax, time[part], one["mesh_deflection"].values[part], CASES[0])
    ax.set_xlim(time[part][0], time[-1])
    keep_to(ax.set_ylim, one["mesh_deflection"].values[part])
    ax.set_xlabel("time $t$ (s)")
    ax.set_ylabel(fitted(label("mesh deflection", one["mesh_deflection"], mesh), 1.4, 8.5), linespacing=0.95)
    return line, bands


def draw_plane(ax: Axes, data: xr.Dataset, mesh: str) -> Any:
    """Rate over deflection, with the sections once per common period as dots."""
    one, part = data.sel(mesh=mesh), settled(data)
    x, v = one["mesh_deflection"].values[part], one["mesh_velocity"].values[part]
    ax.axvspan(*one["play"].values, color=SHADE, linewidth=0, zorder=0.4)
    line = draw_long_line(ax, x, v, CASES[0], 0.5)
    turns = data["time"].values[part] / float(data.attrs["common_period"])
    at = np.abs(turns - np.round(turns)) < 1e-6
    look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.4, "color": CASES[1], "zorder": 3}
    (dots,) = ax.plot(x[at], v[at], label="once per common period", **look)
    keep_to(ax.set_xlim, x)
    ax.set_xlabel(label("mesh deflection", one["mesh_deflection"], ""))
    ax.set_ylabel(label("rate", one["mesh_velocity"], ""))
    return line, dots


def keep_to(set_limits: Any, values: Array) -> None:
    """An axis as long as the motion needs, whatever the play is."""
    margin = 0.06 * (np.ptp(values) or 1.0)
    set_limits(values.min() - margin, values.max() + margin)


def label(words: str, data: xr.DataArray, mesh: str) -> str:
    """``mesh deflection, first (m)``."""
    return plain(words + (f", {mesh}" if mesh else "")) + bracketed(units_of(data))


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a row per mesh: ``histories``, ``planes``, ``sections``, ``bands``, lists by mesh."""
    data = read_backlash(tree)
    names = meshes_of(data, request)
    wide = request.wide("double")
    rows, columns = (len(names), 2) if wide else (2 * len(names), 1)
    figure = new_figure(request, (0.6 * rows, 0.36 * rows), "double")
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False, width_ratios=[1.5, 1] if wide else [1]))
    artists: Artists = {"histories": [], "planes": [], "sections": [], "bands": []}
    for i, mesh in enumerate(names):
        line, band = draw_history(axes[2 * i], data, mesh)
        plane, dots = draw_plane(axes[2 * i + 1], data, mesh)
        for name, artist in zip(artists, (line, plane, dots, band), strict=True):
            artists[name].append(artist)
    figure.align_ylabels(list(axes))
    artists["legend"] = write_legend(figure, [artists["bands"][0], artists["sections"][0]])
    write_title(figure, tree, request)
    return figure, artists


KIND = Kind("phase-plane", "mesh deflections with backlash, over time and as orbits", draw)
