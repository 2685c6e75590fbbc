"""What no proof covers: a scan with a step set by damping, and extrema of the growth rate pursued between its samples.

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
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.kernel.chain import Chain
from gearstab.floquet.solution import DAMPED_ON_CIRCLE
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
CLOSEST = 1e-5
"""Distance down to which a change of branch is followed."""
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

    def uniform(self, step: Array) -> None:
        """Sample the open gaps uniformly, no farther apart than ``step`` ``(r,)``."""
        gaps = self.opened
        count = np.ceil(gaps.width / step[gaps.row]).astype(int) + 1
        owner = np.repeat(np.arange(len(count)), count)
        number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        place = gaps.left[owner] + gaps.width[owner] * (number / np.repeat(count - 1, count))
        self.add(gaps.row[owner], place)

    def refine(self, floor: float) -> None:
        """Pursue the extrema between samples that may change the sign of the growth rate."""
        for _ in range(REFINEMENTS):
            found = [_extrema(self, floor), *_corners(self, floor)]
            row, x = (np.concatenate(part) for part in zip(*found, strict=True))
            inside = self._opened(row, x)
            if not inside.any():
                break
            self.add(row[inside], x[inside])

    def _opened(self, row: Array, x: Array) -> Array:
        """Which points lie in open gaps."""
        gaps = self.opened
        if len(gaps.row) == 0:
            return np.zeros(len(row), dtype=bool)
        apart = 1e4  # more than any range of x
        k = np.searchsorted(gaps.row * apart + gaps.left, row * apart + x, side="right") - 1
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
    solutions differ.
    """
    r, x, g = scan.row, scan.x, scan.growth
    if len(r) < 4:
        return []
    b, c, low = x[1:-2], x[2:-1], np.minimum(g[1:-2], g[2:-1])
    above = (r[3:] == r[:-3]) & (low > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (g[1:-2] - g[:-3]) / (b - x[:-3]), (g[3:] - g[2:-1]) / (x[3:] - c)
        meet = (g[2:-1] - g[1:-2] + left * b - right * c) / (left - right)
        value = g[1:-2] + left * (meet - b)
    sharp = above & (meet > b) & (meet < c) & (low < SHARPNESS * (low - value)) & (c - b > floor)
    place = np.clip(meet, b + INSIDE * (c - b), c - INSIDE * (c - b))
    pairs = np.flatnonzero((r[1:] == r[:-1]) & (g[1:] > 0) & (g[:-1] > 0) & (np.diff(x) > max(CLOSEST, floor)))
    middle = 0.5 * (x[pairs] + x[pairs + 1])
    pairs, middle = (part[scan._opened(r[pairs], middle)] for part in (pairs, middle))
    differ = ~scan.vectors.agree(scan.cover.samples, scan.order[pairs], scan.order[pairs + 1])
    return [(r[1:-2][sharp], place[sharp]), (r[pairs[differ]], middle[differ])]


class _Vectors:
    """Unstable Floquet vectors at t = 0 and T/2 of samples by their positions, each found once."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.slot: dict[int, int] = {}
        self.values = np.empty((0, chain.size), dtype=complex)
        self.unstable = np.empty((0, chain.size), dtype=bool)
        self.start = self.middle = np.empty((0, chain.size, chain.size), dtype=complex)

    def agree(self, samples: MultiplierSamples, first: Array, second: Array) -> Array:
        """Whether an unstable solution at one point is found at the other."""
        if len(first) == 0:
            return np.zeros(0, dtype=bool)
        self._find(samples, [k for k in dict.fromkeys([*first.tolist(), *second.tolist()]) if k not in self.slot])
        a, b = (np.array([self.slot[k] for k in index.tolist()]) for index in (first, second))
        alike = np.ones((len(a), self.chain.size, self.chain.size), dtype=bool)
        for vectors in (self.start, self.middle):
            alike &= np.abs(np.einsum("pki,pkj->pij", vectors[a].conj(), vectors[b])) ** 2 > SAME
        one, other = self.values[a][:, :, None], self.values[b][:, None, :]
        opposite = (one.imag == 0) & (other.imag == 0) & (one.real * other.real < 0)
        alike &= ~opposite & self.unstable[a][:, :, None] & self.unstable[b][:, None, :]
        return np.asarray(alike.any(axis=(1, 2)))

    def _find(self, samples: MultiplierSamples, wanted: list[int]) -> None:
        """Floquet vectors of further samples, the fastest first."""
        if not wanted:
            return
        at = np.array(sorted(wanted, key=lambda k: int(samples.row[k])))
        for step in range(0, len(at), AT_ONCE):
            k = at[step : step + AT_ONCE]
            first, second, _ = halves(self.chain, samples.row[k], np.exp(samples.x[k]))
            values, vectors = np.linalg.eig(second @ first)
            order = np.argsort(-np.abs(values), axis=1, kind="stable")
            values = np.take_along_axis(values, order, axis=1).astype(complex)
            start = np.take_along_axis(vectors, order[:, None, :], axis=2).astype(complex)
            middle = first @ start
            middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), np.finfo(float).tiny)
            self.slot |= {int(j): len(self.values) + i for i, j in enumerate(k)}
            unstable = np.arange(self.chain.size) < samples.outside[k][:, None]
            for name, found in (("values", values), ("start", start), ("middle", middle), ("unstable", unstable)):
                setattr(self, name, np.concatenate([getattr(self, name), found]))


def halves(chain: Chain, row: Array, cycle: Array) -> tuple[Array, Array, Array]:
    """The products of the first and the second half of the segments ``(P, m, m)`` in the coordinates of the states,
    over exp(scale) together, and scale ``(P,)``, at points (row, 1/Omega) ``(P,)``.
    """
    middle = len(chain.states) // 2
    first, one = np.tile(np.eye(chain.size), (len(row), 1, 1)), np.zeros(len(row))
    if middle:
        first, one = kernel.current().products(chain.part(slice(0, middle)), row, cycle)
    second, other = kernel.current().products(chain.part(slice(middle, None)), row, cycle)
    return first, second, one + other
