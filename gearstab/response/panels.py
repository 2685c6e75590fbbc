"""A steady state at the nodes of short panels between jumps, for integrals and extremes over a common period.

Each interval is divided into equal panels of five Gauss-Lobatto nodes, the ends included: integrals are exact for
polynomials of degree seven, and values with their derivatives give the extremes in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import polynomial

from gearstab.propagation.bundles import Bundle, BundleCourse, bundles
from gearstab.propagation.intervals import Interval, SteadyPoints
from gearstab.system import Array, of_wholes

NODES = 0.5 + 0.5 * np.array([-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0])
"""Nodes of the Gauss-Lobatto rule on [0, 1]."""
BETWEEN = np.array([0.055, 0.32, 0.68, 0.945])
"""Further points where a product with a function without known derivative is looked at."""
DEGREE = 2 * len(NODES) - 1
ROUNDS = 4
"""Rounds of Newton's method, from a ninth of a panel away."""
FLAT = 1e-13
"""Curvature below this part of a value is rounding."""


def _powers(x: Array, degree: int = DEGREE) -> Array:
    """Values at x in [0, 1] of the powers of y = 2 x - 1."""
    return polynomial.polyvander(2 * x - 1, degree)


def _derivatives(x: Array, degree: int = DEGREE) -> Array:
    """Their derivatives with respect to x."""
    return np.hstack([np.zeros((len(x), 1)), 2 * np.arange(1, degree + 1) * _powers(x, degree - 1)])


COEFFICIENTS = np.linalg.inv(np.vstack([_powers(NODES), _derivatives(NODES)]))
"""``(10, 10)``, powers of y from five values and five derivatives."""
GRID = np.linspace(0.0, 1.0, 9)
ON_GRID = _powers(GRID) @ COEFFICIENTS
HERMITE = _powers(BETWEEN) @ COEFFICIENTS
"""``(9, 10)`` and ``(4, 10)``, values on the grid and at the points between."""
RATES = _derivatives(NODES, 8) @ np.linalg.inv(_powers(np.concatenate([NODES, BETWEEN]), 8))
"""``(5, 9)``, derivatives at the nodes of the polynomial of degree eight through nodes and points between."""
CURVES = np.hstack([np.zeros((5, 2)), 4 * _powers(NODES, DEGREE - 2) * (np.arange(2, 10) * np.arange(1, 9))])
CURVES = CURVES @ COEFFICIENTS
"""``(5, 10)``, second derivatives at the nodes."""
_OFF = np.array([0.07, 0.93])
"""Between the outer two nodes at either end, where interpolation errs most."""
DOUBT = _powers(_OFF) @ COEFFICIENTS
DOUBT[:, :5] -= _powers(_OFF, 4) @ np.linalg.inv(_powers(NODES, 4))
"""``(2, 10)``, by how much the polynomial of degree four through the values alone is off."""


def extremes(values: Array, rates: Array) -> tuple[Array, Array, Array]:
    """Least and greatest value ``(...)`` on all panels, and the largest error ``(...)`` without the derivatives.

    values, rates: ``(panels, 5, ...)``, at the nodes of each panel, and their derivatives times its length.

    Through five values and five derivatives at the Gauss-Lobatto nodes of a panel goes a polynomial of degree nine. Its
    error for exp(i w t) on a panel of length h is below (w h)^10/4e10 or so: 1e-8 at two radians a panel. The largest
    of its values on a grid tells the panels where the extreme may be, and Newton's method on the derivative finds it
    there.
    """
    shape, origin = values.shape[2:], values[0, 0]
    # A small fluctuation of a large force keeps its digits.
    data = np.concatenate([values - origin, rates], axis=1).reshape(len(values), len(COEFFICIENTS), -1)
    grid = ON_GRID @ data
    doubt = np.abs(DOUBT @ data).max(axis=(0, 1), initial=0.0)
    both = _greatest(np.concatenate([data, -data], axis=2), np.concatenate([grid, -grid], axis=2)).reshape(2, *shape)
    least, greatest = origin - both[1], origin + both[0]
    exact = values.min(axis=(0, 1)), values.max(axis=(0, 1))
    return np.minimum(least, exact[0]), np.maximum(greatest, exact[1]), doubt.reshape(shape)


