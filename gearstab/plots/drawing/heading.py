"""The title over a figure and the legend under it."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any, Literal

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from gearstab.plots.drawing.text import fitted, plain
from gearstab.plots.view import Request, View


def title_of(tree: xr.DataTree) -> str:
    """The title of the result, empty if it has none."""
    return str(tree.attrs.get("title", "") or "")


def write_title(figure: Figure, tree: xr.DataTree, request: Request, view: View | None = None) -> None:
    """Write the result's title or the one asked for, and what was selected, over the figure.

    Nothing if the user wants no title, or gave a frame, over which stand the names of the tongues.
    """
    if not request.title or request.ax is not None:
        return
    title = fitted(plain(request.title if isinstance(request.title, str) else title_of(tree)), figure.get_figwidth(), 9)
    lines = [title] if title else []
    if view is not None and view.chosen:
        lines.append(",  ".join(view.chosen))
    if lines:
        figure.suptitle("\n".join(lines), linespacing=1.1)


Place = Literal["outside lower center", "outside lower right"]


def write_legend(
    figure: Figure, handles: Sequence[Any], place: Place = "outside lower center", ax: Axes | None = None
) -> Legend | None:
    """A legend under the figure with as many columns as its width holds, the rows about equally full.

    None without handles. ax: the frame that it goes into instead, in a figure that the user made.
    """
    if not handles:
        return None
    if ax is not None:
        return ax.legend(handles=list(handles))
    count = len(handles)
    for rows in range(1, count + 1):
        legend = figure.legend(handles=list(handles), loc=place, ncols=ceil(count / rows))
        if rows == count or legend.get_window_extent().width <= figure.bbox.width:
            return legend
        legend.remove()
    return None
