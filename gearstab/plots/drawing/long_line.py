"""Lines of many samples: without gaps, and as pixels inside of files of vectors."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

PIECE = 5000
"""Samples drawn at once. Matplotlib splits longer lines itself and drops two segments wherever it does."""
MOST_VECTORS = 20_000
"""Lines of more samples are stored as pixels inside of a PDF or SVG file: as lines they would take megabytes."""


def draw_long_line(
    ax: Axes, x: np.ndarray, y: np.ndarray, colour: str, linewidth: float = 0.6
) -> Line2D | LineCollection:
    """Draw y over x, both of shape (samples,), as one line whatever its length."""
    if x.size <= PIECE:
        return ax.plot(x, y, color=colour, linewidth=linewidth)[0]
    points = np.column_stack([x, y])
    pieces = [points[k : k + PIECE + 1] for k in range(0, x.size - 1, PIECE)]
    line = LineCollection(pieces, colors=colour, linewidths=linewidth, rasterized=x.size > MOST_VECTORS)
    ax.add_collection(line)
    ax.autoscale_view()
    return line
