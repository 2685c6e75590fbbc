"""Labels clear of one another: names in rows beside an axis, and numbers on the orders of a Campbell diagram.

One row is a least-squares problem, min sum (p_i - a_i)^2 with p_(i+1) - p_i >= (w_i + w_(i+1))/2, which in
q_i = p_i - (the room the labels before take) is isotonic regression; bounds only clip its solution. Labels that
would move too far from what they name climb to a second or third row, and lower rows keep a gap for their leaders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from gearstab.plots.drawing.style import CASES

Array = np.ndarray

FAR = 0.8
"""A label may move by this part of its own width: further off, its leader is hard to follow."""


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


SIZE = 6.5
"""Points of a number."""
HALO = [withStroke(linewidth=2.0, foreground="white")]
ACROSS = 257
"""Points of a line at which it is looked for others."""
CROWD = 1000
"""Points of lines that a mark, or another number, counts as under a number."""
CLEAR = 0.5
"""Points around a number that are kept clear."""
TIMES = r"$\times$"
"""Between the number of an order and its mesh."""


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
    line.set_label(f"{0.5 * half:g}{TIMES}{mesh}")
    return line


def number_orders(
    ax: Axes, orders: Sequence[Line2D], curves: Sequence[Line2D], marks: Sequence[PathCollection]
) -> None:
    """Write on every line its number, as far to the right as nothing else lies there; the frame must have settled.

    Where something lies everywhere it is where least does. Lines of one mesh along the edge of the frame, where their
    numbers do not fit, share one beside it. curves, marks: what else is drawn.
    """
    frame = ax.get_window_extent()
    columns = np.linspace(frame.x0, frame.x1, ACROSS)
    heights = [_heights(line, columns) for line in [*orders, *curves]]
    points = [ax.transData.transform(np.asarray(mark.get_offsets())) for mark in marks]
    crowd = np.concatenate(points) if points else np.zeros((0, 2))
    left: dict[str, list[int]] = {}
    for k, order in enumerate(orders):
        others = [*heights[:k], *heights[k + 1 :]]
        taken = _number(ax, str(order.get_label()), order, columns, heights[k], others, crowd)
        crowd = np.concatenate([crowd, taken])
        if not len(taken):
            left.setdefault(str(order.get_color()), []).append(k)
    for own in left.values():
        numbers, mesh = zip(*(str(orders[k].get_label()).split(TIMES, 1) for k in own), strict=True)
        words, others = ", ".join(numbers) + TIMES + mesh[0], [h for k, h in enumerate(heights) if k not in own]
        taken = _number(ax, words, orders[own[-1]], columns, heights[own[-1]], others, crowd, beside=True)
        crowd = np.concatenate([crowd, taken])


def _number(
    ax: Axes, words: str, order: Line2D, columns: Array, height: Array, others: Sequence[Array], crowd: Array,
    beside: bool = False,
) -> Array:  # fmt: skip
    """Write words on a line; returns points of the room they take, none where there is none.

    height, others: of the line and of all others over ``columns``, in pixels. beside: move words that do not fit into
    the frame, however near its edge the line is.
    """
    frame = ax.get_window_extent()
    text = ax.text(0.0, 0.0, words, ha="center", va="center", fontsize=SIZE, color=order.get_color())
    text.set(path_effects=HALO, zorder=4)
    box = text.get_window_extent()
    half = 0.5 * np.array([box.width, box.height]) + CLEAR * ax.figure.dpi / 72
    middle = np.column_stack([columns, height])
    inside = np.all((middle - half >= frame.min) & (middle + half <= frame.max), axis=1)
    if beside:
        inside = (height >= frame.y0) & (height <= frame.y1)
        middle = np.clip(middle, frame.min + half, frame.max - half)
    if not inside.any():
        text.remove()
        return np.zeros((0, 2))
    cost = CROWD * np.sum(np.all(np.abs(middle[:, None] - crowd) < half, axis=-1), axis=-1)
    near = np.abs(middle[:, :1] - columns) < half[0]
    for other in others:
        with np.errstate(invalid="ignore"):
            cost += np.sum(near & (np.abs(middle[:, None, 1] - other) < half[1]), axis=1)
    best = ACROSS - 1 - int(np.argmin(np.where(inside, cost, np.iinfo(int).max)[::-1]))
    x, y = ax.transData.inverted().transform(middle[best])
    text.set_position((float(x), float(y)))
    return _corners(middle[best], half)


def _heights(line: Line2D, columns: Array) -> Array:
    """The line in pixels over columns of pixels, NaN where there is none."""
    x, y = line.get_transform().transform(line.get_xydata()).T
    return np.asarray(np.interp(columns, x, y, left=np.nan, right=np.nan))


def _corners(middle: Array, half: Array) -> Array:
    """Nine points of a box, so that one of its own size that meets it holds one of them."""
    ways = np.array([-1.0, 0.0, 1.0])
    return np.asarray(middle + half * np.stack(np.meshgrid(ways, ways), axis=-1).reshape(-1, 2))
