"""Small multiples: the stability map over a third (and fourth) axis of an N-dimensional result."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.plots.cases import MOST_PANELS, TALL, arrangement, caption, some
from gearstab.plots.drawing import names, tongues
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import new_figure
from gearstab.plots.drawing.text import fitted
from gearstab.plots.kinds import Kind
from gearstab.plots.maps import doubt, proved, stability_map
from gearstab.plots.maps.coarse import coarse
from gearstab.plots.variables import colour_label, default_variable, find_variable
from gearstab.plots.view import MapView, Request, view_of

Artists = dict[str, Any]


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
    axes and colours. Raises PlotError if there would be more than ``MOST_PANELS``.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)
    view = view_of(tree, map(str, data.dims), request, dataset)
    chosen, note = some(view.free, MOST_PANELS, "panels", request.partial)
    shown = [coarse(tree, view.at(**panel), variable) for panel in chosen]
    views = [item for _, item in shown]
    wide = request.wide("double")
    rows, columns = arrangement(chosen, wide)
    each = 0.88 if wide else 0.62
    figure = new_figure(request, min(1.25 if wide else TALL, 0.12 + each * rows / columns), "double")
    grid = np.ravel(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False))
    values = np.ma.stack([stability_map.read_cells(*item, variable)[0] for item in shown])
    norm = stability_map.colours(values, variable)[1]
    panels = []
    for number, (ax, (part, item), panel) in enumerate(zip(grid, shown, chosen, strict=False)):
        text = f"({chr(97 + number)})  {caption(view.free, panel)}" if len(views) > 1 else caption(view.free, panel)
        panels.append(draw_panel(part, ax, item, variable, norm, text))
    for ax in grid[len(views) :]:
        ax.remove()
    for ax in grid[max(0, len(views) - columns) : len(views)]:
        # The lowest of its column, whether or not that ends above the others.
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(fitted(view.x.label, 0.85 * figure.get_figwidth() / columns, 8.5))
    label = fitted(colour_label(tree, variable), 1.8 * rows, 8.5)
    bar = stability_map.colour_bar(figure, panels[0], list(grid[: len(views)]), label, pad=0.015, aspect=18 * rows)
    doubtful = {words: patches for panel in panels for words, patches in panel["doubtful"].items()}
    tint = next((panel["proved"] for panel in panels if panel["proved"] is not None), None)
    handles = [*tongues.legend_of(tree, panels[0]), *proved.legend_of(tint), *doubt.legend_of_map(doubtful)]
    handles += doubt.legend_of_failed(next((panel for panel in panels if panel["failed"] is not None), panels[0]))
    write_legend(figure, handles)
    figure.supylabel(view.y.label, fontsize=8.5)
    write_title(figure, tree, request, view)
    names.settle(figure)
    for ax, (part, item), artists in zip(grid, shown, panels, strict=False):
        artists["names"] = names.name_view(part, ax, item, rows=1)
    names.freeze(figure, request)
    return figure, {"panels": panels, "colour_bar": bar, "left_out": note}


KIND = Kind(
    "slices",
    "maps over a third axis, one panel per value",
    draw,
    lambda c: c.dimensions is not None and c.dimensions > 2,
)
