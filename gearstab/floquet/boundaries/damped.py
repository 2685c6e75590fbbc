"""Edges of damped regions: zeros of the growth rate, with the regions of the undamped system as a guide.

The growth rate g(Omega) is continuous, not smooth, and its positive parts may be much narrower than any scan. Without
damping regions are found with certainty (:mod:`~gearstab.floquet.boundaries.search`); damping takes from their
growth, so that what is left lies inside them when all modes decay alike, and inside or around them when they do not:
to first order the growth is greatest in the middle of a tongue, whatever the damping, while its edges may move
outwards (see :mod:`gearstab.perturbation.damped`). Hence g is sampled in and about every undamped region, and on a
scan uniform in the period that finds what has moved far. Local maxima below zero that may reach it are refined, and
so are minima above: smooth ones, and the corners where one solution takes over from another as the fastest, which are
recognised by the change of its eigenvector. Sign changes are bracketed and refined with Chandrupatla's method (1997,
Adv. Eng. Softw. 28, 145-149), which mixes inverse quadratic interpolation and bisection.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearstab.floquet.boundaries import search as undamped
from gearstab.floquet.boundaries.krein import spectrum
from gearstab.floquet.boundaries.points import exact, propagate
from gearstab.floquet.boundaries.search import Interval, Search
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.kernel import damped as general
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.solution import DAMPED_ON_CIRCLE
from gearstab.system import Array

REFINEMENTS = 16
"""Rounds in which extrema are refined."""
OPTIMISM = 2.0
"""An extremum is refined while this many times the gain that a parabola promises would cross zero."""
LEAST = 6
"""Parts into which an undamped region is divided at least."""
ASIDE = 0.2
"""Where g is sampled beside an undamped region, in parts of its width."""
SHARPNESS = 4.0
"""The same for a corner, to which the growth falls like a square root."""
DOUBTFUL_GAIN = 0.1
"""The least gain to be hoped for, as a part of the height of the extremum over its neighbours."""


DENSITY = 16
"""Samples a collision inside unstable ranges, of the system and of the undamped one."""
SAME = 0.5
"""Squared overlap of the fastest solutions of neighbouring samples above which they are one branch."""
UNDAMPED = 1e-8
"""Decay a period below which a solution counts as undamped."""
CLOSEST = 1e-5
"""Relative distance down to which a change of branch is followed."""
NO_GROWTH = 1e-13
"""Real part of an exponent, over the root of the mean squared frequency, that rounding gives to one without decay."""


class Growth:
    """The growth rate of a pattern's rows at points, and how often it was asked for."""

    def __init__(self, pattern: Pattern) -> None:
        self.pattern = pattern
        damping = pattern.elastic.damping
        self.fine = exact(pattern)
        self.generator = None if damping is None else general.generators(self.fine, damping)
        self.count = np.zeros(len(pattern.rows), dtype=np.int64)
        self.noise = np.zeros(len(pattern.rows))

    def settle(self, row: Array, value: Array, cycle: Array) -> Array:
        """Find the rows with an undamped mode, whose growth never falls below zero but for rounding: there a growth a
        period up to DAMPED_ON_CIRCLE is none. Returns the samples ``(P,)`` corrected for that.
        """
        lowest = np.zeros(len(self.count))
        period = 2 * np.pi * self.pattern.cycles * cycle
        np.minimum.at(lowest, row, value * period)
        self.noise = np.where(lowest > -UNDAMPED, DAMPED_ON_CIRCLE, 0.0)
        return value - self.noise[row] / period

    def __call__(self, row: Array, cycle: Array) -> tuple[Array, Array]:
        """Largest real part of the exponents ``(P,)``, in the pattern's units, at most 0 where stable; the initial
        state of that solution, a unit vector ``(P, m)``.
        """
        self.count += np.bincount(row, minlength=len(self.count))
        period = 2 * np.pi * self.pattern.cycles * cycle
        if self.generator is None:
            growth, vectors = self._uniform(row, cycle)
            return growth / period - self.pattern.elastic.shift[row] - self.noise[row] / period, vectors
        size = self.generator.matrix.shape[-1]
        result, vectors = np.empty(len(row)), np.empty((len(row), size), dtype=complex)
        for k, mine in enumerate(undamped.by_row(row, len(self.count))):
            if len(mine) == 0:
                continue
            kernel.record("numpy")
            matrix, scale = general.monodromy(self.generator, self.fine, k, 1 / cycle[mine])
            result[mine], vectors[mine] = _fastest(matrix)
            result[mine] += scale
        return (result - self.noise[row]) / period, vectors

    def _uniform(self, row: Array, cycle: Array) -> tuple[Array, Array]:
        """ln max |lambda| without the decay common to all solutions; exactly 0 on the circle."""
        points = propagate(self.pattern, row, cycle)
        found = spectrum(np.where(points.finite[:, None, None], points.matrix, np.eye(2 * self.pattern.size)))
        logs = np.where(found.off & (found.values.imag >= 0), np.log(np.abs(found.values)), 0.0)
        best = logs.argmax(axis=1)
        each = np.arange(len(row))
        growth, vectors = logs[each, best], found.vectors[each, :, best]
        for k in np.flatnonzero(~points.finite):
            matrix, scale = kernel.current().monodromy(self.fine, int(row[k]), 1 / cycle[k : k + 1])
            fastest = _fastest(matrix)
            growth[k], vectors[k] = fastest[0][0] + scale[0], fastest[1][0]
        return growth, vectors


