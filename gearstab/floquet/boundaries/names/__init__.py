"""Which modes and which frequency of excitation make a region unstable.

At epsilon = 0 a tongue is rooted where w_p + w_q = nu, nu = (M/N) Omega with the common period N 2 pi/Omega. How (p,
q, M) are carried on to finite epsilon: inside a tongue the growing Floquet solution is

    u(t) = exp(g t/T) sum_k c_k exp(i w_k t),    w_k = (psi + 2 pi k)/T,

and its Krein form vanishes. In the coordinates of the mean modes the form is the sum of the *actions* w_k |c_(k,
p)|^2 of all modes and frequencies, so that positive and negative frequencies balance. At epsilon = 0 there is one of
each, mode p at +w_p and mode q at -w_q, and their frequencies differ by nu: M = k - k'. At finite epsilon the largest
action of each sign takes their place. This is exact as long as one part carries more than half of its sign's action:
parts are continuous in epsilon, and two cannot exceed one half. Beyond that, and where tongues have merged, each row
distributes the roots over its regions, each once, so that the sum of the shares is greatest: a region has as many
roots of each class (meetings at +1: p = q, M even; at -1: p = q, M odd; elsewhere: p < q) as its meetings say, and a
root is preferred where the number of collisions of its class since T = 0 says that it is its turn. (The nearest root
w_p + w_q = nu, in contrast, is wrong as soon as tongues have shifted by their distance.) The phase of a multiplier
alone cannot tell: it is defined modulo 2 pi and is passed on where two positive multipliers avoid each other.

Here are the parts that all regions share, and the names of those of undamped patterns: where to look, and what the
compiled kernel makes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.points import exact, first_modes
from gearstab.floquet.boundaries.parts import Intervals
from gearstab.floquet.kernel import c_boundaries
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

BAND = 1.25
"""Frequencies up to this times the largest natural frequency of any state are looked at."""
LEADING = 5
"""Parts of each sign that are looked at,"""
LEAST = 1e-3
"""unless they carry less than this of the action of their sign."""
ASIDE = 0.03
"""Points near the edges of merged regions at which their tongues are looked for, as a part of the width."""
UNDEFLECTED = 1e-9
"""A modal mesh deflection below this part of the largest one is rounding."""


@dataclass(frozen=True, order=True)
class Root:
    """Where a tongue is rooted: modes p <= q, counted from 0, M = nu N/Omega, and whether their difference is meant.

    Of a motion that grows by itself p = q, and there are no cycles.
    """

    p: int
    q: int
    cycles: int
    difference: bool = False


Shares = dict[Root, float]
"""How much of the action of an unstable solution a root accounts for, at most 1."""


def nearest_sum(turns: Array) -> tuple[int, int, int]:
    """(p, q, cycles) of the sum of two of the turns ``(n,)`` a common period that is nearest to a whole number of them,
    of equally near ones the least.
    """
    p, q = np.triu_indices(len(turns))
    total = turns[p] + turns[q]
    cycles = np.maximum(np.rint(total), 1)
    # Equally near is what agrees to six digits: the middle of an interval is no better known.
    best = np.lexsort((cycles, np.round(np.abs(total / cycles - 1), 6)))[0]
    return int(p[best]), int(q[best]), int(cycles[best])


def leading_roots(action: Array) -> Shares:
    """Pairs of the leading positive and negative parts of ``(n, K)``; the share is the smaller one of the two."""
    found: Shares = {}
    flat = action.ravel()
    order = np.argsort(flat)
    positive, negative = flat[flat > 0].sum(), flat[flat < 0].sum()
    for up in order[::-1][:LEADING]:
        for down in order[:LEADING]:
            if flat[up] <= LEAST * positive or flat[down] >= LEAST * negative:
                continue
            (p, k), (q, j) = divmod(int(up), action.shape[1]), divmod(int(down), action.shape[1])
            root = Root(min(p, q), max(p, q), k - j)
            found[root] = max(found.get(root, 0.0), float(min(flat[up] / positive, flat[down] / negative)))
    return found


@dataclass(frozen=True, eq=False)
class Names:
    """The roots of the regions, as columns: owner ``(N,)``, ascending, the number of a region; root ``(N, 3)``: p, q,
    cycles of :class:`Root <gearstab.floquet.boundaries.names.Root>`. Of a region the leading one comes first.
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


def named(pattern: Pattern, intervals: Intervals, squared: Array) -> tuple[Names, Array]:
    """The roots of each region, modes counted from 0, and the number of evaluations of each row.

    intervals: by row; squared: ``(r, n)``, frequencies of the mean systems in the pattern's units, squared.
    """
    owner, row, cycle = _points(intervals)
    extra = np.bincount(row, minlength=len(pattern.rows))
    turn = first_modes(pattern, np.arange(len(pattern.rows)))
    shares = c_boundaries.shares(exact(pattern), pattern, squared, turn, row, cycle)
    shares["point"] = owner[shares["point"]]
    middle = 0.5 * (intervals.start + intervals.stop)
    # Where the range cuts a region its meetings are not all there.
    meetings = np.where(np.any(intervals.cut, axis=1, keepdims=True), 0, intervals.meetings)
    frequency = np.sqrt(np.maximum(squared, 0.0))
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
