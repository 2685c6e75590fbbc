"""Multipliers with Krein signs at a point, and how far from it the verdict cannot change.

Theory. Let P(x) be symplectic, x = ln(1/Omega), K = -i J the Krein form. In a basis Y of eigenvectors with Y^H K Y =
S = diag(1, .., -1, ..) the speed of P is a Hermitian matrix E, P^-1 dP/dx = i Y S E Y^-1, and a multiplier exp(i theta)
of sign s moves at dtheta/dx = s E_ii. Stability is lost only where multipliers of opposite signs meet. Of a positive
one i and a negative one j, at a distance d, on the span of both and to first order in h = x - x0

    ln P = i [[theta_i + h E_ii, h E_ij], [-h conj(E_ij), theta_j - h E_jj]],

so that they cannot have met before d = |h| (c + 2 |E_ij|), c the speed at which they approach. A pair that is off the
circle has ln |lambda| = +-g and eigenvectors v of lambda, w of 1/conj(lambda); in the basis (v +- w)/2^(1/2) of signs
+-1 its logarithm is i theta + g [[0, 1], [1, 0]], and it stays off as long as |h (E_ii + E_jj)| < 2 |g + i h E_ij|.

What this leaves out are other multipliers k, by which each of the two moves no more than min(|h E_ik|, h^2
|E_ik|^2/d_ik), and the change of E. With B = P^-1 P' the sum of B_s, what the segments s contribute, seen from the
beginning of the period, B' = sum over s < t of [B_s, B_t] besides the direct dependence on the speed, so that E changes
by no more than (sum |E_s|)^2 |h|. For this stands DRIFT e^2 |h|, with e a bound of the norm of E.

The dependence of the generators on the speed is in dP/dx, so it is in E. Where nothing moves with the speed E > 0
(:mod:`~gearstab.floquet.boundaries.counting.krein`); here nothing is said of its sign.

Sources: Krein 1950; Gelfand & Lidskii 1955; Yakubovich & Starzhinskii 1975, ch. III.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.counting.pairs import KreinSpectrum
from gearstab.system import Array

DRIFT = 2.0
"""Change of E over e^2 |h|, at most: four times what random systems need, of which 0.05 loses regions."""
FAR = 1.0
"""Radius over 1/e that is relied on at most."""
DEEP = 4.0
"""ln |lambda| from which on the inverse of P is lost in rounding, so that the largest multiplier tells the radius."""
PART = 0.5
"""Radians of the fastest motion in that radius; some DEEP of them take a pair back to the circle."""
NEAR = 1 - 4.0 ** -np.arange(1, 14)
"""Parts of a first-order radius that are tried with all terms, besides halves."""


@dataclass(frozen=True)
class KreinPhases:
    """Multipliers at P points in the basis Y, the n positive ones first.

    phase, depth ``(P, 2n)``: ln lambda = depth + i phase, depth 0 on the circle. speed ``(P, 2n, 2n)``: E. partner
    ``(P, 2n)``: of one off the circle the other one of its pair, else -1. known ``(P,)``: whether there are n of each
    sign. deep ``(P,)``: a radius by the largest multiplier, 0 where it is not far from the circle.
    """

    phase: Array
    depth: Array
    speed: Array
    partner: Array
    known: Array
    deep: Array

    @property
    def unstable(self) -> Array:
        """``(P,)``."""
        return np.asarray((self.partner >= 0).any(axis=1))

    @classmethod
    def of(cls, matrix: Array, slope: Array, radian: Array) -> KreinPhases:
        """From P and dP/dx ``(P, 2n, 2n)``; radian ``(P,)``: of the fastest motion over the period, in x."""
        points, n, each = len(matrix), matrix.shape[-1] // 2, np.arange(len(matrix))[:, None]
        found = spectrum(matrix)
        outside = np.abs(found.values) > 1
        positive = np.where(found.off, outside, found.sign > 0)
        order = np.argsort(~positive, axis=1, kind="stable")
        place = np.argsort(order, axis=1, kind="stable")
        values, off = found.values[each, order], found.off[each, order]
        partner = np.where(off, place[each, found.mirror[each, order]], -1)
        vectors = np.take_along_axis(found.vectors, order[:, None, :], axis=2)
        with np.errstate(all="ignore"):
            basis = _normal(vectors, values, off, partner)
            basis = np.concatenate([_orthonormal(basis[:, :, :n], 1.0), _orthonormal(basis[:, :, n:], -1.0)], axis=2)
            inverse = np.concatenate([-_rotated(matrix)[:, n:], _rotated(matrix)[:, :n]], axis=1)
            speed = np.swapaxes(basis.conj(), 1, 2) @ _krein(inverse @ slope @ basis)
        speed = -0.5j * (speed - np.swapaxes(speed.conj(), 1, 2))
        known = (positive.sum(axis=1) == n) & np.isfinite(speed).all(axis=(1, 2))
        pairs = np.where(off, np.take_along_axis(partner, np.maximum(partner, 0), axis=1) == np.arange(2 * n), True)
        known &= pairs.all(axis=1)
        phase, depth = np.angle(values), np.where(off, np.log(np.abs(values)), 0.0)
        speed = np.where(known[:, None, None], speed, np.zeros((points, 1, 1)))
        return cls(phase, depth, speed, partner, known, np.where(_growth(found) > DEEP, PART * radian, 0.0))

    def radii(self) -> Array:
        """``(P, 2)``: how far down and up in x the verdict is the same; 0 where nothing is known."""
        result = np.repeat(self.deep[:, None], 2, axis=1)
        for chosen, radius in ((~self.unstable, _apart), (self.unstable, _off)):
            k = np.flatnonzero(chosen & self.known & (self.deep == 0))
            if len(k):
                own = KreinPhases(*(part[k] for part in vars(self).values()))
                result[k] = np.stack([radius(own, -1.0), radius(own, 1.0)], axis=1)
        return result


def _growth(found: KreinSpectrum) -> Array:
    """``(P,)``: ln of the largest multiplier off the circle."""
    return np.log(np.where(found.off, np.abs(found.values), 1.0).max(axis=1))


def _rotated(matrix: Array) -> Array:
    """(P^T J) ``(P, 2n, 2n)``, of which J times it is the inverse of a symplectic P but for its sign."""
    n = matrix.shape[-1] // 2
    turned = np.swapaxes(matrix, 1, 2)
    return np.concatenate([-turned[:, :, n:], turned[:, :, :n]], axis=2)


def _krein(vectors: Array) -> Array:
    """K y of columns ``(P, 2n, k)``."""
    n = vectors.shape[1] // 2
    return np.concatenate([-1j * vectors[:, n:], 1j * vectors[:, :n]], axis=1)


def _normal(vectors: Array, values: Array, off: Array, partner: Array) -> Array:
    """Eigenvectors ``(P, 2n, 2n)`` with a Krein form of 1 or -1, and (v +- w)/2^(1/2) of pairs off the circle."""
    size = np.abs(np.einsum("pik,pik->pk", vectors.conj(), _krein(vectors)))
    result = vectors / np.sqrt(np.where(off, 1.0, size))[:, None, :]
    p, k = np.nonzero(off & (np.abs(values) > 1))
    if len(p):
        j = partner[p, k]
        v, w = vectors[p, :, k], vectors[p, :, j]
        w = w / np.einsum("pi,pi->p", v.conj(), _krein(w[:, :, None])[:, :, 0])[:, None]
        ratio = np.sqrt(np.linalg.norm(w, axis=1) / np.linalg.norm(v, axis=1))[:, None]
        v, w = v * ratio, w / ratio
        result[p, :, k], result[p, :, j] = (v + w) / np.sqrt(2), (v - w) / np.sqrt(2)
    return result


def _orthonormal(vectors: Array, sign: float) -> Array:
    """The same of one sign, of which nearly equal multipliers have vectors that are not orthogonal as computed."""
    form = sign * np.swapaxes(vectors.conj(), 1, 2) @ _krein(vectors)
    n = form.shape[-1]
    size = np.abs(form - np.eye(n)).max(axis=(1, 2))
    result = vectors.copy()
    k = np.flatnonzero(size > 1e-9)
    if len(k):
        values, frame = np.linalg.eigh(np.where(np.isfinite(form[k]), form[k], 0.0))
        root = np.sqrt(np.where(values > 0, values, np.nan))
        result[k] = vectors[k] @ (frame / root[:, None, :]) @ np.swapaxes(frame.conj(), 1, 2)
    return result


def _turns(angle: Array) -> Array:
    """Distance of two angles on the circle."""
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def _norm(speed: Array) -> Array:
    """A bound of the norm of Hermitian matrices ``(P, 2n, 2n)``: their largest sum along a row."""
    return np.abs(speed).sum(axis=2).max(axis=1)


def _mixing(found: KreinPhases, radius: Array) -> Array:
    """``(P, 2n, 2n)``: how fast k may move i within a radius ``(P,)``; 0 on the diagonal."""
    size, m = np.abs(found.speed), found.phase.shape[1]
    apart = _turns(found.phase[:, :, None] - found.phase[:, None, :])
    apart = np.hypot(apart, found.depth[:, :, None] - found.depth[:, None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(apart > 0, radius[:, None, None] * size**2 / apart, np.inf)
    moved: Array = np.minimum(size, second)
    moved[:, np.arange(m), np.arange(m)] = 0.0
    return moved


def _apart(found: KreinPhases, side: float) -> Array:
    """Radii ``(P,)`` of stable points."""
    n, speed = found.phase.shape[1] // 2, found.speed
    own = np.einsum("pii->pi", speed).real
    turning = side * (own[:, :n, None] + own[:, None, n:])
    ahead = (found.phase[:, :n, None] - found.phase[:, None, n:]) % (2 * np.pi)
    coupling, size = 2 * np.abs(speed[:, :n, n:]), _norm(speed)
    drift = (DRIFT * size**2)[:, None, None]

    def radius(moved: Array | float) -> Array:
        least = FAR / size
        for distance, closing in ((ahead, -turning), (2 * np.pi - ahead, turning)):
            b = closing + coupling + moved
            first = 2 * distance / (b + np.sqrt(b**2 + 4 * drift * distance))
            least = np.minimum(least, first.min(axis=(1, 2)))
        return np.asarray(least)

    mixing = _mixing(found, radius(0.0))
    total = mixing.sum(axis=2)
    others = total[:, :n, None] + total[:, None, n:] - 2 * mixing[:, :n, n:]
    return radius(others)


def _off(found: KreinPhases, side: float) -> Array:
    """Radii ``(P,)`` of unstable points: of the pair that has the largest."""
    result, size = np.zeros(len(found.phase)), _norm(found.speed)
    p, i = np.nonzero(found.depth > 0)
    j, g, own = found.partner[p, i], found.depth[p, i], found.speed[p]
    each = np.arange(len(p))
    # The logarithm of a product, to first order in the second factor, for a pair so far apart.
    factor = 2 * g / -np.expm1(-2 * g)
    turning = factor * (own[each, i, i] + own[each, j, j]).real
    coupling = factor * own[each, i, j]
    b, a = 8 * side * g * coupling.imag, turning**2 - 4 * np.abs(coupling) ** 2
    with np.errstate(all="ignore"):
        root = np.sqrt(b**2 + 16 * a * g**2)
        first = np.where(b + root > 0, 8 * g**2 / (b + root), np.inf)
        first = np.minimum(np.where(np.isnan(first), np.inf, first), FAR / size[p])
    mixing = _mixing(found, np.zeros(len(result)) + FAR / size)
    total = mixing.sum(axis=2)
    others = total[p, i] + total[p, j] - 2 * mixing[p, i, j]
    parts = np.concatenate([2.0 ** -np.arange(8, 1, -1), NEAR])
    radius = first[:, None] * parts
    left = 2 * np.abs(g[:, None] + 1j * side * radius * coupling[:, None]) - np.abs(turning)[:, None] * radius
    left -= others[:, None] * radius + DRIFT * (size[p, None] * radius) ** 2
    good = np.logical_and.accumulate(left > 0, axis=1)
    best = np.where(good, radius, 0.0).max(axis=1)
    np.maximum.at(result, p, best)
    return result
