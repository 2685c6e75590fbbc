"""Exponentials of many small matrices at once."""

from __future__ import annotations

from math import factorial

import numpy as np

from gearstab.system import Array

DEGREE = 12
"""Of the Taylor polynomial, evaluated with five products (Paterson & Stockmeyer 1973)."""
REACH = 0.299
"""The 1-norm up to which its backward error is below 2^-53 (Al-Mohy & Higham 2011, Table 3.1)."""
_COEFFICIENTS = np.array([1.0 / factorial(k) for k in range(DEGREE + 1)])


def expm(matrix: Array) -> Array:
    """exp(A) of ``(P, m, m)`` by scaling and squaring, each matrix with the scaling it needs.

    Matrices that are not finite give NaN.
    """
    result = np.full_like(matrix, np.nan)
    size = np.abs(matrix).sum(axis=-2).max(axis=-1)
    known = np.isfinite(size)
    halvings = np.zeros(len(matrix), dtype=int)
    halvings[known] = np.maximum(0, np.ceil(np.log2(np.maximum(size[known], REACH) / REACH))).astype(int)
    for count in np.unique(halvings[known]):
        members = np.flatnonzero(known & (halvings == count))
        power = _taylor(matrix[members] * 0.5**count)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(count):
                power = power @ power
        result[members] = power
    return result


def _taylor(a: Array) -> Array:
    """sum_k a^k/k! up to DEGREE, as a cubic in a^4 whose coefficients are cubics in a."""
    one = np.eye(a.shape[-1])
    square = a @ a
    powers = (one, a, square, square @ a)
    fourth = square @ square
    total = _COEFFICIENTS[12] * fourth
    for start in (8, 4, 0):
        part = sum(_COEFFICIENTS[start + k] * power for k, power in enumerate(powers))
        total = total + part
        if start:
            total = total @ fourth
    return np.asarray(total)
