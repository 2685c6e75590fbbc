"""All unstable intervals of a conservative pattern along the period, by refinement of brackets.

A bracket lies between two neighbouring samples of a row. Its integers
(:mod:`~gearstab.floquet.boundaries.counting.krein`) say what it holds:

* nothing (both ends stable, equal C; or nowhere stable: begun at the left end exceeds ended at the right end): done;
* exactly one edge (one end stable, the integers of the two agree, no third multiplier near): refined to the tolerance;
* narrow: both ends stable, C differs: tongues or contacts; refined until an unstable sample or the width floor is met;
* open: anything else, e.g. two unstable ends that may have a stable gap between them: halved.

All brackets of all rows are refined at once, one point a bracket and round. Points are proposed by interpolation of
the detuning of the colliding pair (:mod:`~gearstab.floquet.boundaries.counting.pairs`), and by halving where that does
not help; what counts is only the verdict at the point, so that every edge ends between two samples that are a
tolerance apart.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from gearstab.floquet.boundaries.counting.krein import evaluate
from gearstab.floquet.boundaries.counting.pairs import COMBINATION, SELF
from gearstab.floquet.boundaries.intervals import Interval, Intervals, by_row
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

NOTHING, ENTRANCE, EXIT, NARROW, OPEN = range(5)

CHUNK = 20000
"""Matrix entries (points times n^2) treated at once."""
COARSEST = 6
"""Samples of a row that has hardly any collisions."""
PATIENCE = 4
"""Rounds of interpolation in which a bracket must halve."""
NEAR = 1.2
"""Margin by which a pair must miss each other for a bracket to be empty, and a third multiplier for one edge."""
SMALL = 0.26
"""Part of the scan's spacing: brackets whose integers are unknown are taken at face value below, after two halvings."""
ELSEWHERE = 0.11
"""Part of a bracket by which to go off its middle, to either side in turn, for each time that it told nothing."""
CLOSED, BESIDE = 0.8, 0.45
"""A tongue predicted to be narrower than the first part of the floor is enclosed between stable points at the second
part of the floor from it, on both sides."""
WITHIN = 0.4
"""Part of the tolerance: the least distance of a proposed edge from the ends of its bracket."""
ATTEMPTS = 4
"""Points tried where signs are lost in rounding, before a bracket is left as it is."""
ROUNDS = 200
ROUNDED = 2.0**-46
"""Relative error of where a verdict changes, 64 eps: phases of some ten turns are right to a few eps each."""


@dataclass
class Samples:
    """What is known at the points sampled so far; see :class:`~gearstab.floquet.boundaries.counting.krein.Verdicts`.

    row, cycle ``(P,)``; ahead, behind ``(2, 2, P)``: detuning and coupling of each class.
    """

    row: Array
    cycle: Array
    stable: Array
    begun: Array
    ended: Array
    known: Array
    real: Array
    ahead: Array
    behind: Array
    soon: Array
    since: Array
    crowded: Array
    crowding: Array

    def __len__(self) -> int:
        return len(self.row)

    def joined(self, other: Samples) -> Samples:
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Samples(*(np.concatenate(pair, axis=-1) for pair in pairs))


@dataclass
class Brackets:
    """Intervals between neighbouring samples: positions ``(B,)`` of the ends, and of the end that was replaced last
    (-1: none).

    age, width: rounds of interpolation and the width when they began; failures: points that told nothing.
    """

    left: Array
    right: Array
    old: Array
    age: Array
    width: Array
    failures: Array

    def subset(self, index: Array) -> Brackets:
        return Brackets(*(getattr(self, f.name)[index] for f in fields(self)))


@dataclass(frozen=True)
class Search:
    """intervals: by row and ascending cycle. contacts ``(r,)``: collisions that open no interval wider than the
    floor. evaluations ``(r,)``: monodromy matrices computed.
    """

    intervals: Intervals
    contacts: Array
    evaluations: Array


