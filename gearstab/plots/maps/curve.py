"""A variable over one axis, for results with one axis (or one left): growth rate over mesh frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import CASES, DASHES, SHADE, new_frame, write_legend, write_title
from gearstab.plots.drawing.text import fitted
from gearstab.plots.kinds import GROWTH_RATE, Kind, colour_label, default_variable, find_variable
from gearstab.plots.maps import overlays
from gearstab.plots.view import Index, Request, View, caption, some, view_along
from gearstab.results.display import SPEEDS

Array = np.ndarray
Artists = dict[str, Any]


def draw_curve(ax: Axes, data: xr.DataArray, view: View, number: int, label: str) -> Line2D:
    """One line over x; gaps where there is no value."""
    (line,) = ax.plot(
        view.x.ascending, view.cut(data, view.x.name), color=CASES[number], linestyle=DASHES[number],
        label=label, marker="o" if view.x.size == 1 else "", markersize=2.5,
    )  # fmt: skip
    return line


def peak(values: Array) -> float:
    """The largest magnitude; NaN where there is none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else float("nan")


def draw_bands(tree: xr.DataTree, ax: Axes, view: View) -> tuple[tongues.DrawnTongues | None, object | None]:
    """Shade the unstable mesh frequencies, between exact boundaries or else as perturbation theory predicts them.

    Returns the tongues and the bands.
    """
    groups = ("boundaries", "perturbation") if view.x.name in SPEEDS else ()
    known = (tongues.read_tongues(tree, group, view, None) for group in groups)
    lines = next((found for found in known if found is not None), None)
    if lines is None:
        return None, None
    edges = lines.open_ranges()
    if not len(edges):
        return lines, None
    return lines, ax.broken_barh(
        list(zip(edges[:, 0], edges[:, 1] - edges[:, 0], strict=True)), (0, 1), transform=ax.get_xaxis_transform(),
        facecolors=SHADE, linewidth=0, zorder=0.5,
    )  # fmt: skip


def legend_of_bands(tree: xr.DataTree, bands: object | None) -> list[Patch]:
    """Return the handle of the bands of unstable speeds; none without them."""
    if bands is None:
        return []
    exact = "boundaries" in tree.children
    words = "unstable" if exact else f"unstable, {tongues.LOOKS[tongues.theory(tree, 'perturbation')][1]}"
    return [Patch(facecolor=SHADE, label=words)]


def chosen_curves(view: View, data: xr.DataArray, request: Request) -> tuple[list[Index], str]:
    """Return the meaning of each curve over x; of too many those with the largest values, and a sentence that says
    so.
    """
    return some(view.free, len(CASES), "curves", request.partial, lambda c: peak(view.at(**c).cut(data, view.x.name)))


def draw_doubts(
    tree: xr.DataTree, ax: Axes, dataset: xr.Dataset, view: View, cases: list[Index], lines: list[Line2D]
) -> list[str]:
    """Draw halos behind what is in doubt of each case's line; what the legend is to say of them."""
    words = []
    for line, case in zip(lines, cases, strict=True):
        words += overlays.halo(ax, line, overlays.doubtful(tree, dataset, view.at(**case), view.x.name))
    return words


def dress(ax: Axes, x: FigureAxis, label: str) -> None:
    """Scale and labels of a figure of curves over ``x``; ``label``: what they are."""
    ax.set_xscale("log" if x.logarithmic else "linear")
    grid.number(ax.xaxis, x)
    grid.draw_ranges(ax, x, True, 0.97)
    ax.set_xlabel(x.label)
    ax.set_ylabel(fitted(label, 1.8, 8.5), linespacing=0.95)


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``lines``, and for one case over the mesh frequency ``bands`` and ``names`` of the tongues,
    and ``proved``, what is proved stable.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)
    view = view_along(tree, map(str, data.dims), request, dataset)
    cases, note = chosen_curves(view, data, request)
    figure, ax = new_frame(request, (0.72, 0.5))
    lines = [draw_curve(ax, data, view.at(**c), k, caption(view.free, c)) for k, c in enumerate(cases)]
    doubted = draw_doubts(tree, ax, dataset, view, cases, lines)
    low, high = grid.limits(view.x) if view.x.size == 1 else view.x.ascending[[0, -1]]
    ax.set_xlim(low, high)
    dress(ax, view.x, colour_label(tree, variable))
    if variable == GROWTH_RATE:
        ax.axhline(0.0, color="#8a8a8a", linewidth=0.4, zorder=0.8)
    found, bands = draw_bands(tree, ax, view) if len(cases) == 1 else (None, None)
    tint = overlays.draw_proved(tree, ax, view, None) if len(cases) == 1 else None
    handles = [
        *(lines if len(cases) > 1 else []),
        *legend_of_bands(tree, bands),
        *overlays.legend_of_proved(tint),
        *overlays.legend_of_curves(doubted),
    ]
    write_legend(figure, handles, ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    named = names.name_tongues(ax, found, True) if found is not None else None
    names.freeze(figure, request)
    return figure, {"lines": lines, "bands": bands, "proved": tint, "names": named, "left_out": note}


KIND = Kind("curve", "growth rate over one axis", draw, lambda c: c.dimensions is not None and c.dimensions < 2)
