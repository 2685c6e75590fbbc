"""Scan the intervals that the proof leaves open: damping sets the step, maxima between samples are refined.

To first order a tongue is a bump of the growth rate g about nu = w_p + w_q, whose width in nu is at least mu_p + mu_q,
the sum of the rates at which damping takes from both modes: the wider, the stronger the excitation. As nu is about w_p
+ w_q, that is no less than the smallest damping ratio, relatively, for every harmonic and every combination, and
however long the common period is. So a scan uniform in ln Omega whose step is a part of that ratio *counts* the bumps.
Where local maxima below zero may reach it, and minima above, they are refined: smooth ones by a parabola, and corners,
where one solution takes over from another as the fastest, by the lines on both sides. Two tongues may meet in a corner
that a line does not show; their solutions differ: whether neighbouring unstable samples belong to one tongue is seen
from their Floquet vectors at t = 0 and T/2 and the signs of their multipliers (adjacent sidebands of one pair of modes
have equal vectors at t = 0).
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.boundaries.damped.proof import Cover, Gaps, MultiplierSamples
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import Chain
from gearstab.floquet.stability import DAMPED_ON_CIRCLE
from gearstab.grouping import numbered
from gearstab.system import Array

STEP = 0.1
"""Step of the scan over the smallest damping ratio."""
REFINEMENTS = 16
"""Rounds in which extrema are refined."""
OPTIMISM = 2.0
"""An extremum is refined while this many times the gain that a parabola promises would cross zero."""
SHARPNESS = 4.0
"""The same for a corner, to which the growth falls like a square root."""
DOUBTFUL_GAIN = 0.1
"""The least gain to be hoped for, as a part of the height of the extremum over its neighbours."""
GOLDEN = 0.38
"""Part of the wider side at which to look where a vertex tells nothing new."""
BESIDE, INSIDE = 0.05, 0.1
"""Parts of a range by which a point to look at next must keep off the middle sample, or is kept off the outer ones."""
SAME = 0.5
"""Squared overlap of two solutions above which they are one branch."""
MOST = 8
"""Unstable solutions of a sample that are kept, the fastest ones."""
AT_ONCE = 256
"""Points whose Floquet vectors are computed together."""
UNDAMPED = 1e-8
"""Decay a period below which a solution counts as undamped."""


class Scan:
    """Samples of a cover, ordered by row and x, and the growth rate at them.

    noise: ``(r,)``, growth per period that rounding gives to an undamped solution.
    """

    def __init__(self, found: Cover, opened: Gaps) -> None:
        self.cover, self.opened = found, opened
        self.noise = np.zeros(len(found.first))
        self.vectors = _Vectors(found.chain)
        self.order_samples()

    def order_samples(self) -> None:
        """Take in samples that were added to the cover."""
        samples = self.cover.samples
        order = np.lexsort((samples.x, samples.row))
        new = np.ones(len(order), dtype=bool)
        new[1:] = (np.diff(samples.row[order]) > 0) | (np.diff(samples.x[order]) > 0)
        self.order = order[new]
        self.row, self.x = samples.row[self.order], samples.x[self.order]
        self.growth = self.growth_of(samples)[self.order]

    def growth_of(self, samples: MultiplierSamples) -> Array:
        """The growth rate at samples ``(P,)``, 1/time in the chain's units."""
        return (samples.logs[:, 0] - self.noise[samples.row]) / self.cover.chain.period(np.exp(samples.x))

    def add(self, row: Array, x: Array) -> None:
        """Sample further points."""
        order = np.lexsort((x, row))
        self.cover.sample(row[order], x[order])
        self.order_samples()

    def settle(self, chosen: Array) -> None:
        """Find those of the chosen rows ``(r,)`` with an undamped mode, whose growth never falls below zero but for
        rounding: there a growth per period up to DAMPED_ON_CIRCLE is none.
        """
        lowest = np.zeros(len(self.noise))
        np.minimum.at(lowest, self.cover.samples.row, self.cover.samples.logs[:, 0])
        self.noise = np.where(chosen & (lowest > -UNDAMPED), DAMPED_ON_CIRCLE, 0.0)
        self.order_samples()

    def uniform(self, step: Array, cell: Array) -> None:
        """Sample the open gaps uniformly, no farther apart than ``step`` ``(r,)``; where ``cell`` ``(r,)`` is finite,
        than that in the cycle.
        """
        gaps, start = self.opened, np.exp(self.opened.left)
        length, along = np.exp(gaps.right) - start, np.isfinite(cell[gaps.row])
        count = np.where(along, length / cell[gaps.row], gaps.width / step[gaps.row])
        count = np.ceil(count).astype(int) + 1
        owner, number = numbered(count)
        part = number / (count - 1)[owner]
        place = np.where(
            along[owner], np.log(start[owner] + length[owner] * part), gaps.left[owner] + gaps.width[owner] * part
        )
        self.add(gaps.row[owner], place)

    def refine(self, floor: float) -> None:
        """Pursue the extrema between samples that may change the sign of the growth rate."""
        for _ in range(REFINEMENTS):
            found = [_extrema(self, floor), *_corners(self, floor)]
            row, x = (np.concatenate(part) for part in zip(*found, strict=True))
            inside = self.within(row, x)
            if not inside.any():
                break
            self.add(row[inside], x[inside])

    def partly_stable(self, row: Array, x: Array) -> Array:
        """Whether the system is stable at any sample between the neighbours of points (row, x) ``(P,)``, samples in
        ascending order, among these.
        """
        place = np.searchsorted(self.row + 1j * self.x, row + 1j * x)
        same = np.diff(row, prepend=-1) == 0
        before = np.where(same, np.append(0, place)[:-1], place)
        after = np.where(np.append(same[1:], False), np.append(place, 0)[1:], place)
        stable = np.append(0, np.cumsum(self.growth <= 0))
        return np.asarray(stable[after + 1] > stable[before])

    def within(self, row: Array, x: Array) -> Array:
        """Which points lie in open gaps."""
        gaps = self.opened
        if len(gaps.row) == 0:
            return np.zeros(len(row), dtype=bool)
        k = np.searchsorted(gaps.row + 1j * gaps.left, row + 1j * x, side="right") - 1
        near = np.maximum(k, 0)
        return np.asarray((k >= 0) & (gaps.row[near] == row) & (x < gaps.right[near]))