def sample(pattern: Pattern, row: Array, cycle: Array) -> Samples:
    """Evaluate points in chunks."""
    step = max(1, CHUNK // pattern.size**2)
    parts = []
    for i in range(0, len(row), step):
        part = slice(i, i + step)
        v = evaluate(pattern, row[part], cycle[part])
        ahead = np.stack([v.ahead.detuning, v.ahead.coupling])
        behind = np.stack([v.behind.detuning, v.behind.coupling])
        verdicts = v.stable, v.begun, v.ended, v.known, v.real
        times = v.soon, v.since, v.crowded, v.crowding
        parts.append(Samples(row[part], cycle[part], *verdicts, ahead, behind, *times))
    total = parts[0]
    for more in parts[1:]:
        total = total.joined(more)
    return total


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, 1/Omega in the pattern's
    units.

    tolerance, floor: relative to Omega.
    """
    if len(pattern.states) == 1 and np.all(pattern.squared_frequency > 0):
        # Constant stiffness: multipliers only pass through each other.
        return Search(Intervals.of([]), *np.zeros((2, len(first)), dtype=np.int64))
    samples, brackets = _scan(pattern, first, last)
    spacing = np.full(len(first), np.inf)
    np.minimum.at(spacing, samples.row[brackets.left], samples.cycle[brackets.right] - samples.cycle[brackets.left])
    evaluations = np.bincount(samples.row, minlength=len(first))
    contacts = np.zeros(len(first), dtype=np.int64)
    edges: list[tuple[Array, ...]] = []
    for _ in range(ROUNDS):
        kind = classify(samples, brackets, spacing)
        least = np.where(samples.stable[brackets.left] != samples.stable[brackets.right], tolerance, floor)
        wide = _width(samples, brackets) > least * samples.cycle[brackets.left]
        more = (kind != NOTHING) & wide & (brackets.failures < ATTEMPTS)
        finished = brackets.subset(np.flatnonzero((kind != NOTHING) & ~more))
        _finish(samples, finished, kind[(kind != NOTHING) & ~more], edges, contacts)
        brackets, kind = brackets.subset(np.flatnonzero(more)), kind[more]
        if len(brackets.left) == 0:
            break
        cycle = propose(samples, brackets, kind, tolerance, floor)
        fresh = sample(pattern, samples.row[brackets.left], cycle)
        evaluations += np.bincount(fresh.row, minlength=len(first))
        samples, brackets = _divide(samples, fresh, brackets)
    left, right = (np.concatenate(part) for part in zip(*edges, strict=True))
    places, extra = _halved(pattern, samples, left, right, tolerance)
    intervals = _assemble(samples, left, right, places, first, last, floor)
    return Search(intervals, contacts, evaluations + extra)


def _scan(pattern: Pattern, first: Array, last: Array) -> tuple[Samples, Brackets]:
    """About one sample a collision, uniform in the period, and the brackets between them."""
    count = collisions(pattern, first, last)
    row = np.repeat(np.arange(len(first)), count)
    place = np.concatenate([np.linspace(0, 1, c) for c in count])
    cycle = first[row] + (last - first)[row] * place
    # Both ends exactly.
    cycle[np.cumsum(count) - 1] = last
    samples = sample(pattern, row, cycle)
    for attempt in range(1, ATTEMPTS):
        lost = np.flatnonzero(~samples.known & samples.stable)
        if len(lost) == 0:
            break
        # Further than rounding reaches; at an end of the range hardly, and inwards.
        nudge = np.where(place[lost] == 1, -1, 1) * attempt * np.where((place[lost] % 1) == 0, 1e-11, 1e-4)
        again = sample(pattern, row[lost], cycle[lost] * (1 + nudge))
        for f in fields(samples):
            getattr(samples, f.name)[..., lost] = getattr(again, f.name)
    kept = np.flatnonzero(samples.known | ~samples.stable)
    inner = samples.row[kept[1:]] == samples.row[kept[:-1]]
    left, right = kept[:-1][inner], kept[1:][inner]
    none = np.full(len(left), -1)
    return samples, Brackets(
        left, right, none, np.zeros_like(left), samples.cycle[right] - samples.cycle[left], np.zeros_like(left)
    )


def collisions(pattern: Pattern, first: Array, last: Array) -> Array:
    """About how many collisions lie between two cycles, ``(r,)``: pairs p <= q meet every (w_p + w_q) T = 2 pi."""
    mean = np.sqrt(np.maximum(pattern.squared_frequency, 0)).mean(axis=1).sum(axis=-1)
    return np.maximum(COARSEST, np.ceil((pattern.size + 1) * mean * pattern.cycles * (last - first)).astype(int))


def classify(samples: Samples, brackets: Brackets, spacing: Array) -> Array:
    """Decide what each bracket holds. Where the integers are unknown (strong growth) a bracket is halved down to a
    quarter of the scan's spacing and then taken at face value.
    """
    a, b = brackets.left, brackets.right
    stable_a, stable_b = samples.stable[a], samples.stable[b]
    begun, ended = samples.begun[a], samples.ended[b]
    known = samples.known[a] & samples.known[b]
    width = _width(samples, brackets)
    near = (samples.soon[a] < NEAR * width) & (samples.since[b] < NEAR * width)
    kind = np.full(len(a), OPEN)
    same = begun == ended
    # Where a third multiplier overtakes a tongue, three edges can count like one.
    single = same & ((samples.crowding[a] > NEAR * width) | (samples.crowded[b] > NEAR * width))
    kind[stable_a & ~stable_b & single] = ENTRANCE
    kind[~stable_a & stable_b & single] = EXIT
    kind[stable_a & stable_b & ~same] = NARROW
    kind[~near & ((stable_a & stable_b & same) | (~stable_a & ~stable_b & (begun > ended)))] = NOTHING
    small = width < SMALL * spacing[samples.row[a]]
    face = np.where(stable_a, np.where(stable_b, NARROW, ENTRANCE), np.where(stable_b, EXIT, NOTHING))
    return np.where(known, kind, np.where(small, face, OPEN))


def _width(samples: Samples, brackets: Brackets) -> Array:
    return samples.cycle[brackets.right] - samples.cycle[brackets.left]


def propose(samples: Samples, brackets: Brackets, kind: Array, tolerance: float, floor: float) -> Array:
    """The next point of each bracket, ``(B,)``."""
    a, b = brackets.left, brackets.right
    x, y = samples.cycle[a], samples.cycle[b]
    middle = 0.5 * (x + y)
    # Where a middle told nothing, somewhere else.
    middle += (y - x) * ELSEWHERE * brackets.failures * np.where(brackets.failures % 2 == 1, 1, -1)
    weight = np.where(kind == NARROW, samples.ended[b] - samples.begun[a], 1)
    weight = np.where(kind == ENTRANCE, samples.begun[b] - samples.begun[a], weight)
    weight = np.where(kind == EXIT, samples.ended[b] - samples.ended[a], weight)
    group = np.where(weight == 1, SELF, COMBINATION)
    side = np.select([kind == ENTRANCE, kind == EXIT], [2.0, -2.0], 0.0)
    f, g = (_value(samples.ahead, a, group, side), _value(samples.behind, b, group, side))
    with np.errstate(divide="ignore", invalid="ignore"):
        root = x - f * (y - x) / (g - f)
        better = _quadratic(samples, brackets, group, side, (x, f), (y, g))
        root = np.where((better > x) & (better < y), better, root)
        usable = (f < 0) & (g > 0) & (root > x) & (root < y) & (weight <= 2) & (kind != OPEN)
        usable &= (brackets.failures == 0) & (brackets.age < PATIENCE)
        least = WITHIN * tolerance * x
        root = np.where(side != 0, np.clip(root, x + least, y - least), root)
        # Is the tongue predicted to be narrower than the floor? Then enclose it between two stable points.
        slope = (g - f) / (y - x)
        coupling = np.maximum(samples.ahead[1, group, a], samples.behind[1, group, b])
        closed = (side == 0) & (4 * coupling < CLOSED * floor * x * slope)
        aside = BESIDE * floor * x
        probe = np.where(root - x > (BESIDE + 0.01) * floor * x, root - aside, root + aside)
    usable &= ~closed | ((probe > x) & (probe < y))
    return np.where(usable, np.where(closed, probe, root), middle)


def _value(side: Array, index: Array, group: Array, factor: Array) -> Array:
    return side[0, group, index] + factor * side[1, group, index]


def _quadratic(
    samples: Samples,
    brackets: Brackets,
    group: Array,
    factor: Array,
    left: tuple[Array, Array],
    right: tuple[Array, Array],
) -> Array:
    """Inverse quadratic interpolation through both ends and the end replaced last; NaN without one."""
    old = np.maximum(brackets.old, 0)
    z = samples.cycle[old]
    ahead = z < left[0]
    h = np.where(ahead, _value(samples.ahead, old, group, factor), _value(samples.behind, old, group, factor))
    (x, f), (y, g) = left, right
    root = x * g * h / ((f - g) * (f - h)) + y * f * h / ((g - f) * (g - h)) + z * f * g / ((h - f) * (h - g))
    monotone = np.where(ahead, h < f, h > g)
    return np.where((brackets.old >= 0) & monotone, root, np.nan)


def _divide(samples: Samples, fresh: Samples, brackets: Brackets) -> tuple[Samples, Brackets]:
    """Put the new samples into their brackets; one that told nothing is dropped."""
    a, b = brackets.left, brackets.right
    good = fresh.known | ~fresh.stable
    new = len(samples) + np.arange(len(fresh))
    keep = np.flatnonzero(good)
    middle = new[keep]
    left, right = a[keep], b[keep]
    joined = samples.joined(fresh)
    age, width = brackets.age[keep] + 1, brackets.width[keep]
    first = Brackets(left, middle, right, age, width, np.zeros_like(left))
    second = Brackets(middle, right, left, age, width, np.zeros_like(left))
    bad = brackets.subset(np.flatnonzero(~good))
    bad.failures = bad.failures + 1
    parts = [first, second, bad]
    total = Brackets(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Brackets)))
    now = _width(joined, total)
    restart = (now < 0.5 * total.width) | (total.age > PATIENCE)
    total.age = np.where(restart, 0, total.age)
    total.width = np.where(restart, now, total.width)
    return joined, total


def _finish(samples: Samples, brackets: Brackets, kind: Array, edges: list[tuple[Array, ...]], contacts: Array) -> None:
    """Note the edges and the contacts among brackets that need no more work."""
    a, b = brackets.left, brackets.right
    edge = samples.stable[a] != samples.stable[b]
    edges.append((a[edge], b[edge]))
    narrow = kind == NARROW
    np.add.at(contacts, samples.row[a[narrow]], (samples.ended[b] - samples.begun[a])[narrow])


def _halved(pattern: Pattern, samples: Samples, a: Array, b: Array, tolerance: float) -> tuple[Array, Array]:
    """Cycles on both sides of each edge between the samples a and b ``(2, E)``, and the evaluations of each row.

    Where signs are lost in rounding a bracket was left wider than the tolerance; stable or not is known even there.
    """
    ends, row = samples.cycle[np.stack([a, b])], samples.row[a]
    evaluations = np.zeros(len(pattern.rows), dtype=np.int64)
    while len(wide := np.flatnonzero(ends[1] - ends[0] > tolerance * ends[0])):
        middle = 0.5 * (ends[0] + ends[1])[wide]
        stable = evaluate(pattern, row[wide], middle).stable
        ends[np.where(stable == samples.stable[a[wide]], 0, 1), wide] = middle
        evaluations += np.bincount(row[wide], minlength=len(evaluations))
    return ends, evaluations


def _assemble(
    samples: Samples, a: Array, b: Array, places: Array, first: Array, last: Array, floor: float
) -> Intervals:
    order = np.lexsort((places[0], samples.row[a]))
    a, b, places = a[order], b[order], places[:, order]
    usable = np.flatnonzero(samples.known | ~samples.stable)
    result = []
    edges_of, samples_of = by_row(samples.row[a], len(first)), by_row(samples.row[usable], len(first))
    for row, (mine, own) in enumerate(zip(edges_of, samples_of, strict=True)):
        result += _intervals(samples, a[mine], b[mine], places[:, mine], usable[own], row, floor)
    return Intervals.of(result)


def _intervals(
    samples: Samples, a: Array, b: Array, places: Array, own: Array, row: int, floor: float
) -> list[Interval]:
    """Pair entrances with exits; a region that reaches an end of the range is cut there."""
    where = 0.5 * (places[0] + places[1])
    error = places[1] - places[0] + 2 * ROUNDED * where
    result: list[Interval] = []
    lowest, highest = own[np.argmin(samples.cycle[own])], own[np.argmax(samples.cycle[own])]
    start = None if samples.stable[lowest] else (samples.cycle[lowest], lowest, 0.0)
    for k in range(len(a)):
        if samples.stable[a[k]]:
            start = (where[k], a[k], error[k])
        elif start is not None:
            result.append(_interval(samples, row, start, (where[k], b[k], error[k])))
            start = None
    if start is not None:
        result.append(_interval(samples, row, start, (samples.cycle[highest], highest, 0.0)))
    return [i for i in result if i.stop - i.start > floor * i.start]


def _interval(samples: Samples, row: int, start: tuple[float, int, float], stop: tuple[float, int, float]) -> Interval:
    """From (cycle, sample beyond the edge, error) of both ends; at the end of the range that sample is unstable."""
    a, b = start[1], stop[1]
    passed = _by_class(samples.real[:, a], samples.ended[a])
    meetings = _by_class(samples.real[:, b] - samples.real[:, a], samples.begun[b] - samples.ended[a])
    cut = (not samples.stable[a], not samples.stable[b])
    return Interval(row, float(start[0]), float(stop[0]), passed, meetings, (float(start[2]), float(stop[2])), cut)


def _by_class(real: Array, total: int) -> tuple[int, int, int]:
    """Collisions at +1, at -1 and elsewhere, each once, from those at +-1 and C."""
    at_one, at_minus_one = (int(n) for n in real)
    return at_one, at_minus_one, (int(total) - at_one - at_minus_one) // 2
