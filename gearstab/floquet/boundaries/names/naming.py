"""The names of the unstable intervals of a pattern: where to look, and what the compiled kernel makes of it
(:mod:`~gearstab.floquet.boundaries.names.labels`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.points import exact, first_modes
from gearstab.floquet.boundaries.intervals import Intervals
from gearstab.floquet.boundaries.names.labels import Root
from gearstab.floquet.kernel import c_boundaries
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

ASIDE = 0.03
"""Points near the edges of merged regions at which their tongues are looked for, as a part of the width."""
UNDEFLECTED = 1e-9
"""A modal mesh deflection below this part of the largest one is rounding."""


@dataclass(frozen=True, eq=False)
class Names:
    """The roots of the regions, as columns: owner ``(N,)``, ascending, the number of a region; root ``(N, 3)``: p, q,
    cycles of :class:`Root <gearstab.floquet.boundaries.names.labels.Root>`. Of a region the leading one comes first.
    """

    owner: Array
    root: Array

    @classmethod
    def of(cls, names: Sequence[tuple[Root, ...]]) -> Names:
        """The roots of each region as columns."""
        listed = [(k, r.p, r.q, r.cycles) for k, roots in enumerate(names) for r in roots]
        table = np.array(listed, dtype=np.int64).reshape(-1, 4)
        return cls(table[:, 0], table[:, 1:])

    def roots(self, count: int) -> list[tuple[Root, ...]]:
        """Return the root of each of so many regions."""
        result: list[tuple[Root, ...]] = [()] * count
        for k, root in zip(self.owner.tolist(), self.root.tolist(), strict=True):
            result[k] = (*result[k], Root(*root))
        return result


def named(pattern: Pattern, intervals: Intervals, frequency: Array) -> tuple[Names, Array]:
    """The roots of each region, modes counted from 0, and the number of evaluations of each row.

    intervals: by row; frequency: ``(r, n)``, of the mean systems in the pattern's units.
    """
    owner, row, cycle = _points(intervals)
    extra = np.bincount(row, minlength=len(pattern.rows))
    turn = first_modes(pattern, np.arange(len(pattern.rows)))
    shares = c_boundaries.shares(exact(pattern), pattern, turn, row, cycle)
    shares["point"] = owner[shares["point"]]
    middle = 0.5 * (intervals.start + intervals.stop)
    # Where the range cuts a region its meetings are not all there.
    meetings = np.where(np.any(intervals.cut, axis=1, keepdims=True), 0, intervals.meetings)
    known = c_boundaries.names(frequency, pattern.cycles, intervals.row, middle, intervals.passed, meetings, shares)
    found = Names(known["region"], np.stack([known[name] for name in ("p", "q", "cycles")], axis=1))
    return coupled(pattern, intervals, found), extra


def coupled(pattern: Pattern, intervals: Intervals, names: Names) -> Names:
    """The roots of modes that act on each other; others pass through: a collision, but no tongue."""
    row, (p, q, _) = intervals.row[names.owner], names.root.T
    acting: Array = _coupled(pattern.elastic.directions)[row, p, q]
    # A region of which nothing would be left keeps its leading name.
    leading = np.diff(names.owner, prepend=-1) > 0
    left = np.bincount(names.owner, acting, minlength=len(intervals))
    kept = acting | (leading & (left[names.owner] == 0))
    return Names(names.owner[kept], names.root[kept])


def _points(intervals: Intervals) -> tuple[Array, Array, Array]:
    """(interval, row, cycle) where unstable solutions are looked for: in the middle, and near both edges of a region
    that may hold several tongues.
    """
    several = (intervals.meetings.sum(axis=1) > 1) | intervals.cut.any(axis=1)
    owner = np.repeat(np.arange(len(intervals)), np.where(several, 3, 1))
    place = np.full(len(owner), 0.5)
    first = np.searchsorted(owner, np.flatnonzero(several))
    place[first + 1], place[first + 2] = ASIDE, 1 - ASIDE
    return owner, intervals.row[owner], intervals.start[owner] + place * (intervals.stop - intervals.start)[owner]


def _coupled(directions: Array) -> Array:
    """Which modes ``(r, n, n)`` are coupled by the meshes ``(r, meshes, n)``, directly or through others."""
    deflects = np.abs(directions) > UNDEFLECTED * np.abs(directions).max(axis=(1, 2), initial=0.0)[:, None, None]
    reached = np.swapaxes(deflects, 1, 2).astype(int) @ deflects > 0
    for _ in range(reached.shape[-1].bit_length()):
        reached = reached.astype(int) @ reached > 0
    return np.asarray(reached)