def _greatest(data: Array, grid: Array) -> Array:
    """``(Q,)``, of the functions with ``data (panels, 10, Q)`` and values ``(panels, 9, Q)`` on the grid."""
    at = grid.argmax(axis=1)[:, None]
    inner = np.clip(at, 1, len(GRID) - 2)
    left, middle, right = (np.take_along_axis(grid, inner + k, axis=1)[:, 0] for k in (-1, 0, 1))
    top = np.take_along_axis(grid, at, axis=1)[:, 0]
    best = top.max(axis=0)
    # A parabola through neighbours rises above them by an eighth of their second difference at most.
    bend = np.abs(left - 2 * middle + right)
    panel, column = np.nonzero((top + bend > best) & (bend > FLAT * np.abs(best)))
    c = (data[panel, :, column] @ COEFFICIENTS.T).T
    slope, curve = polynomial.polyder(c), polynomial.polyder(c, 2)
    start, width = 2 * GRID[at[panel, 0, column]] - 1, 2 * GRID[1]
    low, high = np.maximum(start - width, -1.0), np.minimum(start + width, 1.0)
    y = start
    for _ in range(ROUNDS):
        first, second = polynomial.polyval(y, slope, tensor=False), polynomial.polyval(y, curve, tensor=False)
        step = np.where(second < 0, -first / np.where(second < 0, second, -1.0), width * np.sign(first))
        y = np.clip(y + step, low, high)
    np.maximum.at(best, column, polynomial.polyval(y, c, tensor=False))
    return np.asarray(best)


WEIGHTS = np.array([1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20])
"""Gauss-Lobatto rule of five nodes on [0, 1] (Abramowitz & Stegun 1964, 25.4.32)."""
COARSE = np.array([1 / 6, 0.0, 2 / 3, 0.0, 1 / 6])
"""Simpson's rule on the same nodes, to judge by."""


@dataclass(frozen=True)
class Panels:
    """Q intervals of K points, of equally many panels.

    tau: ``(panels, 5, Q, K)``, times in parts of the common period; length: ``(Q, K)``, of a panel.
    """

    tau: Array
    length: Array

    @property
    def middle(self) -> Array:
        """``(Q, K)``, of each interval."""
        return np.asarray(0.5 * (self.tau[0, 0] + self.tau[-1, -1]))

    def mean(self, values: Array, rule: Array = WEIGHTS) -> Array:
        """The contribution ``(K, ...)`` of values ``(panels, 5, Q, K, ...)`` to a mean over the common period."""
        total = np.einsum("pjqk...,j->qk...", values, rule)
        return np.einsum("qk...,qk->k...", total, self.length)


@dataclass(frozen=True)
class Readings(Panels):
    """Readings of gauges, ``values (panels, 5, Q, K, i)``, in a part of the common period."""

    part: Bundle | Interval
    values: Array

    def of(self, first: int, last: int | None = None) -> Readings:
        """Return what some of the gauges show."""
        return replace(self, values=self.values[..., first:last])


@dataclass(frozen=True)
class PanelSamples(Panels):
    """Mesh forces and deflections.

    force, deflection: ``(panels, 5, Q, K, meshes)``; force_rate, deflection_rate: their derivatives with respect to
    tau.
    """

    force: Array
    deflection: Array
    force_rate: Array
    deflection_rate: Array

    def extremes(self) -> tuple[Array, Array, Array]:
        """Return least and greatest force and deflection, and what samples alone would miss, ``(Q, K, 2, meshes)``."""
        values = np.stack([self.force, self.deflection], axis=4)
        rates = np.stack([self.force_rate, self.deflection_rate], axis=4) * self.length[..., None, None]
        return extremes(values, rates)


def pieces(points: SteadyPoints, x: Array, panels: float) -> Iterator[PanelSamples]:
    """The steady state that begins with x ``(K, m)``; about that many panels in a common period."""
    return map(samples, readings(points, x, mesh_gauges(points), panels))


