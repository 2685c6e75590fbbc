"""Steps of the sixth-order Magnus expansion of x' = A(t) x, prepared once for all mesh frequencies, and their products.

With A_1, A_2, A_3 at the Gauss-Legendre nodes of a step h and a_1 = A_2, a_2 = sqrt(15)/3 (A_3 - A_1),
a_3 = 10/3 (A_3 - 2 A_2 + A_1) the step is exp(W),

    W = h (a_1 + a_3/12) + 1/240 [-20 h a_1 - h a_3 + C_1, h a_2 + C_2],
    C_1 = h^2 [a_1, a_2],    C_2 = -1/60 [h a_1, 2 h a_3 + C_1],

a polynomial of degree five in h, whose matrices do not depend on the mesh frequency when time is measured in periods.
A step in which A is constant is exact. Its error is of order h^7 a step and even: halving all steps gains a factor 64.

Source: Blanes, Casas, Oteo & Ros 2009, Physics Reports 470, section 5.

With a scheme of order p the difference of two results is 2^p - 1 times the error of the finer one once that has
converged (Richardson). How results are compared is left to whoever computes them; :class:`StepControl` decides which
points are computed again, and with how many steps: twice as many, or more, until a tolerance is reached.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearstab.system import Array

ORDER = 6
NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(15) / 10
"""Gauss-Legendre nodes of a step."""
AIM = 0.5
"""Error aimed at, as a part of the tolerance."""
LEAP = 3
"""Most doublings at once: a factor 8 in the number of steps, 2^18 in an error of order six."""


def polynomial(a: Array) -> Array:
    """``(..., 5, m, m)``: the matrices of h, h^2, ..., h^5 in W, from A at the nodes ``(..., 3, m, m)``."""
    first, middle, last = (a[..., k, :, :] for k in range(3))
    slope = np.sqrt(15) / 3 * (last - first)
    bend = 10 / 3 * (last - 2 * middle + first)
    c = _commutator(middle, slope)
    q1 = -_commutator(middle, bend) / 30
    q2 = -_commutator(middle, c) / 60
    base = -20 * middle - bend
    return np.stack(
        [
            middle + bend / 12,
            _commutator(base, slope) / 240,
            (_commutator(base, q1) + _commutator(c, slope)) / 240,
            (_commutator(base, q2) + _commutator(c, q1)) / 240,
            _commutator(c, q2) / 240,
        ],
        axis=-3,
    )


def _commutator(a: Array, b: Array) -> Array:
    return a @ b - b @ a


def exponent(coefficients: Array, step: Array) -> Array:
    """W ``(..., m, m)`` of steps' coefficients ``(..., 5, m, m)`` and lengths ``(...)``."""
    powers = np.asarray(step)[..., None] ** np.arange(1, 6)
    return np.einsum("...p,...pij->...ij", powers, coefficients)


def product(matrices: Array) -> tuple[Array, Array]:
    """Return P ``(..., m, m)`` and s ``(...)``: exp(s) P is the last of ``(..., S, m, m)`` times .. times the first."""
    scale = np.zeros(matrices.shape[:-3])
    while matrices.shape[-3] > 1:
        even = matrices.shape[-3] // 2 * 2
        pairs = matrices[..., 1:even:2, :, :] @ matrices[..., 0:even:2, :, :]
        matrices = np.concatenate([pairs, matrices[..., even:, :, :]], axis=-3)
        size = np.abs(matrices).max(axis=(-2, -1), initial=1e-300)
        if size.max() > 1e60 or size.min() < 1e-60:
            matrices = matrices / size[..., None, None]
            scale = scale + np.log(size).sum(axis=-1)
    return matrices[..., 0, :, :], scale


def scaled(matrix: Array) -> tuple[Array, float]:
    """Return a matrix over its largest entry, and the logarithm of that."""
    size = float(np.abs(matrix).max(initial=0.0))
    return (matrix / size, float(np.log(size))) if size > 0 else (matrix, 0.0)


def remainder(order: int) -> float:
    """Return the error of a converged result, as a part of its difference from that of half of the steps."""
    return 1.0 / (2**order - 1)


class StepControl:
    """Iteration over levels of resolution, each with the points to be computed there.

    level: ``(...)`` int, at which each point begins, raised in place. last: the largest one of each point. doubling:
    levels that double the steps. leap: doublings at once, at most. Every level is answered by :meth:`judge` before the
    next::

        for level, chosen in control:
            control.judge(error of the chosen points)
    """

    def __init__(
        self, level: Array, last: Array | int, tolerance: float, order: int, doubling: int = 1, leap: int = LEAP
    ) -> None:
        self.level, self.last = level, np.broadcast_to(last, level.shape)
        self.pending = np.ones(level.shape, dtype=bool)
        self.tolerance, self.order, self.doubling, self.leap = tolerance, order, doubling, leap

    def __iter__(self) -> Iterator[tuple[int, Array]]:
        """Yield levels in ascending order, and which points are to be computed there, bool."""
        while self.pending.any():
            level = int(self.level[self.pending].min())
            self.chosen = self.pending & (self.level == level)
            yield level, self.chosen

    def judge(self, error: Array | float, rounding: Array | float = 0.0) -> None:
        """Take the estimated errors of the points of this level; more steps follow where they are too large.

        rounding: the part of an error that more steps do not lessen. Errors that are not finite: an endless one is
        followed by twice the steps, NaN by none.
        """
        error, before = np.asarray(error), self.level[self.chosen]
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.maximum(error - rounding, 0.0) / np.maximum(AIM * self.tolerance, rounding)
            times = np.ceil(np.nan_to_num(np.log2(excess) / self.order, nan=1.0, posinf=1.0))
        more = self.doubling * np.clip(times, 1, self.leap).astype(int)
        # Where rounding has the last word more steps do not help.
        again = (error > self.tolerance) & (error > 2 * np.asarray(rounding)) & (before < self.last[self.chosen])
        self.level[self.chosen] = np.minimum(before + np.where(again, more, 0), self.last[self.chosen])
        self.pending[self.chosen] = again
