"""All multipliers of a long product, from the largest to the smallest, none lost to rounding.

The eigenvalues of a product formed explicitly are right to eps times the *largest* one: after a long period the small
multipliers are noise, or have underflowed. Here the product is never formed. Orthogonal iteration carries an
orthonormal basis around the period, Q_{s+1} R_s = A_s Q_s; after a few rounds the basis is ordered by growth
and the multipliers of each growth level are the eigenvalues of a small diagonal block of R_S ... R_1, which is formed
with its own scale (periodic QR; Bojanczyk, Golub & Van Dooren 1992, Watkins 2007).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

Array = np.ndarray

ROUNDS = 16
"""At first. Two levels are separate when their growths a round differ by ln(1e17)/(ROUNDS - 2): the rounds then reduced
their mixing to 1e-17. Closer levels stay in one block."""
MOST_ROUNDS = 1024
WIDEST = 7.0
"""By how much the growths of a block may differ: its smallest multipliers lose a factor of exp(7) = 1,100. Points with
a wider block take twice the rounds."""
CLOSED = 1e-12
"""A split also needs the basis to return to itself: what is left below the split is convergence, not rotation."""


def log_multipliers(factors: Sequence[Array]) -> Array:
    """ln lambda of A_S ... A_2 A_1, ``(P, m)`` complex, imaginary part in (-pi, pi].

    factors: ``(P, m, m)`` each, A_1 first.

    Each factor should be moderately conditioned (subdivide long segments), then every ln lambda has an
    absolute error of some 1e-14 times the number of factors, however far the multipliers spread.
    """
    points, size = factors[0].shape[:2]
    return _iterated(factors, np.broadcast_to(_start(size), (points, size, size)), 0, ROUNDS)


def _iterated(factors: Sequence[Array], basis: Array, done: int, rounds: int) -> Array:
    """The same with a basis ``(P, m, m)`` of so many rounds, after that many at least."""
    points, size = basis.shape[:2]
    for _ in range(rounds - done):
        before, levels = basis, np.zeros((points, size))
        for basis, triangle in _round(factors, before):  # noqa: B007, the last one is that of the round
            levels += np.log(np.abs(np.diagonal(triangle, axis1=-2, axis2=-1)) + np.finfo(float).tiny)
    closing = np.swapaxes(before, -1, -2) @ basis
    result = np.empty((points, size), dtype=complex)
    splits = (np.diff(levels, axis=1) < -np.log(1e17) / (rounds - 2)) & (_below(closing) < CLOSED)
    wide, blocks = np.zeros(points, dtype=bool), []
    for key in np.unique(splits, axis=0):
        members = np.flatnonzero(np.all(splits == key, axis=1))
        for block in np.split(np.arange(size), np.flatnonzero(key) + 1):
            part = slice(block[0], block[-1] + 1)
            wide[members] |= np.ptp(levels[members, part], axis=1) > WIDEST
            blocks.append((members, part, _Product(len(members), len(block))))
    # The last round once more: its triangles are as many as factors and are not kept.
    for _, triangle in _round(factors, before):
        for members, part, product in blocks:
            product.take(triangle[members, part, part])
    for members, part, product in blocks:
        result[members, part] = product.logs(closing[members, part, part])
    if wide.any() and rounds < MOST_ROUNDS:
        result[wide] = _iterated([factor[wide] for factor in factors], basis[wide], rounds, 2 * rounds)
    return result


def _round(factors: Sequence[Array], basis: Array) -> Iterator[tuple[Array, Array]]:
    """Q_{s+1} and R_s of each factor."""
    for factor in factors:
        basis, triangle = np.linalg.qr(factor @ basis)
        yield basis, triangle


def _start(size: int) -> Array:
    """A fixed orthonormal basis in general position."""
    return np.linalg.qr(np.random.default_rng(20021).standard_normal((size, size)))[0]


def _below(closing: Array) -> Array:
    """``(P, m - 1)``: the largest entry of ``closing`` below and left of each possible split."""
    points, size = closing.shape[:2]
    below = np.empty((points, size - 1))
    for k in range(1, size):
        below[:, k - 1] = np.abs(closing[:, k:, :k]).max(axis=(1, 2))
    return below


class _Product:
    """A product of triangles ``(P, k, k)`` of size one, and its size as logarithms ``(P,)``."""

    def __init__(self, points: int, size: int) -> None:
        self.matrix, self.scale = np.broadcast_to(np.eye(size), (points, size, size)), np.zeros(points)

    def take(self, triangle: Array) -> None:
        """Multiply by a further triangle from the left."""
        product = triangle @ self.matrix
        size = np.abs(product).max(axis=(1, 2))
        self.matrix, self.scale = product / size[:, None, None], self.scale + np.log(size)

    def logs(self, closing: Array) -> Array:
        """ln of the eigenvalues of closing times the product."""
        return np.log(np.linalg.eigvals(closing @ self.matrix).astype(complex)) + self.scale[:, None]
