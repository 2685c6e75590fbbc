"""Unstable intervals as columns: a map has tens of thousands, and an object of each takes longer than to find it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from gearstab.grouping import Columns
from gearstab.system import Array


@dataclass(frozen=True)
class Interval:
    """One unstable interval of a row in cycle = 1/Omega.

    passed: collisions at +1, at -1 and elsewhere between T = 0 and ``start``; meetings: how many of each are inside,
    from the counts on both sides (where the range cuts the interval, in the part that it shows); error: widths of the
    brackets of both edges; cut: whether an end is that of the range.
    """

    row: int
    start: float
    stop: float
    passed: tuple[int, int, int] = (0, 0, 0)
    meetings: tuple[int, int, int] = (0, 0, 0)
    error: tuple[float, float] = (0.0, 0.0)
    cut: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, eq=False)
class Intervals(Columns):
    """The same of K intervals: row, start, stop ``(K,)``; passed, meetings ``(K, 3)``; error, cut ``(K, 2)``."""

    row: Array
    start: Array
    stop: Array
    passed: Array
    meetings: Array
    error: Array
    cut: Array

    @classmethod
    def of(cls, items: Iterable[Interval]) -> Intervals:
        """Intervals one by one as columns."""
        items = list(items)

        def column(name: str, kind: type, *several: int) -> Array:
            return np.array([getattr(item, name) for item in items], dtype=kind).reshape(-1, *several)

        return cls(*(column(name, *kind) for name, kind in KINDS.items()))

    def subset(self, index: Array | Sequence[int]) -> Intervals:
        """Return the intervals at the positions ``index``."""
        return self.chosen(np.asarray(index, dtype=int))

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, index: int) -> Interval:
        return next(iter(self.subset([index])))

    def __iter__(self) -> Iterator[Interval]:
        columns = zip(*(getattr(self, name).tolist() for name in KINDS), strict=True)
        return (Interval(row, start, stop, *map(tuple, rest)) for row, start, stop, *rest in columns)


KINDS: dict[str, tuple[Any, ...]] = {
    "row": (int,), "start": (float,), "stop": (float,),
    "passed": (int, 3), "meetings": (int, 3), "error": (float, 2), "cut": (bool, 2),
}  # fmt: skip


def verdicts_at_ends(row: Array, unstable: Array) -> Array:
    """``(2, r)``: whether the first and the last one of the points of each row, by row and ascending, is unstable."""
    begin = np.flatnonzero(np.diff(row, prepend=-1))
    return np.stack([unstable[begin], unstable[np.append(begin[1:], len(row)) - 1]])


def paired(ends: Array, row: Array, edge: Array, error: Array, beyond: Array, floor: float) -> Intervals:
    """Intervals between the edges ``(E,)`` of rows, in cycles, wider than the floor, relatively.

    ends ``(2, r)``: of the range, which cuts an interval where it is unstable, ``beyond`` ``(2, r)``. error ``(E,)``:
    widths of the brackets.
    """
    side, cut_row = np.nonzero(beyond)
    row, edge = np.append(row, cut_row), np.append(edge, ends[side, cut_row])
    error, cut = np.append(error, np.zeros(len(side))), np.arange(len(row)) >= len(error)
    both = np.lexsort((edge, row)).reshape(-1, 2)
    both = both[np.diff(edge[both], axis=1)[:, 0] > floor * edge[both[:, 0]]]
    (start, stop), none = edge[both].T, np.zeros((len(both), 3), dtype=int)
    return Intervals(row[both[:, 0]], start, stop, none, none, error[both], cut[both])


def by_row(row: Array, count: int) -> list[Array]:
    """Positions of the entries of each of ``count`` rows, in their order."""
    order = np.argsort(row, kind="stable")
    ends = np.searchsorted(row[order], np.arange(count + 1)).tolist()
    return [order[begin:end] for begin, end in pairwise(ends)]
