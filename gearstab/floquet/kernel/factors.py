"""Products as moderately conditioned factors, and the exponents that the compiled kernel leaves to NumPy: of states
that cannot be diagonalised safely, and of very large ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from gearstab.floquet.kernel import damped
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Pattern, Succession
from gearstab.system import Array

ENTRIES_AT_ONCE = 2**22
"""Entries of all factors of a product, or of the monodromy matrices of points in doubt: 32 MB."""
SPREAD = np.log(100.0)
"""Damped monodromy matrices whose ln |lambda| differ by more have small multipliers that an eigenvalue solver would
blur."""


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
    :mod:`gearstab.floquet.kernel.levels` does not serve.
    """
    logs = np.full((*omega.shape, generator.matrix.shape[-1]), np.nan, dtype=complex)
    decay = np.ptp(generator.eigen[0].real, axis=-1)[:, pattern.states]
    for row in map(int, np.flatnonzero(generator.well_conditioned)):
        points = decay[row] @ pattern.durations(row, omega[row]) > SPREAD
        if points.any():
            from gearstab.floquet.kernel import levels  # which loads a part of SciPy

            logs[row, points] = levels.log_multipliers(pattern, generator, row, omega[row, points])
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