def _extrema(scan: Scan, floor: float) -> tuple[Array, Array]:
    """Where to look next for a maximum that may exceed zero, or a minimum that may fall below."""
    r, x, g = scan.row, scan.x, scan.growth
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
    wanted = (r[2:] == r[:-2]) & (fb >= fa) & (fb >= fc) & (fb + OPTIMISM * gain > 0) & (c - a > floor)
    wider = np.where(c - b > b - a, b + GOLDEN * (c - b), b - GOLDEN * (b - a))
    top = np.where(np.abs(top - b) < BESIDE * (c - a), wider, top)
    top = np.clip(top, a + INSIDE * (b - a), c - INSIDE * (c - b))
    return r[1:-1][wanted], top[wanted]


def _corners(scan: Scan, floor: float) -> list[tuple[Array, Array]]:
    """Where g may fall below zero between two samples above it, as one solution takes over from another as the fastest:
    where the lines through the two samples on either side meet below zero, and in the middle, where the unstable
    solutions differ. And where it may rise above zero between two samples below: these lines bound it there, as far as
    it is concave, and a parabola does not, where it is steep on one side only.
    """
    r, x, g = scan.row, scan.x, scan.growth
    if len(r) < 4:
        return []
    sharp = [_meeting(r, x, g, SHARPNESS, floor), _meeting(r, x, -g, OPTIMISM, floor)]
    pairs = np.flatnonzero((r[1:] == r[:-1]) & (g[1:] > 0) & (g[:-1] > 0) & (np.diff(x) > floor))
    middle = 0.5 * (x[pairs] + x[pairs + 1])
    pairs, middle = (part[scan.within(r[pairs], middle)] for part in (pairs, middle))
    differ = ~scan.vectors.agree(scan.cover.samples, scan.order[pairs], scan.order[pairs + 1])
    return [*sharp, (r[pairs[differ]], middle[differ])]


def _meeting(r: Array, x: Array, g: Array, hope: float, floor: float) -> tuple[Array, Array]:
    """Where lines through the two samples on either side of two positive ones meet, if ``hope`` times the fall that
    they promise crosses zero; the middle where they meet outside, and either is below zero at the other sample: it goes
    on for as long as another solution is not above it, and falls faster than its line.
    """
    b, c, low = x[1:-2], x[2:-1], np.minimum(g[1:-2], g[2:-1])
    above = (r[3:] == r[:-3]) & (low > 0) & (c - b > floor)
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (g[1:-2] - g[:-3]) / (b - x[:-3]), (g[3:] - g[2:-1]) / (x[3:] - c)
        meet = (g[2:-1] - g[1:-2] + left * b - right * c) / (left - right)
        value = g[1:-2] + left * (meet - b)
        beyond = np.minimum(g[1:-2] + left * (c - b), g[2:-1] + right * (b - c))
    inside = (meet > b) & (meet < c)
    sharp = above & np.where(inside, low < hope * (low - value), beyond < 0)
    place = np.where(inside, np.clip(meet, b + INSIDE * (c - b), c - INSIDE * (c - b)), 0.5 * (b + c))
    return r[1:-2][sharp], place[sharp]


