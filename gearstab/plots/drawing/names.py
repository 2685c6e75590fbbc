"""Names of the tongues in rows beside the frame, with leader lines, none over another.

One row is a least-squares problem, min sum (p_i - a_i)^2 with p_(i+1) - p_i >= (w_i + w_(i+1))/2, which in
q_i = p_i - (the room the labels before take) is isotonic regression; bounds only clip its solution. Labels that
would move too far from what they name climb to a second or third row, and lower rows keep a gap for their leaders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, MaxNLocator
from matplotlib.transforms import (
    Affine2D,
    Bbox,
    ScaledTranslation,
    Transform,
    blended_transform_factory,
)

from gearstab.plots.drawing.text import fitted, tongue_label
from gearstab.plots.drawing.tongues import (
    INVISIBLE,
    DrawnTongues,
    frequency_limits,
    parameter_axis,
    read_tongues,
    regions_of_one_mode,
    widest,
)
from gearstab.plots.view import Request, View

Array = np.ndarray

SIZE = 7.5
"""Points of a name."""
GAP, ROW_GAP, SPACE, LEADER = 5.5, 4.0, 3.4, 3.0
"""Points: from the frame to the first row, from row to row, between neighbours in a row, around a leader in a row."""

FAR = 0.8
"""A label may move by this part of its own width: further off, its leader is hard to follow."""
FAR_BESIDE = 2.0
"""As FAR, of names one under another, which are less high than wide."""


@dataclass(frozen=True)
class NamedTongues:
    """The names that were drawn, their leaders outside the frame, and those that go on inside it to a tongue's end."""

    texts: tuple[Text, ...] = ()
    leaders: tuple[Line2D, ...] = ()
    inner: tuple[Line2D, ...] = ()

    def remove(self) -> None:
        """Take all of them off the figure."""
        for artist in (*self.texts, *self.leaders, *self.inner):
            artist.remove()


def anchors(tongues: DrawnTongues, low: float, high: float, logarithmic: bool = False) -> tuple[Array, Array, Array]:
    """Where each tongue meets the end of its parameter axis.

    Returns (middle of the tongue as a part of the frame, position along the parameter axis, weight) for every tongue:
    at the last row where it is visible. The weight is its greatest width; tongues not worth a name have 0. Of a curve,
    which shows the growth of every region, none is too narrow.
    """
    if logarithmic:
        tongues = DrawnTongues(np.log(tongues.edges), tongues.labels, tongues.parameter)
        low, high = np.log(low), np.log(high)
    part = tongues.inside(low, high)
    width = np.nan_to_num(part[:, 1] - part[:, 0])
    weight, least = width.max(axis=-1), INVISIBLE if tongues.parameter.name else 0.0
    seen = width > 0.5 * least
    last = seen.shape[1] - 1 - np.argmax(seen[:, ::-1], axis=1)
    rows = np.arange(len(last))
    middle = part[rows, :, last].mean(axis=-1)
    return middle, tongues.positions[last], np.where(seen.any(axis=1) & (weight > least), weight, 0.0)


def name_view(tree: xr.DataTree, ax: Axes, view: View, rows: int = 3) -> NamedTongues:
    """Name the tongues of a view whose frame has settled: by exact boundaries, or else by predicted ones, or else
    those of a single mode by where they lie.
    """
    found = parameter_axis(view)
    if found is None:
        return NamedTongues()
    parameter, frequency_on_x = found
    limits = frequency_limits(ax, frequency_on_x)
    groups = [read_tongues(tree, group, view, parameter) for group in ("boundaries", "perturbation")]
    known = [group for group in groups if group is not None]
    lines = merged(known, *limits) if known else regions_of_one_mode(tree, view, parameter)
    return name_tongues(ax, lines, frequency_on_x, rows) if lines is not None else NamedTongues()


def merged(groups: list[DrawnTongues], low: float, high: float) -> DrawnTongues | None:
    """The labelled tongues of all groups that can be seen, from the first group that shows each; None without any."""
    edges: dict[str, Array] = {}
    for group in groups:
        seen = widest(group, low, high) > INVISIBLE
        for i in np.flatnonzero(seen):
            edges.setdefault(group.labels[i], group.edges[i])
    edges.pop("", None)
    return DrawnTongues(np.stack(list(edges.values())), tuple(edges), groups[0].parameter) if edges else None


