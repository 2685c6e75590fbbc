"""Load or root stress of a tooth along its contact, static and dynamic (as in Kuria & Kihiu 2008, Figs. 6 to 8)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import CASES, new_figure
from gearstab.plots.drawing.text import fitted, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.motions.response import MOST_PANELS, columns, read_response, refuse_selections
from gearstab.plots.view import Request

Artists = dict[str, Any]

DYNAMIC = ("tooth_load", "root_stress")
"""Variables that can be drawn; the static one has ``static_`` before its name."""


MOST_IN_A_COLUMN = 5
"""Panels that stand over one another in one column of a journal."""


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """One panel per mesh (or a gear, of ``--variable root_stress``); its artists are ``lines`` and ``static``."""
    dataset = read_response(tree)
    name = request.variable or DYNAMIC[0]
    if name not in DYNAMIC:
        raise PlotError(f"no variable {name!r} along the contact of teeth; there is {listed(DYNAMIC)}")
    if name not in dataset:
        raise PlotError("this response holds no loads of teeth: they come with steady states of kind gearbox")
    refuse_selections(request, [dataset[name]], "contact")
    both = [columns(dataset[which], request, "contact") for which in (name, f"static_{name}")]
    panels = [(label, data, rest) for (label, data), (_, rest) in zip(*both, strict=True) if not data.isnull().all()]
    if not panels:
        raise PlotError(f"{name} has no values: there is nothing to draw")
    if len(panels) > MOST_PANELS:
        raise PlotError(f"{len(panels)} panels are too many (at most {MOST_PANELS}): choose with --select")
    stress = name == "root_stress"
    wide = request.wide("double")
    across = 2 if len(panels) > 1 and (wide or len(panels) > MOST_IN_A_COLUMN) else 1
    down = -(-len(panels) // across)
    figure = new_figure(request, (0.28 if wide else 0.42) * down + 0.12, "double")
    axes = np.ravel(figure.subplots(down, across, sharex=True, squeeze=False))
    lines, still = [], []
    for ax, (label, data, rest) in zip(axes, panels, strict=False):
        scale = 1e-6 if stress else 1.0
        where = dataset["contact"].values
        still += ax.plot(where, scale * rest.values, color="#8a8a8a", linewidth=0.9, label="static")
        lines += ax.plot(where, scale * data.values, color=CASES[0], linewidth=0.9, label="dynamic, largest")
        words = label.split(", ", 1)[1].rsplit(" (", 1)[0]
        ax.set_title(plain(words if stress else f"mesh {words}"), fontsize="small")
        ax.set_ylabel("root stress (MPa)" if stress else "load (N)")
        ax.set_ylim(bottom=0)
        ax.set_xlim(0, 1)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    for ax in axes[max(0, len(panels) - across) : len(panels)]:
        ax.xaxis.set_tick_params(labelbottom=True)
        ax.set_xlabel(fitted("contact, from first to last point", 0.7 * figure.get_figwidth() / across, 8.5))
    write_legend(figure, [still[0], lines[0]])
    write_title(figure, tree, request)
    return figure, {"lines": lines, "static": still}


KIND = Kind("teeth", "load or root stress of teeth along their contact, static and dynamic", draw)
