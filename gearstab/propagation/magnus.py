"""Steps of the sixth-order Magnus expansion of x' = A(t) x, prepared once for all mesh frequencies, and their products.

With A_1, A_2, A_3 at the Gauss-Legendre nodes of a step h and a_1 = A_2, a_2 = sqrt(15)/3 (A_3 - A_1),
a_3 = 10/3 (A_3 - 2 A_2 + A_1) the step is exp(W),

    W = h (a_1 + a_3/12) + 1/240 [-20 h a_1 - h a_3 + C_1, h a_2 + C_2],
    C_1 = h^2 [a_1, a_2],    C_2 = -1/60 [h a_1, 2 h a_3 + C_1],

a polynomial of degree five in h, whose matrices do not depend on the mesh frequency when time is measured in periods.
A step in which A is constant is exact. Its error is of order h^7 a step and even: halving all steps gains a factor 64.

Source: Blanes, Casas, Oteo & Ros 2009, Physics Reports 470, section 5.
"""

from __future__ import annotations

import numpy as np

from gearstab.system import Array

ORDER = 6
NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(15) / 10
"""Gauss-Legendre nodes of a step."""


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
