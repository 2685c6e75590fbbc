"""A steady state at the nodes of short panels between jumps, for integrals and extremes over a common period.

Each interval is divided into equal panels of five Gauss-Lobatto nodes, the ends included: integrals are exact for
polynomials of degree seven, and values with their derivatives give the extremes in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.response.linear.intervals import SteadyPoints, intervals, occupied
from gearstab.response.measures.extremes import BETWEEN, HERMITE, NODES, RATES, extremes
from gearstab.system import Array

WEIGHTS = np.array([1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20])
"""Gauss-Lobatto rule of five nodes on [0, 1] (Abramowitz & Stegun 1964, 25.4.32)."""
COARSE = np.array([1 / 6, 0.0, 2 / 3, 0.0, 1 / 6])
"""Simpson's rule on the same nodes, to judge by."""


@dataclass(frozen=True)
class PanelSamples:
    """One interval of K points.

    tau: ``(panels, 5, K)``, times in parts of the common period; length: ``(K,)``, of a panel.
    force, deflection: ``(panels, 5, K, meshes)``, mesh forces and deflections; force_rate, deflection_rate: their
    derivatives with respect to tau.
    """

    tau: Array
    length: Array
    force: Array
    deflection: Array
    force_rate: Array
    deflection_rate: Array

    def mean(self, values: Array, rule: Array = WEIGHTS) -> Array:
        """The contribution ``(K, ...)`` of values ``(panels, 5, K, ...)`` to a mean over the common period."""
        total = np.einsum("pjk...,j->k...", values, rule)
        return np.asarray(total * self.length.reshape(-1, *(1,) * (total.ndim - 1)))

    def extremes(self) -> tuple[Array, Array, Array]:
        """Return least and greatest force and deflection, and what samples alone would miss, ``(K, 2, meshes)``."""
        values = np.stack([self.force, self.deflection], axis=3)
        rates = np.stack([self.force_rate, self.deflection_rate], axis=3) * self.length[:, None, None]
        return extremes(values, rates)


def pieces(points: SteadyPoints, x: Array, panels: float) -> Iterator[PanelSamples]:
    """The steady state that begins with x ``(K, m)``; about that many panels in a common period."""
    basis, at = points.basis, points.at
    directions = points.excitation.directions[basis.rows]
    turn = 2 * np.pi * points.excitation.cycles
    gauge = np.einsum("rin,rnm->rim", directions, basis.outlet)[at]
    gauge_rate = np.einsum("rin,rnm->rim", directions, basis.speed)[at] * (turn / points.omega)[:, None, None]
    for q, interval in zip(occupied(points), intervals(points), strict=True):
        begin, end = points.edges[at, q], points.edges[at, q + 1]
        # A whole number of panels, but for rounding, takes no further one.
        count = max(1, int(np.ceil((end - begin).max() * panels - 1e-9)))
        flat = _fractions(count, NODES)
        state = np.stack(list(interval.through(x, flat)))
        x = state[-1]
        tau = begin + flat[:, None] * (end - begin)
        shape = (count, len(NODES), len(at), -1)
        values = [np.einsum("kim,xkm->xki", part, state).reshape(shape) for part in (gauge, gauge_rate)]
        length = (end - begin) / count
        force, force_rate = _force(points, q, tau.reshape(shape[:3]), length, *values)
        yield PanelSamples(tau.reshape(shape[:3]), length, force, values[0], force_rate, values[1])


def _fractions(count: int, nodes: Array) -> Array:
    """``(count X,)``, where nodes of every panel are in an interval."""
    return np.asarray(((np.arange(count)[:, None] + nodes) / count).ravel())


def _force(
    points: SteadyPoints, q: int, tau: Array, length: Array, deflection: Array, rate: Array
) -> tuple[Array, Array]:
    """Mesh forces k (d - e) and their derivatives ``(panels, 5, K, meshes)`` in interval q, from deflections d."""
    drive, rows, at = points.excitation, points.basis.rows, points.at
    errors, slopes = drive.errors[rows][at], 2 * np.pi * drive.cycles * drive.slopes[rows][at]
    z, count = drive.z(tau), len(tau)
    stretch = deflection - np.einsum("kil,pjkl->pjki", errors, z)
    if drive.exact:
        stiffness = _stiffness(points, q, np.array([0.5]))
        return stiffness * stretch, stiffness * (rate - np.einsum("kil,pjkl->pjki", slopes, z))
    force = _stiffness(points, q, _fractions(count, NODES)).reshape(stretch.shape) * stretch
    # The derivative of the stiffness is not known: the force between the nodes stands for it.
    data = np.concatenate([deflection, rate * length[:, None]], axis=1)
    between = np.einsum("fj,pjki->pfki", HERMITE, data)
    later = drive.z(tau[:, :1] + BETWEEN[:, None] * length)
    stretch = between - np.einsum("kil,pjkl->pjki", errors, later)
    more = _stiffness(points, q, _fractions(count, BETWEEN)).reshape(stretch.shape) * stretch
    slope = np.einsum("fj,pjki->pfki", RATES, np.concatenate([force, more], axis=1))
    return force, slope / length[:, None]


def _stiffness(points: SteadyPoints, q: int, fractions: Array) -> Array:
    """``(X, K, meshes)`` within interval q, its ends from inside."""
    begin, end = points.edges[:, q], points.edges[:, q + 1]
    inner = np.array([0.5]) if points.excitation.exact else np.clip(fractions, 1e-9, 1 - 1e-9)
    values = points.values(begin + inner[:, None] * (end - begin))
    return np.asarray(points.excitation.split(values)[0][:, points.at])


def fastest(points: SteadyPoints) -> float:
    """The largest natural frequency at the mean stiffness times the common period, in turns, among the points."""
    values = np.abs(np.linalg.eigvals(points.basis.generator(_means(points)[None])[0]))
    return float(np.max(values.max(axis=-1, initial=0.0)[points.at] * points.period) / (2 * np.pi))


def _means(points: SteadyPoints) -> Array:
    """``(r, J)``, the mean values of what varies in A, by Gauss's rule of three points per interval, about."""
    edges = points.edges
    total = 0.0
    for q in occupied(points):
        width = edges[:, q + 1] - edges[:, q]
        for fraction, weight in ((0.1127, 5 / 18), (0.5, 4 / 9), (0.8873, 5 / 18)):
            values = points.values((edges[:, q] + fraction * width)[None])
            total = total + weight * width[:, None] * points.excitation.split(values)[1][0]
    return np.asarray(total)
