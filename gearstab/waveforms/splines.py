"""Splines up to cubic ones: what waves made of samples consist of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearstab.waveforms.base import Array

FEWEST = {"linear": 2, "cubic": 3}
"""Samples of a period that an interpolation needs at least."""

NARROW = 1e-12
"""Pieces shorter than this part of the period, between breakpoints that differ by rounding, count as constant."""

_NODES = np.array([0.125, 0.375, 0.625, 0.875])
_CUBIC = np.linalg.inv(np.vander(_NODES, increasing=True))
_SERIES_TERMS = 20
"""Terms of exp(-i z) for |z| < 1; the first one left out is below 1/20!, 4e-19."""


@dataclass(frozen=True)
class Pieces:
    """f(u) = sum_m c_km (u - u_k)^m for u_k <= u < u_{k+1}; the end pieces go on outside.

    Parameters
    ----------
    knots: ``(K + 1,)``, u_k, ascending.
    coefficients: ``(..., K, D)``, c_km, m = 0 .. D - 1.
    """

    knots: Array
    coefficients: Array

    @property
    def batch(self) -> tuple[int, ...]:
        return np.shape(self.coefficients)[:-2]

    @property
    def constant(self) -> bool:
        """Whether the pieces are of degree 0."""
        return np.shape(self.coefficients)[-1] == 1

    def value(self, u: Array) -> Array:
        """f; u broadcasts against the batch."""
        u = np.asarray(u, dtype=float)
        piece = np.clip(np.searchsorted(self.knots, u, side="right") - 1, 0, len(self.knots) - 2)
        t = u - self.knots[piece]
        if self.batch:
            shape = np.broadcast_shapes(u.shape, self.batch)
            table = np.broadcast_to(self.coefficients, (*shape, *self.coefficients.shape[-2:]))
            index = np.broadcast_to(piece, shape)[..., None, None]
            own = np.take_along_axis(table, index, axis=-2)[..., 0, :]
        else:
            own = self.coefficients[piece]
        return _horner(np.moveaxis(own, -1, 0), t)

    def extremes(self) -> tuple[Array, Array]:
        """Least and greatest value of f between the first and the last knot, ``(...)`` each."""
        power = np.arange(np.shape(self.coefficients)[-1])
        scaled = np.moveaxis(self.coefficients * np.diff(self.knots)[:, None] ** power, (-1, -2), (0, 1))
        return _ranges(np.concatenate([scaled, np.zeros((4 - len(power), *scaled.shape[1:]))]))

    def integral(self) -> Array:
        """Integrate f over all pieces, ``(...)``."""
        h, m = np.diff(self.knots)[:, None], np.arange(1, np.shape(self.coefficients)[-1] + 1)
        return np.sum(self.coefficients * h**m / m, axis=(-2, -1))

    def transform(self, theta: Array | float) -> Array:
        """Integral of f(u) exp(-i theta u) over all pieces, ``(...)``; theta broadcasts against the batch.

        In closed form: with h = u_{k+1} - u_k a piece gives exp(-i theta u_k) sum_m c_km h^(m+1) E_m(theta h).
        """
        theta = np.asarray(theta, dtype=float)[..., None]
        h = np.diff(self.knots)
        moments = _moments(theta * h, np.shape(self.coefficients)[-1])
        scaled = self.coefficients * h[:, None] ** np.arange(1, np.shape(self.coefficients)[-1] + 1)
        return np.sum(np.exp(-1j * theta * self.knots[:-1]) * np.sum(scaled * moments, axis=-1), axis=-1)


def interpolate(knots: Array, values: Array, interpolation: str, periodic: bool) -> Pieces:
    """Pieces through ``values (..., K + 1)`` at ``knots (K + 1,)``.

    interpolation: ``linear``, an error of O(h^2) for a smooth function and no value outside the samples', or ``cubic``,
    the spline with two continuous derivatives: O(h^4), but it overshoots at jumps. Its ends are periodic, the first and
    the last value being equal, or "not a knot".
    """
    knots, values = np.asarray(knots, dtype=float), np.asarray(values, dtype=float)
    if interpolation == "linear":
        slopes = np.diff(values, axis=-1) / np.diff(knots)
        return Pieces(knots, np.stack([values[..., :-1], slopes], axis=-1))
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(knots, values, axis=-1, bc_type="periodic" if periodic else "not-a-knot")
    return Pieces(knots, np.moveaxis(spline.c[::-1], (0, 1), (-1, -2)))


def cubic_extremes(function: Callable[[Array], Array], breakpoints: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(...)`` of a function of period 1 that is a cubic between breakpoints ``(..., B)``.

    Each piece is found from four values inside it, so that jumps at its ends do no harm.
    """
    edges = np.moveaxis(np.sort(breakpoints, axis=-1), -1, 0)
    width = np.diff(edges, axis=0, append=edges[:1] + 1.0)
    nodes = _NODES.reshape(-1, *[1] * edges.ndim)
    values = function(edges + width * nodes)
    return _ranges(np.tensordot(_CUBIC, np.where(width > NARROW, values, values[:1]), axes=1))


def _ranges(q: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(...)`` over 0 <= t <= 1 of the cubics sum_m q_m t^m, ``(4, B, ...)``, of all B."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # Zeros of q1 + 2 q2 t + 3 q3 t^2, in the form that does not cancel; where there are none, any t will do.
        root = np.sqrt(np.maximum(q[2] ** 2 - 3 * q[1] * q[3], 0.0))
        larger = -(q[2] + np.copysign(root, q[2]))
        inner = [np.clip(np.nan_to_num(t, nan=0.0), 0.0, 1.0) for t in (larger / (3 * q[3]), q[1] / larger)]
    found = np.stack([_horner(q, t) for t in (np.zeros(()), np.ones(()), *inner)])
    return found.min(axis=(0, 1)), found.max(axis=(0, 1))


def _horner(coefficients: Array, t: Array) -> Array:
    """sum_m c_m t^m, of coefficients ``(D, ...)``."""
    total = np.broadcast_to(coefficients[-1], np.broadcast_shapes(coefficients[-1].shape, np.shape(t)))
    for c in coefficients[-2::-1]:
        total = total * t + c
    return total


def _moments(z: Array, count: int) -> Array:
    """E_m(z) = integral of t^m exp(-i z t) over 0 .. 1, ``(..., count)``, m = 0 .. count - 1.

    i z E_m = m E_{m-1} - exp(-i z), which loses no digits for |z| >= 1 and so few m; below that the power series.
    """
    small = np.abs(z) < 1.0
    safe = np.where(small, 1.0, z)
    decay = np.exp(-1j * safe)
    large = [(1.0 - decay) / (1j * safe)]
    for m in range(1, count):
        large.append((m * large[-1] - decay) / (1j * safe))
    near, term = np.where(small, z, 0.0), np.ones(np.shape(z), dtype=complex)
    series = [np.zeros(np.shape(z), dtype=complex) for _ in range(count)]
    for k in range(_SERIES_TERMS):
        series = [total + term / (m + k + 1) for m, total in enumerate(series)]
        term = term * (-1j * near) / (k + 1)
    return np.stack([np.where(small, a, b) for a, b in zip(series, large, strict=True)], axis=-1)
