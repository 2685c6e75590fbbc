"""The response of a gear pair: deflection over a few mesh cycles, total energy, spectrum (Oh, Grosh & Barber 2005)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError
from gearstab.plots.axes import group_of
from gearstab.plots.drawing.heading import write_title
from gearstab.plots.drawing.long_line import draw_long_line
from gearstab.plots.drawing.style import CASES, SHADE, new_figure
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.motions.response import refuse_a_moment
from gearstab.plots.motions.spectrum import FLOOR, largest
from gearstab.plots.view import Request

Array = np.ndarray
Artists = dict[str, Any]

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


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``deflection``, ``bands``, ``energy`` and ``density``, None without spectrum."""
    data = read_pair(tree)
    if request.variable is not None or request.select:
        raise PlotError(
            "this figure has fixed panels; --kind response and --kind spectrum take --variable and --select"
        )
    spectral = data.sizes.get("frequency", 0) > 1 and bool(np.isfinite(data["normalised_frequency"].values).all())
    count = 3 if spectral else 2
    wide = request.wide()
    figure = new_figure(request, (0.46 * count, 0.36))
    axes = np.ravel(figure.subplots(1 if wide else count, count if wide else 1, squeeze=False))
    artists = draw_deflection(axes[0], data)
    artists["energy"] = draw_energy(axes[1], data)
    artists["density"] = draw_density(axes[2], data) if spectral else None
    if not wide:
        figure.align_ylabels(list(axes))
    write_title(figure, tree, request)
    return figure, artists


def _suits(contents: Contents) -> bool:
    request = contents.request
    whole = not contents.axes and request.variable is None and not request.select
    return whole and contents.holds("response") and "phi" in contents.tree["response"].data_vars


KIND = Kind("pair", "deflection, energy and spectrum of a gear pair given by its gears", draw, _suits)
