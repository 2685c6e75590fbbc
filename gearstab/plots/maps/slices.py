"""Small multiples: the stability map over a third (and fourth) axis of an N-dimensional result."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, prod
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.plots.axes import MapView, Request, view_of
from gearstab.plots.cases import Index, caption, some
from gearstab.plots.drawing import names
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import new_figure
from gearstab.plots.drawing.text import fitted
from gearstab.plots.kinds import Kind
from gearstab.plots.maps import doubt, proved, stability_map
from gearstab.plots.variables import colour_label, default_variable, find_variable

Artists = dict[str, Any]

MOST = 12
"""More panels than this are too small to read on a page."""


def arrangement(panels: Sequence[Index]) -> tuple[int, int]:
    """(rows, columns) of the panels: values of the two axes left over if these are few, else about a square."""
    sizes = [len({panel[name] for panel in panels}) for name in panels[0]]
    count = len(panels)
    if len(sizes) == 2 and max(sizes) <= 4 and prod(sizes) == count:
        return sizes[0], sizes[1]
    columns = {1: 1, 2: 2, 3: 3, 4: 2}.get(count, 3 if count <= 9 else 4)
    return ceil(count / columns), columns


def draw_panel(tree: xr.DataTree, ax: Axes, view: MapView, variable: str, norm: Any, text: str) -> Artists:
    """One map with its caption above (the names of the tongues stand between)."""
    artists = stability_map.draw_map(tree, ax, view, variable, norm)
    artists["caption"] = ax.set_title(text, loc="left", pad=18)
    ax.label_outer()
    ax.set(xlabel="", ylabel="")
    return artists


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``panels`` and ``colour_bar``.

    A panel is a mapping of artists, see ``stability_map.draw_map``, with ``caption`` and ``names``. All panels share
    axes and colours. Raises PlotError if there would be more than ``MOST``.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)
    view = view_of(tree, map(str, data.dims), request, dataset)
    chosen, note = some(view.free, MOST, "panels", request.partial)
    views = [view.at(**panel) for panel in chosen]
    rows, columns = arrangement(chosen)
    figure = new_figure(request, min(1.25, 0.12 + 0.88 * rows / columns), "double")
    grid = np.ravel(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False))
    values = np.ma.stack([stability_map.read_cells(tree, item, variable)[0] for item in views])
    norm = stability_map.colours(values, variable)[1]
    panels = []
    for number, (ax, item, panel) in enumerate(zip(grid, views, chosen, strict=False)):
        text = f"({chr(97 + number)})  {caption(view.free, panel)}" if len(views) > 1 else caption(view.free, panel)
        panels.append(draw_panel(tree, ax, item, variable, norm, text))
    for ax in grid[len(views) :]:
        ax.remove()
    for ax in grid[max(0, len(views) - columns) : len(views)]:
        ax.tick_params(labelbottom=True)  # the lowest of its column, whether or not that ends above the others
    bar = figure.colorbar(panels[0]["cells"], ax=list(grid[: len(views)]), pad=0.015, aspect=18 * rows)
    bar.set_label(fitted(colour_label(tree, variable), 1.8 * rows, 8.5))
    bar.outline.set_linewidth(0.5)
    doubtful = {words: patches for panel in panels for words, patches in panel["doubtful"].items()}
    # The name of the axis stands in the middle.
    tint = next((panel["proved"] for panel in panels if panel["proved"] is not None), None)
    write_legend(figure, [*proved.legend_of(tint), *doubt.legend_of_map(doubtful)], "outside lower right")
    figure.supxlabel(view.x.label, fontsize=8.5)
    figure.supylabel(view.y.label, fontsize=8.5)
    write_title(figure, tree, request, view)
    names.settle(figure)
    for ax, item, artists in zip(grid, views, panels, strict=False):
        artists["names"] = names.name_view(tree, ax, item, rows=1)
    names.freeze(figure, request)
    return figure, {"panels": panels, "colour_bar": bar, "left_out": note}


KIND = Kind(
    "slices",
    "maps over a third axis, one panel per value",
    draw,
    lambda c: c.dimensions is not None and c.dimensions > 2,
)
