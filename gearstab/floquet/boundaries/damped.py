"""Edges of damped regions: zeros of the growth rate, with the regions of the undamped system as a guide.

The growth rate g(Omega) is continuous, not smooth, and its positive parts may be much narrower than any scan. Without damping
regions are found with certainty (:mod:`~gearstab.floquet.boundaries.search`); damping takes from their growth, so that what is left lies
inside them when all modes decay alike, and inside or around them when they do not: to first order
the growth is greatest in the middle of a tongue, whatever the damping, while its edges may move outwards (see
:mod:`gearstab.perturbation.damped`). Hence g is sampled at the edges and the middle of every undamped region, and on a scan uniform in the
period that finds what has moved far; local maxima below zero that may reach it (and minima above) are refined; sign changes are bracketed
and refined with Chandrupatla's method (1997, Adv. Eng. Softw. 28, 145-149), which mixes inverse quadratic interpolation and bisection.
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet import damped as general
from gearstab.floquet import kernel
from gearstab.floquet.boundaries import search as undamped
from gearstab.floquet.boundaries.krein import spectrum
from gearstab.floquet.boundaries.points import propagate
from gearstab.floquet.boundaries.search import Interval, Search
from gearstab.floquet.segments import Pattern
from gearstab.floquet.solve import DAMPED_ON_CIRCLE
from gearstab.system import Array

REFINEMENTS = 16
"""Rounds in which extrema are refined."""
OPTIMISM = 2.0
"""An extremum is refined while this many times the gain that a parabola promises would cross zero."""
DOUBTFUL_GAIN = 0.1
"""The least gain to be hoped for, as a part of the height of the extremum over its neighbours."""


class Growth:
    """The growth rate of a pattern's rows at points, and how often it was asked for."""

    def __init__(self, pattern: Pattern) -> None:
        self.pattern = pattern
        self.generator = None if pattern.elastic.damping is None else general.generators(pattern)
        self.count = np.zeros(len(pattern.rows), dtype=np.int64)

    def __call__(self, row: Array, cycle: Array) -> Array:
        """Largest real part of the exponents ``(P,)``, in the pattern's units; at most 0 where stable."""
        self.count += np.bincount(row, minlength=len(self.count))
        period = 2 * np.pi * self.pattern.cycles * cycle
        if self.generator is None:
            return self._uniform(row, cycle) / period - self.pattern.elastic.shift[row]
        result = np.empty(len(row))
        for k in np.unique(row):
            mine = np.flatnonzero(row == k)
            matrix, scale = general.monodromy(self.generator, self.pattern, int(k), 1 / cycle[mine])
            with np.errstate(divide="ignore"):
                result[mine] = np.log(np.abs(np.linalg.eigvals(matrix)).max(axis=1)) + scale
        return (result - DAMPED_ON_CIRCLE) / period

    def _uniform(self, row: Array, cycle: Array) -> Array:
        """ln max |lambda| without the decay common to all solutions; exactly 0 on the circle."""
        points = propagate(self.pattern, row, cycle)
        found = spectrum(np.where(points.finite[:, None, None], points.matrix, np.eye(2 * self.pattern.size)))
        growth = np.where(found.off, np.log(np.abs(found.values)), 0.0).max(axis=1)
        for k in np.flatnonzero(~points.finite):
            matrix, scale = kernel.current().monodromy(self.pattern, int(row[k]), 1 / cycle[k : k + 1])
            growth[k] = np.log(np.abs(np.linalg.eigvals(matrix[0])).max()) + scale[0]
        return growth