def _fastest(matrix: Array) -> tuple[Array, Array]:
    """ln |lambda| and eigenvector of the largest eigenvalue of ``(P, m, m)``; of a complex pair, that of positive
    imaginary part.
    """
    values, vectors = np.linalg.eig(matrix)
    with np.errstate(divide="ignore"):
        logs = np.where(values.imag >= 0, np.log(np.abs(values)), -np.inf)
    best = logs.argmax(axis=1)
    each = np.arange(len(matrix))
    return logs[each, best], vectors[each, :, best]


class Table:
    """Samples of g, ordered by row and cycle."""

    def __init__(self, growth: Growth, row: Array, cycle: Array) -> None:
        self.growth = growth
        self.row, self.cycle = row, cycle
        self.value, self.vector = growth(row, cycle)
        self.value = growth.settle(row, self.value, cycle)
        self._sort()

    def add(self, row: Array, cycle: Array) -> None:
        """Sample further points."""
        if len(row) == 0:
            return
        value, vector = self.growth(row, cycle)
        self.value, self.vector = np.append(self.value, value), np.append(self.vector, vector, axis=0)
        self.row, self.cycle = np.append(self.row, row), np.append(self.cycle, cycle)
        self._sort()

    def _sort(self) -> None:
        order = np.lexsort((self.cycle, self.row))
        new = np.ones(len(order), dtype=bool)
        new[1:] = (np.diff(self.row[order]) > 0) | (np.diff(self.cycle[order]) > 0)
        kept = order[new]
        self.row, self.cycle, self.value, self.vector = (
            x[kept] for x in (self.row, self.cycle, self.value, self.vector)
        )


def search(
    pattern: Pattern, guide: Pattern, first: Array, last: Array, tolerance: float, floor: float
) -> tuple[Search, Search]:
    """Intervals of positive growth of all rows between the cycles ``first`` and ``last`` ``(r,)``, in the pattern's
    units.

    Returns (the damped intervals, those of the guide); all evaluations are counted in the first.
    guide: the same rows without damping.
    """
    if _constant(pattern):
        none = undamped.Search([], *np.zeros((2, len(first)), dtype=np.int64))
        return none, none
    found = undamped.search(guide, first, last, max(tolerance, 0.1 * floor), floor)
    spacing = (last - first) / undamped.collisions(pattern, first, last) / DENSITY
    row, cycle = _scan(pattern, found.intervals, first, last, spacing)
    table = Table(Growth(pattern), row, cycle)
    table.add(*_fill(table, spacing))
    for _ in range(REFINEMENTS):
        where, fresh = _extrema(table, floor)
        if len(where) == 0:
            break
        table.add(where, fresh)
    change = np.flatnonzero((table.row[1:] == table.row[:-1]) & ((table.value[1:] > 0) != (table.value[:-1] > 0)))
    root, error = _roots(table, change, tolerance)
    intervals = _intervals(table, change, root, error, floor)
    return Search(intervals, found.contacts, found.evaluations + table.growth.count), found


