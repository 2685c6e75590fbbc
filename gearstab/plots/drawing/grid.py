"""A rectangular grid of values as an image or a mesh, whichever is faster and stays exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis as MatplotlibAxis
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, Normalize
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, ScalarFormatter
from matplotlib.transforms import blended_transform_factory

from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing.style import FAILED, LINE
from gearstab.plots.drawing.text import fitted, plain
from gearstab.plots.view import MapView
from gearstab.results.display import SPEEDS

Array = np.ndarray


def draw_cells(
    ax: Axes, x: FigureAxis, y: FigureAxis, values: Array, cmap: Colormap, norm: Normalize
) -> ScalarMappable:
    """Colour the cells of a grid; masked ones stay as they are.

    values: masked ``(y.size, x.size)`` over ascending axes. Even spacing gives an image (whose array repeats cells if
    the frame is finer than the grid in one direction and coarser in the other), uneven spacing a rasterised mesh.
    """
    columns, rows = x.edges(), y.edges()
    if not (x.uniform and y.uniform):
        return ax.pcolormesh(columns, rows, values, cmap=cmap, norm=norm, rasterized=True, zorder=1)
    box = ax.get_window_extent()
    image, smooth = resolved(values, box.width, box.height)
    return ax.imshow(
        image, cmap=cmap, norm=norm, origin="lower", aspect="auto", extent=(*columns[[0, -1]], *rows[[0, -1]]),
        interpolation="antialiased" if smooth else "nearest", interpolation_stage="rgba", zorder=1,
    )  # fmt: skip


def resolved(values: Array, width: float, height: float) -> tuple[Array, bool]:
    """The cells for a frame of the given pixels, and whether their colours are to be averaged.

    Where a pixel holds several cells their colours are averaged, so that thin tongues fade instead of breaking up. The
    filter would also blur cells wider than a pixel in the other direction; repeating them keeps their edges sharp.
    """
    down, across = width < values.shape[1], height < values.shape[0]
    if down and not across:
        values = np.ma.repeat(values, ceil(height / values.shape[0]), axis=0)
    elif across and not down:
        values = np.ma.repeat(values, ceil(width / values.shape[1]), axis=1)
    return values, down or across


def draw_failed(ax: Axes, x: FigureAxis, y: FigureAxis, failed: Array) -> PolyCollection | None:
    """Hatch the cells without a value in grey; None if there are none."""
    if not failed.any():
        return None
    patches = runs(x, y, failed)
    patches.set(
        facecolor=FAILED, edgecolor="#707070", linewidth=0, hatch="/" * 6, zorder=1.5, rasterized=True
    )  # fmt: skip
    ax.add_collection(patches, autolim=False)
    return patches


def runs(x: FigureAxis, y: FigureAxis, cells: Array) -> PolyCollection:
    """Return one polygon for each run of chosen cells along x; ``cells``: ``(y.size, x.size)`` over ascending axes."""
    columns, rows = x.edges(), y.edges()
    padded = np.zeros((cells.shape[0], cells.shape[1] + 2), dtype=np.int8)
    padded[:, 1:-1] = cells
    change = np.diff(padded, axis=1)
    (row, start), (_, stop) = np.nonzero(change == 1), np.nonzero(change == -1)
    left, right, bottom, top = columns[start], columns[stop], rows[row], rows[row + 1]
    corners = np.stack([left, bottom, right, bottom, right, top, left, top], axis=-1).reshape(-1, 4, 2)
    return PolyCollection(list(corners))


def frame(ax: Axes, x: FigureAxis, y: FigureAxis) -> None:
    """Limits, scales, ticks and labels of both axes.

    The limits are the first and the last number; on an axis of labels or of one value they are the cells' edges.
    """
    (left, right), (bottom, top) = limits(x), limits(y)
    ax.set_xscale("log" if x.logarithmic else "linear")
    ax.set_yscale("log" if y.logarithmic else "linear")
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    box = ax.get_window_extent()
    for axis, side, length in ((x, ax.xaxis, box.width), (y, ax.yaxis, box.height)):
        side.set_label_text(fitted(axis.label, 1.1 * length / ax.figure.dpi, 8.5), linespacing=0.95)
        number(side, axis)
        draw_ranges(ax, axis, side is ax.xaxis)
        if not axis.numeric or axis.size == 1:
            side.set_ticks(axis.positions, [axis.text(i) for i in range(axis.size)])
            side.set_tick_params(which="minor", length=0)


def draw_ranges(ax: Axes, axis: FigureAxis, on_x: bool, at: float = 0.03) -> list[Any]:
    """Mark the operating ranges along an axis whose limits are set: what lies outside is veiled. Nothing without them,
    or where the frame lies within one.

    at: where the words stand across the axis, a part of the frame.
    """
    low, high = ax.get_xlim() if on_x else ax.get_ylim()
    inside = sorted((max(a, low), min(b, high)) for a, b in axis.ranges if a < high and b > low)
    if not axis.ranges.size or inside[:1] == [(low, high)]:
        return []
    span, line = (ax.axvspan, ax.axvline) if on_x else (ax.axhspan, ax.axhline)
    drawn: list[Any] = []
    end = low
    for a, b in [*inside, (high, high)]:
        if a > end:
            drawn.append(span(end, a, facecolor="white", alpha=0.6, linewidth=0, zorder=2.45))
        end = max(end, b)
    for place in {place for pair in inside for place in pair} - {low, high}:
        drawn.append(line(place, color=LINE, linewidth=0.7, linestyle=(0, (6, 2)), zorder=3))
    for a, b in inside:
        middle, near = 0.5 * (a + b), at < 0.5
        across = blended_transform_factory(*((ax.transData, ax.transAxes) if on_x else (ax.transAxes, ax.transData)))
        drawn.append(ax.text(
            middle if on_x else at, at if on_x else middle, "operating range", transform=across, fontsize=6.5, zorder=5,
            rotation=0 if on_x else 90, ha="center" if on_x else "left" if near else "right",
            va="center" if not on_x else "bottom" if near else "top",
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        ))  # fmt: skip
    return drawn


def number(side: MatplotlibAxis, axis: FigureAxis) -> None:
    """Numbers as one writes them: decades of a logarithmic axis, speeds without a power of ten."""
    if axis.logarithmic:
        number_decades(side)
    elif axis.name in SPEEDS and isinstance(formatter := side.get_major_formatter(), ScalarFormatter):
        formatter.set_powerlimits((-3, 6))


def number_decades(side: MatplotlibAxis) -> None:
    """Plain numbers at 1, 2 and 5 of every decade of a logarithmic axis that spans few, powers of ten else."""
    low, high = side.get_view_interval()
    if high / low < 2e3:
        side.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        side.set_major_formatter(FuncFormatter(lambda value, _: decade_text(value)))
    side.set_minor_formatter(NullFormatter())


def decade_text(value: float) -> str:
    """``200``, or ``$2\\times 10^{-6}$`` where digits alone would be many."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    digit, power = f"{value:.0e}".split("e")
    return f"${'' if digit == '1' else digit + chr(92) + 'times'}10^{{{int(power)}}}$"


