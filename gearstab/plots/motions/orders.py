"""Harmonics of the mesh forces of a run-up over the speed: what an order analysis shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearstab.plots.axes import units_of
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import CASES, DASHES, new_figure
from gearstab.plots.drawing.text import bracketed, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.motions.response import fit_labels
from gearstab.plots.motions.waterfall import chosen_meshes, read_ramp, speed_label
from gearstab.plots.view import Request

Artists = dict[str, Any]

VARIABLE = "mesh_force_harmonic"
SHOWN = 4
"""Harmonics that are drawn."""


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a panel per mesh: ``lines``. Raises PlotError without a run-up."""
    data, axis = read_ramp(tree, VARIABLE)
    chosen, speed = chosen_meshes(data, request), data.coords[axis]
    rising = np.argsort(speed.values)
    figure = new_figure(request, (0.5 * len(chosen) + 0.15, 0.28 * len(chosen) + 0.12))
    axes = list(np.ravel(figure.subplots(len(chosen), 1, sharex=True, squeeze=False)))
    lines = []
    for ax, k in zip(axes, chosen, strict=True):
        own = data.isel(mesh=k).transpose(axis, "harmonic")
        for s in range(min(SHOWN, data.sizes["harmonic"])):
            lines += ax.plot(
                speed.values[rising], own.values[rising, s], color=CASES[s], linestyle=DASHES[s], linewidth=0.7,
                label=f"harmonic {int(own.coords['harmonic'].values[s])}",
            )  # fmt: skip
        ax.set_ylim(bottom=0.0)
        name = plain(f"{data.coords['mesh'].values[k]}")
        ax.set_ylabel(f"mesh force, {name}{bracketed(units_of(data))}")
    axes[0].set_xlim(*speed.values[rising][[0, -1]])
    axes[-1].set_xlabel(speed_label(speed))
    write_legend(figure, lines[:SHOWN])
    write_title(figure, tree, request)
    figure.align_ylabels(axes)
    fit_labels(axes)
    return figure, {"lines": lines}


KIND = Kind("orders", "harmonics of the mesh forces of a run-up over the speed", draw)