def name_tongues(ax: Axes, tongues: DrawnTongues, frequency_on_x: bool, rows: int = 3) -> NamedTongues:
    """Write the tongues' names beyond the far end of the parameter axis, with leaders to where they belong.

    The frame must have its final length along the frequency axis; names stand above it, or right of it if the
    frequency is on y. DrawnTongues too thin to be seen, and the thinnest where not all names fit, are left out.
    """
    low, high = sorted(frequency_limits(ax, frequency_on_x))
    scale = ax.get_xscale() if frequency_on_x else ax.get_yscale()
    middle, depth, weight = anchors(tongues, low, high, scale == "log")
    chosen = np.array([i for i in np.flatnonzero(weight) if tongues.labels[i]], dtype=int)
    if not chosen.size:
        return NamedTongues()
    words = [tongue_label(tongues.labels[i], tongues.parameter.meshes) for i in chosen]
    ends = depth[chosen] if tongues.parameter.name else None
    return name_places(ax, words, middle[chosen], weight[chosen], frequency_on_x, rows, ends)


def name_places(
    ax: Axes, words: list[str], middle: Array, weight: Array, frequency_on_x: bool, rows: int = 3,
    depth: Array | None = None,
) -> NamedTongues:  # fmt: skip
    """The same of any words, each for a place along the frequency axis.

    middle: ``(words,)``, parts of the frame. weight: words of less weight give way. depth: along the other axis, where
    a leader goes on to inside the frame.
    """
    if not words:
        return NamedTongues()
    spans, thickness = measured(ax, words, frequency_on_x)
    box = ax.get_window_extent()
    length = (box.width if frequency_on_x else box.height) * 72 / ax.figure.dpi
    edge = 0.3 * SIZE
    if not frequency_on_x:
        rows = 1  # a column of names takes the width of the figure, and holds many
    far = FAR if frequency_on_x else FAR_BESIDE
    placed = place(middle * length, spans + SPACE, -edge, length + edge, weight, rows, LEADER, far)
    outside = beyond(ax, frequency_on_x)
    texts, leaders, inner = [], [], []
    for item in placed:
        start = float(middle[item.index])
        texts.append(write_name(ax, words[item.index], item, length, thickness, outside, frequency_on_x))
        points = leader_points(item, start * length, thickness) / (length, 1.0)
        leaders.append(thin_line(ax, points, outside, frequency_on_x))
        if depth is not None and not reaches_end(ax, float(depth[item.index]), frequency_on_x):
            inner.append(inner_leader(ax, start, float(depth[item.index]), frequency_on_x))
    return NamedTongues(tuple(texts), tuple(leaders), tuple(inner))


def measured(ax: Axes, words: list[str], frequency_on_x: bool) -> tuple[Array, float]:
    """In points: the length of each name along the frequency axis, and the greatest across it."""
    points = 72 / ax.figure.dpi
    boxes: list[Bbox] = []
    for word in words:
        text = ax.text(0.5, 0.5, word, fontsize=SIZE)
        boxes.append(text.get_window_extent())
        text.remove()
    widths, heights = np.array([(box.width, box.height) for box in boxes]).T * points
    along, across = (widths, heights) if frequency_on_x else (heights, widths)
    return along, float(across.max())


def beyond(ax: Axes, frequency_on_x: bool) -> Transform:
    """From (part of the frame along the frequency axis, points beyond its far end) to the figure.

    The distances stay what they are when the layout gives the frame another height.
    """
    points = Affine2D().scale(1 / 72) + ax.figure.dpi_scale_trans
    if frequency_on_x:
        return blended_transform_factory(ax.transAxes, points + ScaledTranslation(0, 1, ax.transAxes))  # type: ignore[arg-type]
    return blended_transform_factory(points + ScaledTranslation(1, 0, ax.transAxes), ax.transAxes)  # type: ignore[arg-type]


