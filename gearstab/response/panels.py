"""A steady state at the nodes of short panels between jumps, for integrals and extremes over a common period.

Each interval is divided into equal panels of five Gauss-Lobatto nodes, the ends included: integrals are exact for
polynomials of degree seven, and the polynomial of degree four through the nodes gives the extremes in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.response.intervals import Points, intervals, occupied
from gearstab.system import Array

NODES = 0.5 + 0.5 * np.array([-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0])
WEIGHTS = np.array([1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20])
"""Gauss-Lobatto rule of five nodes on [0, 1] (Abramowitz & Stegun 1964, 25.4.32)."""
COARSE = np.array([1 / 6, 0.0, 2 / 3, 0.0, 1 / 6])
"""Simpson's rule on the same nodes, to judge by."""
FINE = np.polynomial.polynomial.polyvander(np.linspace(0.0, 1.0, 33), 4) @ np.linalg.inv(
    np.polynomial.polynomial.polyvander(NODES, 4)
)
"""``(33, 5)``: from the nodes to equally spaced points of the polynomial through them."""


@dataclass(frozen=True)
class Piece:
    """One interval of K points.

    tau: ``(panels, 5, K)``, times in parts of the common period; length: ``(K,)``, of a panel.
    force, deflection: ``(panels, 5, K, meshes)``, mesh forces and deflections.
    """

    tau: Array
    length: Array
    force: Array
    deflection: Array

    def mean(self, values: Array, rule: Array = WEIGHTS) -> Array:
        """The contribution ``(K, ...)`` of values ``(panels, 5, K, ...)`` to a mean over the common period."""
        total = np.einsum("pjk...,j->k...", values, rule)
        return np.asarray(total * self.length.reshape(-1, *(1,) * (total.ndim - 1)))

    @staticmethod
    def extremes(values: Array) -> tuple[Array, Array]:
        """Least and greatest value ``(K, ...)``."""
        fine = np.einsum("fj,pjk...->pfk...", FINE, values)
        return fine.min(axis=(0, 1)), fine.max(axis=(0, 1))


def pieces(points: Points, x: Array, panels: float) -> Iterator[Piece]:
    """The steady state that begins with x ``(K, m)``; about that many panels in a common period."""
    drive, rows, at = points.excitation, points.basis.rows, points.at
    gauge = np.einsum("rin,rnm->rim", drive.directions[rows], points.basis.outlet)[at]
    errors = drive.errors[rows][at]
    for q, interval in zip(occupied(points), intervals(points), strict=True):
        begin, end = points.edges[at, q], points.edges[at, q + 1]
        count = max(1, int(np.ceil((end - begin).max() * panels - 1e-9)))
        parts = (np.arange(count)[:, None] + NODES) / count
        flat = parts.ravel()
        state = np.stack(list(interval.through(x, flat)))
        x = state[-1]
        tau = begin + flat[:, None] * (end - begin)
        deflection = np.einsum("kim,xkm->xki", gauge, state)
        error = np.einsum("kil,xkl->xki", errors, drive.z(tau))
        force = _stiffness(points, q, flat) * (deflection - error)
        shape = (count, len(NODES), len(at), -1)
        yield Piece(tau.reshape(shape[:3]), (end - begin) / count, force.reshape(shape), deflection.reshape(shape))


def _stiffness(points: Points, q: int, fractions: Array) -> Array:
    """``(X, K, meshes)`` within interval q, its ends from inside."""
    begin, end = points.edges[:, q], points.edges[:, q + 1]
    inner = np.array([0.5]) if points.excitation.exact else np.clip(fractions, 1e-9, 1 - 1e-9)
    values = points.values(begin + inner[:, None] * (end - begin))
    return np.asarray(points.excitation.split(values)[0][:, points.at])


def fastest(points: Points) -> float:
    """The largest natural frequency at the mean stiffness times the common period, in turns, among the points."""
    values = np.abs(np.linalg.eigvals(points.basis.generator(_means(points)[None])[0]))
    return float(np.max(values.max(axis=-1, initial=0.0)[points.at] * points.period) / (2 * np.pi))


def _means(points: Points) -> Array:
    """``(r, J)``, the mean values of what varies in A, by the rule of three points an interval."""
    edges = points.edges
    total = 0.0
    for q in occupied(points):
        width = edges[:, q + 1] - edges[:, q]
        for fraction, weight in ((0.1127, 5 / 18), (0.5, 4 / 9), (0.8873, 5 / 18)):
            values = points.values((edges[:, q] + fraction * width)[None])
            total = total + weight * width[:, None] * points.excitation.split(values)[1][0]
    return np.asarray(total)
