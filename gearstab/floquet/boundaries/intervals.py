"""Unstable intervals as columns: a map has tens of thousands, and an object of each takes longer than to find it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np

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
class Intervals:
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
        index = np.asarray(index, dtype=int)
        return Intervals(*(getattr(self, f.name)[index] for f in fields(self)))

    def joined(self, other: Intervals) -> Intervals:
        """Return both, by row and start."""
        columns = [np.concatenate([getattr(part, f.name) for part in (self, other)]) for f in fields(self)]
        order = np.lexsort((columns[1], columns[0]))
        return Intervals(*(column[order] for column in columns))

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


def by_row(row: Array, count: int) -> list[Array]:
    """Positions of the entries of each of ``count`` rows, in their order."""
    order = np.argsort(row, kind="stable")
    ends = np.searchsorted(row[order], np.arange(count + 1)).tolist()
    return [order[begin:end] for begin, end in pairwise(ends)]