def readings(points: SteadyPoints, x: Array, gauges: Array, panels: float) -> Iterator[Readings]:
    """The steady state that begins with x ``(K, m)``, as ``gauges`` see it, ``(r, i, m)``: i linear functions of the
    state, for every row; about that many panels in a common period.
    """
    for part in bundles(points):
        if isinstance(part, Bundle):
            course, x = part.through(x)
            modal, counts = part.modal(gauges), _panels(part.length, panels)
            for count in dict.fromkeys(counts.tolist()):  # the first sample comes first
                yield _read(course.some(np.flatnonzero(counts == count)), modal, count)
        else:
            x, found = _read_alone(part, x, gauges, panels)
            yield found


def samples(piece: Readings) -> PanelSamples:
    """Mesh forces and deflections from what :func:`mesh_gauges` show."""
    return _bundled(piece, piece.part) if isinstance(piece.part, Bundle) else _alone(piece, piece.part)


def mesh_gauges(points: SteadyPoints) -> Array:
    """``(r, 2 meshes, m)``, mesh deflections and their derivatives with respect to time from x."""
    basis = points.basis
    directions = points.excitation.directions
    return np.concatenate([directions @ basis.outlet, directions @ basis.speed], axis=1)


def _deflections(points: SteadyPoints, seen: Array) -> tuple[Array, Array]:
    """Mesh deflections ``(..., K, meshes)`` and their derivatives with respect to tau from what gauges show."""
    deflection, rate = np.split(seen, 2, axis=-1)
    period = 2 * np.pi * points.excitation.cycles / points.omega
    return deflection, rate * period[:, None]


def _panels(length: Array, panels: float) -> Array:
    """``(Q,)``, how many panels each interval is divided into; a whole number, but for rounding, takes no further."""
    return np.maximum(1, np.ceil(length.max(axis=1) * panels - 1e-9)).astype(int)


def _read(course: BundleCourse, modal: Array, count: int) -> Readings:
    """The intervals of a course, of ``count`` panels each."""
    bundle = course.bundle
    fractions = _fractions(count, NODES).reshape(count, -1, 1, 1)
    tau = bundle.begin + fractions * bundle.length
    return Readings(tau, bundle.length / count, bundle, course.seen(modal, count, NODES))


def _bundled(piece: Readings, bundle: Bundle) -> PanelSamples:
    """Mesh forces and deflections in the intervals of a bundle."""
    deflection, rate = _deflections(bundle.points, piece.values)
    errors, slopes = _errors(bundle.points)
    z = bundle.points.excitation.z(piece.tau)
    force = bundle.stiffness * (deflection - np.einsum("kil,pjqkl->pjqki", errors, z))
    force_rate = bundle.stiffness * (rate - np.einsum("kil,pjqkl->pjqki", slopes, z))
    fields = _of_wholes(bundle.points, force, deflection, force_rate, rate)
    return PanelSamples(piece.tau, piece.length, *fields)


def _read_alone(interval: Interval, x: Array, gauges: Array, panels: float) -> tuple[Array, Readings]:
    """One interval after x ``(K, m)``, and the state at its end."""
    points, q = interval.points, interval.q
    begin, end = points.edges[points.at, q], points.edges[points.at, q + 1]
    count = int(_panels((end - begin)[None], panels)[0])
    flat = _fractions(count, NODES)
    state = np.stack(list(interval.through(x, flat)))
    seen = np.einsum("kim,xkm->xki", gauges[points.at], state)
    values = seen.reshape(count, len(NODES), 1, *seen.shape[1:])
    tau, length = (begin + flat[:, None] * (end - begin)).reshape(values.shape[:4]), (end - begin) / count
    return state[-1], Readings(tau, length[None], interval, values)


def _alone(piece: Readings, interval: Interval) -> PanelSamples:
    """Mesh forces and deflections in one interval."""
    points, tau, length = interval.points, piece.tau[:, :, 0], piece.length[0]
    deflection, rate = _deflections(points, piece.values[:, :, 0])
    force, force_rate = _force(points, interval.q, tau, length, deflection, rate)
    fields = _of_wholes(points, force, deflection, force_rate, rate)
    return PanelSamples(piece.tau, piece.length, *(field[:, :, None] for field in fields))


