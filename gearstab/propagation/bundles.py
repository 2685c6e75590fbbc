"""Many intervals at once, where everything is constant between jumps: a long common period has thousands of them.

Interval by interval the steps between samples would be matrices, and most of the time that of calling NumPy. Here the
motion is first taken from interval to interval, then followed inside a bundle of them together, by modal amplitudes y
that every step only multiplies:

    x = Re X y,    y' = L y + X^-1 B z(t),    A = X L X^-1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.propagation.intervals import ENTRIES, Interval, SteadyPoints, intervals
from gearstab.propagation.segment import Eigen, divided_exponential
from gearstab.system import Array


@dataclass(frozen=True)
class Bundle:
    """Q neighbouring intervals of K points.

    q: ``(Q,)``, their numbers.
    eigen: of all states and rows; state: ``(Q, K)``, which of them each point is in, or ``(Q, 1)`` where all points are
        of one row.
    begin, length: ``(Q, K)``, parts of the common period.
    """

    points: SteadyPoints
    q: Array
    eigen: Eigen
    state: Array
    begin: Array
    length: Array

    def some(self, index: Array | slice) -> Bundle:
        """Return some of the intervals, by position."""
        own = {name: getattr(self, name)[index] for name in ("q", "state", "begin", "length")}
        return replace(self, **own)

    @property
    def duration(self) -> Array:
        """``(Q, K)``, in units of 1/rate."""
        return np.asarray(self.length * self.points.period)

    @property
    def stiffness(self) -> Array:
        """``(Q, K, meshes)``."""
        return np.asarray(self.points.excitation.split(self.points.equation.middles[self.q])[0][:, self.points.at])

    def through(self, x: Array) -> tuple[BundleCourse, Array]:
        """Return the course that begins with x ``(K, m)``, and the state at its end."""
        drive = self._drive()
        growth, quotients = self.steps(np.ones(1))
        quotients = quotients[0] * self.phases(0.0)[..., None, :]
        begins = np.empty((*self.length.shape, x.shape[-1]), dtype=complex)
        for k, state in enumerate(self.state):
            inverse = self.eigen.inverse[state]
            drive[k] = inverse @ drive[k]
            begins[k] = (inverse @ x[..., None])[..., 0]
            y = growth[0, k] * begins[k] + (quotients[k] * drive[k]).sum(axis=-1)
            x = (self.eigen.vectors[state] @ y[..., None])[..., 0].real
        return BundleCourse(self, begins, drive), x

    def _drive(self) -> Array:
        """``(Q, K, m, 1 + H)``, forces times the durations, of c cos + s sin = Re[(c - i s) exp(i phi)]."""
        points = self.points
        constant, rates = points.equation.forces(points.equation.middles[self.q])
        drive = constant[:, points.at] + points.omega[:, None, None] * rates[points.at]
        inner = np.concatenate([drive[..., :1], drive[..., 1::2] - 1j * drive[..., 2::2]], axis=-1)
        return np.asarray(inner * self.duration[..., None, None])

    def steps(self, fractions: Array) -> tuple[Array, Array]:
        """(exp ``(F, Q, K, m)``, what forces are multiplied by ``(F, Q, K, m, 1 + H)``) of parts of the intervals."""
        part = fractions[:, None, None, None]
        turn = np.concatenate([[0.0], self.points.excitation.harmonics]) * 2j * np.pi * self.length[..., None]
        growth = self.eigen.values[self.state] * self.duration[..., None] * part
        return np.exp(growth), divided_exponential(growth[..., None], (turn * part)[..., None, :]) * part[..., None]

    def phases(self, fraction: float) -> Array:
        """``(Q, K, 1 + H)``, exp(i phi) of the harmonics of z at a part of each interval."""
        harmonics = np.concatenate([[0.0], self.points.excitation.harmonics])
        return np.asarray(np.exp(2j * np.pi * harmonics * (self.begin + fraction * self.length)[..., None]))

    def modal(self, gauges: Array) -> Array:
        """Return gauges of the rows ``(r, i, m)`` for the amplitudes of each state, ``(states and rows, i, m)``."""
        vectors = self.eigen.vectors.reshape(-1, *gauges.shape[:1], *self.eigen.vectors.shape[1:])
        return (gauges @ vectors).reshape(-1, *gauges.shape[1:])


@dataclass(frozen=True)
class BundleCourse:
    """The way of a motion through a bundle: y at the beginning of each interval, ``(Q, K, m)``, and the forces on y."""

    bundle: Bundle
    begins: Array
    drive: Array

    def some(self, index: Array) -> BundleCourse:
        """Return some of the intervals, by position."""
        return BundleCourse(self.bundle.some(index), self.begins[index], self.drive[index])

    def amplitudes(self, panels: int, nodes: Array) -> Array:
        """Return y ``(Q, K, panels, nodes, m)`` at the nodes of equal panels, the first one 0 and the last one 1."""
        y, (growth, quotients) = self.begins, self.bundle.steps(nodes[1:] / panels)
        found = np.empty((*y.shape[:2], panels, len(nodes), y.shape[2]), dtype=complex)
        pushes = quotients * self.drive
        for k in range(panels):
            later = growth * y + (pushes @ self.bundle.phases(k / panels)[..., None])[..., 0]
            found[:, :, k, 0], found[:, :, k, 1:] = y, np.moveaxis(later, 0, 2)
            y = later[-1]
        return found

    def seen(self, modal: Array, panels: int, nodes: Array) -> Array:
        """Return what gauges show, see :meth:`Bundle.modal`, at the nodes of panels, ``(panels, nodes, Q, K, i)``."""
        amplitudes = self.amplitudes(panels, nodes)
        # Re(g y), real and imaginary parts beside each other as complex numbers keep them.
        pairs = np.swapaxes(modal.conj().view(float), -1, -2)[self.bundle.state]
        flat = amplitudes.reshape(*self.begins.shape[:2], panels * len(nodes), -1).view(float)
        values = (flat @ pairs).reshape(*amplitudes.shape[:-1], modal.shape[1])
        return np.ascontiguousarray(np.moveaxis(values, (2, 3), (0, 1)))


def bundles(points: SteadyPoints) -> Iterator[Bundle | Interval]:
    """All intervals of a common period that are not empty in every row, those that cannot be bundled one by one."""
    equation, at, q = points.equation, points.at, points.equation.occupied
    eigen = equation.states.eigen if equation.drive.exact else None
    if eigen is None:
        yield from intervals(points)
        return
    rows, m = len(equation.form.rows), equation.form.size
    own = at[:1] if np.all(at == at[0]) else at
    merged = (part.reshape(-1, *part.shape[2:]) for part in (eigen.values, eigen.vectors, eigen.inverse))
    begin, length = equation.edges[at][:, q].T, np.diff(equation.edges, axis=1)[at][:, q].T
    whole = Bundle(points, q, Eigen(*merged), equation.states.of[q, None] * rows + own, begin, length)
    at_once = max(1, ENTRIES // max(1, len(at) * m * (1 + equation.drive.width)))
    yield from (whole.some(slice(i, i + at_once)) for i in range(0, len(q), at_once))
