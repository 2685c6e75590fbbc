"""Orders of mesh frequencies in a Campbell diagram, and their numbers, clear of all else that is drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from gearstab.plots.drawing.style import CASES

Array = np.ndarray

SIZE = 6.5
"""Points of a number."""
HALO = [withStroke(linewidth=2.0, foreground="white")]
ACROSS = 257
"""Points of a line at which it is looked for others."""
CROWD = 1000
"""How many points of lines a number, or a mark, counts that would be under another number."""
CLEAR = 0.5
"""Points around a number that are kept clear."""


def order_colour(number: int, count: int) -> str:
    """The colour of the orders of a mesh frequency: blue where there is one alone, never that of the natural ones."""
    return CASES[2] if count == 1 else (CASES[2], CASES[3], CASES[4], CASES[5])[number % 4]


def draw_order(ax: Axes, slope: float, level: float, half: int, colour: str, mesh: str) -> Line2D | None:
    """Draw frequencies slope x + level, of half the harmonics ``half``; None where they lie above the frame.

    Its label is its number, with the mesh behind it.
    """
    x = np.linspace(*ax.get_xlim(), 2)
    y = slope * x + level
    if y.min() > ax.get_ylim()[1]:
        return None
    look = "-" if half % 2 == 0 else (0, (4, 2))
    (line,) = ax.plot(x, y, color=colour, linestyle=look, linewidth=0.6, alpha=0.85, zorder=1.5)
    line.set_label(f"{0.5 * half:g}$\\times${mesh}")
    return line


def number_orders(
    ax: Axes, orders: Sequence[Line2D], curves: Sequence[Line2D], marks: Sequence[PathCollection]
) -> None:
    """Write on every line its number, as far to the right as nothing else lies there; the frame must have settled.

    Where something lies everywhere it is where least does. A line too low or too short for its number has none.
    curves, marks: what else is drawn.
    """
    frame = ax.get_window_extent()
    columns = np.linspace(frame.x0, frame.x1, ACROSS)
    heights = [_heights(line, columns) for line in [*orders, *curves]]
    points = [ax.transData.transform(np.asarray(mark.get_offsets())) for mark in marks]
    crowd = np.concatenate(points) if points else np.zeros((0, 2))
    for k, order in enumerate(orders):
        text = ax.text(
            0.0, 0.0, str(order.get_label()), ha="center", va="center", fontsize=SIZE, color=order.get_color()
        )
        text.set(path_effects=HALO, zorder=4)
        box = text.get_window_extent()
        half = 0.5 * np.array([box.width, box.height]) + CLEAR * ax.figure.dpi / 72
        middle = np.column_stack([columns, heights[k]])
        inside = np.all((middle - half >= frame.min) & (middle + half <= frame.max), axis=1)
        if not inside.any():
            text.remove()
            continue
        cost = CROWD * np.sum(np.all(np.abs(middle[:, None] - crowd) < half, axis=-1), axis=-1)
        near = np.abs(columns[:, None] - columns) < half[0]
        for j, height in enumerate(heights):
            if j != k:
                with np.errstate(invalid="ignore"):
                    cost += np.sum(near & (np.abs(middle[:, None, 1] - height) < half[1]), axis=1)
        cost = np.where(inside, cost, np.iinfo(int).max)
        best = ACROSS - 1 - int(np.argmin(cost[::-1]))
        x, y = ax.transData.inverted().transform(middle[best])
        text.set_position((float(x), float(y)))
        crowd = np.concatenate([crowd, _corners(middle[best], half)])


def _heights(line: Line2D, columns: Array) -> Array:
    """The line in pixels over columns of pixels, NaN where there is none."""
    x, y = line.get_transform().transform(line.get_xydata()).T
    return np.asarray(np.interp(columns, x, y, left=np.nan, right=np.nan))


def _corners(middle: Array, half: Array) -> Array:
    """Nine points of a box, so that one of its own size that meets it holds one of them."""
    ways = np.array([-1.0, 0.0, 1.0])
    return np.asarray(middle + half * np.stack(np.meshgrid(ways, ways), axis=-1).reshape(-1, 2))
