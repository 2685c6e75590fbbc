"""Edges of damped regions: the stable part proved, the rest scanned.

1. :mod:`~gearstab.floquet.boundaries.damped.proof` covers the range with stretches on which no multiplier crosses the
   unit circle, and finds the edges between stable and unstable ones, within a budget.
2. What it leaves open, :mod:`~gearstab.floquet.boundaries.damped.scan` samples with a step set by damping, as long as
   the same budget allows for it. Where damping is too light for that, or a mode has none, all meetings of two
   multipliers are pursued (:mod:`~gearstab.floquet.boundaries.damped.meetings`), of symmetric systems and others. Where
   there are too many of them for the budget, it is spent on samples at equal steps, and what they miss is missed.
3. Regions are where the growth rate is positive; every edge is a change of its sign between two points that are a
   tolerance apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.boundaries import undamped
from gearstab.floquet.boundaries.damped.meetings import RASTER, pursue, pursue_beside
from gearstab.floquet.boundaries.damped.proof import MODULI, PROVED, SPECTRUM, Cover, cover, damping_ratio
from gearstab.floquet.boundaries.damped.scan import STEP, Scan
from gearstab.floquet.boundaries.parts import Interval, Intervals, by_row, paired, verdicts_at_ends
from gearstab.floquet.boundaries.undamped import Search
from gearstab.floquet.kernel import damped as general
from gearstab.floquet.kernel.chain import Chain
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.smooth.steps import Division
from gearstab.roots import RootBrackets, narrowed
from gearstab.system import Array

COARSEST, FINEST, EQUAL = 200, 50_000, 10_000
"""Points of a scan of a row, however small or large the budget; the last one of a scan that damping does not guide."""
EVALUATIONS, SPECTRA = 75, 25
"""Growth rates, and spectra, that a meeting of multipliers takes with the edges beside it, medians of 31 random trains:
30 to 170, and 7 to 66; half of the rates and two thirds of the spectra beside edges."""
MEETINGS, PURSUIT = 1_700, 50.0
"""Meetings of a row, and budgets for these, up to which they are pursued."""
PATIENCE = 20.0
"""Budgets of a scan with the step set by damping where generators go with the mesh frequency, so that points cost
more, and proofs far more.
"""
BESIDE_EDGES = 4
"""Rounds in which edges are looked beside: regions found beside an edge have edges of their own."""
NO_GROWTH = 1e-13
"""Real part of an exponent, over the root of the mean squared frequency, that rounding gives to one without decay."""


@dataclass(frozen=True)
class Stretches:
    """Parts start..stop of rows ``(K,)``, in cycles 1/Omega, by row and ascending."""

    row: Array
    start: Array
    stop: Array


@dataclass(frozen=True)
class SearchResult:
    """intervals: unstable, by row and ascending cycle. evaluations ``(r,)``: monodromy matrices and proofs tried.
    proved, counted: where stability is proved, and where nothing is but the scan had the step set by damping.
    step: ``(r,)``, relative distance of the samples elsewhere, 0 where there is nothing else. coarse ``(r,)``: whether
    meetings of multipliers between them were not pursued. peaks: cycles inside of each interval at which growth is
    largest, among samples. contacts: ``(r,)``, collisions that open no interval, where they are counted.
    """

    intervals: Intervals
    peaks: list[Array]
    evaluations: Array
    proved: Stretches
    counted: Stretches
    step: Array
    coarse: Array
    contacts: Array | None = None


@dataclass(frozen=True)
class Limits:
    """Range, tolerances and budget of a search.

    start, stop: mesh frequencies. tolerance, floor: relative, of edges and of regions. budget: multiplications a row
    for the proof, and as many for the scan.
    """

    start: float
    stop: float
    tolerance: float
    floor: float
    budget: float

    def cycles(self, rows: Pattern | Division) -> tuple[Array, Array]:
        """1/Omega in the units of the rows ``(r,)``, from the highest to the lowest mesh frequency."""
        return rows.elastic.rate / self.stop, rows.elastic.rate / self.start

    def undamped(self, pattern: Pattern) -> Search:
        """The intervals of a conservative pattern."""
        return undamped.search(pattern, *self.cycles(pattern), self.tolerance, self.floor)

    def damped(self, chain: Chain, rows: Pattern | Division) -> SearchResult:
        """Return the chain of some rows."""
        return search(chain, *self.cycles(rows), self.tolerance, self.floor, self.budget)


def search(chain: Chain, first: Array, last: Array, tolerance: float, floor: float, budget: float) -> SearchResult:
    """Intervals of positive growth of all rows between the cycles ``first`` and ``last`` ``(r,)``.

    tolerance, floor: relative. budget: multiplications a row for the proof, as many for the scan, and PURSUIT times as
    many for meetings of multipliers.
    """
    if chain.values.shape[1] == 1 and chain.following is None:
        return _constant(chain, first, last)
    products = budget / chain.size**3
    found = cover(chain, np.log(first), np.log(last), tolerance, floor, products)
    scan = Scan(found, found.open(floor))
    plan = ScanPlan.of(scan, first, last, products)
    scan.uniform(plan.step, plan.cell)
    scan.settle(plan.left > 0)
    if plan.pursued.any():
        pursue(scan, plan.cell, floor)
    scan.refine(floor)
    _narrow(scan, tolerance)
    if plan.pursued.any():
        _complete(scan, plan.cell, tolerance, floor)
    intervals = _intervals(scan, first, last, floor)
    chosen = scan.opened.chosen(np.flatnonzero(plan.counted[scan.opened.row]))
    counted = Stretches(chosen.row, np.exp(chosen.left), np.exp(chosen.right))
    step = np.where(plan.counted, 0.0, np.where(plan.pursued, plan.cell / first, plan.step))
    coarse = ~(plan.counted | plan.pursued)
    return SearchResult(intervals, _peaks(scan, intervals), found.evaluations, _proved(found), counted, step, coarse)


@dataclass(frozen=True)
class ScanPlan:
    """How each row ``(r,)`` is scanned where nothing is proved.

    left: how much of ln Omega that is. step: distance of samples in ln Omega, cell: that in the cycle, finite where
    meetings are pursued. counted: whether damping sets the step.
    """

    left: Array
    step: Array
    cell: Array
    counted: Array

    @property
    def pursued(self) -> Array:
        """Whether meetings are."""
        return np.isfinite(self.cell)

    @classmethod
    def of(cls, scan: Scan, first: Array, last: Array, products: float) -> ScanPlan:
        """Return the evaluations that the budget allows."""
        chain, opened = scan.cover.chain, scan.opened
        left = np.bincount(opened.row, opened.width, minlength=len(first))
        more = chain.exponential * len(chain.states)
        each = MODULI * len(chain.states) + more
        budgets = 1.0 if chain.following is None else PATIENCE
        most = float(np.clip(budgets * products / each, COARSEST, FINEST))
        step = STEP * damping_ratio(chain)
        counted = left <= most * step
        meetings = np.maximum(collisions(chain, first, last), COARSEST / RASTER)
        work = meetings * (EVALUATIONS * each + SPECTRA * (2 * (len(chain.states) + more) + SPECTRUM))
        pursued = ~counted & (meetings <= MEETINGS) & (work <= PURSUIT * products)
        equal = np.maximum(left, np.finfo(float).tiny) / np.clip(products / (each + SPECTRUM), COARSEST, EQUAL)
        step = np.where(counted, np.maximum(step, np.finfo(float).tiny), equal)
        return cls(left, step, np.where(pursued, (last - first) / (RASTER * meetings), np.inf), counted)


def _constant(chain: Chain, first: Array, last: Array) -> SearchResult:
    """Rows whose stiffness does not vary, so that the mesh frequency makes no difference."""
    grows = chain.values[:, 0].real.max(axis=1) > NO_GROWTH
    k, none = np.flatnonzero(~grows), np.empty(0)
    unstable = [Interval(int(r), float(first[r]), float(last[r]), cut=(True, True)) for r in np.flatnonzero(grows)]
    proved, counted = Stretches(k, first[k], last[k]), Stretches(none.astype(int), none, none)
    return SearchResult(
        Intervals.of(unstable), [none for _ in unstable], np.zeros(len(first), dtype=np.int64), proved, counted,
        np.zeros(len(first)), np.zeros(len(first), dtype=bool),
    )  # fmt: skip


def growing(pattern: Pattern) -> Array:
    """``(r,)``: which coordinate of the mean system grows most by itself, its velocity standing for a rigid-body mode
    after the n elastic ones; -1 where none grows.
    """
    rows, n = len(pattern.rows), pattern.size
    result = np.full(rows, -1)
    if pattern.elastic.conservative:
        return np.where(pattern.elastic.shift < 0, 0, result) if n else result
    mean = np.einsum("rs,rsij->rij", pattern.fractions, pattern.stiffness[:, pattern.states])
    return fastest(general.generators(replace(pattern, stiffness=mean[:, None])), n)


def fastest(mean: general.Generators, n: int) -> Array:
    """The same of the generators of mean systems, one state each, of n elastic coordinates."""
    values, vectors, _ = mean.eigen
    first = values[:, 0].real.argmax(axis=1)
    each = np.arange(len(first))
    share = np.abs(vectors[each, 0, n:, first])
    return np.where(values[each, 0, first].real > NO_GROWTH, share.argmax(axis=1), -1)


def collisions(chain: Chain, first: Array, last: Array) -> Array:
    """About how many collisions of multipliers of the undamped system lie between two cycles, ``(r,)``."""
    total = np.nan_to_num(chain.frequencies).sum(axis=1)
    return (chain.frequencies.shape[1] + 1) * total * chain.cycles * (last - first)


def _narrow(scan: Scan, tolerance: float) -> None:
    """Find an edge wherever the sign of the growth rate changes between samples."""
    for _ in range(2):
        k = _changes(scan)
        k = k[scan.x[k + 1] - scan.x[k] > tolerance]
        if len(k) == 0:
            return
        row = scan.row[k]

        def growth(which: Array, x: Array, row: Array = row) -> Array:
            return scan.growth_of(scan.cover.sample(row[which], x))

        narrowed(growth, RootBrackets(scan.x[k], scan.x[k + 1], scan.growth[k], scan.growth[k + 1]), tolerance)
        scan.order_samples()


def _complete(scan: Scan, cell: Array, tolerance: float, floor: float) -> None:
    """Look beside all edges of the rows that have a finite ``cell`` ``(r,)``, and beside those that appear then."""
    known = np.empty((0, 2))
    for _ in range(BESIDE_EDGES):
        k = _changes(scan)
        k = k[np.isfinite(cell[scan.row[k]])]
        row, edge = scan.row[k], np.exp(scan.x[k])
        new = _apart(known, row, edge, floor)
        if not new.any():
            break
        known = np.concatenate([known, np.stack([row, edge], axis=1)[new]])
        pursue_beside(scan, row[new], edge[new], cell, floor)
        scan.refine(floor)
        _narrow(scan, tolerance)


def _apart(known: Array, row: Array, edge: Array, floor: float) -> Array:
    """Which edges (row, cycle) ``(E,)`` are farther than the floor from all known ones ``(K, 2)`` of their rows."""
    new = np.ones(len(row), dtype=bool)
    for r in np.unique(row):
        own, there = row == r, np.sort(known[known[:, 0] == r, 1])
        beside = np.searchsorted(there, edge[own] * (1 + floor * np.array([[-1.0], [1.0]])))
        new[own] = beside[0] == beside[1]
    return new


def _changes(scan: Scan) -> Array:
    """Positions k of samples after which the sign of the growth rate changes."""
    unstable = scan.growth > 0
    return np.flatnonzero((scan.row[1:] == scan.row[:-1]) & (unstable[1:] != unstable[:-1]))


def _intervals(scan: Scan, first: Array, last: Array, floor: float) -> Intervals:
    """Pair the edges of each row."""
    change = _changes(scan)
    smaller = np.abs(scan.growth[change]) < np.abs(scan.growth[change + 1])
    root = np.exp(np.where(smaller, scan.x[change], scan.x[change + 1]))
    error = root * (scan.x[change + 1] - scan.x[change])
    beyond = verdicts_at_ends(scan.row, scan.growth > 0)
    return paired(np.stack([first, last]), scan.row[change], root, error, beyond, floor)


def _peaks(scan: Scan, intervals: Intervals) -> list[Array]:
    """The samples of locally largest growth inside each interval, the largest first."""
    g, x = scan.growth, scan.x
    summit = np.zeros(len(g), dtype=bool)
    summit[1:-1] = (g[1:-1] > 0) & (g[1:-1] >= g[:-2]) & (g[1:-1] >= g[2:])
    summit = np.flatnonzero(summit)
    of_row = by_row(scan.row[summit], len(scan.noise))
    result = []
    for i in intervals:
        own = summit[of_row[i.row]]
        own = own[(x[own] > np.log(i.start)) & (x[own] < np.log(i.stop))]
        result.append(np.exp(x[own[np.argsort(-g[own], kind="stable")]]))
    return result


def _proved(found: Cover) -> Stretches:
    """Where all multipliers are proved to be inside the unit circle, neighbours joined."""
    items = found.items.chosen(np.flatnonzero((found.items.kind == PROVED) & (found.items.outside == 0)))
    apart = np.ones(len(items.row), dtype=bool)
    apart[1:] = (np.diff(items.row) > 0) | (items.low[1:] > items.high[:-1])
    begin = np.flatnonzero(apart)
    end = np.append(begin[1:], len(apart))[: len(begin)] - 1
    return Stretches(items.row[begin], np.exp(items.low[begin]), np.exp(items.high[end]))
