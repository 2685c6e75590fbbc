"""Exact steps of x' = A x + b with constant A: exponentials of generators that occur again and again.

A generator A does not depend on the mesh frequency: diagonalised once, A = X L X^-1, it gives exp(A t) and the response
to harmonics for every time and speed,

    int_0^t exp(l (t - s)) exp(i nu s) ds = t [exp(i nu t) - exp(l t)]/(i nu t - l t),

a difference quotient that is evaluated without cancellation, at resonance too. Where eigenvectors are nearly parallel
(critical damping) the exponential of the whole matrix is needed instead (:mod:`~gearstab.propagation.intervals`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.ckernel import exponentials
from gearstab.system import Array

ILL_CONDITIONED = 1e4
"""cond(X) beyond which diagonalisation would cost more than four of sixteen digits."""
NOTHING = 1e-200
"""Exponents closer than this are equal; complex division by much smaller numbers overflows."""


@dataclass(frozen=True)
class Eigen:
    """values ``(r, m)``, vectors ``(r, m, m)`` and their inverses, complex."""

    values: Array
    vectors: Array
    inverse: Array

    def exponentials(self, row: int, duration: Array) -> Array:
        """Return exp(A t) ``(X, m, m)`` of one row for many t.

        Of two conjugate eigenvalues one is enough: 2 Re(v exp(l t) w) = 2 [Re v e, -Im v e] [Re w; Im w].
        """
        values, vectors, inverse = (part[row] for part in (self.values, self.vectors, self.inverse))
        own = values.imag >= 0
        right = inverse[own] * np.where(values.imag[own] > 0, 2.0, 1.0)[:, None]
        left = vectors[:, own] * np.exp(duration[:, None] * values[own])[:, None, :]
        real = np.concatenate([left.real, -left.imag], axis=-1).reshape(len(duration) * len(vectors), -1)
        return np.asarray((real @ np.concatenate([right.real, right.imag])).reshape(-1, *vectors.shape))

    def propagators(self, at: Array, duration: Array, drive: Array, turn: Array) -> tuple[Array, Array]:
        """P ``(K, m, m)`` and F ``(K, m, L)`` with x(t) = P x(0) + F z(0).

        at: ``(K,)``, rows;  duration: ``(K,)``, t;  drive: ``(K, m, L)``, B of x' = A x + B z;
        turn: ``(K, H)``, by which the harmonics of z = (1, cos, sin, ...) turn meanwhile, in radians.
        """
        vectors, inverse = self.vectors[at], self.inverse[at]
        growth = self.values[at] * duration[:, None]
        p = ((vectors * np.exp(growth)[:, None, :]) @ inverse).real
        # c cos + s sin = Re[(c - i s) exp(i phi)], phi = nu t from the phase at the beginning on.
        inner = np.concatenate([drive[:, :, :1], drive[:, :, 1::2] - 1j * drive[:, :, 2::2]], axis=2)
        rotation = np.concatenate([np.zeros((len(at), 1)), turn], axis=1)
        quotient = divided_exponential(growth[:, :, None], 1j * rotation[:, None, :]) * duration[:, None, None]
        f = vectors @ (quotient * (inverse @ inner))
        result = np.empty_like(drive)
        result[:, :, 0] = f[:, :, 0].real
        result[:, :, 1::2], result[:, :, 2::2] = f[:, :, 1:].real, -f[:, :, 1:].imag
        return p, result


def diagonalised(generators: Array) -> Eigen | None:
    """The eigenvectors of generators ``(r, m, m)``; None where those of a row are too nearly parallel."""
    values, vectors = np.linalg.eig(generators)
    if generators.shape[-1] == 0:
        return Eigen(values.astype(complex), vectors.astype(complex), vectors.astype(complex))
    singular = np.linalg.svd(vectors, compute_uv=False)
    if not np.all(singular[:, 0] < ILL_CONDITIONED * singular[:, -1]):
        return None
    vectors = vectors.astype(complex)
    return Eigen(values.astype(complex), vectors, np.linalg.inv(vectors))


@dataclass(frozen=True)
class States:
    """Distinct generators ``(D, r, m, m)`` of A, and which of them each interval between edges has, ``of (Q,)``."""

    of: Array
    generators: Array

    @cached_property
    def each(self) -> list[Eigen | None]:
        """The eigenvectors of every state, None where those of a row are too nearly parallel."""
        return [diagonalised(generators) for generators in self.generators]

    @cached_property
    def eigen(self) -> Eigen | None:
        """The eigenvectors of all states, ``(D, r, ...)``; None where a state has none."""
        known = [eigen for eigen in self.each if eigen is not None]
        if len(known) < len(self.each):
            return None
        return Eigen(*(np.stack([getattr(eigen, n) for eigen in known]) for n in ("values", "vectors", "inverse")))

    def exponentials(self, which: Array, duration: Array) -> Array:
        """Return exp(A t) ``(X, m, m)`` of states of a single row for durations ``(X,)``."""
        found = np.empty((len(which), *self.generators.shape[2:]))
        for state in np.unique(which):
            own, eigen = which == state, self.each[state]
            if eigen is None:
                found[own] = exponentials(self.generators[state] * duration[own, None, None])
            else:
                found[own] = eigen.exponentials(0, duration[own])
        return found


def augmented(a: Array, b: Array, turn: Array) -> Array:
    """[[A, B], [0, R]] ``(..., m + L, m + L)``: x' = A x + B z, z' = R z with the harmonics z = (1, cos, sin, ...).

    a: ``(..., m, m)``. b: ``(..., m, L)``. turn: ``(..., H)``, radians by which the harmonics turn in a unit of time.
    """
    m, width = b.shape[-2:]
    whole = np.zeros((*b.shape[:-2], m + width, m + width))
    whole[..., :m, :m], whole[..., :m, m:] = a, b
    cosine = m + 1 + 2 * np.arange(turn.shape[-1])
    whole[..., cosine, cosine + 1], whole[..., cosine + 1, cosine] = -turn, turn
    return whole


def divided_exponential(a: Array, b: Array) -> Array:
    """(exp b - exp a)/(b - a), exp a where they are equal."""
    difference = b - a
    # From the smaller exponential to the larger one nothing overflows that the result does not.
    forward = difference.real <= 0
    base, step = np.where(forward, a, b), np.where(forward, difference, -difference)
    nothing = np.abs(step) < NOTHING
    safe = np.where(nothing, 1.0, step)
    return np.asarray(np.exp(base) * np.where(nothing, 1.0, np.expm1(safe) / safe))
