"""Products as moderately conditioned factors, and the exponents that the compiled kernel leaves to NumPy: of states
that cannot be diagonalised safely, and of very large ones.

Of few segments in which modes decay very differently all multipliers are those of matrices of size one. In the modes of
its state, by descending growth, a segment is a diagonal matrix E of sizes exp(a_i t), from one down to less than a
computer's numbers, and a matrix C of size one leads on to the next one. Sizes move through matrices without loss: with
C = L U, triangular and without pivots,

    E C E' = (E L E^-1) E E' (E'^-1 U E'),

where both brackets are of size one again, as the sizes descend. So a whole period is similar to E H, with the sizes
E of the period as logarithms and H of size one. Steps of the LR algorithm, H = L U -> U (E L E^-1), which cost the same
however far the sizes are apart, reduce H_ij below the diagonal by E_i/E_j each (Rutishauser 1958). After ROUNDS of them
an eigenvalue is that of a window of neighbouring sizes: what lies OVERLAP away changes it by exp(-ROUNDS OVERLAP).

There are no pivots, so that a result is checked: triangles of moderate entries, neighbouring windows that agree, and
Liouville's formula, by which all ln |lambda| add up to the integral of the trace.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from gearstab.floquet.kernel import damped
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Pattern, Succession
from gearstab.interrupts import heed
from gearstab.system import Array

ENTRIES_AT_ONCE = 2**22
"""Entries of all factors of a product, or of the monodromy matrices of points in doubt: 32 MB."""
SPREAD = np.log(100.0)
"""Damped monodromy matrices whose ln |lambda| differ by more have small multipliers that an eigenvalue solver would
blur."""
ROUNDS, OVERLAP, KEPT = 4, 7.0, 3.0
"""Steps, and logarithms of sizes: how far a window reaches beyond the multipliers taken from it, and how far these are
apart. An eigenvalue solver leaves an error of eps exp(OVERLAP + KEPT) = 5e-12 of the smallest multiplier taken."""
MOST_GROWN = 1e3
"""Largest entry of a triangle: a result loses so many of its digits."""
AGREEMENT = 1e-9
"""Difference of ln |lambda| between windows, and relative one of their sum from the trace; else there is no result."""
SMALL = 8
"""Size of a half from which on matrices are eliminated by halves."""


def rotation(squared: Array, fraction: float, inverse: Array) -> tuple[Array, Array]:
    """cos(w t), sin(w t)/w, -w sin(w t) for w^2 of either sign, without overflow.

    Parameters: ``squared`` (n,) w^2; ``fraction`` and ``inverse`` (P,): the duration is t = 2 pi fraction inverse; of a
    segment that runs backwards, as part of a Magnus step, it is negative.
    Returns: ``(3, n, P)``, all divided by exp(growth), and growth (P,). Phases are counted in turns, so
    that reducing them to [-1/2, 1/2] is exact.
    """
    w = np.sqrt(np.abs(squared))[:, None]
    turns = (w * fraction) * inverse
    growth = np.zeros(inverse.shape)
    angle = 2 * np.pi * (turns - np.rint(turns))
    cosine, sine = np.cos(angle), np.sin(angle)
    for mode in np.flatnonzero(squared < 0):
        growth = np.maximum(growth, 2 * np.pi * np.abs(turns[mode]))
    terms = np.empty((3, *turns.shape))
    terms[0], terms[2] = cosine, -w * sine
    with np.errstate(divide="ignore", invalid="ignore"):
        terms[1] = sine / w
    if np.any(squared < 0):
        terms *= np.exp(-growth)
    for mode in np.flatnonzero(squared < 0):
        x = 2 * np.pi * np.abs(turns[mode])
        up, down = 0.5 * np.exp(x - growth), 0.5 * np.exp(-x - growth)
        # sinh as a difference of exponentials loses digits for small x.
        difference = np.where(x < 1, np.exp(-growth) * np.sinh(np.minimum(x, 1)), up - down)
        difference = np.copysign(difference, fraction)
        terms[:, mode] = up + down, difference / w[mode], w[mode] * difference
    for mode in np.flatnonzero(squared == 0):
        terms[:2, mode] = np.exp(-growth), np.exp(-growth) * 2 * np.pi * fraction * inverse
        terms[2, mode] = 0.0
    return terms, growth


def factors(pattern: Pattern, row: int, omega: Array) -> list[Array]:
    """Return the monodromy matrix of one row as moderately conditioned factors ``(P, 2n, 2n)``, first segment first.

    Segments in which a mode grows exponentially are subdivided to less than a factor e each.
    """
    n = pattern.size
    frequency, inverse = pattern.squared_frequency[row], pattern.cycles / omega
    index = np.arange(n)
    result = []
    for s, state in enumerate(pattern.states):
        fraction = pattern.fractions[row, s]
        turns = np.sqrt(np.maximum(-frequency[state], 0.0)).max() * fraction * inverse.max()
        pieces = max(1, int(np.ceil(2 * np.pi * turns)))
        terms, growth = rotation(frequency[state], fraction / pieces, inverse)
        terms = np.moveaxis(terms * np.exp(growth), -1, 1)
        factor = np.zeros((len(omega), 2 * n, 2 * n))
        factor[:, index, index], factor[:, index, n + index] = terms[0], terms[1]
        factor[:, n + index, index], factor[:, n + index, n + index] = terms[2], terms[0]
        turn = np.kron(np.eye(2), pattern.change(s)[row])
        result += [factor] * (pieces - 1) + [turn @ factor]
    return result


def chains(chosen: Array, segments: int, size: int) -> Iterator[tuple[int, Array]]:
    """(row, points) of all chosen points ``(r, P)``, in pieces of which all factors of the product fit in memory.

    segments: as many factors there are, of order ``size``.
    """
    step = max(1, ENTRIES_AT_ONCE // (segments * size**2))
    for row in np.flatnonzero(chosen.any(axis=1)):
        points = np.flatnonzero(chosen[row])
        for i in range(0, len(points), step):
            yield int(row), points[i : i + step]


def log_multipliers_damped(
    pattern: Succession,
    generator: Generators,
    omega: Array,
    multipliers: Callable[[Succession, Generators, Array], tuple[Array, Array, Array]],
    of_factors: Callable[[Sequence[Array]], Array],
) -> Array:
    """ln lambda ``(r, P, m)`` of a damped pattern; the product is formed only where that costs no digits.

    multipliers: of a product that is formed: ln max |lambda|, ln of its size, and lambda over that. of_factors: where
    :func:`log_multipliers` does not serve.
    """
    logs = np.full((*omega.shape, generator.matrix.shape[-1]), np.nan, dtype=complex)
    decay = np.ptp(generator.eigen[0].real, axis=-1)[:, pattern.states]
    for row in map(int, np.flatnonzero(generator.well_conditioned)):
        points = decay[row] @ pattern.durations(row, omega[row]) > SPREAD
        if points.any():
            logs[row, points] = log_multipliers(pattern, generator, row, omega[row, points])
    wide = np.asarray(np.isnan(logs).any(axis=2))
    for row in map(int, np.flatnonzero(wide.any(axis=1))):
        own, left = (pattern.row(row), generator.row(row)), wide[row]
        _, scale, values = multipliers(*own, omega[row : row + 1, left])
        with np.errstate(divide="ignore", invalid="ignore"):
            logs[row, left] = np.log(values[0]) + scale[0, :, None]
        wide[row, left] = np.ptp(logs[row, left].real, axis=-1) > SPREAD
    for row, points in chains(wide, len(pattern.states), logs.shape[-1]):
        chain, growing = damped.factors(generator, pattern, row, omega[row, points], spread=1.0)
        logs[row, points] = of_factors(chain) + growing[:, None]
    return logs


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
    from scipy.linalg.blas import ztrsm  # takes as long to load as a small sweep to run

    first, last = slice(half), slice(half, None)
    _eliminate(a[first, first])
    a[first, last] = ztrsm(1.0, a[first, first], a[first, last], lower=1, diag=1)
    a[last, first] = ztrsm(1.0, a[first, first], a[last, first], side=1)
    a[last, last] -= a[last, first] @ a[first, last]
    _eliminate(a[last, last])


def _spectrum(level: Array, matrix: Array) -> Array:
    """ln of the eigenvalues ``(m,)`` of E H, by descending size; NaN where they are not found."""
    from scipy.linalg.blas import ztrmm  # takes as long to load as a small sweep to run

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
