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
piece a -Q that carried.py chooses, stays below 0. P is made anew by carried.py; what it gives is checked here.

**In floating point.** Numbers are doubles, rounded to nearest. With m terms of products in any order, fused or not,
|fl(A B) - A B| <= m e/(1 - m e) |A| |B|, e = 2^-53. |.| is the root of the sum of squares; bounds of it are larger by
0.1 %, which holds all roundings of bounds, and by TINY, which holds what underflows. L is positive definite if
|L - c I - R R^T| < c for any c and R, as R R^T has no negative eigenvalue: R is a Cholesky factor of L - c I, however
well it was computed. What L may be off is added. G_i are enclosed in balls (python-flint) in coordinates X of modes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from flint import arb, ctx

from gearstab.certificates.carried import COARSE, FINE, Carried
from gearstab.certificates.choices import modal
from gearstab.certificates.polynomials import exact, near
from gearstab.certificates.verifier import Flow

Array = np.ndarray

BITS, ROUNDING, TINY = 128, 2.0**-52, 1e-150
"""Bits of the midpoints; 2 e; larger than a sum of squares that underflows."""
SPARE = 8
"""Roundings besides those of products: of factors and of sums."""


def decays(flow: Flow, low: float, high: float) -> bool:
    """Whether decay of all solutions is proved for low <= Omega <= high; False for everything else."""
    ctx.prec = BITS
    if not 0 < low <= high < np.inf:
        return False
    try:
        middles, radii = _generators(flow, low, high)
        weights = [0.25, 0.5, 0.25] if flow.following else [0.5, 0.5]
        with np.errstate(all="ignore"):
            carried = Carried(np.einsum("i,sijk->sjk", weights, middles), flow.states, flow.fractions)
            return any(_falls(flow, carried, middles, radii, scale) for scale in (COARSE, FINE))
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
        return False


def _falls(flow: Flow, carried: Carried, middles: Array, radii: Array, scale: float) -> bool:
    """The hypotheses of the theorem, for steps of some scale."""
    carried.scale = scale
    ends = carried.ends
    if len(ends) != len(flow.states) + 1 or not np.array_equal(ends[0], ends[-1]):
        return False
    if not _definite(ends[:1].copy(), np.zeros(1)):
        return False
    sorts: dict[tuple[int, float], list[int]] = {}
    for k, key in enumerate(zip(flow.states, flow.fractions, strict=True)):
        sorts.setdefault(key, []).append(k)
    for (state, fraction), places in sorts.items():
        seen = 0
        for where, lengths, forms in carried.inside((state, fraction), np.array(places)):
            if list(where) != places[seen : seen + len(where)] or not _joined(ends, where, lengths, forms):
                return False
            if not _falls_inside(lengths, forms, fraction * middles[state], fraction * radii[state]):
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


def _falls_inside(lengths: Array, forms: Array, generators: Array, radii: Array) -> bool:
    """Whether all -(D_j + h (G_i^T P_j + P_j G_i)) are positive definite. generators ``(I, m, m)``, of the segment."""
    m, size, own = forms.shape[-1], _size(forms), -lengths[:, None, None, None]
    first, second, third, last = np.moveaxis(forms, 1, 0)
    slopes = 3 * (second - first), 2 * third - second - first, last + third - 2 * second, 3 * (last - third)
    rounded = 2 * SPARE * ROUNDING * size.sum(axis=1)
    for generator, radius in zip(generators, radii, strict=True):
        off = float(_size(generator)) * (m + SPARE) * ROUNDING + radius
        for j, slope in enumerate(slopes):
            half = forms[:, j] @ generator
            half *= own
            found = half + np.swapaxes(half, -1, -2)
            found -= slope
            if not _definite(found, 2 * off * lengths[:, None] * size[:, j] + rounded):
                return False
    return True


def _definite(matrices: Array, error: Array) -> bool:
    """Whether all symmetric matrices that are no farther from these than an error are positive definite. They are
    changed.
    """
    count, diagonal = (matrices.shape[-1] + SPARE) * ROUNDING, np.einsum("...ii->...i", matrices)
    shift = 2 * error + 4 * count * np.abs(diagonal).sum(axis=-1) + TINY
    rounded = _size(matrices) + shift
    diagonal -= shift[..., None]  # a view of the matrices
    try:
        root = np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return False
    rest = root @ np.swapaxes(root, -1, -2)
    rest -= matrices
    return bool((1.001 * (_size(rest) + count * (_size(root) ** 2 + rounded) + error) < shift).all())


def _size(matrices: Array) -> Array:
    """The root of the sum of squares, from above."""
    return np.asarray(1.001 * np.sqrt(np.einsum("...ij,...ij->...", matrices, matrices)) + TINY)


def _generators(flow: Flow, low: float, high: float) -> tuple[Array, Array]:
    """G_i of each state in coordinates of the modes of the mean system, ``(D, I, m, m)``, and how far they may be off,
    ``(D, I)``.
    """
    first, last = 1 / arb(high), 1 / arb(low)
    middle, turn = (first + last) / 2, 2 * arb.pi() * arb(flow.cycles)
    if flow.following:
        points = ((first, first * first), (middle, first * last), (last, last * last))
        found = [
            [a + b * u + c * v for u, v in points] for a, (b, c) in zip(flow.generators, flow.following, strict=True)
        ]
    else:
        found = [[a * first, a * last] for a in flow.generators]
    share = np.bincount(flow.states, flow.fractions)
    modes = exact(modal(np.array([near(own[len(own) // 2]) for own in found]), share))
    back = modes.inv() * turn
    found = [[back * part * modes for part in own] for own in found]
    radii = [[[float(x.rad()) for x in part.entries()] for part in own] for own in found]
    return np.array([[near(part) for part in own] for own in found]), _size(np.array(radii)[..., None])