def _of_wholes(points: SteadyPoints, force: Array, deflection: Array, force_rate: Array, rate: Array) -> list[Array]:
    """The same of whole meshes: forces of parts added to theirs, deflections of parts left out."""
    wholes = points.excitation.wholes
    if wholes is None:
        return [force, deflection, force_rate, rate]
    count = wholes.shape[1]
    return [of_wholes(force, wholes), deflection[..., :count], of_wholes(force_rate, wholes), rate[..., :count]]


def _fractions(count: int, nodes: Array) -> Array:
    """``(count X,)``, where nodes of every panel are in an interval."""
    return np.asarray(((np.arange(count)[:, None] + nodes) / count).ravel())


def _force(
    points: SteadyPoints, q: int, tau: Array, length: Array, deflection: Array, rate: Array
) -> tuple[Array, Array]:
    """Mesh forces k (d - e) and their derivatives ``(panels, 5, K, meshes)`` in interval q, from deflections d."""
    drive, (errors, slopes) = points.excitation, _errors(points)
    z, count = drive.z(tau), len(tau)
    stretch = deflection - np.einsum("kil,pjkl->pjki", errors, z)
    if drive.exact:
        stiffness, push = _teeth(points, q, np.array([0.5]))
        return stiffness * stretch - push, stiffness * (rate - np.einsum("kil,pjkl->pjki", slopes, z))
    stiffness, push = (part.reshape(stretch.shape) for part in _teeth(points, q, _fractions(count, NODES)))
    force = stiffness * stretch - push
    # The derivative of the stiffness is not known: the force between the nodes stands for it.
    data = np.concatenate([deflection, rate * length[:, None]], axis=1)
    between = np.einsum("fj,pjki->pfki", HERMITE, data)
    later = drive.z(tau[:, :1] + BETWEEN[:, None] * length)
    stretch = between - np.einsum("kil,pjkl->pjki", errors, later)
    stiffness, push = (part.reshape(stretch.shape) for part in _teeth(points, q, _fractions(count, BETWEEN)))
    more = stiffness * stretch - push
    slope = np.einsum("fj,pjki->pfki", RATES, np.concatenate([force, more], axis=1))
    return force, slope / length[:, None]


def _errors(points: SteadyPoints) -> tuple[Array, Array]:
    """Transmission errors and their derivatives with respect to tau by z, ``(K, meshes, L)``."""
    drive, at = points.excitation, points.at
    return drive.errors[at], 2 * np.pi * drive.cycles * drive.slopes[at]


def _teeth(points: SteadyPoints, q: int, fractions: Array) -> tuple[Array, Array]:
    """Mesh stiffnesses, and forces that teeth exert by themselves, ``(X, K, meshes)`` within interval q, its ends from
    inside.
    """
    begin, end = points.edges[:, q], points.edges[:, q + 1]
    inner = np.array([0.5]) if points.excitation.exact else np.clip(fractions, 1e-9, 1 - 1e-9)
    values = points.equation.values(begin + inner[:, None] * (end - begin))
    stiffness, _, others = points.excitation.split(values)
    return stiffness[:, points.at], (others @ points.excitation.exerted.T)[:, points.at]


def fastest(points: SteadyPoints) -> float:
    """The largest natural frequency at the mean stiffness times the common period, in turns, among the points."""
    values = np.abs(np.linalg.eigvals(points.basis.generator(_means(points)[None])[0]))
    return float(np.max(values.max(axis=-1, initial=0.0)[points.at] * points.period) / (2 * np.pi))


def _means(points: SteadyPoints) -> Array:
    """``(r, J)``, the mean values of what varies in A, by Gauss's rule of three points per interval, about."""
    edges = points.edges
    total = 0.0
    for q in points.equation.occupied:
        width = edges[:, q + 1] - edges[:, q]
        for fraction, weight in ((0.1127, 5 / 18), (0.5, 4 / 9), (0.8873, 5 / 18)):
            values = points.equation.values((edges[:, q] + fraction * width)[None])
            total = total + weight * width[:, None] * points.excitation.split(values)[1][0]
    return np.asarray(total)
