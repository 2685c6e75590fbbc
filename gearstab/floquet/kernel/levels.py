"""All multipliers of a period of few segments in which modes decay very differently, from matrices of size one.

In the modes of its state, by descending growth, a segment is a diagonal matrix E of sizes exp(a_i t), from one down to
less than a computer's numbers, and a matrix C of size one leads on to the next one. Sizes move through matrices without
loss: with C = L U, triangular and without pivots,

    E C E' = (E L E^-1) E E' (E'^-1 U E'),

where both brackets are of size one again, as the sizes descend. So a whole period is similar to E H, with the sizes
E of the period as logarithms and H of size one. Steps of the LR algorithm, H = L U -> U (E L E^-1), which cost the same
however far the sizes are apart, reduce H_ij below the diagonal by E_i/E_j each (Rutishauser 1958). After ROUNDS of them
an eigenvalue is that of a window of neighbouring sizes: what lies OVERLAP away changes it by exp(-ROUNDS OVERLAP).

There are no pivots, so that a result is checked: triangles of moderate entries, neighbouring windows that agree, and
Liouville's formula, by which all ln |lambda| add up to the integral of the trace.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import ztrmm, ztrsm

from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Succession
from gearstab.interrupts import heed
from gearstab.system import Array

ROUNDS, OVERLAP, KEPT = 4, 7.0, 3.0
"""Steps, and logarithms of sizes: how far a window reaches beyond the multipliers taken from it, and how far these are
apart. An eigenvalue solver leaves an error of eps exp(OVERLAP + KEPT) = 5e-12 of the smallest multiplier taken."""
MOST_GROWN = 1e3
"""Largest entry of a triangle: a result loses so many of its digits."""
AGREEMENT = 1e-9
"""Difference of ln |lambda| between windows, and relative one of their sum from the trace; else there is no result."""
SMALL = 8
"""Size of a half from which on matrices are eliminated by halves."""


def log_multipliers(pattern: Succession, generator: Generators, row: int, omega: Array) -> Array:
    """ln lambda ``(P, m)``, from the largest to the smallest, of a well-conditioned row; NaN where checks fail."""
    values, vectors, inverse = (part[row : row + 1] for part in generator.eigen)
    order = np.argsort(-values.real, axis=-1, kind="stable")
    values = np.take_along_axis(values, order, axis=-1)[0]
    vectors = np.take_along_axis(vectors, order[..., None, :], axis=-1)
    change, follows = pattern.pairs(np.take_along_axis(inverse, order[..., None], axis=-2), vectors)
    durations = pattern.durations(row, omega)
    result = np.full((len(omega), values.shape[-1]), np.nan, dtype=complex)
    for k in np.flatnonzero((durations >= 0).all(axis=0)):
        heed()
        exponents = values[pattern.states] * durations[:, k, None]
        with np.errstate(all="ignore"):
            found = _spectrum(*_sizes(exponents, change[0, follows]))
            trace = exponents.real.sum()
            if abs(found.real.sum() - trace) <= AGREEMENT * max(1.0, abs(trace)):
                result[k] = found
    return result


def _sizes(exponents: Array, change: Array) -> tuple[Array, Array]:
    """(ln E ``(m,)``, H ``(m, m)``) with the multipliers of a period as eigenvalues of E H; H is NaN where they fail.

    exponents ``(S, m)``: eigenvalues of each segment times its duration. change ``(S, m, m)``: what follows each.
    """
    level, right = exponents[0].real, np.eye(exponents.shape[1])
    left = change[0] * np.exp(1j * exponents[0].imag)
    for own, following in zip(exponents[1:], change[1:], strict=True):
        lower, upper = _triangles(left)
        right = upper * _descending(level).T @ right
        level = level + own.real
        left = following * np.exp(1j * own.imag) @ (lower * _descending(own.real))
    return level, right @ left


def _descending(level: Array) -> Array:
    """E_i/E_j below the diagonal, ``(m, m)``."""
    return np.tril(np.exp(np.minimum(level[:, None] - level, 0.0)))


def _triangles(matrix: Array) -> tuple[Array, Array]:
    """L, of ones on the diagonal, and U of a matrix ``(m, m)`` without pivots; NaN where entries grow large."""
    a = np.array(matrix, dtype=complex)
    _eliminate(a)
    if not np.abs(a).max(initial=0.0) < MOST_GROWN:
        a[:] = np.nan
    return np.tril(a, -1) + np.eye(len(a)), np.triu(a)


def _eliminate(a: Array) -> None:
    """Put both triangles in the place of a matrix, by halves as far as products of matrices are the faster way."""
    half = len(a) // 2
    if half < SMALL:
        for k in range(len(a) - 1):
            a[k + 1 :, k] /= a[k, k]
            a[k + 1 :, k + 1 :] -= a[k + 1 :, k, None] * a[k, k + 1 :]
        return
    first, last = slice(half), slice(half, None)
    _eliminate(a[first, first])
    a[first, last] = ztrsm(1.0, a[first, first], a[first, last], lower=1, diag=1)
    a[last, first] = ztrsm(1.0, a[first, first], a[last, first], side=1)
    a[last, last] -= a[last, first] @ a[first, last]
    _eliminate(a[last, last])


def _spectrum(level: Array, matrix: Array) -> Array:
    """ln of the eigenvalues ``(m,)`` of E H, by descending size; NaN where they are not found."""
    for _ in range(ROUNDS):
        lower, upper = _triangles(matrix)
        grown = np.abs(np.diagonal(upper))
        matrix = ztrmm(1.0, upper / grown[:, None], lower * _descending(level))
        level = level + np.log(grown)
        order = np.argsort(-level, kind="stable")
        matrix, level = matrix[np.ix_(order, order)], level[order]
    result, done = np.full(len(level), np.nan, dtype=complex), 0
    while done < len(level) and np.isfinite(matrix).all():
        top = level[done]
        first, last = np.searchsorted(-level, [-top - OVERLAP, KEPT + OVERLAP - top])
        values = np.linalg.eigvals(np.exp(level[first:last] - top)[:, None] * matrix[first:last, first:last])
        logs = np.log(values[np.argsort(-np.abs(values))]) + top
        # The last one known may lie at the end of this window, where what is left out above still changes it.
        left = np.exp(-ROUNDS * (level[first - 1] - level[done - 1])) if first else 0.0
        if done > first and not abs(logs[done - first - 1].real - result[done - 1].real) < AGREEMENT + left:
            break
        end = len(logs) if last == len(level) else _gap(logs.real, done - first, top - KEPT)
        result[done : first + end] = logs[done - first : end]
        done = first + end
    return result


def _gap(sizes: Array, first: int, least: float) -> int:
    """Where the sizes from the first one on, not below the least but for one, are farthest apart; the next place."""
    end = max(int(np.count_nonzero(sizes > least)), first + 1)
    places = np.arange((first + end) // 2 + 1, min(end, len(sizes) - 1) + 1)
    return int(places[np.argmax(sizes[places - 1] - sizes[places])]) if len(places) else len(sizes)
