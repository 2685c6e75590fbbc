"""The title over a figure."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from gearstab.plots.axes import Request, View
from gearstab.plots.text import fitted, plain


def title_of(tree: xr.DataTree) -> str:
    """The title of the result, empty if it has none."""
    return str(tree.attrs.get("title", "") or "")


def write_title(figure: Figure, tree: xr.DataTree, request: Request, view: View | None = None) -> None:
    """Write the result's title, and what was selected, over the figure; nothing if the user wants no title."""
    if not request.title:
        return
    title = fitted(plain(title_of(tree)), figure.get_figwidth(), 9)
    lines = [title] if title else []
    if view is not None and view.chosen:
        lines.append(",  ".join(view.chosen))
    if lines:
        figure.suptitle("\n".join(lines), linespacing=1.1)