def _constant(pattern: Pattern) -> bool:
    """Whether the stiffness of no row varies and nothing grows."""
    if pattern.stiffness.shape[1] > 1 or pattern.elastic.damping is None:
        return False
    return bool(general.generators(pattern, pattern.elastic.damping).eigen[0].real.max() <= NO_GROWTH)


def growing(pattern: Pattern) -> Array:
    """``(r,)``: which coordinate of the mean system grows most by itself, its velocity standing for a rigid-body mode
    after the n elastic ones; -1 where none grows.
    """
    rows, n = len(pattern.rows), pattern.size
    result = np.full(rows, -1)
    if pattern.elastic.damping is None:
        return np.where(pattern.elastic.shift < 0, 0, result) if n else result
    mean = np.einsum("rs,rsij->rij", pattern.fractions, pattern.stiffness[:, pattern.states])
    values, vectors, _ = general.generators(replace(pattern, stiffness=mean[:, None]), pattern.elastic.damping).eigen
    fastest = values[:, 0].real.argmax(axis=1)
    each = np.arange(rows)
    share = np.abs(vectors[each, 0, n:, fastest])
    return np.where(values[each, 0, fastest].real > NO_GROWTH, share.argmax(axis=1), result)


def _scan(pattern: Pattern, guides: list[Interval], first: Array, last: Array, spacing: Array) -> tuple[Array, Array]:
    """Uniform in the period, and inside and just outside every undamped region."""
    count = undamped.collisions(pattern, first, last)
    row = np.repeat(np.arange(len(first)), count)
    place = np.concatenate([np.linspace(0, 1, c) for c in count])
    cycle = first[row] + (last - first)[row] * place
    cycle[np.cumsum(count) - 1] = last
    counts = [max(LEAST, int(np.ceil((i.stop - i.start) / spacing[i.row]))) for i in guides]
    owner = np.repeat([i.row for i in guides], [c + 3 for c in counts]).astype(int)
    parts = [np.linspace(i.start, i.stop, c + 1) for i, c in zip(guides, counts, strict=True)]
    aside = [[i.start - ASIDE * (i.stop - i.start), i.stop + ASIDE * (i.stop - i.start)] for i in guides]
    more = np.concatenate([np.concatenate(pair) for pair in zip(parts, aside, strict=True)] or [np.empty(0)])
    inside = (more > first[owner]) & (more < last[owner])
    return np.append(row, owner[inside]), np.append(cycle, more[inside])


def _extrema(table: Table, floor: float) -> tuple[Array, Array]:
    """Where to look next for a maximum that may exceed zero, or a minimum that may fall below."""
    r, x, g = table.row, table.cycle, table.value
    if len(r) < 3:
        return np.empty(0, dtype=int), np.empty(0)
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
    wanted = (r[2:] == r[:-2]) & (fb >= fa) & (fb >= fc) & (fb + OPTIMISM * gain > 0) & (c - a > floor * b)
    wider = np.where(c - b > b - a, b + 0.38 * (c - b), b - 0.38 * (b - a))
    top = np.where(np.abs(top - b) < 0.05 * (c - a), wider, top)
    top = np.clip(top, a + 0.1 * (b - a), c - 0.1 * (c - b))
    owner, corner = _corners(table, floor)
    return np.append(r[1:-1][wanted], owner), np.append(top[wanted], corner)


