"""Maps over two axes: stability with boundaries and names of the tongues, small multiples over a third axis.

Further maps have contour lines: the damping that suppresses instability, and the probability of instability.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gearstab.errors import PlotError
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import (
    GROWTH,
    LIGHT,
    LINE,
    PROVED,
    UNSTABLE,
    label_columns,
    new_frame,
    new_panels,
    write_legend,
    write_title,
)
from gearstab.plots.drawing.text import axis_label, fitted, number_text, plain
from gearstab.plots.kinds import (
    GROWTH_RATE,
    LOAD_FACTOR,
    REQUIRED,
    Contents,
    Kind,
    colour_label,
    default_variable,
    find_variable,
)
from gearstab.plots.kinds import PROBABILITY as NAME
from gearstab.plots.maps import overlays
from gearstab.plots.view import MOST_PANELS, TALL, MapView, Request, arrangement, caption, some, two_axes_only, view_of

Array = np.ndarray
Artists = dict[str, Any]

STABLE = "stable"
"""Flags: 1, 0, and -1 for points without a value."""
WIDE = 30
"""Values that differ by more than this factor are coloured by their logarithms."""
MOST = 1000
"""Larger ones, beside a single point of resonance, share the last colour."""


def read_cells(tree: xr.DataTree, view: MapView, variable: str) -> tuple[Array, Array]:
    """(values, failed), both ``(y.size, x.size)``.

    Masked are the values of stable points in a map of growth rates, and of unstable ones in one of steady states.
    """
    dataset, data = find_variable(tree, variable)
    dims = view.y.name, view.x.name
    values = view.cut(data, *dims).astype(float)
    failed = ~np.isfinite(values) if data.dims == dataset.get("status", data).dims else np.zeros(values.shape, bool)
    if LOAD_FACTOR in dataset.data_vars and variable != "status":
        # Of all meshes at once, which may be an axis of the map.
        repels = view.cut(xr.broadcast(dataset["status"], data)[0], *dims).astype(int) & 1 != 0
        return np.ma.masked_where(repels | ~np.isfinite(values), values), ~np.isfinite(values) & ~repels
    if variable == STABLE:
        return np.ma.masked_less(values, 0), values < 0
    if variable != GROWTH_RATE:
        return np.ma.masked_invalid(values), failed
    stable = values <= 0
    if "stable" in dataset.data_vars:
        flag = view.cut(dataset["stable"], *dims)
        stable, failed = flag == 1, failed | (flag < 0)
    return np.ma.masked_where(stable | failed, values), failed


def colours(values: Array, variable: str) -> tuple[Colormap, Normalize]:
    """The colour map of a variable and its range over all ``values`` shown; growth rates start at zero."""
    if variable == STABLE:
        return ListedColormap([UNSTABLE, PROVED]), BoundaryNorm([-0.5, 0.5, 1.5], 2)
    shown = np.ma.compressed(values) if isinstance(values, np.ma.MaskedArray) else values[np.isfinite(values)]
    low, high = (float(shown.min()), float(shown.max())) if shown.size else (0.0, 0.0)
    if variable == GROWTH_RATE:
        low = 0.0
    elif low > 0 and high > WIDE * low:
        return GROWTH, LogNorm(low, min(high, MOST * low))
    return GROWTH, Normalize(low, high if high > low else low + 1.0)


def draw_map(
    tree: xr.DataTree, ax: Axes, view: MapView, variable: str = GROWTH_RATE, norm: Normalize | None = None
) -> Artists:
    """Draw one map into a frame.

    Returns the artists, None where there is no such thing: ``cells`` (values of unstable points; stable ones masked),
    ``failed`` (hatched) and the ``reason``, ``note`` (if all is stable), ``neutral`` (the line growth_rate = 0 of a
    damped system without exact boundaries), ``perturbation``, ``boundaries`` and ``thin`` (lines, see
    ``tongues.draw_theories``), ``doubtful`` (hatchings by their words, see :mod:`gearstab.plots.maps.overlays`),
    ``proved`` (a tint of what is proved stable).
    """
    values, failed = read_cells(tree, view, variable)
    cmap, own = colours(values, variable)
    artists: Artists = {
        "cells": grid.draw_cells(ax, view.x, view.y, values, cmap, norm or own),
        "failed": grid.draw_failed(ax, view.x, view.y, failed),
        "reason": overlays.reason(find_variable(tree, variable)[0], view, failed),
        "neutral": None,
        "note": None,
    }
    if variable == GROWTH_RATE and np.ma.getmaskarray(values).all() and not failed.any():
        artists["note"] = ax.text(
            0.5, 0.5, "stable at every point", transform=ax.transAxes, ha="center", color="#6e6e6e"
        )
    dataset = find_variable(tree, variable)[0]
    artists["doubtful"] = overlays.hatch(ax, view, overlays.doubtful(tree, dataset, view, view.y.name, view.x.name))
    grid.frame(ax, view.x, view.y)
    overlaid = variable in (GROWTH_RATE, STABLE) or "mesh" in find_variable(tree, variable)[1].dims
    artists |= tongues.draw_theories(tree, ax, view, ("boundaries", "perturbation") if overlaid else ())
    # Between the cells this contour is a guess, which exact boundaries leave no room for.
    if variable == GROWTH_RATE and artists["boundaries"] is None:
        artists["neutral"] = draw_neutral(tree, ax, view)
    stable = np.ma.getmaskarray(values) & ~failed
    return artists | {"proved": overlays.draw_over(tree, ax, view, stable) if overlaid else None}


def draw_neutral(tree: xr.DataTree, ax: Axes, view: MapView) -> object | None:
    """The contour growth_rate = 0 where damping makes stable points decay; None without such points.

    There is none across an axis of labels, between which nothing lies.
    """
    if not (view.x.numeric and view.y.numeric):
        return None
    data = find_variable(tree, GROWTH_RATE)[1]
    values = view.cut(data, view.y.name, view.x.name).astype(float)
    finite = values[np.isfinite(values)]
    # Rounding leaves +-1e-10 on an undamped system's zero: a millionth of the range is far above and draws nothing new.
    decays = finite.size and finite.min() < -1e-6 * np.abs(finite).max() and finite.max() > 0
    if not decays or min(values.shape) < 2:
        return None
    x, y = view.x.ascending, view.y.ascending
    return ax.contour(x, y, np.ma.masked_invalid(values), levels=[0.0], colors=LINE, linewidths=0.5, zorder=2)


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_map`, ``names`` and ``colour_bar``.

    Raises PlotError if an axis is left over, naming it and its values.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        artists = draw_map(tree, ax, view, variable)
        white = ", white where unstable" if LOAD_FACTOR in dataset and artists["cells"].get_array().mask.any() else ""
        return artists, colour_label(tree, variable) + white

    return whole_map(tree, request, dataset, data, painted, ", or --kind slices")


def colour_bar(figure: Figure, artists: Artists, axes: list[Axes], label: str, **place: Any) -> Colorbar:
    """Draw the bar of colours beside maps, of two colours with their words for stable and unstable points."""
    bar = figure.colorbar(artists["cells"], ax=axes, **place)
    if isinstance(artists["cells"].norm, BoundaryNorm):
        bar.set_ticks([0, 1], labels=["unstable", "stable"])
        bar.ax.tick_params(which="both", length=0)
    else:
        bar.set_label(label)
    bar.outline.set_linewidth(0.5)
    return bar


def whole_map(
    tree: xr.DataTree,
    request: Request,
    dataset: xr.Dataset,
    data: xr.DataArray,
    paint: Callable[[xr.DataTree, Axes, MapView], tuple[Artists, str]],
    otherwise: str = "",
) -> tuple[Figure, Artists]:
    """Draw a figure of one map, its colour bar and the names of the tongues.

    paint: draws a result, reduced if large, into a frame; gives the artists and what stands beside the colour bar.
    otherwise: another way to draw what has more than two axes.
    """
    view = view_of(tree, map(str, data.dims), request, dataset)
    two_axes_only(view, otherwise)
    tree, view = grid.coarse(tree, view, str(data.name))
    figure, ax = new_frame(request, (0.78, 0.52))
    artists, label = paint(tree, ax, view)
    artists["marks"] = grid.draw_points(ax, request.marks)
    bar = colour_bar(figure, artists, [ax], fitted(label, 1.8, 8.5), pad=0.02, aspect=28)
    if artists.get("contours") is not None:
        bar.add_lines(artists["contours"])
    artists["colour_bar"] = bar
    tint, doubtful = artists.get("proved"), artists.get("doubtful", {})
    handles = [
        *artists.get("entries", []),
        *tongues.legend_of(tree, artists),
        *overlays.legend_of_proved(tint),
        *overlays.legend_of_map(doubtful),
        *overlays.legend_of_failed(artists),
    ]
    write_legend(figure, handles, ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    artists["names"] = names.name_view(tree, ax, view)
    names.freeze(figure, request)
    return figure, artists


KIND = Kind(
    "map", "growth rate over two axes with boundaries and names of the tongues", draw, lambda c: c.dimensions == 2
)


def draw_panel(tree: xr.DataTree, ax: Axes, view: MapView, variable: str, norm: Any, text: str) -> Artists:
    """One map with its caption above (the names of the tongues stand between)."""
    artists = draw_map(tree, ax, view, variable, norm)
    artists["caption"] = ax.set_title(text, loc="left", pad=18)
    ax.label_outer()
    ax.set(xlabel="", ylabel="")
    return artists


def draw_slices(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``panels`` and ``colour_bar``.

    A panel is a mapping of artists, see ``draw_map``, with ``caption`` and ``names``. All panels share
    axes and colours. Raises PlotError if there would be more than ``MOST_PANELS``.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)
    view = view_of(tree, map(str, data.dims), request, dataset)
    chosen, note = some(view.free, MOST_PANELS, "panels", request.partial)
    shown = [grid.coarse(tree, view.at(**panel), variable) for panel in chosen]
    views = [item for _, item in shown]
    wide = request.wide("double")
    rows, columns = arrangement(chosen, wide)
    each = 0.88 if wide else 0.62
    aspect = min(1.25 if wide else TALL, 0.12 + each * rows / columns)
    figure, frames = new_panels(request, aspect, len(views), columns, "double", sharex=True, sharey=True)
    values = np.ma.stack([read_cells(*item, variable)[0] for item in shown])
    norm = colours(values, variable)[1]
    panels = []
    for number, (ax, (part, item), panel) in enumerate(zip(frames, shown, chosen, strict=True)):
        text = f"({chr(97 + number)})  {caption(view.free, panel)}" if len(views) > 1 else caption(view.free, panel)
        panels.append(draw_panel(part, ax, item, variable, norm, text))
    label_columns(figure, frames, columns, view.x.label)
    label = fitted(colour_label(tree, variable), 1.8 * rows, 8.5)
    bar = colour_bar(figure, panels[0], frames, label, pad=0.015, aspect=18 * rows)
    doubtful = {words: patches for panel in panels for words, patches in panel["doubtful"].items()}
    tint = next((panel["proved"] for panel in panels if panel["proved"] is not None), None)
    handles = [*tongues.legend_of(tree, panels[0]), *overlays.legend_of_proved(tint), *overlays.legend_of_map(doubtful)]
    handles += overlays.legend_of_failed(next((panel for panel in panels if panel["failed"] is not None), panels[0]))
    write_legend(figure, handles)
    figure.supylabel(view.y.label, fontsize=8.5)
    write_title(figure, tree, request, view)
    names.settle(figure)
    for ax, (part, item), artists in zip(frames, shown, panels, strict=True):
        artists["names"] = names.name_view(part, ax, item, rows=1)
    names.freeze(figure, request)
    return figure, {"panels": panels, "colour_bar": bar, "left_out": note}


SLICES = Kind(
    "slices",
    "maps over a third axis, one panel per value",
    draw_slices,
    lambda c: c.dimensions is not None and c.dimensions > 2,
)


TOLERANCE = "tolerance"
"""The group of probabilities."""
DAMPING_LEVELS = 8
"""Contour lines of required damping, about."""
LEVELS = (0.01, 0.1, 0.5, 0.9)
"""Probabilities at which lines are drawn without --level."""
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1, 1.5)))


def draw_contours(
    ax: Axes, view: MapView, data: xr.DataArray, levels: Sequence[float], top: float, nothing: tuple[str, str]
) -> Artists:
    """Draw one map into a frame: ``cells`` (white where the value is zero), ``failed`` (hatched), ``contours`` (None
    where the grid is a line, has an axis of labels or crosses no level) and ``note`` (where no value is above zero).

    levels: of the lines, light on the dark half of the colours; top: the value of the last colour. nothing: the note,
    and the one where some points have no value.
    """
    values = view.cut(data, view.y.name, view.x.name).astype(float)
    failed = ~np.isfinite(values)
    shown = np.ma.masked_where(failed | (values <= 0), values)
    artists: Artists = {
        "cells": grid.draw_cells(ax, view.x, view.y, shown, GROWTH, Normalize(0.0, top)),
        "failed": grid.draw_failed(ax, view.x, view.y, failed),
        "contours": None,
        "note": None,
    }
    crossed = [level for level in levels if (values < level).any() and (values > level).any()]
    if not shown.count():
        words = nothing[int(failed.any())]
        artists["note"] = ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", color="#6e6e6e")
    elif crossed and min(values.shape) > 1 and view.x.numeric and view.y.numeric:
        x, y = view.x.ascending, view.y.ascending
        colours = [LINE if level < 0.5 * top else LIGHT for level in crossed]
        line: Artists = {"levels": crossed, "colors": colours, "linewidths": 0.5, "zorder": 2}
        artists["contours"] = ax.contour(x, y, np.ma.masked_invalid(values), **line)
    grid.frame(ax, view.x, view.y)
    return artists


def draw_damping(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_contours`, ``names`` and ``colour_bar``.

    Raises PlotError without required damping, and if an axis is left over.
    """
    if REQUIRED not in tree.children:
        raise PlotError("this result holds no required damping (methods.required_damping was not run)")
    dataset = tree[REQUIRED].to_dataset()
    what = "damping factor" if dataset.attrs.get("of") == "factor" else "damping ratio"
    nothing = "no damping is required", "no damping in the range is enough"

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        data = tree[REQUIRED].to_dataset()[REQUIRED]
        values = view.cut(data, view.y.name, view.x.name)
        top = float(np.max(values[np.isfinite(values)], initial=0.0)) or 1.0
        ticks = MaxNLocator(DAMPING_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, top)
        artists = draw_contours(ax, view, data, [float(v) for v in ticks if 0 < v < top], top, nothing)
        return artists | {"reason": "none found"}, axis_label(REQUIRED, f"required {what}", "1")

    return whole_map(tree, request, dataset, dataset[REQUIRED], painted)