class Table:
    """Samples of g, ordered by row and cycle."""

    def __init__(self, growth: Growth, row: Array, cycle: Array) -> None:
        self.growth = growth
        self.row, self.cycle, self.value = row, cycle, growth(row, cycle)
        self._sort()

    def add(self, row: Array, cycle: Array) -> None:
        """Sample further points."""
        self.value = np.append(self.value, self.growth(row, cycle))
        self.row, self.cycle = np.append(self.row, row), np.append(self.cycle, cycle)
        self._sort()

    def _sort(self) -> None:
        order = np.lexsort((self.cycle, self.row))
        self.row, self.cycle, self.value = self.row[order], self.cycle[order], self.value[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (np.diff(self.row) > 0) | (np.diff(self.cycle) > 0)
        self.row, self.cycle, self.value = self.row[new], self.cycle[new], self.value[new]


def search(pattern: Pattern, guide: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Intervals of positive growth of all rows between the cycles ``first`` and ``last`` ``(r,)``, in the pattern's units.

    guide: the same rows without damping (or, for a decay common to all solutions, the pattern itself, taken without its shift).
    """
    found = undamped.search(guide, first, last, max(tolerance, 0.1 * floor), floor)
    row, cycle = _scan(pattern, found.intervals, first, last)
    table = Table(Growth(pattern), row, cycle)
    for _ in range(REFINEMENTS):
        where, fresh = _extrema(table, floor)
        if len(where) == 0:
            break
        table.add(where, fresh)
    change = np.flatnonzero((table.row[1:] == table.row[:-1]) & ((table.value[1:] > 0) != (table.value[:-1] > 0)))
    root, error = _roots(table, change, tolerance)
    intervals = _intervals(table, change, root, error, found.intervals, floor)
    return Search(intervals, found.contacts, found.evaluations + table.growth.count)


def _scan(pattern: Pattern, guides: list[Interval], first: Array, last: Array) -> tuple[Array, Array]:
    """Uniform in the period, with the edges and the middle of every undamped region."""
    count = undamped.collisions(pattern, first, last)
    row = np.repeat(np.arange(len(first)), count)
    place = np.concatenate([np.linspace(0, 1, c) for c in count])
    cycle = first[row] + (last - first)[row] * place
    cycle[np.cumsum(count) - 1] = last
    extra = [(i.row, c) for i in guides for c in (i.start, 0.5 * (i.start + i.stop), i.stop)]
    more = np.array(extra).reshape(-1, 2)
    return np.append(row, more[:, 0].astype(int)), np.append(cycle, more[:, 1])


def _extrema(table: Table, floor: float) -> tuple[Array, Array]:
    """Where to look next for a maximum that may exceed zero, or a minimum that may fall below."""
    r, x, g = table.row, table.cycle, table.value
    if len(r) < 3:
        return np.empty(0, dtype=int), np.empty(0)
    whole = r[2:] == r[:-2]
    a, b, c = x[:-2], x[1:-1], x[2:]
    sign = np.where(g[1:-1] <= 0, 1.0, -1.0)
    fa, fb, fc = sign * g[:-2], sign * g[1:-1], sign * g[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
        bend = (right - left) / (c - a)
        # The parabola's vertex; kept off the three points, which would tell nothing new.
        top = 0.5 * (a + b) - left / (2 * bend)
        gain = np.maximum(fa + (top - a) * (left + (top - b) * bend) - fb, 0.0)
    top = np.where(np.isfinite(top), top, b)
    gain = np.maximum(np.where(np.isfinite(gain), gain, 0.0), DOUBTFUL_GAIN * (fb - np.minimum(fa, fc)))
    wanted = whole & (fb >= fa) & (fb >= fc) & (fb + OPTIMISM * gain > 0) & (c - a > floor * b)
    wider = np.where(c - b > b - a, b + 0.38 * (c - b), b - 0.38 * (b - a))
    close = np.abs(top - b) < 0.05 * (c - a)
    top = np.clip(np.where(close, wider, top), a + 0.1 * (b - a), c - 0.1 * (c - b))
    return r[1:-1][wanted], top[wanted]


def _roots(table: Table, change: Array, tolerance: float) -> tuple[Array, Array]:
    """Zeros of g between neighbouring samples of opposite sign, and the widths of their brackets (Chandrupatla 1997)."""
    row = table.row[change]
    a, b = table.cycle[change + 1].copy(), table.cycle[change].copy()
    fa, fb = table.value[change + 1].copy(), table.value[change].copy()
    c, fc = a.copy(), fa.copy()
    t = np.full(len(a), 0.5)
    for _ in range(100):
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        limit = 0.5 * tolerance * best
        active = np.flatnonzero(np.abs(b - a) > 2 * limit)
        if len(active) == 0:
            break
        x = a + t * (b - a)
        fx = np.zeros_like(x)
        fx[active] = table.growth(row[active], x[active])
        done = np.ones(len(a), dtype=bool)
        done[active] = False
        same = (fx > 0) == (fa > 0)
        nc, nfc = np.where(same, a, b), np.where(same, fa, fb)
        nb, nfb = np.where(same, b, a), np.where(same, fb, fa)
        c, fc, b, fb = (np.where(done, old, new) for old, new in ((c, nc), (fc, nfc), (b, nb), (fb, nfb)))
        a, fa = np.where(done, a, x), np.where(done, fa, fx)
        t = _step(a, b, c, fa, fb, fc, tolerance)
    return np.where(np.abs(fa) < np.abs(fb), a, b), np.abs(b - a)


def _step(a: Array, b: Array, c: Array, fa: Array, fb: Array, fc: Array, tolerance: float) -> Array:
    """Where between a (0) and b (1) to look next: inverse quadratic interpolation where it is monotone, else the middle."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        smooth = (1 - np.sqrt(1 - xi) < phi) & (phi < np.sqrt(xi))
        t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        least = 0.25 * tolerance * np.abs(a) / np.abs(b - a)
    t = np.where(smooth & np.isfinite(t), t, 0.5)
    return np.clip(t, np.minimum(least, 0.5), np.maximum(1 - least, 0.5))


def _intervals(
    table: Table, change: Array, root: Array, error: Array, guides: list[Interval], floor: float
) -> list[Interval]:
    """Pair the zeros of each row; a region that reaches an end of the range is cut there."""
    result = []
    for row in range(len(table.growth.count)):
        mine = np.flatnonzero(table.row == row)
        edges = [(float(root[k]), float(error[k])) for k in np.flatnonzero(table.row[change] == row)]
        low, high = table.cycle[mine[0]], table.cycle[mine[-1]]
        cut = (bool(table.value[mine[0]] > 0), bool(table.value[mine[-1]] > 0))
        edges = [(float(low), 0.0)] * cut[0] + edges + [(float(high), 0.0)] * cut[1]
        near = [i for i in guides if i.row == row]
        pairs = list(zip(edges[::2], edges[1::2], strict=True))
        for k, ((start, wrong), (stop, other)) in enumerate(pairs):
            ends = (cut[0] and k == 0, cut[1] and k == len(pairs) - 1)
            if stop - start > floor * start:
                probe = _probe(0.5 * (start + stop), near)
                result.append(Interval(row, start, stop, (0, 0, 0), (wrong, other), ends, probe))
    return result


def _probe(middle: float, guides: list[Interval]) -> float:
    """The point of an undamped region that is nearest to the middle of a damped one, a little inside."""
    inside = [min(max(middle, i.start + 0.1 * (i.stop - i.start)), i.stop - 0.1 * (i.stop - i.start)) for i in guides]
    return min(inside, key=lambda x: abs(x - middle), default=middle)
