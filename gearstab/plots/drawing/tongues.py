"""Instability boundaries of a result as lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from gearstab.plots.axes import FigureAxis, View, texts
from gearstab.plots.drawing.style import GROWTH, LINE
from gearstab.results.display import SPEEDS

Array = np.ndarray

EDGE: dict[str, Any] = {"colors": LINE, "linewidths": 0.45, "zorder": 2.2}
THIN: dict[str, Any] = {"colors": [GROWTH(0.15)], "linewidths": 0.4, "zorder": 2.1}
"""A tongue thinner than a line is a sliver of the lightest growth colours, as it would be among the cells."""

ONE_LINE = 0.002
"""Two edges nearer than this part of the frame print as one line."""

INVISIBLE = 0.004
"""A tongue nowhere wider than this part of the frame is about as thin as its own two lines: it gets no name."""


@dataclass(frozen=True)
class DrawnTongues:
    """Boundaries over one axis of parameters.

    edges: ``(tongue, 2, size)``, lower and upper mesh frequency, or the speed that gives it where the figure shows
        that, NaN where a tongue is closed.
    """

    edges: Array
    labels: tuple[str, ...]
    parameter: FigureAxis

    @property
    def positions(self) -> Array:
        """``(size,)``, ascending."""
        return self.parameter.ascending

    def inside(self, low: float, high: float) -> Array:
        """``(tongue, 2, size)``: the part of the frame, from 0 to 1, between the edges; NaN where there is none."""
        part = np.clip((self.edges - low) / (high - low), 0.0, 1.0)
        return np.where(part[:, 1:] > part[:, :1], part, np.nan)

    def open_ranges(self) -> Array:
        """``(ranges, 2)``, lower and upper edge of the tongues that are open at the first position."""
        edges = self.edges[..., 0]
        return edges[np.isfinite(edges).all(axis=1) & (edges[:, 1] > edges[:, 0])]


def frequency_limits(ax: Axes, frequency_on_x: bool) -> tuple[float, float]:
    """Where the frame begins and ends along the axis of the mesh frequency."""
    return ax.get_xlim() if frequency_on_x else ax.get_ylim()


def read_tongues(tree: xr.DataTree, group: str, view: View, parameter: FigureAxis | None) -> DrawnTongues | None:
    """The boundaries of a group over ``parameter`` at the view's indices; None if the result does not hold them.

    Without a parameter (a figure over the mesh frequency alone) the tongues have one row, at position 0.
    """
    if group not in tree.children or "boundary_frequency" not in tree[group].data_vars:
        return None
    data = tree[group].to_dataset()["boundary_frequency"]
    own = () if parameter is None else (parameter.name,)
    if not {"tongue", "side", *own} <= set(data.dims):
        return None
    if view.factor is None:
        return None
    edges = view.cut(data, "tongue", "side", *own) / view.factor
    if parameter is None:
        edges, parameter = edges[..., None], FigureAxis("", np.zeros(1), meshes=view.x.meshes)
    if edges.shape[0] == 0:
        return None
    raw = data.coords["label"].values if "label" in data.coords else [""] * edges.shape[0]
    labels = texts(raw)
    kept = [i for i, label in enumerate(labels) if view.tongue in (None, label)]
    return DrawnTongues(edges[kept], tuple(labels[i] for i in kept), parameter)


def widest(tongues: DrawnTongues, low: float, high: float) -> Array:
    """``(tongue,)``: the greatest width inside the frame, as a part of it; 0 for one that is never seen."""
    part = tongues.inside(low, high)
    width = np.nan_to_num(part[:, 1] - part[:, 0])
    return width.max(axis=-1)


def boundary_lines(
    ax: Axes, tongues: DrawnTongues, frequency_on_x: bool, chosen: Array | None = None, **line: Any
) -> LineCollection:
    """Draw both edges of the ``chosen`` tongues (an index array or mask; default all) as thin lines."""
    edges = tongues.edges if chosen is None else tongues.edges[chosen]
    along = np.broadcast_to(tongues.positions, edges.shape)
    points = np.stack([edges, along] if frequency_on_x else [along, edges], axis=-1)
    segments = list(points.reshape(-1, *points.shape[-2:]))
    style: dict[str, Any] = {"colors": LINE, "linewidths": 0.6, "capstyle": "round", "joinstyle": "round"}
    lines = LineCollection(segments, **{**style, **line})
    ax.add_collection(lines, autolim=False)
    return lines


def exact_lines(ax: Axes, tongues: DrawnTongues, frequency_on_x: bool) -> tuple[LineCollection, LineCollection]:
    """Draw exact boundaries: both edges of a tongue where it is wide enough to see, else one light line for all of it.

    A line is broken where an edge leaps, as it does where regions merge and where a name passes to another region.
    Returns the edges and the light lines.
    """
    low, high = frequency_limits(ax, frequency_on_x)
    edges, span = tongues.edges, high - low
    narrow = ~(edges[:, 1] - edges[:, 0] >= ONE_LINE * span)
    wide = np.where((narrow & beside(narrow))[:, None], np.nan, edges)
    middle = np.where((~narrow & beside(~narrow))[:, None], np.nan, edges.mean(axis=1, keepdims=True))
    drawn = []
    for frequency, look in ((wide, EDGE), (middle, THIN)):
        lines = frequency.reshape(-1, frequency.shape[-1])
        parts = [part for line in lines for part in pieces(line, tongues.positions, span)]
        drawn.append(LineCollection([p if frequency_on_x else p[:, ::-1] for p in parts], **look))
        ax.add_collection(drawn[-1], autolim=False)
    return drawn[0], drawn[1]


def beside(rows: Array) -> Array:
    """Whether both neighbours of a row hold too: what is cut there overlaps by a row with what goes on."""
    padded = np.pad(rows, ((0, 0), (1, 1)), constant_values=True)
    return padded[:, :-2] & padded[:, 2:]


def pieces(frequency: Array, positions: Array, span: float) -> list[Array]:
    """The unbroken parts ``(points, 2)`` of an edge, cut at NaN and where it leaps.

    A leap is far beyond the edge's usual step (an edge of parabolic shape stays below twice the median), or more than a
    twentieth of the frame.
    """
    leaps = np.abs(np.diff(frequency))
    usual = float(np.median(leaps[np.isfinite(leaps)])) if np.isfinite(leaps).any() else 0.0
    cuts = np.flatnonzero(~(leaps <= min(INVISIBLE * span + 5 * usual, 0.05 * span))) + 1
    parts = np.split(np.stack([frequency, positions], axis=-1), cuts)
    return [part for part in parts if len(part) > 1 and np.isfinite(part).all()]


def parameter_axis(view: View) -> tuple[FigureAxis, bool] | None:
    """(the axis across the mesh frequency, whether the frequency is on x); None if the frequency is on neither."""
    if view.y is None:
        return None
    for frequency, parameter in ((view.x, view.y), (view.y, view.x)):
        if frequency.name in SPEEDS and parameter.numeric:
            return parameter, frequency is view.x
    return None