def _corners(table: Table, floor: float) -> tuple[Array, Array]:
    """Where g may fall below zero between two samples above it, as one solution takes over from another as the fastest.

    Where the lines through the two samples on either side meet below zero; in the middle, where the fastest solutions
    differ.
    """
    r, x, g = table.row, table.cycle, table.value
    if len(r) < 4:
        return np.empty(0, dtype=int), np.empty(0)
    b, c, low = x[1:-2], x[2:-1], np.minimum(g[1:-2], g[2:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (g[1:-2] - g[:-3]) / (b - x[:-3]), (g[3:] - g[2:-1]) / (x[3:] - c)
        meet = (g[2:-1] - g[1:-2] + left * b - right * c) / (left - right)
        value = g[1:-2] + left * (meet - b)
    sharp = (meet > b) & (meet < c) & (low < SHARPNESS * (low - value)) & (c - b > floor * b)
    first, second = table.vector[1:-2], table.vector[2:-1]
    overlap = np.maximum(*(np.abs(np.einsum("pi,pi->p", v, second)) ** 2 for v in (first, first.conj())))
    differ = (overlap < SAME) & (c - b > max(CLOSEST, floor) * b)
    wanted = (r[3:] == r[:-3]) & (low > 0) & (sharp | differ)
    place = np.where(sharp, np.clip(meet, b + 0.1 * (c - b), c - 0.1 * (c - b)), 0.5 * (b + c))
    return r[1:-2][wanted], place[wanted]


def _fill(table: Table, spacing: Array) -> tuple[Array, Array]:
    """Further points between samples above zero, so that they are no farther apart than ``spacing`` ``(r,)``; more
    where the sign changes, which may hide two further changes.
    """
    x = table.cycle
    width = np.diff(x)
    above = np.stack([table.value[1:], table.value[:-1]]) > 0
    limit = spacing[table.row[1:]] * np.where(above.all(axis=0), 1.0, 0.25)
    inside = (np.diff(table.row) == 0) & above.any(axis=0)
    count = np.where(inside, np.ceil(width / limit) - 1, 0).astype(int)
    owner = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 1
    return table.row[owner], x[owner] + width[owner] * number / (count[owner] + 1)


def _roots(table: Table, change: Array, tolerance: float) -> tuple[Array, Array]:
    """Zeros of g between neighbouring samples of opposite sign, and the widths of their brackets (Chandrupatla
    1997).
    """
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
        fx[active] = table.growth(row[active], x[active])[0]
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
    """Where between a (0) and b (1) to look next: inverse quadratic interpolation where it is monotone, else the
    middle.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        smooth = (1 - np.sqrt(1 - xi) < phi) & (phi < np.sqrt(xi))
        t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        least = 0.25 * tolerance * np.abs(a) / np.abs(b - a)
    t = np.where(smooth & np.isfinite(t), t, 0.5)
    return np.clip(t, np.minimum(least, 0.5), np.maximum(1 - least, 0.5))


def _intervals(table: Table, change: Array, root: Array, error: Array, floor: float) -> list[Interval]:
    """Pair the zeros of each row; a region that reaches an end of the range is cut there."""
    result = []
    rows = len(table.growth.count)
    samples_of, edges_of = undamped.by_row(table.row, rows), undamped.by_row(table.row[change], rows)
    for row, (mine, own) in enumerate(zip(samples_of, edges_of, strict=True)):
        edges = [(float(root[k]), float(error[k])) for k in own]
        low, high = table.cycle[mine[0]], table.cycle[mine[-1]]
        cut = (bool(table.value[mine[0]] > 0), bool(table.value[mine[-1]] > 0))
        edges = [(float(low), 0.0)] * cut[0] + edges + [(float(high), 0.0)] * cut[1]
        pairs = list(zip(edges[::2], edges[1::2], strict=True))
        for k, ((start, wrong), (stop, other)) in enumerate(pairs):
            ends = (cut[0] and k == 0, cut[1] and k == len(pairs) - 1)
            if stop - start > floor * start:
                result.append(Interval(row, start, stop, (0, 0, 0), (0, 0, 0), (wrong, other), ends))
    return result