def limits(axis: FigureAxis) -> tuple[float, float]:
    """Where the frame of a map begins and ends along an axis: nothing was computed beyond the first and last number."""
    ends = axis.edges() if axis.size == 1 or not axis.numeric else axis.ascending
    return float(ends[0]), float(ends[-1])


def draw_points(ax: Axes, points: Mapping[str, tuple[float, float]]) -> list[Any]:
    """Mark points by a cross and their names."""
    drawn: list[Any] = []
    for name, place in points.items():
        halo = [withStroke(linewidth=2.0, foreground="white")]
        drawn += ax.plot(*place, "+", color=LINE, markersize=6, markeredgewidth=1.0, path_effects=halo, zorder=5)
        drawn.append(ax.annotate(
            plain(name), place, (4, 3), textcoords="offset points", fontsize=8, path_effects=halo, zorder=5
        ))  # fmt: skip
    return drawn


MOST_CELLS = 1000
"""Along each axis of a reduced map."""
LARGE = 4_000_000
"""Points from which a map is reduced; the colours of fewer are averaged where several share a pixel."""
TILE = 1 << 20
"""Points that are read together of a variable without chunks."""
BESIDE = ("growth_rate", "stable", "status", "notices", "dynamic_load_factor")
"""Variables over the points of a map that maps of others need."""

BADNESS = np.array([1, 2, 0], dtype=np.int8)
"""Codes of failed, unstable and stable points (-1, 0, 1): a cell shows the worst."""


@dataclass(frozen=True)
class Cells:
    """One axis of a map, reduced.

    axis: the reduced one, ascending. of ``(size,)``: the cell of every point in the order of the result. middle: the
    index of the point nearest to the middle of each cell.
    """

    axis: FigureAxis
    of: Array
    middle: Array