class _Vectors:
    """Unstable Floquet vectors at t = 0 and T/2 of samples by their positions, each found once."""

    def __init__(self, chain: Chain) -> None:
        self.chain, most = chain, min(MOST, chain.size)
        self.slot: dict[int, int] = {}
        self.known: dict[tuple[int, int], bool] = {}
        self.values = np.empty((0, most), dtype=complex)
        self.unstable = np.empty((0, most), dtype=bool)
        self.start = self.middle = np.empty((0, chain.size, most), dtype=complex)

    def agree(self, samples: MultiplierSamples, first: Array, second: Array) -> Array:
        """Whether an unstable solution at one point is found at the other."""
        pairs = list(zip(first.tolist(), second.tolist(), strict=True))
        fresh = [pair for pair in pairs if pair not in self.known]
        if fresh:
            self._find(samples, [k for k in dict.fromkeys(sum(fresh, ())) if k not in self.slot])
            slots = np.array([[self.slot[k] for k in pair] for pair in fresh])
            self.known |= dict(zip(fresh, self._alike(slots[:, 0], slots[:, 1]).tolist(), strict=True))
        return np.array([self.known[pair] for pair in pairs], dtype=bool)

    def _alike(self, a: Array, b: Array) -> Array:
        """The same of places in the tables."""
        alike = self.unstable[a][:, :, None] & self.unstable[b][:, None, :]
        for vectors in (self.start, self.middle):
            alike &= np.abs(np.swapaxes(vectors[a].conj(), 1, 2) @ vectors[b]) ** 2 > SAME
        one, other = self.values[a][:, :, None], self.values[b][:, None, :]
        real = one.imag == 0
        # Two real multipliers that become a complex pair meet two more in between, and may be on the circle there.
        apart = (real != (other.imag == 0)) | (real & (one.real * other.real < 0))
        return np.asarray((alike & ~apart).any(axis=(1, 2)))

    def _find(self, samples: MultiplierSamples, wanted: list[int]) -> None:
        """Floquet vectors of further samples, the fastest first."""
        if not wanted:
            return
        at = np.array(sorted(wanted, key=lambda k: int(samples.row[k])))
        most = self.values.shape[1]
        tables: list[list[Array]] = [[self.values], [self.start], [self.middle], [self.unstable]]
        for step in range(0, len(at), AT_ONCE):
            k = at[step : step + AT_ONCE]
            first, second, _ = halves(self.chain, samples.row[k], np.exp(samples.x[k]))
            values, vectors = np.linalg.eig(second @ first)
            order = np.argsort(-np.abs(values), axis=1, kind="stable")[:, :most]
            values = np.take_along_axis(values, order, axis=1).astype(complex)
            start = np.take_along_axis(vectors, order[:, None, :], axis=2).astype(complex)
            middle = first @ start
            middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), np.finfo(float).tiny)
            unstable = np.arange(most) < samples.outside[k][:, None]
            for table, found in zip(tables, (values, start, middle, unstable), strict=True):
                table.append(found)
        self.slot |= {int(k): len(self.values) + i for i, k in enumerate(at)}
        self.values, self.start, self.middle, self.unstable = (np.concatenate(table) for table in tables)


def halves(chain: Chain, row: Array, cycle: Array) -> tuple[Array, Array, Array]:
    """The products of the first and the second half of the segments ``(P, m, m)`` in the coordinates of the states,
    over exp(scale) together, and scale ``(P,)``, at points (row, 1/Omega) ``(P,)``.
    """
    middle = len(chain.states) // 2
    first, one = np.tile(np.eye(chain.size), (len(row), 1, 1)), np.zeros(len(row))
    if middle:
        first, one = c_points.products(chain.part(slice(0, middle)), row, cycle)
    second, other = c_points.products(chain.part(slice(middle, None)), row, cycle)
    return first, second, one + other
