"""The compiled kernel at scattered points (row, 1/Omega) of damped chains and generators, one period at each."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab import ckernel
from gearstab.floquet.kernel import lyapunov
from gearstab.floquet.kernel.c_kernel import LANES, contiguous, damped_arguments, whole_numbers
from gearstab.floquet.kernel.chain import Chain
from gearstab.floquet.kernel.damped import Generators, real_modes
from gearstab.floquet.kernel.threads import in_threads
from gearstab.system import Array


def moduli(chain: Chain, row: Array, cycle: Array, limit: int | None = None) -> Array:
    """ln |lambda| of all multipliers, descending, ``(P, m)``, at points (row, 1/Omega) ``(P,)``."""
    logs = np.empty((len(row), chain.size))
    given, where = _of_chain(chain), (whole_numbers(row), contiguous(cycle))

    def part(first: int, last: int) -> None:
        ckernel.library.moduli(ckernel.simd(), *given, first, last, len(row), *where, logs)

    in_threads(part, len(row), float(len(chain.states) * chain.size**3), limit)
    left = np.flatnonzero(np.isnan(logs).any(axis=1) | ~chain.sound[row])
    if len(left):
        matrix, scale = products(chain, row[left], cycle[left])
        with np.errstate(divide="ignore"):
            logs[left] = -np.sort(-np.log(np.abs(np.linalg.eigvals(matrix))) - scale[:, None], axis=1)
    return logs


def products(chain: Chain, row: Array, cycle: Array, limit: int | None = None) -> tuple[Array, Array]:
    """Return products of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, over exp(scale); scale ``(P,)``.

    In the coordinates of the states; in those of the generators where these go with the mesh frequency or a state has
    no eigenvectors.
    """
    matrix, scale = _products(_of_chain(chain), row, cycle, limit)
    left = np.flatnonzero(~chain.sound[row])
    if len(left):
        given = _scattered(chain.cycles, chain.fractions, chain.states, chain.generator)
        matrix[left], scale[left] = _products(given, row[left], cycle[left], limit)
    return matrix, scale


def _products(given: tuple[Any, ...], row: Array, cycle: Array, limit: int | None = None) -> tuple[Array, Array]:
    """The same by the arguments of the C function."""
    segments, m = given[0][1], given[0][4]
    matrix, scale = np.empty((len(row), m, m)), np.empty(len(row))
    where = whole_numbers(row), contiguous(cycle)

    def part(first: int, last: int) -> None:
        of_points = LANES * first, min(LANES * last, len(row)), len(row)
        ckernel.library.products(ckernel.simd(), *given, *of_points, *where, matrix, scale)

    # Points that go through the period side by side take no longer than one.
    in_threads(part, -(-len(row) // LANES), float(LANES * segments * m**3), limit)
    return matrix, scale


def exponentials(
    cycles: float, fractions: Array, states: Array, generator: Generators, row: Array, cycle: Array
) -> Array:
    """Products of the exponentials of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, not scaled.

    fractions ``(r, S)``, states ``(S,)``: as of a pattern.
    """
    matrix, scale = _products(_scattered(cycles, fractions, states, generator), row, cycle)
    with np.errstate(over="ignore"):
        return matrix * np.exp(scale)[:, None, None]


def chained(
    cycles: float, fractions: Array, states: Array, values: Array, vectors: Array, inverse: Array, row: Array,
    cycle: Array,
) -> Array:  # fmt: skip
    """Products of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, not scaled.

    values ``(r, D, m)``, vectors and their inverse ``(r, D, m, m)``: of well-conditioned states. fractions ``(r, S)``,
    states ``(S,)``: as of a pattern.
    """
    values, basis, inverse = real_modes(values, vectors, inverse)
    count, following = values.shape[1], np.roll(states, -1)
    pairs, index = np.unique(following * count + states, return_inverse=True)
    change = inverse[:, pairs // count] @ basis[:, pairs % count]
    matrix, scale = _products(damped_arguments(cycles, values, fractions, states, change, index), row, cycle)
    first = states[0]
    return basis[row, first] @ (matrix * np.exp(scale)[:, None, None]) @ inverse[row, first]


def radii(chain: Chain, row: Array, cycle: Array, growth: Array, limit: int | None = None) -> Array:
    """``(P, 2)``: by which part all periods may be longer, and shorter, and as many multipliers are outside the unit
    circle as at the points (row, 1/Omega) ``(P,)``; 0 where nothing is proved, see :mod:`~.lyapunov`.

    growth: ``(P,)``, the largest ln |lambda|.
    """
    chain, row = chain.at(row, cycle, slopes=True)
    radius, m = np.zeros((len(row), 2)), chain.size
    slopes = (np.empty(0), np.empty(0)) if chain.slope is None or chain.bend is None else (chain.slope, chain.bend)
    given = (*_of_chain(chain), contiguous(chain.weight), lyapunov.settings(chain), *map(contiguous, slopes))

    def proved(which: Array, equation: Array, reads: bool) -> Array:
        found = np.empty((len(which), 2))
        where = (whole_numbers(row[which]), contiguous(cycle[which]), contiguous(growth[which]))

        def part(first: int, last: int) -> None:
            of_points = first, last, len(which)
            ckernel.library.radii(ckernel.simd(), *given, *of_points, *where, found, equation, int(reads))

        # Roughly: it decides only from how many points on threads pay.
        in_threads(part, len(which), 10.0 * len(chain.states) * m**3, limit)
        return found

    by_vectors = chain.sound[row] & (growth >= 0) & lyapunov.too_many(m)
    plain, left = np.flatnonzero(chain.sound[row] & ~by_vectors), np.flatnonzero(by_vectors)
    radius[plain] = proved(plain, np.empty(0), False)
    if len(left):
        equation = np.empty((len(left), 2, m, m))
        proved(left, equation, False)
        with np.errstate(all="ignore"):
            equation[:, 1] = lyapunov.stein(equation[:, 0], equation[:, 1])
        radius[left] = proved(left, equation, True)
    return np.nan_to_num(radius)


def _scattered(cycles: float, fractions: Array, states: Array, generator: Generators) -> tuple[Any, ...]:
    """Any generators, of which each point makes exponentials, as the C functions for scattered points take them."""
    rows, count, m = generator.matrix.shape[:3]
    by_speed, laws = np.empty((rows, 0, m, m)), np.empty((rows, 0, 3))
    if generator.by_speed is not None and generator.laws is not None:
        by_speed, laws = generator.by_speed, generator.laws
    numbers = (rows, len(states), count, count, m, by_speed.shape[1], float(cycles))
    unused, order = np.zeros((rows, count, m)), np.ascontiguousarray(states, dtype=np.int64)
    return (
        numbers,
        unused,
        unused,
        contiguous(fractions),
        order,
        order,
        *map(contiguous, (generator.matrix, by_speed, laws)),
    )


def _of_chain(chain: Chain) -> tuple[Any, ...]:
    if chain.following is not None:
        parts = chain.fractions[:, chain.span], chain.states[chain.span]
        return _scattered(chain.cycles, *parts, chain.following)
    return damped_arguments(chain.cycles, chain.values, chain.fractions, chain.states, chain.change, chain.index)