def coarse(tree: xr.DataTree, view: MapView, variable: str, large: int = LARGE) -> tuple[xr.DataTree, MapView]:
    """Return a tree, and the view of it, with no more points than a picture shows; small ones as they are.

    variable: that is drawn. Of the others over the points of the map only those that go with it are kept.
    """
    if view.x.size * view.y.size <= large:
        return tree, view
    cells = {axis.name: gathered(axis) for axis in (view.x, view.y)}
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    reduced = {path: _reduced(data, view, cells, {variable, *BESIDE}) for path, data in groups.items()}
    found = type(tree).from_dict(reduced, name=tree.name)
    return found, replace(view, x=cells[view.x.name].axis, y=cells[view.y.name].axis)


def gathered(axis: FigureAxis) -> Cells:
    """Divide an axis into cells of equal numbers of points, those at the ends of half as many.

    So evenly spaced cells have their middles where evenly spaced points have them, the first and the last value kept.
    """
    count = min(axis.size, MOST_CELLS) if axis.numeric else axis.size
    scale = (count - 1) / max(axis.size - 1, 1)
    of = np.empty(axis.size, dtype=np.intp)
    of[axis.order] = np.rint(np.arange(axis.size) * scale).astype(np.intp)
    middle = axis.order[np.rint(np.arange(count) / (scale or 1.0)).astype(np.intp)]
    values, low, high = axis.values[middle], axis.ascending[0], axis.ascending[-1]
    if count < axis.size and axis.uniform:
        values = np.linspace(low, high, count)
    elif count < axis.size and axis.logarithmic:
        values = np.geomspace(low, high, count)
    return Cells(replace(axis, values=values), of, middle)


def _reduced(data: xr.Dataset, view: MapView, cells: Mapping[str, Cells], wanted: set[str]) -> xr.Dataset:
    """A group over the cells of both axes."""
    variables = {}
    for name, item in data.data_vars.items():
        if not set(cells) <= set(map(str, item.dims)):
            variables[name] = item.isel({dim: cells[str(dim)].middle for dim in item.dims if dim in cells}).variable
        elif name in wanted:
            part = item.isel({dim: index for dim, index in view.fixed.items() if dim in item.dims}, drop=True)
            if part.ndim == 2:
                variables[name] = _worst(part, cells, _tile(item), str(name))
    coords = {}
    for name, item in data.coords.items():
        coords[name] = item.isel({dim: cells[str(dim)].middle for dim in item.dims if dim in cells}).variable
        if name in cells:
            coords[name] = xr.Variable(item.dims, cells[str(name)].axis.values, item.attrs)
    return xr.Dataset(variables, coords, data.attrs)


def _tile(data: xr.DataArray) -> dict[str, int]:
    """Sizes of the pieces that are read together: those in which the values are stored."""
    chunks = data.encoding.get("chunksizes")
    if chunks:
        return dict(zip(map(str, data.dims), chunks, strict=True))
    tile, left = {}, TILE
    for dim in reversed(data.dims):
        tile[str(dim)] = max(1, min(data.sizes[dim], left))
        left //= tile[str(dim)]
    return tile


def _worst(data: xr.DataArray, cells: Mapping[str, Cells], tile: Mapping[str, int], name: str) -> xr.Variable:
    """The worst value of each cell of a variable over both axes."""
    places = [cells[str(dim)] for dim in data.dims]
    shape = tuple(place.axis.size for place in places)
    flags = name in ("status", "notices")
    together = np.bitwise_or if flags else np.fmax if data.dtype.kind == "f" else np.maximum
    least = 0 if flags else np.nan if data.dtype.kind == "f" else np.iinfo(data.dtype).min
    found = np.full(shape, least, dtype=data.dtype)
    starts = product(*(range(0, data.sizes[dim], tile[str(dim)]) for dim in data.dims))
    for start in starts:
        span = [slice(first, first + tile[str(dim)]) for first, dim in zip(start, data.dims, strict=True)]
        values = data.isel(dict(zip(data.dims, span, strict=True))).values
        values = BADNESS[values + 1] if name == "stable" else values
        held = []
        for axis, (place, part) in enumerate(zip(places, span, strict=True)):
            own, values = _grouped(place.of[part], values, axis, together)
            held.append(own)
        there = np.ix_(*held)
        found[there] = together(found[there], values)
    if name == "stable":
        found = (np.argsort(BADNESS) - 1).astype(data.dtype)[found]
    return xr.Variable(data.dims, found, data.attrs)


def _grouped(of: Array, values: Array, axis: int, together: np.ufunc) -> tuple[Array, Array]:
    """The cells that points lie in, and what their values along an axis make together."""
    if np.any(np.diff(of) < 0):
        order = np.argsort(of, kind="stable")
        of, values = of[order], values.take(order, axis=axis)
    first = np.flatnonzero(np.diff(of, prepend=-1))
    if len(first) == len(of):
        return of, values
    return of[first], together.reduceat(values, first, axis=axis)
