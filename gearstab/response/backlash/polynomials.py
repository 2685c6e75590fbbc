"""Values and extremes of many polynomials on [0, 1], by the compiled kernel where there is one."""

from __future__ import annotations

import numpy as np

from gearstab import ckernel
from gearstab.system import Array

FINE = np.linspace(0.0, 1.0, 129)
"""Between the values at these, extremes are those of parabolas."""


def sampled(powers: Array, first: Array, u: Array, kept: int) -> Array:
    """``(X, kept)``: values of the first ``kept`` polynomials of group s at the places u[first[s]:first[s + 1]].

    powers: ``(S, degree + 1, D)``, coefficients of powers of u;  first: ``(S + 1,)``, from 0 to X;  u: ``(X,)``.
    """
    found = np.empty((len(u), kept))
    if ckernel.in_use() and ckernel.library is not None:
        count, terms, size = powers.shape
        first = np.ascontiguousarray(first, dtype=np.int64)
        ckernel.library.sampled(count, terms - 1, size, kept, np.ascontiguousarray(powers), first, len(u), u, found)
        return found
    for s in np.flatnonzero(np.diff(first)):
        inside = slice(first[s], first[s + 1])
        found[inside] = np.vander(u[inside], powers.shape[1], increasing=True) @ powers[s, :, :kept]
    return found


def product(one: Array, other: Array) -> Array:
    """``(S, m + n + 1, C)``, coefficients of products of polynomials ``(S, m + 1, C)`` and ``(S, n + 1, C)``."""
    terms = other.shape[1]
    found = np.zeros((len(one), one.shape[1] + terms - 1, one.shape[2]))
    for i in range(one.shape[1]):
        found[:, i : i + terms] += one[:, i, None] * other
    return found


def extremes_of(powers: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(S, C)`` on [0, 1] of the polynomials with the coefficients ``(S, degree + 1, C)``."""
    count, terms, size = powers.shape
    if ckernel.in_use() and ckernel.library is not None:
        low, high = np.empty((2, count, size))
        given = np.ascontiguousarray(powers)
        ckernel.library.extremes(count, terms - 1, size, given, len(FINE), low, high)
        return low, high
    low, high = extremes(np.tensordot(np.vander(FINE, terms, increasing=True), powers, axes=(1, 1)))
    return low, high


def extremes(fine: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(...)`` of functions given at equally spaced points ``(X, ...)``.

    The extremes of the parabolas through the largest value and its two neighbours.
    """
    found = []
    for f in (-fine, fine):
        at = np.clip(f.argmax(axis=0), 1, len(f) - 2)[None]
        before, here, after = (np.take_along_axis(f, at + i, axis=0)[0] for i in (-1, 0, 1))
        bend, slope = 2 * here - before - after, 0.5 * (after - before)
        inside = (bend > 0) & (np.abs(slope) <= bend)
        rise = np.where(inside, 0.5 * slope**2 / np.where(inside, bend, 1.0), 0.0)
        found.append(np.maximum(f.max(axis=0), here + rise))
    return -found[0], found[1]
