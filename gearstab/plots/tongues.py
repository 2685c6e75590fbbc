"""Instability boundaries of a result as lines, and the names of the tongues beside the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from gearstab.plots.axes import FREQUENCY, Axis, View
from gearstab.plots.placement import Placed, place
from gearstab.plots.style import LINE
from gearstab.plots.text import tongue_label

Array = np.ndarray

INVISIBLE = 0.004
"""A tongue nowhere wider than this part of the frame is about as thin as its own two lines: it gets no name."""


@dataclass(frozen=True)
class Tongues:
    """Boundaries over one axis of parameters.

    edges: ``(tongue, 2, size)``, lower and upper mesh frequency, NaN where a tongue is closed.
    """

    edges: Array
    labels: tuple[str, ...]
    parameter: Axis

    @property
    def positions(self) -> Array:
        """``(size,)``, ascending."""
        return self.parameter.positions[self.parameter.order]

    def inside(self, low: float, high: float) -> Array:
        """``(tongue, 2, size)``: the part of the frame, from 0 to 1, between the edges; NaN where there is none."""
        part = np.clip((self.edges - low) / (high - low), 0.0, 1.0)
        return np.where(part[:, 1:] > part[:, :1], part, np.nan)


def read_tongues(tree: xr.DataTree, group: str, view: View, parameter: Axis | None) -> Tongues | None:
    """The boundaries of a group over ``parameter`` at the view's indices; None if the result does not hold them.

    Without a parameter (a figure over the mesh frequency alone) the tongues have one row, at position 0.
    """
    if group not in tree.children or "boundary_frequency" not in tree[group].data_vars:
        return None
    data = tree[group].to_dataset()["boundary_frequency"]
    own = () if parameter is None else (parameter.name,)
    if not {"tongue", "side", *own} <= set(data.dims):
        return None
    edges = view.cut(data, "tongue", "side", *own)
    if parameter is None:
        edges, parameter = edges[..., None], Axis("", np.zeros(1), meshes=view.x.meshes)
    if edges.shape[0] == 0:
        return None
    raw = data.coords["label"].values if "label" in data.coords else [""] * edges.shape[0]
    labels = [v.decode() if isinstance(v, bytes) else str(v) for v in raw]
    kept = [i for i, label in enumerate(labels) if view.tongue in (None, label)]
    return Tongues(edges[kept], tuple(labels[i] for i in kept), parameter)


def widest(tongues: Tongues, low: float, high: float) -> Array:
    """``(tongue,)``: the greatest width inside the frame, as a part of it; 0 for one that is never seen."""
    part = tongues.inside(low, high)
    width = np.nan_to_num(part[:, 1] - part[:, 0])
    return width.max(axis=-1)


def boundary_lines(
    ax: Axes, tongues: Tongues, frequency_on_x: bool, chosen: Array | None = None, **line: Any
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


def anchors(tongues: Tongues, low: float, high: float, logarithmic: bool = False) -> tuple[Array, Array, Array]:
    """Where each tongue meets the end of its parameter axis.

    Returns (middle of the tongue as a part of the frame, position along the parameter axis, weight) for every tongue:
    at the last row where it is visible. The weight is its greatest width; tongues not worth a name have 0.
    """
    if logarithmic:
        tongues = Tongues(np.log(tongues.edges), tongues.labels, tongues.parameter)
        low, high = np.log(low), np.log(high)
    part = tongues.inside(low, high)
    width = np.nan_to_num(part[:, 1] - part[:, 0])
    weight = width.max(axis=-1)
    seen = width > 0.5 * INVISIBLE
    last = seen.shape[1] - 1 - np.argmax(seen[:, ::-1], axis=1)
    rows = np.arange(len(last))
    middle = part[rows, :, last].mean(axis=-1)
    return middle, tongues.positions[last], np.where(seen.any(axis=1) & (weight > INVISIBLE), weight, 0.0)


def parameter_axis(view: View) -> tuple[Axis, bool] | None:
    """(the axis across the mesh frequency, whether the frequency is on x); None if the frequency is on neither."""
    if view.y is None:
        return None
    for frequency, parameter in ((view.x, view.y), (view.y, view.x)):
        if frequency.name == FREQUENCY and parameter.numeric:
            return parameter, frequency is view.x
    return None


@dataclass(frozen=True)
class NamedTongues:
    """The labels that were drawn and their leader lines."""

    texts: tuple[Text, ...]
    leaders: tuple[Line2D, ...]


def name_tongues(ax: Axes, tongues: Tongues, frequency_on_x: bool, rows: int = 3) -> NamedTongues:
    """Write the tongues' names beyond the far end of the parameter axis, with leaders to where they belong.

    The frame must have its final length along the frequency axis; labels stand above it, or right of it if the
    frequency is on y. Tongues too thin to be seen, and the thinnest where not all names fit, are left out.
    """
    low, high = sorted(ax.get_xlim() if frequency_on_x else ax.get_ylim())
    scale = ax.get_xscale() if frequency_on_x else ax.get_yscale()
    middle, depth, weight = anchors(tongues, low, high, scale == "log")
    chosen = [i for i in np.flatnonzero(weight) if tongues.labels[i]]
    size = ax.figure.dpi / 72 * 7.5
    texts = [label_text(ax, tongue_label(tongues.labels[i], tongues.parameter.meshes), frequency_on_x) for i in chosen]
    if not texts:
        return NamedTongues((), ())
    boxes = [text.get_window_extent() for text in texts]
    frame = ax.get_window_extent()
    length, across = (frame.width, frame.height) if frequency_on_x else (frame.height, frame.width)
    room = np.array([box.width if frequency_on_x else box.height for box in boxes]) + 0.45 * size
    pitch = max(box.height if frequency_on_x else box.width for box in boxes) + 0.35 * size
    placed = place(middle[chosen] * length, room, -0.3 * size, length + 0.3 * size, weight[chosen], rows, 0.4 * size)
    gap = 0.75 * size
    leaders = []
    for item in placed:
        at = item.position / length, 1 + (gap + item.row * pitch) / across
        texts[item.index].set_position(at if frequency_on_x else at[::-1])
        row = float(depth[chosen[item.index]])
        inner = end_of(ax, row, frequency_on_x) if tongues.parameter.name else 1.0
        points = leader_points(item, float(middle[chosen[item.index]]), inner, length, gap / across, pitch / across)
        leaders.append(leader_line(ax, points if frequency_on_x else points[:, ::-1]))
    kept = {item.index for item in placed}
    for index, text in enumerate(texts):
        if index not in kept:
            text.remove()
    return NamedTongues(tuple(texts[item.index] for item in placed), tuple(leaders))


def name_view(tree: xr.DataTree, ax: Axes, view: View, rows: int = 3) -> NamedTongues:
    """Name the tongues of a view whose frame has settled: those of the exact boundaries if they are labelled."""
    found = parameter_axis(view)
    if found is not None:
        for group in ("boundaries", "perturbation"):
            lines = read_tongues(tree, group, view, found[0])
            if lines is not None and any(lines.labels):
                return name_tongues(ax, lines, found[1], rows)
    return NamedTongues((), ())


def label_text(ax: Axes, label: str, above: bool) -> Text:
    """A label that waits for its position (axes fractions)."""
    horizontal, vertical = ("center", "bottom") if above else ("left", "center")
    return ax.text(0.5, 0.5, label, transform=ax.transAxes, ha=horizontal, va=vertical, fontsize=7.5, clip_on=False)


def end_of(ax: Axes, position: float, frequency_on_x: bool) -> float:
    """A position on the parameter axis as a fraction of the frame; 1 from a twentieth below its end on."""
    point = ax.transData.transform((ax.get_xlim()[0], position) if frequency_on_x else (position, ax.get_ylim()[0]))
    fraction = float(ax.transAxes.inverted().transform(point)[1 if frequency_on_x else 0])
    return 1.0 if fraction > 0.95 else fraction


def leader_points(item: Placed, start: float, inner: float, length: float, gap: float, pitch: float) -> Array:
    """``(points, 2)``: from the tongue's end over each row's gap to just under the label, in axes fractions."""
    points = [(start, inner)] if inner < 1.0 else []
    points.append((start, 1.0 + 0.12 * gap))
    for row, along in enumerate(item.path):
        bottom = 1.0 + gap + row * pitch
        points.append((along / length, bottom - 0.08 * gap))
        if row < item.row:
            points.append((along / length, bottom + 0.75 * pitch))
    return np.array(points)


def leader_line(ax: Axes, points: Array) -> Line2D:
    """One thin grey leader that may leave the frame."""
    line = Line2D(points[:, 0], points[:, 1], transform=ax.transAxes, color="#6e6e6e", linewidth=0.4, clip_on=False)
    ax.add_artist(line)
    line.set_clip_on(False)
    return line


def settle(figure: Figure) -> None:
    """Run the layout, so that frames have their lengths and text can be measured against them."""
    figure.draw_without_rendering()


def freeze(figure: Figure) -> None:
    """Run the layout a last time, now with the labels, and keep it: every output format then shows the same figure."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
