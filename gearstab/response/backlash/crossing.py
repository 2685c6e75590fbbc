"""The first time at which a polynomial falls below zero, found so that none is missed.

A polynomial on [0, 1] is nowhere below the least of its Bernstein coefficients, and has at most as many roots in (0, 1)
as these change their sign. Subdivision makes both sharp. A dip that stays above -tolerance is none.

Source: Farouki 2012, sections 3.3 and 5 (Bernstein form, subdivision, variation diminishing property).
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from gearstab.system import Array

SMALLEST = 2.0**-48
"""Intervals of u that are not divided further."""


@cache
def bernstein(degree: int) -> Array:
    """``(n + 1, n + 1)``: Bernstein coefficients on [0, 1] from those of the powers of u."""
    found = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for k in range(j + 1):
            found[j, k] = comb(j, k) / comb(degree, k)
    return found


@cache
def _left(degree: int) -> Array:
    """Coefficients on [0, 1/2] from those on [0, 1]; the right half is the mirror image."""
    found = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for k in range(j + 1):
            found[j, k] = comb(j, k) * 0.5**j
    return found


def first_below(powers: Array, tolerance: float) -> float | None:
    """The least u in [0, 1] at which sum_k a_k u^k changes from positive to negative; None where it does not.

    powers: ``(n + 1,)``, a_k; tolerance: how deep below zero it may dip unnoticed, positive.
    """
    degree = len(powers) - 1
    half = _left(degree)
    found = bernstein(degree) @ powers
    waiting = [(0.0, 1.0, found)]
    while waiting:
        low, high, found = waiting.pop()
        if found.min() >= -tolerance:
            continue
        if found[0] < -tolerance or high - low < SMALLEST:
            return low
        below = found < 0
        # What is zero at the beginning, but for rounding, may rise from there.
        if found[0] > tolerance and np.count_nonzero(below[1:] != below[:-1]) == 1:
            return _root(powers, low, high)
        middle = 0.5 * (low + high)
        waiting.append((middle, high, (half @ found[::-1])[::-1]))
        waiting.append((low, middle, half @ found))
    return None


def _root(powers: Array, low: float, high: float) -> float:
    from scipy.optimize import brentq

    coefficients = powers[::-1].tolist()

    def value(u: float) -> float:
        total = 0.0
        for c in coefficients:
            total = total * u + c
        return total

    if value(low) <= 0:
        return low
    if value(high) >= 0:
        return high
    # To the last digit; the tolerance is relative only.
    return float(brentq(value, low, high, xtol=1e-300, rtol=8.9e-16))
