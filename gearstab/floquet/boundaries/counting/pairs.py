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


@dataclass(frozen=True)
class MultiplierPair:
    """delta, |b| and d delta/d tau of the nearest pair of each class, ``(2, P)``; NaN where there is none.

    The slope is that of delta in a fixed basis; tau = T/2 pi.
    """

    detuning: Array
    coupling: Array
    slope: Array


def nearest(
    matrix: Array, energy: Array, found: KreinSpectrum, order: Array, phase: Array, off: Array
) -> tuple[MultiplierPair, MultiplierPair]:
    """(ahead, behind): the pairs of each class that meet next and that met last at P points.

    order ``(P, n)``: which multipliers are the positive ones, or outside the circle (``off``); phase: their angles.
    """
    points, n = phase.shape
    total = (phase[:, :, None] + phase[:, None, :]) % (2 * np.pi)
    blocked = off[:, :, None] | off[:, None, :]
    result = []
    any_off = np.flatnonzero(off.any(axis=1))
    inside = least_off(matrix, energy, found, order, off, any_off)
    for direction in (1, -1):
        table = np.full((3, 2, points), np.nan)
        for kind in (SELF, COMBINATION):
            wrong = ~np.eye(n, dtype=bool) if kind == SELF else np.tri(n, dtype=bool)
            gap = np.where(blocked | wrong, np.inf, 2 * np.pi - total if direction > 0 else total).reshape(points, -1)
            best = gap.argmin(axis=1)
            usable = np.flatnonzero(gap[np.arange(points), best] < np.pi)
            i, j = best[usable] // n, best[usable] % n
            first = found.vectors[usable, :, order[usable, i]]
            second = found.vectors[usable, :, order[usable, j]].conj()
            table[:, kind, usable] = reduced(matrix[usable], energy[usable], first, second)
            table[:, kind, any_off] = inside[:, kind]
        result.append(MultiplierPair(*table))
    return result[0], result[1]


def least_off(matrix: Array, energy: Array, found: KreinSpectrum, order: Array, off: Array, points: Array) -> Array:
    """delta, |b|, d delta/d tau ``(3, 2, p)`` for unstable points ``(p,)``: of each class the pair that is least far
    off the circle; of multipliers ``order`` ``(P, m)``, of which those ``off`` the circle are looked at.
    """
    table = np.full((3, 2, len(points)), np.nan)
    if len(points) == 0:
        return table
    chosen, apart = order[points], off[points]
    values = np.take_along_axis(found.values[points], chosen, axis=1)
    for kind in (SELF, COMBINATION):
        wanted = apart & ((values.imag == 0) == (kind == SELF))
        excess = np.where(wanted, np.abs(values), np.inf)
        best = excess.argmin(axis=1)
        usable = np.flatnonzero(np.isfinite(excess[np.arange(len(points)), best]))
        p = points[usable]
        k = chosen[usable, best[usable]]
        first, second = found.vectors[p, :, k], found.vectors[p, :, found.mirror[p, k]]
        table[:, kind, usable] = reduced(matrix[p], energy[p], first, second)
    return table


def reduced(matrix: Array, energy: Array, first: Array, second: Array) -> Array:
    """delta, |b|, d delta/d tau ``(3, P)`` on the span of two eigenvectors ``(P, 2n)`` of M ``(P, 2n, 2n)``."""
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
    vectors = basis @ frame
    slope = np.einsum("pik,pik->p", vectors.conj(), energy @ vectors).real
    return np.where(fine, np.stack([detuning, coupling, slope]), np.nan)


def _krein(left: Array, right: Array) -> Array:
    """left^H (-i J) right, whose diagonal for left = right is kappa = 2 Im u^H v."""
    n = left.shape[-2] // 2
    return np.swapaxes(left.conj(), -1, -2) @ np.concatenate([-1j * right[:, n:], 1j * right[:, :n]], axis=1)
