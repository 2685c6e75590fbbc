r"""Balls of matrix polynomials in floating point: the arithmetic of verifier.py and lyapunov.py.

A ball has coefficients c_0, ..., c_p, matrices of doubles, and a radius r: it holds all functions F of z on [-1, 1]
with |F(z) - (c_0 + c_1 z + ... + c_p z^p)|_2 <= r, the spectral norm, which is not larger than |.|, the root of the sum
of squares. Balls come in stacks, so that one call serves many segments.

Numbers are doubles, rounded to nearest. With m terms of products in any order, fused or not,
|fl(A B) - A B| <= m e/(1 - m e) |A| |B|, e = 2^-53 (Higham, Accuracy and Stability of Numerical Algorithms, 2002,
(3.13)). Bounds are larger by 0.1 %, which holds all roundings of bounds, and by TINY, which holds what underflows. What
overflows becomes no number, of which no comparison is true.

**Exponentials.** exp(E) is a sum of powers of E/2^k, k times squared. Let b_j be the sizes of the coefficients of
E/2^k, and their sum 1 at most. The coefficients of the exponential are below those of exp(b_0 + b_1 z + ...): those
beyond z^p together below exp(b_0 + b_1 R + b_2 R^2 + ...) R^-(p + 1) for any R >= 1. Those up to z^p are found by
products that leave out higher ones; the rest of the sum is below e/19!, and step n of Horner's scheme adds less than
e (p + 1) m^(3/2) 2^-52 to an error, which step n - 1 divides by n - 1 at least. What E/2^k is off by counts at most
exp(1 + its size) times.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import comb, factorial
from typing import Any

import numpy as np
from flint import arb_mat

Array = np.ndarray

ROUNDING, TINY, UP = 2.0**-52, 1e-150, 1.001
"""2 e; larger than a sum of squares that underflows; the factor on bounds."""
SPARE = 8
"""Roundings besides those of products: of factors and of sums."""
SMALL, TERMS = 1.0, 18
"""Size up to which an exponential is summed, the larger ones being squares; how many of its terms."""


@dataclass(frozen=True)
class Ball:
    """Coefficients ``(..., p + 1, m, m)``, radius ``(...)``."""

    centre: Array
    radius: Array

    def __getitem__(self, index: Any) -> Ball:
        return Ball(self.centre[index], self.radius[index])

    @property
    def turned(self) -> Ball:
        """The transposes."""
        return Ball(np.swapaxes(self.centre, -1, -2), self.radius)


def known(matrices: Array) -> Ball:
    """Matrices ``(..., m, m)`` as they are."""
    return Ball(matrices[..., None, :, :], np.zeros(matrices.shape[:-2]))


def total(weights: Array, matrices: Array, radii: Array) -> Ball:
    """Sums over i of ``weights[..., k, i]`` times matrices ``[..., i, :, :]``, each known to its radius, for all k.

    Weights may be off by a few roundings.
    """
    each = radii + SPARE * ROUNDING * size(matrices)
    centre = np.einsum("...ki,...iab->...kab", weights, matrices)
    return Ball(centre, UP * (np.abs(weights) @ each[..., None])[..., 0].sum(axis=-1))


def plus(a: Ball, b: Ball) -> Ball:
    """Add balls."""
    count = max(a.centre.shape[-3], b.centre.shape[-3])
    rounded = ROUNDING * (size(a.centre).sum(axis=-1) + size(b.centre).sum(axis=-1))
    return Ball(_longer(a.centre, count) + _longer(b.centre, count), UP * (a.radius + b.radius + rounded))


def product(a: Ball, b: Ball, degree: int) -> Ball:
    """Multiply; what is beyond a degree goes into the radius."""
    first, left, m = size(a.centre), reach(a.centre), a.centre.shape[-1]
    second, right = (first, left) if a is b else (size(b.centre), reach(b.centre))
    every = first[..., :, None] * second[..., None, :]
    rounded = (m * min(every.shape[-2:]) + SPARE) * ROUNDING * every.sum(axis=(-2, -1))
    beyond = np.add.outer(*map(np.arange, every.shape[-2:])) > degree
    radius = left * b.radius + (right + b.radius) * a.radius + every[..., beyond].sum(axis=-1) + rounded
    return Ball(_times(a.centre, b.centre, degree), UP * radius)


def exponential(a: Ball, degree: int) -> Ball:
    """exp(E), up to a degree."""
    sizes, m = size(a.centre), a.centre.shape[-1]
    largest = sizes.sum(axis=-1).max()
    if not np.isfinite(largest):
        raise np.linalg.LinAlgError("an exponent is not finite")
    halvings = max(0, int(np.ceil(np.log2(largest / SMALL))))
    small, own, radius = (part * 0.5**halvings for part in (a.centre, sizes, a.radius))
    unit = np.eye(m)
    found = np.broadcast_to(unit, (*radius.shape, 1, m, m))
    # Without E_0 no more powers than the degree.
    for order in range(TERMS if small[..., 0, :, :].any() else degree, 0, -1):
        found = _times(small / order, found, degree)
        found[..., 0, :, :] += unit
    rest = SMALL ** (TERMS + 1) / factorial(TERMS + 1) * np.exp(SMALL) + radius * np.exp(SMALL + radius)
    off = 8 * ((degree + 1) * m + SPARE) * ROUNDING * np.sqrt(m) + rest
    if own.shape[-1] > 1:
        powers = np.arange(own.shape[-1])
        ratio = np.clip(((degree + 1) / own[..., 1:]) ** (1 / powers[1:]), 1.0, 1e6).min(axis=-1)
        off += np.exp((own * ratio[..., None] ** powers).sum(axis=-1)) / ratio ** (degree + 1)
    ball = Ball(found, UP**2 * off)
    for _ in range(halvings):
        ball = product(ball, ball, degree)
    return ball


def _times(a: Array, b: Array, degree: int) -> Array:
    """Coefficients of a product, up to a degree."""
    p, q = a.shape[-3], b.shape[-3]
    if min(p, q) == 1:
        return np.asarray((a @ b)[..., : degree + 1, :, :])
    found = []
    for k in range(min(p + q - 1, degree + 1)):
        start, stop = max(0, k - q + 1), min(k + 1, p)
        found.append(
            (a[..., start:stop, :, :] @ b[..., k - stop + 1 : k - start + 1, :, :][..., ::-1, :, :]).sum(axis=-3)
        )
    return np.stack(found, axis=-3)


def _longer(coefficients: Array, count: int) -> Array:
    missing = count - coefficients.shape[-3]
    return (
        np.concatenate([coefficients, np.zeros((*coefficients.shape[:-3], missing, *coefficients.shape[-2:]))], axis=-3)
        if missing
        else coefficients
    )


def positive(a: Ball) -> bool:
    """Whether all symmetric matrices of balls are positive definite at all z of [-1, 1].

    They are convex combinations of their Bernstein coefficients.
    """
    symmetric = 0.5 * (a.centre + np.swapaxes(a.centre, -1, -2))
    weights, sizes = _bernstein(a.centre.shape[-3]), size(symmetric)
    rounded = SPARE * len(weights) * ROUNDING * (sizes @ np.abs(weights).T)
    return definite(np.einsum("ki,...iab->...kab", weights, symmetric), UP * (rounded + a.radius[..., None]))


def definite(matrices: Array, error: Array) -> bool:
    """Whether all symmetric matrices that are no farther from these than an error are positive definite. They are
    changed.

    L is positive definite if |L - c I - R R^T| < c for any c and R, as R R^T has no negative eigenvalue: R is a
    Cholesky factor of L - c I, however well it was computed. What L may be off is added.
    """
    count, diagonal = (matrices.shape[-1] + SPARE) * ROUNDING, np.einsum("...ii->...i", matrices)
    shift = 2 * error + 4 * count * np.abs(diagonal).sum(axis=-1) + TINY
    rounded = size(matrices) + shift
    diagonal -= shift[..., None]  # a view of the matrices
    try:
        root = np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return False
    rest = root @ np.swapaxes(root, -1, -2)
    rest -= matrices
    return bool((UP * (size(rest) + count * (size(root) ** 2 + rounded) + error) < shift).all())


def size(matrices: Array) -> Array:
    """The root of the sum of squares, from above."""
    return np.asarray(UP * np.sqrt(np.einsum("...ij,...ij->...", matrices, matrices)) + TINY)


def reach(centre: Array) -> Array:
    """Bound the spectral norm of a polynomial on [-1, 1].

    |A|_2^2 is the largest eigenvalue of A^T A, which is not farther from their mean s than |A^T A - s I|.
    """
    first, m = centre[..., 0, :, :], centre.shape[-1]
    square = np.swapaxes(first, -1, -2) @ first
    mean = np.einsum("...ii->...", square) / m
    off = size(square - mean[..., None, None] * np.eye(m)) + (m + SPARE) * ROUNDING * m * mean
    return np.asarray(UP * np.sqrt(mean + off) + size(centre[..., 1:, :, :]).sum(axis=-1) + TINY)


def enclosed(matrices: list[list[arb_mat]]) -> tuple[Array, Array]:
    """Doubles near matrices, and how far these may be off."""
    middles = np.array([[near(part) for part in parts] for parts in matrices])
    radii = np.array([[[[float(x.rad())] for x in part.entries()] for part in parts] for parts in matrices])
    return middles, UP * (size(radii) + ROUNDING * size(middles))


@cache
def _bernstein(count: int) -> Array:
    """From coefficients of a polynomial on [-1, 1] to those of Bernstein."""
    n = range(count)
    shift = [[comb(k, j) * 2**j * (-1) ** (k - j) for k in n] for j in n]
    return np.array(
        [[float(sum(Fraction(comb(i, j), comb(count - 1, j)) * shift[j][k] for j in n)) for k in n] for i in n]
    )


def exact(matrix: Array) -> arb_mat:
    """Doubles as they are."""
    return arb_mat(matrix.tolist())


def near(matrix: arb_mat) -> Array:
    """Doubles near the midpoints."""
    return np.array([*map(float, matrix.entries())]).reshape(matrix.nrows(), matrix.ncols())
