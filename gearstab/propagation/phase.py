"""The first-order equation of one row while the mesh frequency follows a path.

With theta(t) the phase of the first mesh, Omega = theta', and tau = theta/(2 pi N) in common periods,

    x' = A(tau, Omega) x + b(tau, Omega).

Between the edges of its schedule, where nothing varies with the phase and A not with the speed, a step is the
exponential of a constant matrix. By the eigenvectors A = X L X^-1 a step h takes y = X^-1 x to

    exp(L h) y + int_0^h exp(L (h - s)) X^-1 b(t + s) ds,

exactly where b is constant, and by Gauss-Legendre quadrature of three nodes where it varies, with steps so short that
the quadrature's error is some 1e-9 of what it adds. Otherwise sixth-order Magnus steps of [[A, b], [0, 0]] are taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from gearstab.ckernel import exponentials
from gearstab.grouping import numbered
from gearstab.interrupts import heed
from gearstab.propagation import magnus
from gearstab.propagation.equation import Equation
from gearstab.propagation.path import Path
from gearstab.propagation.segment import Eigen, divided_exponential
from gearstab.system import Array

QUADRATURE_REACH, MAGNUS_REACH = 0.5, 0.25
"""Longest steps in units of the fastest rate: the error goes as the seventh power, and is some 1e-9 then."""
NODES, WEIGHTS = magnus.NODES, np.array([5.0, 8.0, 5.0]) / 18
PROBES = np.linspace(0.0, 1.0, 65)[:-1] + 1 / 128
"""Parts of the common period at which the fastest rate is looked for."""
STEPS_AT_ONCE = 1 << 14
"""Steps that are prepared together."""
ENTRIES = 1 << 17
"""Entries of the matrices of steps that are treated together."""


@dataclass(frozen=True)
class Steps:
    """Steps that follow one another: begin, duration ``(S,)``, times, and in which part of the period its middle is.

    kept: ``(S,)``, whether a sample lies at the end of the step.
    """

    begin: Array
    duration: Array
    part: Array
    kept: Array


@dataclass(frozen=True)
class PhaseEquation(Equation):
    """The equation of a single row along paths of the mesh frequency."""

    @property
    def period(self) -> float:
        """Radians of the first mesh in a common period."""
        return 2 * np.pi * self.drive.cycles

    @property
    def rate(self) -> float:
        """The unit of 1/time of the first-order form."""
        return float(self.form.rate[0])

    @property
    def turns(self) -> float:
        """Cycles of the fastest harmonic of b in a common period, 0 where b is constant while A is."""
        return float(max(self.drive.harmonics, default=0.0))

    @property
    def exact(self) -> bool:
        """Whether A is constant between edges, whatever the path."""
        return self.drive.exact and self.form.by_speed is None

    def along(self, part: Array) -> Array:
        """``(X, J)``, what varies at parts of the common period."""
        return self.values(part[:, None])[:, 0]

    def generators(self, values: Array, speed: Array | float, rate: Array | float = 0.0) -> Array:
        """A ``(X, m, m)`` for what varies ``(X, J)`` at speeds ``(X,)`` that change at rates ``(X,)``."""
        own = self.form.generator(values[:, None], np.asarray(speed)[..., None])[:, 0]
        return own if self.form.by_rate is None else own + np.asarray(rate)[..., None, None] * self.form.by_rate[0]

    def push(self, values: Array, part: Array, speed: Array) -> Array:
        """b ``(X, m)`` for what varies ``(X, J)``, at parts of the common period and speeds ``(X,)``."""
        force = self.drive.force(values[:, None])[:, 0] + speed[:, None, None] * self.drive.force_of_rates[0]
        return np.asarray(np.einsum("mn,xnl,xl->xm", self.form.inlet[0], force, self.drive.z(part)))

    def longest_step(self, path: Path) -> float:
        """Return the longest step, in time; infinite where none is too long."""
        if self.exact and not self.turns:
            return np.inf
        generators = self.generators(self.along(PROBES), path.range[1])
        own = self.rate * np.abs(np.linalg.eigvals(generators)).max(initial=0.0)
        waves = 0 if self.drive.exact else 4 * max(source.cycles for source in self.drive.schedule.functions.found)
        forced = max(self.turns, waves) * path.range[1] / self.drive.cycles
        return float((QUADRATURE_REACH if self.exact else MAGNUS_REACH) / (own + forced))

    def magnus_maps(self, path: Path, begin: Array, duration: Array, part: Array) -> Iterator[tuple[Array, Array]]:
        """Yield P ``(m, m)`` and p ``(m,)`` of the maps x -> P x + p of steps, as :class:`Steps` has them."""
        m, extra = self.form.size, int(self.drive.acts)
        at_once = max(1, ENTRIES // (8 * (m + extra) ** 2))
        for i in range(0, len(begin), at_once):
            heed()
            some = slice(i, i + at_once)
            nodes = (begin[some, None] + NODES * duration[some, None]).ravel()
            speed, turned = path.speed_at(nodes), path.phase_at(nodes) / self.period
            middle = path.phase_at(begin[some] + 0.5 * duration[some]) / self.period
            # Within the interval, so that values on its ends are those of its inside.
            inside = np.clip(turned - np.repeat(np.floor(middle), 3), 0.0, 1.0)
            values = self.along(np.repeat(part[some], 3) if self.drive.exact else inside)
            a, size = np.zeros((len(nodes), m + extra, m + extra)), 1.0
            a[:, :m, :m] = self.generators(values, speed, path.rate_at(nodes))
            if extra:
                push = self.push(values, turned, speed)
                size = np.abs(push).max(initial=1e-300)
                a[:, :m, m] = push / size
            exponents = magnus.exponent(magnus.polynomial(a.reshape(-1, 3, *a.shape[1:])), duration[some] * self.rate)
            for e in exponentials(exponents):
                yield e[:m, :m], size * e[:m, m:].sum(axis=1)

    def follow(self, path: Path, time: Array, start: Array) -> Array:
        """Return x ``(samples, m)`` at times along a path, from x ``(m,)`` at the first of them."""
        found = np.empty((len(time), len(start)))
        found[0], x, done = start, start, 1
        spectral = self.exact and self.states.eigen is not None
        for steps in self._steps(path, time):
            states = (self._by_eigenvectors if spectral else self._by_magnus)(path, steps, x)
            x = states[-1]
            kept = states[steps.kept]
            found[done : done + len(kept)] = kept
            done += len(kept)
        return found

    def _steps(self, path: Path, time: Array) -> Iterator[Steps]:
        """Yield steps from sample to sample and from edge to edge, none longer than the longest."""
        longest = self.longest_step(path)
        ends = path.phase_at(time) / self.period
        # So many samples at once that there are about STEPS_AT_ONCE steps.
        jumps = (len(self.borders) - 1) * (ends[-1] - ends[0]) / max(1, len(time) - 1)
        finer = ceil((time[1] - time[0]) / longest) if len(time) > 1 else 1
        some = max(1, int(STEPS_AT_ONCE / (finer + jumps + 1)))
        for first in range(0, len(time) - 1, some):
            own = time[first : first + some + 1]
            low, high = ends[first], ends[first + len(own) - 1]
            turn = np.arange(np.floor(low), np.ceil(high) + 1)
            jump = (turn[:, None] + self.borders[:-1]).ravel()
            jump = jump[(jump > low) & (jump < high)]
            moments = path.moment(jump * self.period)
            knots = np.concatenate([own, np.clip(moments, own[0], own[-1]), path.knots(own[0], own[-1])])
            order = np.argsort(knots, kind="stable")
            knots, sample = knots[order], order < len(own)
            begin, duration, last = divided(knots, longest)
            kept = last.copy()
            kept[last] = sample[1:]
            # The middle of a step tells its interval; that of one without length does not matter.
            middle = path.phase_at(begin + 0.5 * duration) / self.period
            yield Steps(begin, duration, middle - np.floor(middle), kept)

    def _by_magnus(self, path: Path, steps: Steps, x: Array) -> Array:
        """Return x at the end of every step, ``(S, m)``."""
        found = np.empty((len(steps.part), len(x)))
        for k, (p, push) in enumerate(self.magnus_maps(path, steps.begin, steps.duration, steps.part)):
            x = p @ x + push
            found[k] = x
        return found

    def _by_eigenvectors(self, path: Path, steps: Steps, x: Array) -> Array:
        """Return the same where A is constant in every step."""
        eigen = self.states.eigen
        assert eigen is not None
        eigen = Eigen(*(part[:, 0] for part in (eigen.values, eigen.vectors, eigen.inverse)))
        place = np.clip(np.searchsorted(self.borders, steps.part, side="right") - 1, 0, len(self.borders) - 2)
        place = self.occupied[place]
        state = self.states.of[place]
        duration = steps.duration * self.rate
        growth = eigen.values[state] * duration[:, None]
        push = self._pushes(path, steps, place, growth, eigen)
        factor = np.exp(growth)
        result = np.empty((len(state), len(x)))
        runs = np.flatnonzero(np.diff(state, prepend=-1))
        for first, last in zip(runs, [*runs[1:], len(state)], strict=True):
            own = state[first]
            y, many = eigen.inverse[own] @ x, np.empty((last - first, len(x)), dtype=complex)
            for j in range(first, last):
                y = factor[j] * y + push[j]
                many[j - first] = y
            result[first:last] = (many @ eigen.vectors[own].T).real
            x = result[last - 1]
        return result

    def _pushes(self, path: Path, steps: Steps, place: Array, growth: Array, eigen: Eigen) -> Array:
        """Return the contribution of b to y in every step, ``(S, m)``."""
        if not self.drive.acts:
            return np.zeros_like(growth)
        duration, values = (steps.duration * self.rate)[:, None], self.middles[place, 0]
        result = np.zeros(growth.shape, dtype=complex)
        for node, weight in zip(NODES, WEIGHTS, strict=True) if self.turns else ((0.0, 1.0),):
            time = steps.begin + node * steps.duration
            push = self.push(values, path.phase_at(time) / self.period, path.speed_at(time))
            factor = np.exp((1 - node) * growth) if self.turns else divided_exponential(growth, np.zeros_like(growth))
            result += weight * duration * factor * _modal(eigen, self.states.of[place], push)
        return result


def _modal(eigen: Eigen, state: Array, push: Array) -> Array:
    """A push ``(S, m)`` on x as one on y, state by state: the matrices of all steps would take a gigabyte."""
    found = np.empty(push.shape, dtype=complex)
    order = np.argsort(state, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(state[order])) + 1):
        found[own] = push[own] @ eigen.inverse[state[own[0]]].T
    return found


def divided(knots: Array, longest: float) -> tuple[Array, Array, Array]:
    """Divide the stretches between knots into equal steps no longer than the longest.

    Returns begin and duration of the steps ``(S,)``, and whether each is the last one before a knot.
    """
    pieces = np.maximum(1, np.ceil(np.diff(knots) / longest)).astype(int)
    stretch, number = numbered(pieces)
    duration = (np.diff(knots) / pieces)[stretch]
    return knots[stretch] + number * duration, duration, number == pieces[stretch] - 1
