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
    """C version of :func:`gearstab.floquet.kernel.lyapunov.moduli`; same arguments and result."""
    logs = np.empty((len(row), chain.size))
    given, where = _of_chain(chain), (whole_numbers(row), contiguous(cycle))

    def part(first: int, last: int) -> None:
        ckernel.library.moduli(ckernel.simd(), *given, first, last, len(row), *where, logs)

    in_threads(part, len(row), float(len(chain.states) * chain.size**3), limit)
    left = np.flatnonzero(np.isnan(logs).any(axis=1) | ~chain.sound[row])
    if len(left):
        logs[left] = lyapunov.moduli(*chain.at(row[left], cycle[left]), cycle[left])
    return logs


def products(chain: Chain, row: Array, cycle: Array, limit: int | None = None) -> tuple[Array, Array]:
    """C form of :func:`gearstab.floquet.kernel.lyapunov.products`; where generators go with the mesh frequency, in the
    coordinates of these.
    """
    matrix, scale = np.empty((len(row), chain.size, chain.size)), np.empty(len(row))
    given, where = _of_chain(chain), (whole_numbers(row), contiguous(cycle))

    def part(first: int, last: int) -> None:
        ckernel.library.products(ckernel.simd(), *given, first, last, len(row), *where, matrix, scale)

    in_threads(part, len(row), float(len(chain.states) * chain.size**3), limit)
    left = np.flatnonzero(~chain.sound[row])
    if len(left):
        matrix[left], scale[left] = lyapunov.products(chain, row[left], cycle[left])
    return matrix, scale


def exponentials(
    cycles: float, fractions: Array, states: Array, generator: Generators, row: Array, cycle: Array
) -> Array:
    """Products of the exponentials of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, not scaled.

    fractions ``(r, S)``, states ``(S,)``: as of a pattern.
    """
    given, where = _scattered(cycles, fractions, states, generator), (whole_numbers(row), contiguous(cycle))
    m = generator.matrix.shape[-1]
    matrix, scale = np.empty((len(row), m, m)), np.empty(len(row))

    def part(first: int, last: int) -> None:
        of_points = LANES * first, min(LANES * last, len(row)), len(row)
        ckernel.library.products(ckernel.simd(), *given, *of_points, *where, matrix, scale)

    in_threads(part, -(-len(row) // LANES), float(LANES * len(states) * m**3), None)
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
    given, where = (
        damped_arguments(cycles, values, fractions, states, change, index),
        (whole_numbers(row), contiguous(cycle)),
    )
    m = values.shape[2]
    matrix, scale = np.empty((len(row), m, m)), np.empty(len(row))

    def part(first: int, last: int) -> None:
        of_points = LANES * first, min(LANES * last, len(row)), len(row)
        ckernel.library.products(ckernel.simd(), *given, *of_points, *where, matrix, scale)

    # Points that go through the period side by side take no longer than one.
    in_threads(part, -(-len(row) // LANES), float(LANES * len(states) * m**3), None)
    first = states[0]
    return basis[row, first] @ (matrix * np.exp(scale)[:, None, None]) @ inverse[row, first]


def radii(chain: Chain, row: Array, cycle: Array, growth: Array, limit: int | None = None) -> Array:
    """C version of :func:`gearstab.floquet.kernel.lyapunov.radii`; same arguments and result."""
    chain, row = chain.at(row, cycle, slopes=True)
    if chain.slope is not None:
        return lyapunov.radii(chain, row, cycle, growth)
    radius = np.empty((len(row), 2))
    given = (*_of_chain(chain), contiguous(chain.weight), lyapunov.settings(chain))
    where = (whole_numbers(row), contiguous(cycle), contiguous(growth))

    def part(first: int, last: int) -> None:
        ckernel.library.radii(ckernel.simd(), *given, first, last, len(row), *where, radius)

    # Roughly: it decides only from how many points on threads pay.
    in_threads(part, len(row), 10.0 * len(chain.states) * chain.size**3, limit)
    left = np.flatnonzero(np.isnan(radius).any(axis=1) | ~chain.sound[row])
    if len(left):
        radius[left] = lyapunov.radii(chain, row[left], cycle[left], growth[left])
    return radius


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
