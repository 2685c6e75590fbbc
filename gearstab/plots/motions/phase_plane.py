"""Motions of meshes: with backlash over the last periods and in the phase plane, and of a pair given by its gears.

The figure of a pair shows deflection, total energy and spectrum as Oh, Grosh & Barber 2005 do.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import group_of, units_of
from gearstab.plots.drawing.style import CASES, SHADE, new_panels, write_legend, write_title
from gearstab.plots.drawing.text import bracketed, fitted, plain
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.motions.response import draw_long_line, refuse_a_moment
from gearstab.plots.motions.spectrum import FLOOR, largest
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
    aspects, widths = (1.2 * len(names), 0.36 * len(names)), [1.5, 1] if wide else [1]
    figure, axes = new_panels(request, aspects, 2 * len(names), len(widths), "double", width_ratios=widths)
    artists: Artists = {"histories": [], "planes": [], "sections": [], "bands": []}
    for i, mesh in enumerate(names):
        line, band = draw_history(axes[2 * i], data, mesh)
        plane, dots = draw_plane(axes[2 * i + 1], data, mesh)
        for name, artist in zip(artists, (line, plane, dots, band), strict=True):
            artists[name].append(artist)
    figure.align_ylabels(axes)
    artists["legend"] = write_legend(figure, [artists["bands"][0], artists["sections"][0]])
    write_title(figure, tree, request)
    return figure, artists


KIND = Kind("phase-plane", "mesh deflections with backlash, over time and as orbits", draw)


CYCLES = 6
"""Mesh cycles of which the deflection is drawn, the last ones: of a hundred nothing could be seen."""
REACH = 8.0
"""End of the frequency axis, over w_d, as in Fig. 4."""


def read_pair(tree: xr.DataTree) -> xr.Dataset:
    """The response of a gear pair. Raises PlotError if the result holds none."""
    dataset = group_of(tree, "response")
    if "phi" not in dataset or "energy" not in dataset:
        raise PlotError("this result holds no response of a gear pair with phi and energy")
    refuse_a_moment(dataset)
    if not np.isfinite(dataset["phi"].values).any():
        raise PlotError("phi has no values: there is nothing to draw")
    return dataset


def last_cycles(data: xr.Dataset) -> slice:
    """The samples of the last whole cycles, from crossing to crossing of the section; all without such crossings."""
    sections = data["section_time"].values
    if sections.size < 2:
        return slice(0, data.sizes["time"])
    begin, end = sections[max(0, sections.size - 1 - CYCLES)], sections[-1]
    first, last = np.searchsorted(data["time"].values, [begin, end])
    # Turned back or at an end at once, crossings may lie closer together than samples, or after the last of them.
    whole = min(last, data.sizes["time"] - 1) <= first
    return slice(0, data.sizes["time"]) if whole else slice(int(first), int(last) + 1)


def draw_deflection(ax: Axes, data: xr.Dataset) -> Artists:
    """phi over the last cycles; times with two pairs in contact are shaded."""
    part = last_cycles(data)
    time, phi = data["time"].values[part], data["phi"].values[part]
    line = draw_long_line(ax, time, phi, CASES[0])
    stiffness = data["mesh_stiffness"].values[part, 0]
    bands = ax.fill_between(
        time, 0, 1, where=(stiffness > stiffness.min()).tolist(), transform=ax.get_xaxis_transform(), color=SHADE,
        linewidth=0, step="post", zorder=0.4,
    )  # fmt: skip
    if time.size > 1:
        ax.set_xlim(time[0], time[-1])
    ax.set_xlabel("time $t$ (s)")
    ax.set_ylabel(r"deflection $\phi$ (rad)")
    return {"deflection": line, "bands": bands}


def draw_energy(ax: Axes, data: xr.Dataset) -> Any:
    """U over the whole time, its own range of values (it may fall by little)."""
    time, energy = data["time"].values, data["energy"].values
    line = draw_long_line(ax, time, energy, CASES[2])
    # Rounding of a constant is no change.
    if np.ptp(energy) < 1e-9 * np.abs(energy).max():
        middle = energy.mean()
        ax.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))
    if time.size > 1:
        ax.set_xlim(time[0], time[-1])
    ax.set_xlabel("time $t$ (s)")
    ax.set_ylabel("total energy $U$ (J)")
    return line


def draw_density(ax: Axes, data: xr.Dataset) -> Any:
    """The power spectral density over the frequency, normalised by w_d."""
    x, values = data["normalised_frequency"].values, data["power_spectral_density"].values
    top = largest(values[x > 0])
    ax.set_yscale("log")
    line = draw_long_line(ax, x, np.maximum(values, 0.01 * FLOOR * top), CASES[1])
    ax.set_xlim(0.0, min(REACH, float(x[-1])))
    ax.set_ylim(FLOOR * 0.01 * top, 3 * top)
    ax.set_xlabel(r"frequency over $\omega_d$")
    ax.set_ylabel(r"spectrum of $\phi$ (rad$^2\,$s)")
    return line


def draw_pair(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``deflection``, ``bands``, ``energy`` and ``density``, None without spectrum."""
    data = read_pair(tree)
    if request.variable is not None or request.select:
        raise PlotError(
            "this figure has fixed panels; --kind response and --kind spectrum take --variable and --select"
        )
    spectral = data.sizes.get("frequency", 0) > 1 and bool(np.isfinite(data["normalised_frequency"].values).all())
    count = 3 if spectral else 2
    wide = request.wide()
    figure, axes = new_panels(request, (0.46 * count, 0.36), count, count if wide else 1)
    artists = draw_deflection(axes[0], data)
    artists["energy"] = draw_energy(axes[1], data)
    artists["density"] = draw_density(axes[2], data) if spectral else None
    if not wide:
        figure.align_ylabels(axes)
    write_title(figure, tree, request)
    return figure, artists


def _suits(contents: Contents) -> bool:
    request = contents.request
    whole = not contents.axes and request.variable is None and not request.select
    return whole and contents.holds("response") and "phi" in contents.tree["response"].data_vars


PAIR = Kind("pair", "deflection, energy and spectrum of a gear pair given by its gears", draw_pair, _suits)
