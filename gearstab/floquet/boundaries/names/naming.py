"""The names of the unstable intervals of a pattern by the kernel in use: where to look, and what :mod:`labels
<gearstab.floquet.boundaries.names.labels>` makes of it.
"""

from __future__ import annotations

import numpy as np

from gearstab.ckernel import in_use
from gearstab.floquet.boundaries.counting.points import exact, first_modes
from gearstab.floquet.boundaries.names import labels
from gearstab.floquet.boundaries.names.labels import Root, Shares, Unnamed
from gearstab.floquet.boundaries.undamped.search import Interval, by_row
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

ASIDE = 0.03
"""Points near the edges of merged regions at which their tongues are looked for, as a part of the width."""
UNDEFLECTED = 1e-9
"""A modal mesh deflection below this part of the largest one is rounding."""


def named(pattern: Pattern, intervals: list[Interval], frequency: Array) -> tuple[list[tuple[Root, ...]], Array]:
    """The roots of each region, modes counted from 0, and the number of evaluations of each row.

    intervals: by row; frequency: ``(r, n)``, of the mean systems in the pattern's units.
    """
    owner, row, cycle = _points(intervals)
    extra = np.bincount(row, minlength=len(pattern.rows))
    if in_use():
        found = _compiled(pattern, intervals, frequency, owner, row, cycle)
    else:
        found = _reference(pattern, intervals, frequency, owner, row, cycle)
    return coupled(pattern, intervals, found), extra


def coupled(pattern: Pattern, intervals: list[Interval], names: list[tuple[Root, ...]]) -> list[tuple[Root, ...]]:
    """The roots of modes that act on each other; others pass through: a collision, but no tongue."""
    acting = _coupled(pattern.elastic.directions)
    return [
        roots if len(roots) == 1 else tuple(r for r in roots if acting[i.row, r.p, r.q]) or roots[:1]
        for i, roots in zip(intervals, names, strict=True)
    ]


def _points(intervals: list[Interval]) -> tuple[Array, Array, Array]:
    """(interval, row, cycle) where unstable solutions are looked for: in the middle, and near both edges of a region
    that may hold several tongues.
    """
    ends = np.array([(i.start, i.stop) for i in intervals]).reshape(-1, 2)
    several = np.array([sum(i.meetings) > 1 or any(i.cut) for i in intervals], dtype=bool)
    owner = np.repeat(np.arange(len(intervals)), np.where(several, 3, 1))
    place = np.full(len(owner), 0.5)
    first = np.searchsorted(owner, np.flatnonzero(several))
    place[first + 1], place[first + 2] = ASIDE, 1 - ASIDE
    row = np.array([i.row for i in intervals], dtype=int)[owner]
    return owner, row, ends[owner, 0] + place * (ends[owner, 1] - ends[owner, 0])


def _records(pattern: Pattern, row: Array, cycle: Array) -> Array:
    """Shares (:data:`gearstab.floquet.c_kernel.SHARE`) in the order of the points, which are ordered by row."""
    turn = first_modes(pattern, np.arange(len(pattern.rows)))
    return c_kernel.shares(exact(pattern), pattern, turn, row, cycle)


def _compiled(
    pattern: Pattern, intervals: list[Interval], frequency: Array, owner: Array, row: Array, cycle: Array
) -> list[tuple[Root, ...]]:
    found = _records(pattern, row, cycle)
    found["point"] = owner[found["point"]]
    of_region = np.array([i.row for i in intervals], dtype=int)
    middle = np.array([0.5 * (i.start + i.stop) for i in intervals])
    passed = np.array([i.passed for i in intervals], dtype=np.int64).reshape(-1, 3)
    meetings = np.array([_meetings(i) for i in intervals], dtype=np.int64).reshape(-1, 3)
    known = c_kernel.names(frequency, pattern.cycles, of_region, middle, passed, meetings, found)
    roots: dict[tuple[int, int, int], Root] = {}
    names: list[tuple[Root, ...]] = [()] * len(intervals)
    for region, p, q, cycles in known.tolist():
        key = p, q, cycles
        if key not in roots:
            roots[key] = Root(p, q, cycles)
        names[region] = (*names[region], roots[key])
    return names


def _reference(
    pattern: Pattern, intervals: list[Interval], frequency: Array, owner: Array, row: Array, cycle: Array
) -> list[tuple[Root, ...]]:
    shares: list[Shares] = [{} for _ in intervals]
    for k, there in zip(owner, labels.shares(pattern, row, cycle) if len(owner) else [], strict=True):
        for root, share in there.items():
            shares[k][root] = max(share, shares[k].get(root, 0.0))
    names: list[tuple[Root, ...]] = [()] * len(intervals)
    for k, mine in enumerate(by_row(np.array([i.row for i in intervals], dtype=int), len(pattern.rows))):
        unnamed = [
            Unnamed(0.5 * (i.start + i.stop), shares[j], i.passed, _meetings(i)) for j in mine for i in [intervals[j]]
        ]
        if unnamed:
            for j, own in zip(mine, labels.assign(unnamed, frequency[k], pattern.cycles), strict=True):
                names[j] = own
    return names


def _meetings(interval: Interval) -> tuple[int, int, int]:
    """Those inside; where the range cuts a region they are not all there."""
    return (0, 0, 0) if any(interval.cut) else interval.meetings


def _coupled(directions: Array) -> Array:
    """Which modes ``(r, n, n)`` are coupled by the meshes ``(r, meshes, n)``, directly or through others."""
    deflects = np.abs(directions) > UNDEFLECTED * np.abs(directions).max(axis=(1, 2), initial=0.0)[:, None, None]
    reached = np.swapaxes(deflects, 1, 2).astype(int) @ deflects > 0
    for _ in range(reached.shape[-1].bit_length()):
        reached = reached.astype(int) @ reached > 0
    return np.asarray(reached)
