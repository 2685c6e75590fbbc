"""Values and extremes of many polynomials on [0, 1], by the compiled kernel."""

from __future__ import annotations

import numpy as np

from gearstab import ckernel
from gearstab.system import Array

POINTS = 129
"""Between the values at so many, extremes are those of parabolas."""


def sampled(powers: Array, first: Array, u: Array, kept: int) -> Array:
    """``(X, kept)``: values of the first ``kept`` polynomials of group s at the places u[first[s]:first[s + 1]].

    powers: ``(S, degree + 1, D)``, coefficients of powers of u;  first: ``(S + 1,)``, from 0 to X;  u: ``(X,)``.
    """
    found = np.empty((len(u), kept))
    count, terms, size = powers.shape
    first = np.ascontiguousarray(first, dtype=np.int64)
    ckernel.library.sampled(count, terms - 1, size, kept, np.ascontiguousarray(powers), first, len(u), u, found)
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
    low, high = np.empty((2, count, size))
    ckernel.library.extremes(count, terms - 1, size, np.ascontiguousarray(powers), POINTS, low, high)
    return low, high
