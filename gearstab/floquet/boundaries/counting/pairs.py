"""The two multipliers of opposite sign that are about to meet, reduced to the two numbers that decide their fate.

On the invariant subspace of a positive and a negative multiplier, in a basis e+, e- with Krein form diag(1, -1), the
monodromy matrix is mu exp(i X) with X = [[x, b], [-b*, -y]] and real x, y. With the detuning delta = x + y the
multipliers are on the unit circle where |delta| > 2 |b|. As the period grows delta goes from negative to positive, so
that

    delta + 2 |b| = 0 at the edge where the pair leaves the circle,    delta - 2 |b| = 0 where it returns.

Both are smooth, nearly linear and well conditioned: they cross zero with the slope of the phases, however narrow the
tongue, unlike the discriminant, delta^2 - 4 |b|^2, which is no larger than the square of the tongue's width. The
basis is the Euclidean one of the subspace that diagonalises the form; delta and b depend on that choice, their zeros
do not.

Source: Gelfand & Lidskii 1955; Yakubovich & Starzhinskii 1975, ch. III (strong stability and the 2 x 2 case).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array

SELF, COMBINATION = 0, 1
"""Classes of pairs: a multiplier and its complex conjugate, which meet at +-1, and all others."""


@dataclass(frozen=True)
class KreinSpectrum:
    """Multipliers of P points and their Krein signs.

    values ``(P, 2n)``, vectors ``(P, 2n, 2n)`` in columns; sign ``(P, 2n)``: kappa for unit vectors; off ``(P, 2n)``:
    not on the unit circle; mirror ``(P, 2n)``: position of the multiplier nearest to 1/conj(lambda), another one
    where off.
    """

    values: Array
    vectors: Array
    sign: Array
    off: Array
    mirror: Array


def least_off(matrix: Array, found: KreinSpectrum) -> tuple[Array, Array]:
    """Return delta and |b| ``(2, P)`` of the pair of each class that is least far off the circle; NaN without one."""
    table, outside = np.full((2, 2, len(matrix)), np.nan), found.off & (np.abs(found.values) > 1)
    for kind in (SELF, COMBINATION):
        excess = np.where(outside & ((found.values.imag == 0) == (kind == SELF)), np.abs(found.values), np.inf)
        best = excess.argmin(axis=1)
        p = np.flatnonzero(np.isfinite(excess[np.arange(len(excess)), best]))
        k = best[p]
        table[:, kind, p] = reduced(matrix[p], found.vectors[p, :, k], found.vectors[p, :, found.mirror[p, k]])
    return table[0], table[1]


def reduced(matrix: Array, first: Array, second: Array) -> Array:
    """Return delta and |b| ``(2, P)`` on the span of two eigenvectors ``(P, 2n)`` of M ``(P, 2n, 2n)``."""
    n = matrix.shape[-1] // 2
    rest = second - first * np.einsum("pi,pi->p", first.conj(), second)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        basis = np.stack([first, rest / np.linalg.norm(rest, axis=1)[:, None]], axis=-1)
    fine = np.isfinite(basis).all(axis=(1, 2))
    basis = np.where(fine[:, None, None], basis, np.eye(2 * n, 2))
    form, moved = _krein(basis, basis), _krein(basis, matrix @ basis)
    weights, frame = np.linalg.eigh(form)
    fine &= (weights[:, 0] < 0) & (weights[:, 1] > 0)
    weights = np.where(fine[:, None], weights, [-1.0, 1.0])
    frame = frame / np.sqrt(np.abs(weights))[:, None, :]
    block = np.swapaxes(frame.conj(), -1, -2) @ moved @ frame
    # block = diag(-1, 1) M in this basis (the negative member first); M = mu (cos eta + i X sin(eta)/eta).
    determinant = -(block[:, 0, 0] * block[:, 1, 1] - block[:, 0, 1] * block[:, 1, 0])
    trace = block[:, 1, 1] - block[:, 0, 0]
    mu = np.sqrt(determinant)
    mu = np.where((trace * mu.conj()).real < 0, -mu, mu)
    fine &= mu != 0
    mu = np.where(fine, mu, 1.0)
    block = block / mu[:, None, None]
    detuning = (block[:, 0, 0] + block[:, 1, 1]).imag
    coupling = np.abs(block[:, 0, 1] - block[:, 1, 0].conj()) / 2
    return np.where(fine, np.stack([detuning, coupling]), np.nan)


def _krein(left: Array, right: Array) -> Array:
    """left^H (-i J) right, whose diagonal for left = right is kappa = 2 Im u^H v."""
    n = left.shape[-2] // 2
    return np.swapaxes(left.conj(), -1, -2) @ np.concatenate([-1j * right[:, n:], 1j * right[:, :n]], axis=1)
