"""Unstable intervals as columns, and exact block reduction: what the meshes never couple is searched apart.

A map has tens of thousands of intervals, and an object of each takes longer than to find it.

A block of few coordinates (:mod:`~gearstab.floquet.segments.blocks`) costs a small part of the whole, and multipliers
of different blocks pass each other without a collision that would have to be looked into. A point is unstable where
any block is, so that regions are united; of the stable mesh frequencies those are gathered that are proved stable, or
searched by counting, in all parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from gearstab.floquet.segments.blocks import split, whole
from gearstab.floquet.segments.pattern import Pattern
from gearstab.grouping import Columns, numbered
from gearstab.system import Array

TAKES_PART = 1e-6
"""Share (squared) above which a mode takes part in a coordinate; of other frequencies than its own there is none."""


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


@dataclass(frozen=True)
class Part:
    """A block of a pattern.

    whole: the number of elastic modes of the whole. modes: ``(r, m)``, which of them, from 0, each coordinate is named
    after; of equal frequencies the first that is free. copies: how many identical blocks this one stands for.
    """

    pattern: Pattern
    whole: int
    modes: Array
    copies: int

    def subset(self, rows: Array) -> Part:
        """Some of the rows, by position."""
        if len(rows) == len(self.pattern.rows):
            return self
        return replace(self, pattern=self.pattern.subset(rows), modes=self.modes[rows])


def separated(pattern: Pattern, reduction: bool) -> Iterator[Part]:
    """The blocks of a pattern; one, the pattern, where nothing can be separated or ``reduction`` is False."""
    position = {int(row): k for k, row in enumerate(pattern.rows)}
    named = np.zeros((len(pattern.rows), pattern.size), dtype=bool)
    for block in split(pattern) if reduction else [whole(pattern)]:
        row = np.array([position[int(r)] for r in block.pattern.rows])
        each = np.arange(len(row))
        modes = np.zeros((len(row), block.pattern.size), dtype=int)
        for j in range(block.pattern.size):
            share = block.basis[:, :, j] ** 2
            free = (share > TAKES_PART) & ~named[row]
            modes[:, j] = np.where(free.any(axis=1), free.argmax(axis=1), share.argmax(axis=1))
            named[row[each], modes[:, j]] = True
        yield Part(block.pattern, pattern.size, modes, block.copies)


@dataclass(frozen=True, eq=False)
class RegionEdges:
    """Edges in Omega of K regions of rows: row ``(K,)``; edges, error, cut ``(K, 2)``, of the lower and the upper one.

    owner, member ``(N,)``: the tongues of the regions, of each the leading one first: number of the region, ascending,
    and number of the tongue.
    """

    row: Array
    edges: Array
    error: Array
    cut: Array
    owner: Array
    member: Array

    def subset(self, index: Array) -> RegionEdges:
        """Return the parts at the positions ``index``."""
        count = np.bincount(self.owner, minlength=len(self.row))
        begin, own = (np.cumsum(count) - count)[index], count[index]
        owner, number = numbered(own)
        place = begin[owner] + number
        edges, error, cut = (part[index] for part in (self.edges, self.error, self.cut))
        return RegionEdges(self.row[index], edges, error, cut, owner, self.member[place])

    def ordered(self) -> RegionEdges:
        """Sort by row and mesh frequency."""
        return self.subset(np.lexsort((self.edges[:, 1], self.edges[:, 0], self.row)))

    @classmethod
    def joined(cls, parts: Sequence[RegionEdges]) -> RegionEdges:
        """All of several, one after the other."""
        offsets = np.cumsum([0, *(len(part.row) for part in parts)])
        shifted = [replace(part, owner=part.owner + k) for part, k in zip(parts, offsets, strict=False)]
        return cls(*(np.concatenate([getattr(part, f.name) for part in shifted]) for f in fields(cls)))

    @classmethod
    def none(cls) -> RegionEdges:
        """No region."""
        whole, pairs = np.empty(0, dtype=np.int64), np.empty((0, 2))
        return cls(whole, pairs, pairs, pairs.astype(bool), whole, whole)


def united(regions: RegionEdges) -> RegionEdges:
    """Regions of different blocks that overlap as one, by row and mesh frequency.

    Of its tongues those of the widest region come first.
    """
    found = regions.ordered()
    lower, upper = found.edges.T
    rows = by_row(found.row, int(found.row.max(initial=-1)) + 1)
    reach = np.concatenate([upper[:0], *(np.maximum.accumulate(upper[own]) for own in rows)])
    begin = np.append(True, (np.diff(found.row) > 0) | (lower[1:] >= reach[:-1]))[: len(lower)]
    first = np.flatnonzero(begin)
    several = np.diff(first, append=len(lower)) > 1
    if not several.any():
        return found
    groups = np.split(np.arange(len(lower)), first[1:])
    unions = [_union(found.subset(groups[k])) for k in np.flatnonzero(several)]
    return RegionEdges.joined([found.subset(first[~several]), *unions]).ordered()


def _union(group: RegionEdges) -> RegionEdges:
    ends = np.array([np.argmin(group.edges[:, 0]), np.argmax(group.edges[:, 1])])
    widest = np.argsort(group.edges[:, 0] - group.edges[:, 1], kind="stable")
    member = np.array(list(dict.fromkeys(group.subset(widest).member.tolist())))
    edges, error, cut = (part[ends, [0, 1]][None] for part in (group.edges, group.error, group.cut))
    return RegionEdges(group.row[:1], edges, error, cut, np.zeros(len(member), dtype=np.int64), member)


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
