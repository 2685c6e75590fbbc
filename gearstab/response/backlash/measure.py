"""What a motion amounts to in every common period, and whether it repeats itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from gearstab.linear.first_order import UNDAMPED
from gearstab.response.backlash.contact import APART
from gearstab.response.backlash.dynamics import Dynamics
from gearstab.response.backlash.follow import Stretch
from gearstab.system import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES, _WEIGHTS = 0.5 + 0.5 * _NODES, 0.5 * _WEIGHTS
_FINE = np.linspace(0.0, 1.0, 129)
LONGEST_CYCLE = 32
"""Common periods after which a motion may repeat itself to be called periodic."""
SETTLED = 1e-6
"""Difference of its sections, relative to the extent of the motion, below which it repeats itself."""


@dataclass(frozen=True)
class LimitCycle:
    """What a motion settles to, over the whole common periods after the beginning that was left out.

    begin, end: times. Where no common period is complete, all that is after the beginning counts.
    peak_to_peak, rms: ``(meshes,)``, of the mesh deflection g_i^T q, the latter about its mean.
    force_peak: ``(meshes,)``, the largest magnitude of the elastic mesh force.
    contact_loss: ``(meshes,)``, the part of the time without contact.
    period: after how many common periods the motion repeats itself; 0 where it does not (yet).
    difference: of the sections by which that was decided, relative to the extent of the motion.
    """

    begin: float
    end: float
    peak_to_peak: Array
    rms: Array
    force_peak: Array
    contact_loss: Array
    period: int
    difference: float


class Meter:
    """Collects extremes and integrals of every common period, and the states at the beginnings.

    since: the time from which on. Whole common periods count; where there are none until ``until``, all there is does.
    """

    def __init__(self, dynamics: Dynamics, since: float, until: float) -> None:
        period = dynamics.motion.period
        self.dynamics, self.since = dynamics, since
        # A period that begins or ends at the limit but for rounding counts.
        self.first = int(np.ceil(since / period - 1e-9))
        self.whole = self.first < int(np.floor(until / period * (1 + 1e-12)))
        self.begin = self.end = self.first * period
        self.low: list[Array] = []
        self.high: list[Array] = []
        self.force: list[Array] = []
        self.integrals: list[Array] = []
        self.sections: list[Array] = []

    def add(self, stretch: Stretch) -> None:
        """A stretch of the motion, in the order of time."""
        dynamics, count = self.dynamics, len(self.dynamics.gauge)
        if stretch.period == len(self.sections):
            self.sections.append(stretch.piece.powers[0, : dynamics.size])
            self.low.append(np.full(count, np.inf))
            self.high.append(np.full(count, -np.inf))
            self.force.append(np.zeros(count))
            self.integrals.append(np.zeros((3, count)))
        time = stretch.period * dynamics.motion.period + stretch.begin
        left_out = stretch.period < self.first if self.whole else time < self.since
        if stretch.piece.length == 0 or left_out:
            return
        if not self.whole:
            self.begin, self.end = min(self.begin, time), time + stretch.piece.length
        count, degree = len(dynamics.gauge), len(stretch.piece.powers) - 1
        x, e = (stretch.piece.powers @ row.T for row in (dynamics.deflection, dynamics.gauge))
        force = self._stiffness(stretch) * (_powers("fine", degree) @ e - dynamics.teeth.offset(stretch.contact))
        force *= stretch.contact != APART
        low, high = extremes(np.concatenate([_powers("fine", degree) @ x, force], axis=1))
        k = stretch.period
        self.low[k], self.high[k] = np.minimum(self.low[k], low[:count]), np.maximum(self.high[k], high[:count])
        self.force[k] = np.maximum(self.force[k], np.maximum(-low[count:], high[count:]))
        nodes = _powers("nodes", degree) @ x
        parts = np.stack([_WEIGHTS @ nodes, _WEIGHTS @ nodes**2, (stretch.contact == APART).astype(float)])
        self.integrals[k] += parts * stretch.piece.length

    def _stiffness(self, stretch: Stretch) -> Array:
        """``(1 or X, meshes)``, of the meshes at the fine points."""
        count = len(self.dynamics.gauge)
        if stretch.values is not None:
            return stretch.values[None, :count]
        # Just inside, where a jump ends the piece.
        time = stretch.begin + np.clip(_FINE, 1e-9, 1 - 1e-9) * stretch.piece.length
        return self.dynamics.values(time / self.dynamics.motion.period)[:, :count]

    def summary(self, complete: int) -> LimitCycle | None:
        """Summarise the settled part, if that many common periods are complete; None if nothing is left."""
        first, last = (self.first, complete) if self.whole else (0, len(self.sections))
        begin, end = self.begin, last * self.dynamics.motion.period if self.whole else self.end
        if last <= first or end <= begin:
            return None
        low, high = np.min(self.low[first:last], axis=0), np.max(self.high[first:last], axis=0)
        mean, square, apart = np.sum(self.integrals[first:last], axis=0) / (end - begin)
        sections = np.array(self.sections[first : last + 1] if self.whole else self.sections[:1])
        period, difference = _repetition(self._elastic(sections))
        return LimitCycle(
            begin=begin, end=end, peak_to_peak=high - low, rms=np.sqrt(np.maximum(square - mean**2, 0.0)),
            force_peak=np.max(self.force[first:last], axis=0), contact_loss=np.clip(apart, 0.0, 1.0), period=period,
            difference=difference,
        )  # fmt: skip

    def _elastic(self, sections: Array) -> Array:
        """States without rigid-body modes, which turn the train as a whole, but for velocities that are damped."""
        basis = self.dynamics.motion.basis
        n = basis.size // 2
        # Modes along which no mesh is deflected, but for rounding, and that nothing stiffens.
        still = ~np.any(np.abs(self.dynamics.gauge[:, :n]) > 1e-9 * np.abs(self.dynamics.gauge[:, :n]).max(), axis=0)
        free = still & (np.abs(self.dynamics.fixed[n : 2 * n, :n]).max(axis=0, initial=0.0) == 0)
        drag = np.abs(self.dynamics.fixed[n : 2 * n, n : 2 * n]).max(axis=0, initial=0.0)
        held = drag > UNDAMPED * drag.max(initial=0.0)
        return np.asarray(sections[:, np.concatenate([~free, ~free | held])])


def extremes(fine: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(C,)`` of functions given at equally spaced points ``(X, C)``.

    The extremes of the parabolas through the largest value and its two neighbours.
    """
    found = []
    columns = np.arange(fine.shape[1])
    for f in (-fine, fine):
        at = np.minimum(np.maximum(f.argmax(axis=0), 1), len(f) - 2)
        before, here, after = f[at - 1, columns], f[at, columns], f[at + 1, columns]
        bend, slope = 2 * here - before - after, 0.5 * (after - before)
        inside = (bend > 0) & (np.abs(slope) <= bend)
        rise = np.where(inside, 0.5 * slope**2 / np.where(inside, bend, 1.0), 0.0)
        found.append(np.maximum(f.max(axis=0), here + rise))
    return -found[0], found[1]


@cache
def _powers(kind: str, degree: int) -> Array:
    """``(X, degree + 1)``, u^k at the points of a kind."""
    return np.vander(_NODES if kind == "nodes" else _FINE, degree + 1, increasing=True)


def _repetition(sections: Array) -> tuple[int, float]:
    """(period, difference): the smallest number of sections after which the last ones repeat themselves."""
    count = len(sections)
    size = float(np.abs(sections - sections.mean(axis=0)).max(initial=0.0))
    size = max(size, float(np.abs(sections).max(initial=0.0)))
    least, best = 0, np.inf
    for p in range(1, min(LONGEST_CYCLE, (count - 1) // 2) + 1):
        ahead, behind = sections[count - p - 1 :], sections[count - 2 * p - 1 : count - p]
        difference = float(np.abs(ahead - behind).max(initial=0.0)) / size if size > 0 else 0.0
        if difference <= SETTLED:
            return p, difference
        best = min(best, difference)
    return least, best