def write_name(
    ax: Axes, words: str, item: Placed, length: float, thickness: float, outside: Transform, frequency_on_x: bool
) -> Text:
    """Write one name at its place."""
    at = item.position / length, row_start(item.row, thickness)
    horizontal, vertical = ("center", "bottom") if frequency_on_x else ("left", "center")
    return ax.text(
        *(at if frequency_on_x else at[::-1]), words, transform=outside, ha=horizontal, va=vertical, fontsize=SIZE,
        clip_on=False,
    )  # fmt: skip


def row_start(row: int, thickness: float) -> float:
    """Points from the frame to the near side of a row of names."""
    return GAP + row * (thickness + ROW_GAP)


def leader_points(item: Placed, start: float, thickness: float) -> Array:
    """``(points, 2)``, in points along and beyond the frame: upright through the rows, slanting in the gaps between."""
    points = [(start, 0.5)]
    for row, along in enumerate(item.path):
        near = row_start(row, thickness)
        points.append((along, near - 0.5))
        if row < item.row:
            points.append((along, near + thickness + 0.3))
    return np.array(points)


def reaches_end(ax: Axes, position: float, frequency_on_x: bool) -> bool:
    """Whether a position on the parameter axis lies within a twentieth of its far end."""
    point = ax.transData.transform((ax.get_xlim()[0], position) if frequency_on_x else (position, ax.get_ylim()[0]))
    return bool(ax.transAxes.inverted().transform(point)[1 if frequency_on_x else 0] > 0.95)


def inner_leader(ax: Axes, start: float, end: float, frequency_on_x: bool) -> Line2D:
    """The part of a leader inside the frame, from the last visible row of a tongue to the far end."""
    if frequency_on_x:
        inside = blended_transform_factory(ax.transAxes, ax.transData)
        far = ax.get_ylim()[1]
    else:
        inside = blended_transform_factory(ax.transData, ax.transAxes)
        far = ax.get_xlim()[1]
    return thin_line(ax, np.array([(start, end), (start, far)]), inside, frequency_on_x)


def thin_line(ax: Axes, points: Array, transform: Transform, frequency_on_x: bool) -> Line2D:
    """One thin grey line that may leave the frame; ``points`` are (along the frequency axis, across)."""
    x, y = points.T if frequency_on_x else points.T[::-1]
    line = Line2D(x, y, transform=transform, color="#6e6e6e", linewidth=0.4)
    ax.add_artist(line)
    line.set_clip_on(False)
    return line


def settle(figure: Figure) -> None:
    """Run the layout, so that frames have their lengths and text can be measured against them."""
    if (layout := figure.get_layout_engine()) is None:
        figure.draw_without_rendering()
    else:
        layout.execute(figure)


def freeze(figure: Figure, request: Request) -> None:
    """Run the layout a last time, now with the names, and keep it: every output format then shows the same figure.

    A figure that the user made keeps its own layout.
    """
    for _ in range(2):  # what the first run makes room for moves labels that the second sees
        settle(figure)
        if request.ax is None:
            _break_long_labels(figure)
    if request.ax is None:
        _run_with_fixed_ticks(figure)
        figure.set_layout_engine("none")


def _break_long_labels(figure: Figure) -> None:
    """Break labels along y, and of colour bars, that are longer than their frames with the names beside these."""
    for ax in figure.axes:
        label, room = ax.yaxis.label, ax.get_window_extent().height
        for part in (0.95, 0.75, 0.55):  # the fonts of a style may be wider than those that lines are reckoned for
            if label.get_window_extent().height > room:
                label.set_text(fitted(label.get_text(), part * room / figure.dpi, float(label.get_fontsize())))
                label.set_linespacing(0.95)


def _run_with_fixed_ticks(figure: Figure) -> None:
    """Run the layout once more without a choice of ticks: a frame that changes its ticks with its size never settles.

    Ticks are chosen freely again afterwards, in a window that is zoomed for example; not where that would now give
    others, whose labels nothing has made room for.
    """
    free = [
        (axis, axis.get_major_locator())
        for ax in figure.axes
        for axis in (ax.xaxis, ax.yaxis)
        if isinstance(axis.get_major_locator(), MaxNLocator)
    ]
    fixed = [FixedLocator(list(locator())) for _, locator in free]
    for (axis, _), own in zip(free, fixed, strict=True):
        axis.set_major_locator(own)
    settle(figure)
    for (axis, locator), own in zip(free, fixed, strict=True):
        axis.set_major_locator(locator)
        if not np.array_equal(locator(), own()):
            axis.set_major_locator(own)


