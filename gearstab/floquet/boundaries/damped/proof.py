"""Covering the range of mesh frequencies by stretches on which the number of multipliers outside is proved constant.

A Lyapunov function comes with a radius (:mod:`~gearstab.floquet.kernel.c_points`): around its point the number of
multipliers outside the unit circle does not change. Points are added where stretches leave gaps, until these are
narrower than a floor or the budget is spent:

* between two stretches of equal number, where stretches of the size of their neighbours would meet, in the proportion
  of their radii: a gap that shrinks from both sides closes in on what is narrow inside;
* where the numbers differ a multiplier crosses the circle: the zero of its ln |lambda| is found with Chandrupatla's
  method (1997, Adv. Eng. Softw. 28, 145-149), inverse quadratic interpolation and bisection;
* towards an edge so found in a geometric sequence, as radii shrink with the distance to it: about ten to one per point.

All is done in x = ln(1/Omega), for all rows at once. Nothing can be hidden in a stretch. What is left is *open*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import Chain
from gearstab.grouping import Columns, numbered
from gearstab.roots import RootBrackets, narrowed
from gearstab.system import Array

PROVED, FAILED, EDGE = range(3)

FIRST = 4.0
"""Distance of the first points, in damping ratios: about two radii of medium ones."""
FEWEST, MOST = 8, 20_000
"""First points of a row; if damping is too light for the latter no proof is begun."""
LIGHTEST = 1e-30
"""Damping ratio that stands for none."""
HOPELESS = 4.0
"""Budgets that a proof at the first points may cost to be begun."""
REACH = 2.6
"""Distance of points between two gaps in radii of the smaller neighbour; two are the least that may do."""
AT_ONCE = 8
"""Points of one gap in one round, at most."""
BEYOND = 0.5
"""Part of a radius beyond a stretch up to which what ends it is expected."""
SAFETY = 0.99
"""Part of a radius that is used."""
CAUTION = 0.9
"""Part of the radius expected near an edge that is relied on."""
PARTS = 0.05, 0.9
"""Radii expected near an edge, in parts of the distance to it."""
GIVEN_UP = 0.1
"""Distance of a failed proof from a stretch, in its radii, at which no more is tried."""
STRONGEST = 12.0
"""Growth a period, as a logarithm, up to which a proof is tried: the square of its exponential magnifies rounding."""
ROUNDS = 100
MODULI, PROOF = 1.5, 10.0
"""Work of a monodromy matrix with its multipliers, and of a proof, in products of two matrices per segment."""
SPECTRUM = 70.0
"""Work of all eigenvalues and eigenvectors of a matrix, in such products."""


@dataclass
class MultiplierSamples(Columns):
    """Points (row, x) ``(P,)`` and ln |lambda| of all multipliers there ``(P, m)``, descending."""

    row: Array
    x: Array
    logs: Array

    @property
    def outside(self) -> Array:
        """``(P,)``, the number of multipliers outside the unit circle."""
        return (self.logs > 0).sum(axis=1)


@dataclass
class Items(Columns):
    """Stretches low..high around x, or single points, in order of (row, low): their number of multipliers outside."""

    row: Array
    low: Array
    high: Array
    x: Array
    outside: Array
    kind: Array

    @classmethod
    def none(cls) -> Items:
        """No items."""
        numbers, floats = np.empty(0, dtype=int), np.empty(0)
        return cls(numbers, floats, floats, floats, numbers, numbers)

    def added(self, other: Items) -> Items:
        """All, in order, without what lies in a stretch: ``high`` ascends, and gaps are between neighbours."""
        every = Items.joined([self, other])
        every = every.chosen(np.lexsort((-every.high, every.low, every.row)))
        inner = np.zeros(len(every.row), dtype=bool)
        inner[1:] = (np.diff(every.row) == 0) & (every.high[1:] <= running_maximum(every.row, every.high)[:-1])
        return every.chosen(np.flatnonzero(~inner))


def running_maximum(row: Array, values: Array) -> Array:
    """The largest value so far of each row; rows ascend."""
    order = np.argsort(values, kind="stable")
    rank = np.empty(len(values), dtype=int)
    rank[order] = np.arange(len(values))
    return values[order[np.maximum.accumulate(rank + row * len(values)) - row * len(values)]]


@dataclass
class Gaps(Columns):
    """Stretches between neighbouring items: left..right, and the positions of both items."""

    row: Array
    left: Array
    right: Array
    before: Array
    after: Array

    @property
    def width(self) -> Array:
        """right - left."""
        return self.right - self.left


class Cover:
    """State of all rows of a chain between the ends ``first`` and ``last`` ``(r,)`` of x.

    samples: all points. items: stretches, edges and points without proof. work ``(r,)``: products of two matrices.
    evaluations ``(r,)``: points at which multipliers were computed, and points tried for a proof.
    """

    def __init__(self, chain: Chain, first: Array, last: Array, budget: float) -> None:
        self.chain, self.first, self.last, self.budget = chain, first, last, budget
        none = np.empty(0)
        self.samples = MultiplierSamples(none.astype(int), none, np.empty((0, chain.size)))
        self.items = Items.none()
        self.provable = np.ones(len(first), dtype=bool)
        self.settled = np.empty(0, dtype=complex)
        self.work, self.evaluations = np.zeros(len(first)), np.zeros(len(first), dtype=int)

    def sample(self, row: Array, x: Array) -> MultiplierSamples:
        """Multipliers at further points, which are kept; rows ascend."""
        found = MultiplierSamples(row, x, c_points.moduli(self.chain, row, np.exp(x)))
        self.count(row, MODULI + self.chain.exponential)
        self.samples = MultiplierSamples.joined([self.samples, found])
        return found

    def count(self, row: Array, products: float) -> None:
        """Record evaluations at points ``(P,)`` of so many products a segment each."""
        count = np.bincount(row, minlength=len(self.work))
        self.evaluations += count
        self.work += products * len(self.chain.states) * count

    def prove(self, row: Array, x: Array) -> None:
        """Sample points and try a proof at each."""
        order = np.lexsort((x, row))
        found = self.sample(row[order], x[order])
        growth = found.logs[:, 0]
        radius = np.zeros((len(row), 2))
        tried = np.flatnonzero((growth < STRONGEST) & (growth != 0) & self.provable[found.row])
        if len(tried):
            given = found.row[tried], np.exp(found.x[tried]), growth[tried]
            radius[tried] = SAFETY * c_points.radii(self.chain, *given)
            # One that is 0 says that not even Q is positive.
            radius[(radius == 0).any(axis=1)] = 0.0
            self.count(found.row[tried], PROOF + self.chain.preparation)
        high = np.minimum(found.x + np.log1p(radius[:, 0]), self.last[found.row])
        low = np.maximum(found.x + np.log1p(-radius[:, 1]), self.first[found.row])
        kind = np.where(low < high, PROVED, FAILED)
        self.items = self.items.added(Items(found.row, low, high, found.x, found.outside, kind))

    def gaps(self) -> Gaps:
        """All of them."""
        items = self.items
        k = np.flatnonzero((np.diff(items.row) == 0) & (items.low[1:] > items.high[:-1]))
        return Gaps(items.row[k], items.high[k], items.low[k + 1], k, k + 1)

    def active(self, gaps: Gaps, inside: bool) -> Array:
        """Which of them may be looked into: of provable rows with budget left, where rounding has not had the last
        word.

        inside: only those that begin or end with all multipliers inside the circle.
        """
        fewest = np.minimum(self.items.outside[gaps.before], self.items.outside[gaps.after])
        chosen = self.provable[gaps.row] & (self.work[gaps.row] < self.budget) & ((fewest == 0) | (not inside))
        return np.asarray(chosen & ~np.isin(gaps.row + 1j * gaps.left, self.settled))

    def crossed(self, gaps: Gaps) -> Array:
        """Return the gaps in which multipliers cross the unit circle."""
        return np.asarray(self.items.outside[gaps.before] != self.items.outside[gaps.after])

    def narrow(self, gaps: Gaps, tolerance: float) -> None:
        """Find an edge in each of these gaps, in which multipliers cross the circle."""
        fewer = np.minimum(self.items.outside[gaps.before], self.items.outside[gaps.after])

        def crossing(which: Array, x: Array) -> Array:
            return np.asarray(self.sample(gaps.row[which], x).logs[np.arange(len(which)), fewer[which]])

        every = np.arange(len(fewer))
        ends = RootBrackets(gaps.left, gaps.right, crossing(every, gaps.left), crossing(every, gaps.right))
        # Where rounding has the last word at an end, that is the edge.
        wrong = (ends.fa > 0) == (ends.fb > 0)
        end = np.where(np.abs(ends.fa) < np.abs(ends.fb), gaps.left, gaps.right)
        ends.a, ends.b = np.where(wrong, end, ends.a), np.where(wrong, end, ends.b)
        bracket = narrowed(crossing, ends, tolerance)
        row, x = np.repeat(gaps.row, 2), np.stack([bracket.a, bracket.b], axis=1).ravel()
        inner = (x > np.repeat(gaps.left, 2)) & (x < np.repeat(gaps.right, 2))
        found = self.sample(row[inner], x[inner])
        kind = np.full(len(found.row), EDGE)
        self.items = self.items.added(Items(found.row, found.x, found.x, found.x, found.outside, kind))
        self.settled = np.append(self.settled, (gaps.row + 1j * gaps.left)[wrong])

    def wanted(self, gaps: Gaps, floor: float) -> tuple[Array, Array]:
        """Return where to try a proof next, (row, x), in gaps in which no multiplier is known to cross the circle."""
        items, width = self.items, gaps.width
        left, right = items.kind[gaps.before], items.kind[gaps.after]
        radius = [
            np.where(left == PROVED, gaps.left - items.x[gaps.before], 0.0),
            np.where(right == PROVED, items.x[gaps.after] - gaps.right, 0.0),
        ]
        rows, places = [], []

        def add(which: Array, x: Array) -> None:
            rows.append(gaps.row[which])
            places.append(x)

        both = (left == PROVED) & (right == PROVED)
        larger = np.maximum(*radius)
        wide = np.flatnonzero(both & (width > np.maximum(REACH * larger, floor)))
        mean = np.maximum(np.sqrt(radius[0] * radius[1])[wide], width[wide] / (REACH * AT_ONCE))
        count = np.ceil(width[wide] / (REACH * mean)).astype(int)
        gap, number = numbered(count)
        owner = wide[gap]
        add(owner, gaps.left[owner] + width[owner] * (number + 0.5) / count[gap])
        near = np.flatnonzero(both & (width <= REACH * larger) & (width > floor))
        # Both radii point to what is narrow inside; where they reach over it there is nothing.
        one, two, whole = radius[0][near], radius[1][near], width[near]
        inner = whole - BEYOND * (one + two)
        add(near, gaps.left[near] + np.where(inner > 0, BEYOND * one + 0.5 * inner, whole * one / (one + two)))
        for own, other, end, sign, size in (
            (left, right, gaps.right, -1.0, radius[0]),
            (right, left, gaps.left, 1.0, radius[1]),
        ):
            # Towards an edge: the radius is a part of the distance to it.
            k = np.flatnonzero((own == PROVED) & (other == EDGE) & (width > floor))
            part = CAUTION * np.clip(size[k] / (size[k] + width[k]), *PARTS)
            distance = width[k] / (1 + part)
            for _ in range(AT_ONCE):
                add(k, end[k] + sign * distance)
                more = distance * (1 - part) > floor
                k, part, distance = k[more], part[more], (distance * (1 - part) / (1 + part))[more]
            # Where a proof has failed, nearer to what is proved.
            k = np.flatnonzero((own == PROVED) & (other == FAILED) & (width > np.maximum(floor, GIVEN_UP * size)))
            add(k, (end + sign * np.maximum(width - size, 0.5 * width))[k])
        k = np.flatnonzero((left != PROVED) & (right != PROVED) & ((left == EDGE) | (right == EDGE)) & (width > floor))
        add(k, 0.5 * (gaps.left + gaps.right)[k])
        return np.concatenate(rows), np.concatenate(places)

    def open(self, floor: float) -> Gaps:
        """The gaps wider than the floor, in which nothing is proved."""
        gaps = self.gaps()
        return gaps.chosen(np.flatnonzero(gaps.width > floor))


def damping_ratio(chain: Chain) -> Array:
    """``(r,)``, the smallest |mu_j|/w_j; 0 where a mode has none or no frequency."""
    if chain.lightest is not None:
        return np.asarray(chain.lightest.min(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(chain.rates[:, : chain.frequencies.shape[1]]) / chain.frequencies
    return np.asarray(np.where(np.isfinite(ratio), ratio, 0.0).min(axis=1))


def cover(chain: Chain, first: Array, last: Array, tolerance: float, floor: float, budget: float) -> Cover:
    """Prove what can be proved between x = ``first`` and ``last`` ``(r,)``.

    tolerance, floor: of edges, and of gaps that are left, in x. budget: products of two matrices per row, after which
    no more is begun; nor is where far more would be needed.
    """
    found = Cover(chain, first, last, budget)
    # Where damping changes with the speed, few places have the lightest.
    usual = damping_ratio(chain) if chain.lightest is None else np.median(chain.lightest, axis=1)
    count = (last - first) / (FIRST * np.maximum(usual, LIGHTEST))
    sound = chain.sound & (chain.rates > 0).all(axis=1) & (chain.frequencies > 0).all(axis=1)
    found.provable = (
        sound & (count <= MOST) & (count * (PROOF + chain.preparation) * len(chain.states) < HOPELESS * budget)
    )
    count = np.ceil(np.where(found.provable, np.maximum(count, FEWEST), FEWEST)).astype(int)
    row = np.repeat(np.arange(len(count)), count)
    found.prove(row, np.concatenate([np.linspace(a, b, c) for a, b, c in zip(first, last, count, strict=True)]))
    for inside in (True, False):
        # The stable part and its edges first.
        for _ in range(ROUNDS):
            gaps = found.gaps()
            crossed = found.crossed(gaps) & (gaps.width > tolerance) & found.active(gaps, inside)
            if crossed.any():
                found.narrow(gaps.chosen(np.flatnonzero(crossed)), tolerance)
                gaps = found.gaps()
            row, x = found.wanted(gaps.chosen(np.flatnonzero(~found.crossed(gaps) & found.active(gaps, inside))), floor)
            if len(row) == 0:
                break
            found.prove(row, x)
    return found
