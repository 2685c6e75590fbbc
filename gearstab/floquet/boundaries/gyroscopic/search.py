"""All intervals of instability of undamped systems with gyroscopic terms, however narrow, by covering the range.

Every point has a stretch around it on which its verdict cannot change (:mod:`.phases`). Points are added where
stretches leave gaps. Towards a collision of two multipliers, or an edge, the end of a stretch is known to second order
in the distance, so that gaps shrink quadratically: where they are below the width floor and the verdict on both sides
is the same nothing as wide is hidden, and where it is not there is an edge, which points on both sides confirm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.damped.proof import running_maximum
from gearstab.floquet.boundaries.damped.search import SearchResult, Stretches
from gearstab.floquet.boundaries.gyroscopic.phases import KreinPhases
from gearstab.floquet.boundaries.intervals import Intervals, paired, verdicts_at_ends
from gearstab.floquet.general.canonical import CanonicalPeriods
from gearstab.grouping import Columns, numbered
from gearstab.interrupts import heed
from gearstab.system import Array

FEWEST = 16
"""First points of a row."""
SHARE = 0.25
"""Part of the width floor to which gaps are closed."""
CLOSE = 0.1
"""Part of the tolerance to which an edge is closed in, before points on both sides confirm it."""
REACH = 2.2
"""Distance of new points in radii of the neighbours."""
AT_ONCE = 16
"""New points of a gap in one round, at most."""
ROUNDS = 60
MOST = 50_000
"""Points of a row, at most."""


def search(periods: CanonicalPeriods, first: Array, last: Array, tolerance: float, floor: float) -> SearchResult:
    """Find the intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``; tolerance, floor: relative.

    Rows in which a gap is left open are not counted; their step is the widest one.
    """
    found = VerdictCover(periods, np.log(first), np.log(last))
    count = len(first)
    found.add(np.repeat(np.arange(count), FEWEST), np.linspace(found.first, found.last, FEWEST, axis=1).ravel())
    for _ in range(ROUNDS):
        gaps = found.gaps()
        row, x = gaps.wanted(gaps.open(tolerance, floor) & (found.evaluations < MOST)[gaps.row])
        if len(row) == 0:
            break
        found.add(row, x)
    gaps = found.gaps()
    left = gaps.open(tolerance, floor)
    step, none = np.zeros(count), np.empty(0)
    np.maximum.at(step, gaps.row[left], gaps.width[left])
    closed = ~gaps.differ & ~found.unstable[gaps.before] & ~left
    edges = gaps.chosen(gaps.differ)
    intervals = found.intervals(edges, *found.confirmed(edges, tolerance), floor)
    k = np.flatnonzero(step == 0)
    return SearchResult(
        intervals, [none for _ in intervals], found.evaluations, Stretches(none.astype(int), none, none),
        Stretches(k, first[k], last[k]), step, step > 0, np.bincount(gaps.row[closed], minlength=count),
    )  # fmt: skip


@dataclass(frozen=True)
class VerdictGaps(Columns):
    """Gaps that stretches leave between neighbouring points ``before`` and ``before + 1``: left..right, and whether the
    verdicts differ; radius: the mean one of both.
    """

    row: Array
    before: Array
    left: Array
    right: Array
    differ: Array
    radius: Array

    @property
    def width(self) -> Array:
        """right - left."""
        return self.right - self.left

    def open(self, tolerance: float, floor: float) -> Array:
        """Return which are too wide."""
        return np.asarray(self.width > np.where(self.differ, CLOSE * tolerance, SHARE * floor))

    def wanted(self, chosen: Array) -> tuple[Array, Array]:
        """Return points (row, x) to look at in the chosen ones."""
        k = np.flatnonzero(chosen)
        width = self.width[k]
        count = np.ceil(width / (REACH * np.maximum(self.radius[k], width / (REACH * AT_ONCE)))).astype(int)
        chosen_of, number = numbered(count)
        owner = k[chosen_of]
        return self.row[owner], self.left[owner] + self.width[owner] * (number + 0.5) / count[chosen_of]


class VerdictCover:
    """Points of rows in order of (row, x), x = ln(1/Omega): their verdicts, and the stretches on which these hold."""

    def __init__(self, periods: CanonicalPeriods, first: Array, last: Array) -> None:
        self.periods, self.first, self.last = periods, first, last
        self.row, self.unstable = np.empty(0, dtype=int), np.empty(0, dtype=bool)
        self.x, self.low, self.high = np.empty((3, 0))
        self.evaluations = np.zeros(len(first), dtype=np.int64)
        self.fastest = periods.radians(0.5 * (np.exp(-first) + np.exp(-last)))

    def look(self, row: Array, x: Array) -> KreinPhases:
        """Compute points."""
        heed()
        self.evaluations += np.bincount(row, minlength=len(self.first))
        cycle = np.exp(x)
        return KreinPhases.of(*self.periods.with_slope(row, cycle), 1 / (self.fastest[row] * cycle))

    def add(self, row: Array, x: Array) -> None:
        """Take in further points."""
        found = self.look(row, x)
        radius = found.radii()
        new = row, x, x - radius[:, 0], x + radius[:, 1], found.unstable
        own = (self.row, self.x, self.low, self.high, self.unstable)
        columns = [np.concatenate(pair) for pair in zip(own, new, strict=True)]
        order = np.lexsort((columns[1], columns[0]))
        self.row, self.x, self.low, self.high, self.unstable = (column[order] for column in columns)

    def gaps(self) -> VerdictGaps:
        """All of them."""
        change = (np.diff(self.row) > 0) | (self.unstable[1:] != self.unstable[:-1])
        run = np.append(0, np.cumsum(change))
        reach = running_maximum(run, self.high)
        back = -running_maximum(run[-1] - run[::-1], -self.low[::-1])[::-1]
        k = np.flatnonzero(np.diff(self.row) == 0)
        left, right, differ = reach[k], back[k + 1], self.unstable[k + 1] != self.unstable[k]
        # Where stretches of different verdicts overlap none of them is believed.
        wrong = differ & (np.maximum(left, self.x[k]) >= np.minimum(right, self.x[k + 1]))
        left, right = np.where(wrong, self.x[k], left), np.where(wrong, self.x[k + 1], right)
        radius = np.sqrt((self.high - self.x)[k] * (self.x - self.low)[k + 1])
        every = VerdictGaps(self.row[k], k, left, right, differ, radius)
        return every.chosen((right > left) & (self.x[k + 1] > self.x[k]))

    def confirmed(self, edges: VerdictGaps, tolerance: float) -> tuple[Array, Array]:
        """Where the edges are, and the widths of brackets of points on both sides ``(E,)``."""
        middle, before = 0.5 * (edges.left + edges.right), self.unstable[edges.before]
        low, high = self.x[edges.before], self.x[edges.before + 1]
        inner = np.stack([np.maximum(middle - 0.5 * tolerance, low), np.minimum(middle + 0.5 * tolerance, high)])
        while True:
            wide = np.flatnonzero(high - low > 1.01 * tolerance)
            if len(wide) == 0:
                break
            row = edges.row[wide]
            for x in inner[:, wide]:
                # One of the two halves otherwise.
                beyond = self.look(row, x).unstable != before[wide]
                high[wide[beyond]] = np.minimum(high[wide[beyond]], x[beyond])
                low[wide[~beyond]] = np.maximum(low[wide[~beyond]], x[~beyond])
            inner = 0.5 * (low + high)[None]
        return 0.5 * (low + high), high - low

    def intervals(self, edges: VerdictGaps, place: Array, width: Array, floor: float) -> Intervals:
        """Pair the edges of each row."""
        cycle, ends = np.exp(place), np.exp(np.stack([self.first, self.last]))
        return paired(ends, edges.row, cycle, width * cycle, verdicts_at_ends(self.row, self.unstable), floor)