def draw_probability(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_contours`, the ``entries`` of lines in the legend,
    ``names`` and ``colour_bar``.

    Raises PlotError without probabilities, and if an axis is left over.
    """
    if TOLERANCE not in tree.children:
        raise PlotError("this result holds no probabilities (methods.tolerance was not run)")
    dataset = tree[TOLERANCE].to_dataset()
    levels = tuple(sorted(request.levels)) or LEVELS

    def painted(tree: xr.DataTree, ax: Axes, view: MapView) -> tuple[Artists, str]:
        data = tree[TOLERANCE].to_dataset()[NAME]
        artists = draw_contours(ax, view, data, levels, 1.0, ("no sample is unstable", ""))
        entries = []
        if (drawn := artists["contours"]) is not None:
            dashes = [DASHES[levels.index(level) % len(DASHES)] for level in drawn.levels]
            drawn.set_linestyle(dashes)
            entries = [
                Line2D([], [], color=LINE, linewidth=0.6, linestyle=dash, label=plain(f"{number_text(100 * level)} %"))
                for level, dash in zip(drawn.levels, dashes, strict=True)
            ]
        return artists | {"entries": entries}, "probability of instability"

    return whole_map(tree, request, dataset, dataset[NAME], painted)


def _alone(contents: Contents, group: str) -> bool:
    """Return whether a group over two axes is what a sweep holds, without growth rates and responses."""
    other = contents.growth or contents.holds("response") or not contents.holds(group)
    return contents.by_itself and not other and len(contents.own(group)) == 2


REQUIRED_DAMPING = Kind(
    "required-damping", "damping that suppresses instability, over two axes", draw_damping,
    lambda contents: _alone(contents, REQUIRED),
)  # fmt: skip
PROBABILITY = Kind(
    "probability", "probability of instability over two axes, with lines of given probability", draw_probability,
    lambda contents: _alone(contents, TOLERANCE),
)  # fmt: skip
