"""A rectangular grid of values as an image or a mesh, whichever is faster and stays exact."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

import numpy as np
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
