"""Maps of the state over intervals of time, x -> P x + p, for many points at once.

Where everything is constant between jumps the equation x' = A x + B z(t), z' = R z with R the rotations of the
harmonics, is linear with constant coefficients: the exponential of [[A, B], [0, R]] is exact, at resonance too. It is
formed from the eigenvectors of A, which serve all mesh frequencies, or as a whole where these are ill-conditioned.
Smooth functions are taken in steps of the sixth-order Magnus expansion of [[A(t), B(t) z(t)], [0, 0]] (Blanes, Casas,
Oteo & Ros 2009, section 5).

Of one motion through an interval in which functions vary smoothly only the vector is followed, by the Runge-Kutta
method of order 8 of Dormand & Prince (Hairer, Norsett & Wanner 1993, section II.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from gearstab.ckernel import exponentials
from gearstab.grouping import numbered
from gearstab.interrupts import heed
from gearstab.propagation import magnus
from gearstab.propagation.equation import INSIDE, Equation, Excitation
from gearstab.propagation.first_order import FirstOrder
from gearstab.propagation.segment import augmented
from gearstab.system import Array

ENTRIES = 2**17
"""Entries of the matrices that are treated at once."""

Map = tuple[Array, Array]
"""P ``(K, m, m)`` and p ``(K, m)``."""
RELATIVE = 1e-11
"""Error of a step as a part of the state. That of 20 periods of 41 intervals, m = 72, is 2e-12."""

DEGREES = (16, 32, 64)
"""Degrees of polynomials that approximate what varies in an interval, each tried where the one before is not enough."""
RESOLVED = 1e-14
"""Size of the last coefficients of such a polynomial, as a part of the largest."""


@dataclass(frozen=True)
class SteadyPoints:
    """K operating points: rows of an equation and mesh frequencies.

    at: ``(K,)``, positions among the rows;  omega: ``(K,)``, Omega.
    steps: Magnus steps in an interval between edges (of no effect where all is piecewise constant).
    """

    equation: Equation
    at: Array
    omega: Array
    steps: int = 1

    @classmethod
    def of(cls, equation: Equation, at: Array, omega: Array, steps: int = 1) -> SteadyPoints:
        """Return points of rows of an equation, each a row of its own where A goes with the speed."""
        if equation.form.by_speed is not None:
            equation, at = equation.at_speeds(at, omega), np.arange(len(at))
        return cls(equation, at, omega, steps)

    @property
    def excitation(self) -> Excitation:
        """Excitation of the rows."""
        return self.equation.drive

    @property
    def basis(self) -> FirstOrder:
        """The first-order form of the rows."""
        return self.equation.form

    @property
    def edges(self) -> Array:
        """``(r, Q + 1)``, between which everything is smooth, in parts of the common period."""
        return self.equation.edges

    @property
    def period(self) -> Array:
        """``(K,)``, the common period in units of 1/rate."""
        return 2 * np.pi * self.excitation.cycles / self.omega * self.basis.rate[self.at]


class Exact:
    """Propagation through one interval ``q`` between neighbouring edges, everything constant."""

    def __init__(self, points: SteadyPoints, q: int) -> None:
        begin, end = points.edges[:, q], points.edges[:, q + 1]
        equation, at = points.equation, points.at
        constant, rates = equation.forces(equation.middles[q, None])
        self.points, self.q, self.state = points, q, equation.states.of[q]
        self.begin, self.length = begin[at], (end - begin)[at]
        self.duration = self.length * points.period
        self.drive = constant[0][at] + points.omega[:, None, None] * rates[at]
        self.turn = 2 * np.pi * self.length[:, None] * points.excitation.harmonics

    def _propagators(self, fractions: Array) -> Iterator[tuple[Array, Array]]:
        """(P, F) over parts of the interval, x -> P x + F z."""
        states, at = self.points.equation.states, self.points.at
        if (eigen := states.each[self.state]) is not None:
            for part in fractions:
                heed()
                yield eigen.propagators(at, part * self.duration, self.drive, part * self.turn)
            return
        size, duration = _size(self.drive)[:, :, None], self.duration[:, None, None]
        generator = augmented(states.generators[self.state, at] * duration, self.drive * duration / size, self.turn)
        m, count = self.drive.shape[1], max(1, ENTRIES // generator.size)
        for i in range(0, len(fractions), count):
            heed()
            some = fractions[i : i + count, None, None, None] * generator
            for e in exponentials(some.reshape(-1, *some.shape[2:])).reshape(some.shape):
                yield e[:, :m, :m], e[:, :m, m:] * size

    def across(self) -> Map:
        """The map over the whole interval."""
        return next(self.at(np.ones(1)))

    def at(self, fractions: Array) -> Iterator[Map]:
        """The maps from the beginning to the given fractions (X,) of the interval."""
        start = self.points.excitation.z(self.begin)
        for p, f in self._propagators(fractions):
            yield p, np.einsum("kil,kl->ki", f, start)

    def through(self, x: Array, fractions: Array) -> Iterator[Array]:
        """The states x ``(K, m)`` at ascending fractions of the interval, from the one at its beginning."""
        known: dict[float, tuple[Array, Array]] = {}
        steps = np.diff(fractions, prepend=0.0)
        drives = self.points.excitation.z(self.begin + (fractions - steps)[:, None] * self.length)
        for step, z in zip(steps, drives, strict=True):
            if step > 0:
                key = round(float(step), 14)  # equal steps, but for rounding, share their propagators
                if key not in known:
                    known[key] = next(self._propagators(np.array([step])))
                p, f = known[key]
                x = np.einsum("kij,kj->ki", p, x) + np.einsum("kil,kl->ki", f, z)
            yield x


class Stepped:
    """The same where functions vary smoothly, in Magnus steps."""

    def __init__(self, points: SteadyPoints, q: int) -> None:
        self.points, self.q = points, q
        self.begin, self.end = points.edges[:, q], points.edges[:, q + 1]

    def across(self) -> Map:
        """The map over the whole interval."""
        return next(self._steps(np.ones(1)))

    def at(self, fractions: Array) -> Iterator[Map]:
        """The maps from the beginning to the given ascending fractions (X,) of the interval."""
        m, count = self.points.basis.size, len(self.points.at)
        p, shift = np.broadcast_to(np.eye(m), (count, m, m)), np.zeros((count, m))
        for e, push in self._steps(fractions):
            p, shift = e @ p, np.einsum("kij,kj->ki", e, shift) + push
            yield p, shift

    def through(self, x: Array, fractions: Array) -> Iterator[Array]:
        """The states x ``(K, m)`` at ascending fractions of the interval, from the one at its beginning."""
        for e, push in self._steps(fractions):
            x = np.einsum("kij,kj->ki", e, x) + push
            yield x

    def _steps(self, fractions: Array) -> Iterator[Map]:
        """The maps from each fraction to the next, the first from 0."""
        points, m = self.points, self.points.basis.size
        whole = np.diff(fractions, prepend=0.0)
        # A whole number of steps, but for rounding, takes no further one.
        counts = np.where(whole > 0, np.maximum(1, np.ceil(points.steps * whole - 1e-9)), 0).astype(int)
        interval, before = numbered(counts)
        width = (whole / np.maximum(counts, 1))[interval]
        maps = self._maps((fractions - whole)[interval] + before * width, width)
        for count in counts:
            p, shift = np.broadcast_to(np.eye(m), (len(points.at), m, m)), np.zeros((len(points.at), m))
            for _ in range(count):
                e, push = next(maps)
                p, shift = e @ p, np.einsum("kij,kj->ki", e, shift) + push
            yield p, shift

    def _maps(self, begin: Array, width: Array) -> Iterator[Map]:
        """Return the generators of the Magnus steps that begin at fractions ``(S,)`` and have widths ``(S,)``, many
        prepared at once.
        """
        points, m = self.points, self.points.basis.size
        count = max(1, ENTRIES // (8 * len(points.at) * (m + 2) ** 2))
        for i in range(0, len(begin), count):
            heed()
            part = slice(i, i + count)
            nodes = (begin[part, None] + magnus.NODES * width[part, None]).ravel()
            tau = self.begin + nodes[:, None] * (self.end - self.begin)
            exponents, sizes = self._exponents(tau, width[part])
            maps = exponentials(exponents.reshape(-1, m + 2, m + 2)).reshape(exponents.shape)
            for e, size in zip(maps, sizes, strict=True):
                yield e[:, :m, :m], size * (e[:, :m, m] + points.omega[:, None] * e[:, :m, m + 1])

    def _exponents(self, tau: Array, width: Array) -> tuple[Array, Array]:
        """``(S, K, m + 2, m + 2)``, and ``(S, K, 1)``, what their last two columns are to be multiplied by.

        These are the forces without and with the factor Omega. tau: ``(3 S, r)``, three nodes a step.
        """
        points, m = self.points, self.points.basis.size
        a, constant, rates = points.equation.inputs(points.equation.values(tau))
        z = points.excitation.z(tau)
        whole = np.zeros((*tau.shape, m + 2, m + 2))
        whole[:, :, :m, :m] = a
        whole[:, :, :m, m] = np.einsum("xril,xrl->xri", constant, z)
        whole[:, :, :m, m + 1] = np.einsum("ril,xrl->xri", rates, z)
        whole = np.moveaxis(whole.reshape(len(width), 3, *whole.shape[1:]), 1, 2)
        size = _size(whole[..., :m, m:].reshape(-1, 3 * m, 2)).reshape(*whole.shape[:2], 1)
        whole[..., :m, m:] /= size[..., None, None]
        coefficients = magnus.polynomial(whole)[:, points.at]
        length = width[:, None] * (self.end - self.begin)[points.at] * points.period
        return magnus.exponent(coefficients, length), size[:, points.at]


def _size(drive: Array) -> Array:
    """``(K, 1)``, what forces are divided by in an exponential, whose accuracy and cost go with its largest entry."""
    largest = np.abs(drive).max(axis=(1, 2), initial=0.0)
    return np.where(largest > 0, largest, 1.0)[:, None]


Interval = Exact | Stepped


def intervals(points: SteadyPoints) -> Iterator[Interval]:
    """All intervals of a common period that are not empty in every row."""
    kind = Exact if points.excitation.exact else Stepped
    for q in points.equation.occupied:
        yield kind(points, int(q))


def followed(points: SteadyPoints, q: int, x: Array, fractions: Array) -> tuple[Array, Array]:
    """The states ``(X, m)`` of one operating point at ascending fractions of interval ``q``, and that at its end, from
    x ``(m,)`` at its beginning; NaN where the motion outgrew double precision.
    """
    basis, momentary = points.basis, _quickly(partial(_momentary, points, q))
    scale = float(np.diff(points.edges[0, q : q + 2])[0] * points.period[0])
    generators = np.concatenate([basis.constant, basis.parts[0]]).reshape(-1, len(x))
    count = 1 + basis.parts.shape[1]

    def slope(s: float, state: Array) -> Array:
        values = momentary(np.array([s]))[0]
        moved = values[:count] @ (generators @ state).reshape(count, -1) + values[count:]
        return np.asarray(scale * moved)

    # SciPy's integrators take a third of a second to import.
    from scipy.integrate import solve_ivp

    size = np.abs(x).max() + np.abs(slope(0.0, x)).max()
    found = np.full((len(fractions) + 1, len(x)), np.nan)
    if np.isfinite(size):
        asked = np.append(fractions[fractions < 1.0], 1.0)
        least = max(RELATIVE * size, np.finfo(float).tiny)
        motion = solve_ivp(slope, (0.0, 1.0), x, "DOP853", asked, rtol=RELATIVE, atol=least)
        found[: motion.y.shape[1]] = motion.y.T
        if motion.success:
            found[len(asked) - 1 :] = motion.y[:, -1]
    return found[:-1], found[-1]


def _momentary(points: SteadyPoints, q: int, fractions: Array) -> Array:
    """Return the functions that vary in an interval: 1, the functions in A, then the force on x, ``(X, 1 + J + m)`` at
    fractions.
    """
    drive, (begin, end) = points.excitation, points.edges[0, q : q + 2]
    tau = begin + (end - begin) * np.clip(fractions, INSIDE, 1.0 - INSIDE)
    values = drive.varying(tau[None])[0]
    constant, rates = points.equation.forces(values[:, None])
    force = (constant[:, 0] + points.omega[0] * rates[0]) @ drive.z(tau)[..., None]
    return np.concatenate([np.ones((len(tau), 1)), drive.split(values)[1], force[..., 0]], axis=1)


def _quickly(momentary: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The same by polynomials of Chebyshev, which take a fifth of the time, where these are as exact."""
    for degree in DEGREES:
        k = np.arange(degree)
        angle = np.pi * (k + 0.5) / degree
        values = momentary(0.5 + 0.5 * np.cos(angle))
        coefficients = 2 / degree * np.cos(k[:, None] * angle) @ values
        coefficients[0] /= 2
        size = np.abs(coefficients).max(axis=0)
        if np.all(np.abs(coefficients[-4:]) <= RESOLVED * size):
            break
    else:
        return momentary
    kept = coefficients[: 1 + int(np.flatnonzero(np.any(np.abs(coefficients) > RESOLVED * size, axis=1)).max())]
    orders = np.arange(len(kept))
    return lambda fractions: np.cos(orders * np.arccos(np.clip(2 * fractions[:, None] - 1, -1.0, 1.0))) @ kept
