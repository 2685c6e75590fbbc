"""Which share of the stable mesh frequencies is proved stable, and which is scanned only."""

from __future__ import annotations

import numpy as np

from gearstab.system import Array


def union(parts: Array) -> Array:
    """Intervals ``(K, 2)`` in any order as disjoint ascending ones."""
    parts = parts[np.argsort(parts[:, 0], kind="stable")]
    reach = np.maximum.accumulate(parts[:, 1])
    apart = np.ones(len(parts), dtype=bool)
    apart[1:] = parts[1:, 0] > reach[:-1]
    begin = np.flatnonzero(apart)
    end = np.append(begin[1:], len(parts))[: len(begin)] - 1
    return np.stack([parts[begin, 0], reach[end]], axis=1)


def complement(parts: Array, start: float, stop: float) -> Array:
    """Return the gaps that intervals ``(K, 2)`` leave in start..stop, disjoint and ascending."""
    return _gaps(union(np.clip(parts, start, stop)), start, stop)


def _gaps(parts: Array, start: float, stop: float) -> Array:
    """The same of intervals that are disjoint and ascending, within start..stop."""
    edges = np.concatenate([[start], parts.ravel(), [stop]]).reshape(-1, 2)
    return edges[edges[:, 1] > edges[:, 0]]


class Coverage:
    """Where the search of each row, part by part of its system, has left something unproved, or not even counted."""

    def __init__(self, rows: int, start: float, stop: float) -> None:
        self.start, self.stop = start, stop
        self.bare = np.zeros(rows, dtype=bool)
        self.unproved: list[list[Array]] = [[] for _ in range(rows)]
        self.uncounted: list[list[Array]] = [[] for _ in range(rows)]

    def count(self, rows: Array) -> None:
        """Record that a part of the systems of some rows was searched by counting only."""
        self.bare[rows] = True

    def add(self, row: int, proved: Array, counted: Array) -> None:
        """Add what was proved, and what else was counted, of a part of a row's system: ``(K, 2)`` mesh frequencies
        each.
        """
        both = np.concatenate([proved, counted])
        for left, known in ((self.unproved, proved), (self.uncounted, both)):
            rest = complement(known, self.start, self.stop)
            if len(rest):
                left[row].append(rest)

    def of(self, row: int, unstable: Array) -> tuple[Array, Array]:
        """(proved, counted) of what is stable, given the unstable intervals ``(K, 2)``: disjoint and ascending each."""
        proved = np.empty((0, 2))
        if self.bare[row] and not self.uncounted[row]:
            return proved, _gaps(unstable, self.start, self.stop)
        if not self.bare[row]:
            proved = complement(np.concatenate([unstable, *self.unproved[row]]), self.start, self.stop)
        counted = complement(np.concatenate([unstable, proved, *self.uncounted[row]]), self.start, self.stop)
        return proved, counted
