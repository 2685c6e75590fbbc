"""Maps of the state over intervals of time, x -> P x + p, for many points at once.

Where everything is constant between jumps the equation x' = A x + B z(t), z' = R z with R the rotations of the
harmonics, is linear with constant coefficients: one exponential of [[A, B], [0, R]] is exact, at resonance too. Smooth
functions are taken in steps of the sixth-order Magnus expansion of [[A(t), B(t) z(t)], [0, 0]] (Blanes, Casas, Oteo &
Ros 2009, section 5).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.general import magnus
from gearstab.floquet.general.exponential import expm
from gearstab.response.basis import Basis
from gearstab.response.excitation import Excitation
from gearstab.system import Array

ENTRIES = 2**17
"""Of the matrices that are treated at once."""

Map = tuple[Array, Array]
"""P ``(K, m, m)`` and p ``(K, m)``."""


@dataclass(frozen=True)
class Points:
    """K operating points: rows of a basis and mesh frequencies.

    excitation: of all rows of the system; basis: of some of them.
    at: ``(K,)``, positions among the basis's rows;  omega: ``(K,)``, Omega.
    steps: Magnus steps in an interval between edges (of no effect where all is piecewise constant).
    """

    excitation: Excitation
    basis: Basis
    at: Array
    omega: Array
    steps: int = 1

    @property
    def edges(self) -> Array:
        """``(r, Q + 1)``, between which everything is smooth, in parts of the common period."""
        return self.excitation.schedule.edges[self.basis.rows]

    @property
    def period(self) -> Array:
        """``(K,)``, the common period in units of 1/rate."""
        return 2 * np.pi * self.excitation.cycles / self.omega * self.basis.rate[self.at]

    def values(self, tau: Array) -> Array:
        """``(X, r, J)``, the varying functions at the times ``(X, r)``."""
        excitation = self.excitation
        every = np.zeros((len(excitation.schedule.edges), len(tau)))
        every[self.basis.rows] = tau.T
        return np.swapaxes(excitation.varying(every)[self.basis.rows], 0, 1)

    def inputs(self, values: Array) -> tuple[Array, Array, Array]:
        """A ``(X, r, m, m)``, and B = B_0 + Omega B_1, ``(X, r, m, L)`` and ``(r, m, L)``, for values ``(X, r, J)``."""
        excitation, rows = self.excitation, self.basis.rows
        every = np.zeros((len(values), len(excitation.schedule.edges), values.shape[-1]))
        every[:, rows] = values
        force = excitation.force(every)[:, rows]
        inner = excitation.split(values)[1]
        inlet = self.basis.inlet
        return self.basis.generator(inner), inlet @ force, inlet @ excitation.force_of_rates[rows]

    def subset(self, chosen: Array) -> Points:
        """Some of the points."""
        return Points(self.excitation, self.basis, self.at[chosen], self.omega[chosen], self.steps)


class Exact:
    """Propagation through one interval ``q`` between neighbouring edges, everything constant."""

    def __init__(self, points: Points, q: int) -> None:
        begin, end = points.edges[:, q], points.edges[:, q + 1]
        a, constant, rates = points.inputs(points.values(0.5 * (begin + end)[None]))
        excitation, at = points.excitation, points.at
        m, width = points.basis.size, excitation.width
        length = (end - begin)[at]
        duration = (length * points.period)[:, None, None]
        self.size = m
        self.start = excitation.z(begin)[at]
        drive = constant[0][at] + points.omega[:, None, None] * rates[at]
        size = _size(drive)
        self.start *= size
        self.generator = np.zeros((len(at), m + width, m + width))
        self.generator[:, :m, :m] = a[0][at] * duration
        self.generator[:, :m, m:] = drive * duration / size[:, :, None]
        turn = 2 * np.pi * length[:, None] * excitation.harmonics
        cosine = m + 1 + 2 * np.arange(len(excitation.harmonics))
        self.generator[:, cosine, cosine + 1] = -turn
        self.generator[:, cosine + 1, cosine] = turn

    def across(self) -> Map:
        """The map over the whole interval."""
        return self._map(expm(self.generator))

    def _map(self, e: Array) -> Map:
        m = self.size
        return e[:, :m, :m], np.einsum("kil,kl->ki", e[:, :m, m:], self.start)

    def at(self, fractions: Array) -> Iterator[Map]:
        """The maps from the beginning to the given fractions (X,) of the interval."""
        count = max(1, ENTRIES // self.generator.size)
        for i in range(0, len(fractions), count):
            some = fractions[i : i + count, None, None, None] * self.generator
            e = expm(some.reshape(-1, *some.shape[2:])).reshape(some.shape)
            yield from map(self._map, e)

    def through(self, x: Array, fractions: Array) -> Iterator[Array]:
        """The states x ``(K, m)`` at ascending fractions of the interval, from the one at its beginning."""
        whole = np.concatenate([x, self.start], axis=1)
        known: dict[float, Array] = {}
        for step in np.diff(fractions, prepend=0.0):
            if step > 0:
                key = round(float(step), 14)
                if key not in known:
                    known[key] = expm(self.generator * step)
                whole = np.einsum("kij,kj->ki", known[key], whole)
            yield whole[:, : self.size]


class Stepped:
    """The same where functions vary smoothly, in Magnus steps."""

    def __init__(self, points: Points, q: int) -> None:
        self.points = points
        self.begin, self.end = points.edges[:, q], points.edges[:, q + 1]

    def across(self) -> Map:
        """The map over the whole interval."""
        return self._step(0.0, 1.0)

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
        begin = 0.0
        for end in fractions:
            yield self._step(begin, float(end))
            begin = float(end)

    def _step(self, begin: float, end: float) -> Map:
        points, m = self.points, self.points.basis.size
        p, shift = np.broadcast_to(np.eye(m), (len(points.at), m, m)), np.zeros((len(points.at), m))
        if end == begin:
            return p, shift
        pieces = max(1, int(np.ceil(points.steps * (end - begin) - 1e-9)))
        for k in range(pieces):
            width = (end - begin) / pieces
            nodes = begin + (k + magnus.NODES) * width
            tau = self.begin + nodes[:, None] * (self.end - self.begin)
            exponent, size = self._exponent(tau, width)
            e = expm(exponent)
            push = size * (e[:, :m, m] + points.omega[:, None] * e[:, :m, m + 1])
            p, shift = e[:, :m, :m] @ p, np.einsum("kij,kj->ki", e[:, :m, :m], shift) + push
        return p, shift

    def _exponent(self, tau: Array, width: float) -> tuple[Array, Array]:
        """``(K, m + 2, m + 2)``, and ``(K, 1)``, what its last two columns are to be multiplied by.

        These are the forces without and with the factor Omega.
        """
        points, m = self.points, self.points.basis.size
        a, constant, rates = points.inputs(points.values(tau))
        z = points.excitation.z(tau)
        whole = np.zeros((len(points.edges), 3, m + 2, m + 2))
        whole[:, :, :m, :m] = np.swapaxes(a, 0, 1)
        whole[:, :, :m, m] = np.einsum("xril,xrl->rxi", constant, z)
        whole[:, :, :m, m + 1] = np.einsum("ril,xrl->rxi", rates, z)
        size = _size(whole[:, :, :m, m:].reshape(len(whole), -1, 2))
        whole[:, :, :m, m:] /= size[:, :, None, None]
        coefficients = magnus.polynomial(whole)[points.at]
        length = width * (self.end - self.begin)[points.at] * points.period
        powers = length[:, None] ** np.arange(1, 6)
        return np.einsum("kp,kpij->kij", powers, coefficients), size[points.at]


def _size(drive: Array) -> Array:
    """``(K, 1)``, what forces are divided by in an exponential, whose accuracy and cost go with its largest entry."""
    largest = np.abs(drive).max(axis=(1, 2), initial=0.0)
    return np.where(largest > 0, largest, 1.0)[:, None]


Interval = Exact | Stepped


def intervals(points: Points) -> Iterator[Interval]:
    """All intervals of a common period that are not empty in every row."""
    kind = Exact if points.excitation.exact else Stepped
    for q in occupied(points):
        yield kind(points, q)


def occupied(points: Points) -> list[int]:
    """The intervals that some row has."""
    return [int(q) for q in np.flatnonzero(np.any(np.diff(points.edges, axis=1) > 0, axis=0))]
