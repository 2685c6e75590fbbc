r"""Decay over whole intervals of the mesh frequency, proved by a form that is carried along the period.

With the notation of verifier.py and u = 1/Omega, in shares t of a period x' = G(t, u) x, 0 <= t <= 1, where G is
2 pi N u A_s in segment s, of length f_s. G is linear in u; where matrices follow the speed, 2 pi N (A_0 + u A_1 + u^2
A_2). On [1/high, 1/low] it has the Bernstein coefficients G_0, G_1, or G_0, G_1, G_2: weighted means of them are all G.

**Theorem 4.** Let P(t) be symmetric and continuous, P(1) = P(0) positive definite, and cubic on each of a number of
parts of segments, with Bernstein coefficients P_0, ..., P_3 on a part of the length h and those of h P', D_0, ..., D_3,

    D_0 = 3 (P_1 - P_0),  D_1 = 2 P_2 - P_1 - P_0,  D_2 = P_3 + P_2 - 2 P_1,  D_3 = 3 (P_3 - P_2).

If -(D_j + h (G_i^T P_j + P_j G_i)) is positive definite on every part and for all j and i, all solutions decay
exponentially at every Omega from low to high. *Proof.* Bernstein polynomials are not negative and add up to 1, on a
part as in u: so P' + G^T P + P G, the sum of their products with these matrices, is negative definite at each t and u
(on both sides of a point between two parts). V = x^T P x then falls while x is not 0, and over a period to less than
q V, q < 1, as the unit sphere is compact. V(0) is the square of a norm.

No phase adds up: whatever the number of segments is, u may change as far as P' + G^T P + P G, at the middle of the
piece a -Q that choices.py chooses, stays below 0. P is made anew by choices.py; what it gives is checked here.

Its arithmetic is that of balls.py, where all coordinates are those of modes: what G_i may be off counts as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from gearstab.certificates.balls import ROUNDING, SPARE, Array, Ball, definite, size, total
from gearstab.certificates.choices import COARSE, FINE, Carried
from gearstab.certificates.equations import Flow


def decays(flow: Flow, low: float, high: float) -> bool:
    """Whether decay of all solutions is proved for low <= Omega <= high; False for everything else."""
    if not 0 < low <= high < np.inf:
        return False
    try:
        with np.errstate(all="ignore"):
            generators = _generators(flow, low, high)
            weights = [0.25, 0.5, 0.25] if flow.following else [0.5, 0.5]
            middles = np.einsum("i,sijk->sjk", weights, generators.centre)
            carried = Carried(middles, flow.states, flow.fractions)
            return any(_falls(flow, carried, generators, scale) for scale in (COARSE, FINE))
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
        return False


def _falls(flow: Flow, carried: Carried, generators: Ball, scale: float) -> bool:
    """The hypotheses of the theorem, for steps of some scale."""
    carried.scale = scale
    ends = carried.ends
    if len(ends) != len(flow.states) + 1 or not np.array_equal(ends[0], ends[-1]):
        return False
    if not definite(ends[:1].copy(), np.zeros(1)):
        return False
    sorts: dict[tuple[int, float], list[int]] = {}
    for k, key in enumerate(zip(flow.states, flow.fractions, strict=True)):
        sorts.setdefault(key, []).append(k)
    for (state, fraction), places in sorts.items():
        seen = 0
        for where, lengths, forms in carried.inside((state, fraction), np.array(places)):
            if list(where) != places[seen : seen + len(where)] or not _joined(ends, where, lengths, forms):
                return False
            if not _falls_inside(
                lengths, forms, fraction * generators.centre[state], fraction * generators.radius[state]
            ):
                return False
            seen += len(where)
        if seen != len(places):
            return False
    return True


def _joined(ends: Array, where: Array, lengths: Array, forms: Array) -> bool:
    """Whether P is symmetric and continuous, and the steps, fractions of powers of 2, make up the segment."""
    pairs: Iterable[tuple[Any, Any]] = (
        (forms, np.swapaxes(forms, -1, -2)), (forms[0, 3], ends[where + 1]), (forms[-1, 0], ends[where]),
        (forms[:-1, 0], forms[1:, 3]), (np.frexp(lengths)[0], np.full(len(lengths), 0.5)), (lengths.sum(), 1.0),
    )  # fmt: skip
    return all(np.array_equal(a, b) for a, b in pairs)


def _falls_inside(lengths: Array, forms: Array, generators: Array, radius: float) -> bool:
    """Whether all -(D_j + h (G_i^T P_j + P_j G_i)) are positive definite. generators ``(I, m, m)``, of the segment."""
    m, sizes, own = forms.shape[-1], size(forms), -lengths[:, None, None, None]
    first, second, third, last = np.moveaxis(forms, 1, 0)
    slopes = 3 * (second - first), 2 * third - second - first, last + third - 2 * second, 3 * (last - third)
    rounded = 2 * SPARE * ROUNDING * sizes.sum(axis=1)
    for generator in generators:
        off = float(size(generator)) * (m + SPARE) * ROUNDING + radius
        for j, slope in enumerate(slopes):
            half = forms[:, j] @ generator
            half *= own
            found = half + np.swapaxes(half, -1, -2)
            found -= slope
            if not definite(found, 2 * off * lengths[:, None] * sizes[:, j] + rounded):
                return False
    return True


def _generators(flow: Flow, low: float, high: float) -> Ball:
    """G_i of each state ``(D, I, m, m)``."""
    own, first, last = flow.enclosed(low), 1 / high, 1 / low
    points = [[1.0, first, first**2], [1.0, (first + last) / 2, first * last], [1.0, last, last**2]]
    weights = np.array(points) if flow.following else np.array([[first], [last]])
    return total(2 * np.pi * flow.cycles * weights, own.terms, own.radii)
