"""Zeros of many functions at once (Chandrupatla 1997, Adv. Eng. Softw. 28, 145-149): inverse quadratic interpolation
where it is monotone, else bisection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearstab.system import Array

ROUNDS = 100
"""Steps at the most; bisection alone needs some 60 to neighbouring numbers."""


@dataclass
class RootBrackets:
    """Ends a, b ``(Z,)`` on both sides of a zero each, where the functions are fa, fb; a is the one found last."""

    a: Array
    b: Array
    fa: Array
    fb: Array

    @property
    def best(self) -> Array:
        """The end at which the function is smaller."""
        return np.where(np.abs(self.fa) < np.abs(self.fb), self.a, self.b)


def narrowed(
    function: Callable[[Array, Array], Array], bracket: RootBrackets, tolerance: Array | float
) -> RootBrackets:
    """Brackets no wider than the tolerance ``(Z,)``, or than neighbouring numbers. A value of 0 counts as one below 0.

    function: (which of the functions ``(K,)``, places ``(K,)``) -> values ``(K,)``.
    """
    a, b, fa, fb = bracket.b.copy(), bracket.a.copy(), bracket.fb.copy(), bracket.fa.copy()
    c, fc, t = a.copy(), fa.copy(), np.full(len(a), 0.5)
    limit = np.maximum(tolerance, 4 * np.finfo(float).eps * np.maximum(np.abs(a), np.abs(b)))
    for _ in range(ROUNDS):
        k = np.flatnonzero(np.abs(b - a) > limit)
        if len(k) == 0:
            break
        x = a[k] + t[k] * (b[k] - a[k])
        fx = function(k, x)
        same = (fx > 0) == (fa[k] > 0)
        c[k], fc[k] = np.where(same, a[k], b[k]), np.where(same, fa[k], fb[k])
        b[k], fb[k] = np.where(same, b[k], a[k]), np.where(same, fb[k], fa[k])
        a[k], fa[k] = x, fx
        t[k] = _next(a[k], b[k], c[k], fa[k], fb[k], fc[k], limit[k])
    return RootBrackets(a, b, fa, fb)


def _next(a: Array, b: Array, c: Array, fa: Array, fb: Array, fc: Array, limit: Array) -> Array:
    """Where between a (0) and b (1) to look next."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        smooth = (1 - np.sqrt(1 - xi) < phi) & (phi < np.sqrt(xi))
        t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        # From the old ends, so that a zero beside one of them is enclosed by the next step, and not crept up to.
        least = 0.25 * limit / np.abs(b - a)
    t = np.where(smooth & np.isfinite(t), t, 0.5)
    return np.clip(t, np.minimum(least, 0.5), np.maximum(1 - least, 0.5))
