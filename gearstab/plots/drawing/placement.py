"""Labels in a row beside an axis: close to what they name, never over one another.

One row is a least-squares problem, min sum (p_i - a_i)^2 with p_(i+1) - p_i >= (w_i + w_(i+1))/2, which in
q_i = p_i - (the room the labels before take) is isotonic regression; bounds only clip its solution. Labels that
would move too far from what they name climb to a second or third row, and lower rows keep a gap for their leaders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