@dataclass(frozen=True)
class Placed:
    """Where one label went: its index, its row (0 nearest) and the leader's position in each row up to its own."""

    index: int
    row: int
    path: tuple[float, ...]

    @property
    def position(self) -> float:
        """The middle of the label along the axis."""
        return self.path[-1]


def isotonic(values: Array) -> Array:
    """The non-decreasing sequence nearest to ``values`` in least squares (pool adjacent violators)."""
    means: list[float] = []
    counts: list[int] = []
    for value in values:
        means.append(float(value))
        counts.append(1)
        while len(means) > 1 and means[-2] > means[-1]:
            total = counts[-2] + counts[-1]
            means[-2:] = [(means[-2] * counts[-2] + means[-1] * counts[-1]) / total]
            counts[-2:] = [total]
    return np.repeat(means, counts)


def pack(anchors: Array, widths: Array, low: float, high: float) -> Array:
    """Middles of labels of the given widths, in the order of the (ascending) anchors, inside ``[low, high]``.

    The widths must fit, ``sum(widths) <= high - low``.
    """
    before = np.concatenate([[0.0], np.cumsum(0.5 * (widths[1:] + widths[:-1]))])
    first, last = low + 0.5 * widths[0], high - 0.5 * widths[-1] - before[-1]
    return np.clip(isotonic(anchors - before), first, max(first, last)) + before


def place(
    anchors: Array, widths: Array, low: float, high: float, weights: Array, rows: int = 3, leader: float = 0.0,
    far: float = FAR,
) -> list[Placed]:  # fmt: skip
    """Place labels beside an axis in at most ``rows`` rows, none further than ``far`` of its width from its place.

    anchors, widths: ``(labels,)``, where each label belongs and the room it needs along the axis, space included.
    low, high: the room there is. weights: labels come in by descending weight, and one for which there is no
    room beside those before it is left out. leader: the room a leader line needs between labels.

    Returns the labels placed, by ascending anchor.
    """
    kept: list[int] = []
    placed: list[Placed] = []
    for label in np.argsort(-weights, kind="stable"):
        trial = np.array(sorted([*kept, int(label)], key=lambda k: (anchors[k], k)))
        paths = arranged(anchors[trial], widths[trial], low, high, rows, leader, far)
        if paths:
            kept.append(int(label))
            placed = [Placed(int(k), len(path) - 1, tuple(path)) for k, path in zip(trial, paths, strict=True)]
    return placed


def arranged(
    anchors: Array, widths: Array, low: float, high: float, rows: int, leader: float, far: float
) -> list[list[float]]:
    """The leaders' paths of all labels in the fewest rows that keep each near its anchor; empty without such."""
    for most in range(1, rows + 1):
        paths = packed(anchors, widths, climbed(anchors, widths, most), low, high, leader)
        if paths and np.all(np.abs(np.array([path[-1] for path in paths]) - anchors) <= far * widths):
            return paths
    return []


def climbed(anchors: Array, widths: Array, rows: int) -> Array:
    """A row for each label: neighbours that would overlap where they belong take turns over ``rows`` rows."""
    levels = np.zeros(anchors.size, dtype=int)
    for i in range(1, anchors.size):
        crowded = anchors[i] - anchors[i - 1] < 0.5 * (widths[i] + widths[i - 1])
        levels[i] = (levels[i - 1] + 1) % rows if crowded else 0
    return levels


def packed(anchors: Array, widths: Array, levels: Array, low: float, high: float, leader: float) -> list[list[float]]:
    """The leader's path through the rows for every label, the label's middle last; empty if a row is too short."""
    paths: list[list[float]] = [[] for _ in anchors]
    position = anchors
    for level in range(int(levels.max()) + 1):
        members = np.flatnonzero(levels >= level)
        room = np.where(levels[members] == level, widths[members], leader)
        if room.sum() > high - low:
            return []
        middles = pack(position[members], room, low, high)
        position = position.copy()
        position[members] = middles
        for member, middle in zip(members, middles, strict=True):
            paths[member].append(float(middle))
    return paths
