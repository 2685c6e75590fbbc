"""The compiled kernel: exact propagation over one period, for patterns and mesh frequencies ``(r, P)``.

Each segment is n rotations in the modal coordinates of its state followed by the change to the next state's modes.
The eigenproblems were solved once per state and serve the whole frequency axis. Mesh frequencies, in units of the
pattern's rate, run side by side in vector registers, rows in threads.

For a conservative system the monodromy matrix M is symplectic, M^-1 = -J M^T J, and W = M + M^-1 = [[E, F], [G,
E^T]] with skew F and G has every rho = lambda + 1/lambda twice. Their elementary symmetric functions are
polynomials in E, F, G:

    n = 1: s1 = E;    n = 2: s1 = tr E, s2 = det E + F_12 G_12;
    n = 3: s1 = tr E, s2 = e2(E) + f.g, s3 = det E + f^T E g   (F = [f]x, G = [g]x)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from gearstab import ckernel
from gearstab.floquet.kernel import decision
from gearstab.floquet.kernel import factors as left
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.kernel.threads import in_threads
from gearstab.floquet.segments.pattern import Pattern, Succession
from gearstab.system import Array

LANES = 8
"""Most points that go through the kernel side by side."""
LARGE = 2.0**200
"""Entries above this are scaled down, so that a product of any length stays finite."""
LIMITS = (
    decision.EDGE_NOISE, decision.DISCRIMINANT_NOISE, decision.GROWTH_NOISE, decision.LARGEST, LARGE,
)  # fmt: skip
"""Thresholds of verdicts: ``struct limits`` of kernel.h."""
FITTED = (4, 6)
"""Sizes of states whose growth polynomials of the period may give."""
MOST_IN_LANES = 64
"""Size of damped matrices whose exponents LAPACK does not find faster."""
NOTHING = np.empty((2, 0))
"""Speed-dependent part of patterns that have none."""
TRACELESS = 1e-13
"""Part of the largest entry of a matrix up to which its trace is rounding."""
ENTRIES_AT_ONCE = 1 << 23
"""Entries of the changes of modes of all segments: 64 MB. Common periods may have thousands of segments."""


def scan(pattern: Pattern, omega: Array, limit: int | None = None) -> tuple[Array, Array]:
    """Verdict (int8) and growth per period of every point, ``(r, P)`` each; mesh frequencies ``(r, P)``.

    limit: the number of threads, by default :func:`gearstab.ckernel.threads`; the results do not depend on it.
    """
    return _scan(pattern, omega, np.empty((len(omega), 0), dtype=complex), limit)


def rates(
    pattern: Pattern, mesh_frequency: Array, place: Array, stable: Array, growth: Array, limit: int | None = None
) -> tuple[Array, Array]:
    """Flags and growth rates of every point, put in their places in a result (rows, points)."""
    omega, where = contiguous(mesh_frequency), whole_numbers(place)
    rate, shift = contiguous(pattern.elastic.rate), contiguous(pattern.elastic.shift)
    points, every = omega.shape[-1], len(stable)
    found: dict[int, Array] = {}

    def part(given: tuple[Any, ...], rows: slice, first: int, last: int) -> None:
        own = (omega if omega.ndim == 1 else omega[rows], rate[rows], shift[rows], where[rows], stable.T, growth.T)
        raw = ckernel.library.rates(ckernel.simd(), *given, first, last, points, every, *own)
        found[rows.start + first] = np.frombuffer(raw, dtype=np.int64).reshape(-1, 2) + np.array([rows.start, 0])

    _in_portions(part, pattern, points, limit)
    row, point = np.concatenate([found[first] for first in sorted(found)]).T
    return row, point


def scan_traces(
    pattern: Pattern, omega: Array, interpolate: bool = False, limit: int | None = None
) -> tuple[Array, Array, Array, Array]:
    """:func:`scan`, rho = lambda + 1/lambda ``(r, P, n)`` complex, as of :func:`traces`, from one propagation, and by
    how much the rounding errors ``(r, P)`` exceed those of propagation.

    interpolate: whether matrices may be interpolated between those of other mesh frequencies, where that pays; the
    interpolation is exact within rounding errors, but these are those of the largest matrix nearby.
    """
    rho, magnified = np.empty((*omega.shape, pattern.size), dtype=complex), np.ones(omega.shape)
    return *_scan(pattern, omega, rho, limit, magnified if interpolate else None), rho, magnified


def _scan(
    pattern: Pattern, omega: Array, rho: Array, limit: int | None, magnified: Array | None = None
) -> tuple[Array, Array]:
    asked = contiguous(omega)
    verdict, growth = np.empty(asked.shape, dtype=np.int8), np.empty(asked.shape)
    results: list[Array] = [verdict, growth, rho, *([] if magnified is None else [magnified])]

    def part(given: tuple[Any, ...], rows: slice, first: int, last: int) -> None:
        own = (asked.shape[1], asked[rows], *(result[rows] for result in results))
        ckernel.library.scan(ckernel.simd(), *given, first, last, *own)

    _in_portions(part, pattern, asked.shape[1], limit)
    return verdict, growth


def _in_portions(
    part: Callable[[tuple[Any, ...], slice, int, int], None], pattern: Pattern, points: int, limit: int | None
) -> None:
    """Call part(arguments of the C functions for some rows, these rows, first, last) on pieces of these, in threads."""
    for rows in portions(len(pattern.rows), len(pattern.states), pattern.size):
        call = partial(part, pattern_arguments(pattern, rows), rows)
        in_threads(call, rows.stop - rows.start, points * cost(pattern), limit)


def monodromy(pattern: Pattern, row: int | Array, omega: Array) -> tuple[Array, Array]:
    """(M exp(-scale) as ``(P, 2n, 2n)``, scale ``(P,)``) at ``(P,)`` frequencies of one row or of a row each."""
    asked = contiguous(omega)
    needed, index = np.unique(np.broadcast_to(row, asked.shape), return_inverse=True)
    size = 2 * pattern.size
    matrix, scale = np.empty((len(asked), size, size)), np.empty(len(asked))
    for rows in portions(len(needed), len(pattern.states), pattern.size):
        members = np.flatnonzero((index >= rows.start) & (index < rows.stop))
        points, arguments = len(members), pattern_arguments(pattern, needed[rows])
        found, size_of = np.empty((points, size, size)), np.empty(points)
        own = (whole_numbers(index[members] - rows.start), asked[members], found, size_of)
        ckernel.library.monodromy(ckernel.simd(), *arguments, 0, points, points, *own)
        matrix[members], scale[members] = found, size_of
    return matrix, scale


def traces(pattern: Pattern, omega: Array, bound: float = np.inf, limit: int | None = None) -> Array:
    """rho = lambda + 1/lambda of the n pairs of multipliers ``(r, P, n)`` complex, in no order; any n.

    From the Paige-Van Loan reduction of M + M^-1, right to eps times the largest entry of M; NaN where that exceeds
    the bound or the product had to be scaled down.
    """
    asked = contiguous(omega)
    rho = np.empty((*asked.shape, pattern.size), dtype=complex)

    def part(given: tuple[Any, ...], rows: slice, first: int, last: int) -> None:
        ckernel.library.traces(
            ckernel.simd(), *given, first, last, asked.shape[1], float(bound), asked[rows], rho[rows]
        )

    _in_portions(part, pattern, asked.shape[1], limit)
    return rho


def trace_change(rho: Array, other: Array, weight: float) -> tuple[Array, Array]:
    """Bound how far the multipliers of two computations differ ``(...)``, and the size of the largest, at least 1.

    rho, other: lambda + 1/lambda ``(..., n)``, in any order. From |d ln lambda| = |d rho|/|lambda - 1/lambda| = |d
    rho|/|rho^2 - 4|^(1/2), but |d rho|^(1/2) where that is larger than the root; weighted by min(1, weight times the
    size of the multiplier over the largest).
    """
    fine, coarse = np.ascontiguousarray(rho), np.ascontiguousarray(other)
    change, largest = np.empty(rho.shape[:-1]), np.empty(rho.shape[:-1])
    ckernel.library.trace_change(change.size, rho.shape[-1], weight, fine, coarse, change, largest)
    return change, largest


def trace_condition(rho: Array, least: Array) -> tuple[Array, Array]:
    """(moved, apart) ``(P,)``: how far a change ``least`` (P,) of the matrix may move multipliers, and how close two of
    them are, as an angle.

    rho: lambda + 1/lambda ``(P, n)``. A change of the matrix moves rho the more the nearer another rho is, and a
    multiplier the more the nearer rho is to +-2, where it meets its inverse.
    """
    given, noise = np.ascontiguousarray(rho, dtype=complex), contiguous(least)
    moved, apart = np.empty(noise.shape), np.empty(noise.shape)
    ckernel.library.trace_condition(noise.size, rho.shape[-1], given, noise, moved, apart)
    return moved, apart


def log_multipliers(pattern: Pattern, omega: Array, bound: float) -> Array:
    """ln lambda ``(r, P, 2n)``, imaginary parts in (-pi, pi]; NaN where an entry of M exceeds the bound."""
    with np.errstate(invalid="ignore"):
        half = np.arccosh(0.5 * traces(pattern, omega, bound))
    logs = np.concatenate([half, -half], axis=-1)
    logs.imag[logs.imag == -np.pi] = np.pi
    return logs


def scan_damped(
    pattern: Succession, generator: Generators, omega: Array, limit: int | None = None
) -> tuple[Array, Array]:
    """ln max |lambda| and, roughly, ln of the size of M, ``(r, P)`` each; NaN where M is not finite."""
    return _scan_periods(pattern, generator, omega, False, limit)[:2]


def multipliers_damped(
    pattern: Succession, generator: Generators, omega: Array, limit: int | None = None
) -> tuple[Array, Array, Array]:
    """:func:`scan_damped` and all multipliers over exp(scale), ``(r, P, m)`` complex."""
    return _scan_periods(pattern, generator, omega, True, limit)


def log_multipliers_damped(pattern: Succession, generator: Generators, omega: Array, limit: int | None = None) -> Array:
    """ln lambda ``(r, P, m)`` of a damped pattern, however far multipliers are apart, by the periodic QR algorithm."""
    points, size = omega.shape[1], generator.matrix.shape[-1]
    if size > MOST_IN_LANES:
        return left.log_multipliers_damped(pattern, generator, omega, multipliers_damped, graded)
    given = _of_modes(pattern, generator)
    logs = np.empty((*omega.shape, size), dtype=complex)
    asked = contiguous(omega)

    def part(first: int, last: int) -> None:
        ckernel.library.exponents(ckernel.simd(), *given, first, last, points, asked, logs)

    in_threads(part, len(omega) * -(-points // LANES), 10.0 * LANES * len(pattern.states) * size**3, limit)
    for row in map(int, np.flatnonzero(~generator.well_conditioned | np.isnan(logs).any(axis=(1, 2)))):
        missing = np.isnan(logs[row]).any(axis=1) | ~generator.well_conditioned[row]
        own = pattern.row(row), generator.row(row), omega[row, missing][None]
        logs[row, missing] = left.log_multipliers_damped(*own, multipliers_damped, graded)[0]
    return logs


def graded(factors: Sequence[Array], limit: int | None = None) -> Array:
    """ln lambda of A_S ... A_2 A_1, ``(P, m)`` complex, imaginary part in (-pi, pi], by the periodic QR algorithm; NaN
    where it does not converge.

    factors: ``(P, m, m)`` each, A_1 first. The eigenvalues of a product formed explicitly are right to eps times the
    *largest* one: after a long period the small multipliers are noise, or have underflowed. Here the product is never
    formed. Each factor should be moderately conditioned (subdivide long segments), then every ln lambda has an absolute
    error of some 1e-14 times the number of factors, however far the multipliers spread. Source: Bojanczyk, Golub & Van
    Dooren 1992; Watkins 2007.
    """
    count, (points, size) = len(factors), factors[0].shape[:2]
    most = max(1, ENTRIES_AT_ONCE // max(1, count * size**2))
    if points > most:
        parts = np.split(np.arange(points), range(most, points, most))
        return np.concatenate([graded([factor[part] for factor in factors], limit) for part in parts])
    given = contiguous(np.stack(factors))
    logs = np.empty((points, size), dtype=complex)

    def part(first: int, last: int) -> None:
        of_points = LANES * first, min(LANES * last, points), points
        ckernel.library.graded(ckernel.simd(), count, size, *of_points, given, logs)

    in_threads(part, -(-points // LANES), 10.0 * LANES * count * size**3, limit)
    return logs


def _scan_periods(
    pattern: Succession, generator: Generators, omega: Array, multipliers: bool, limit: int | None
) -> tuple[Array, Array, Array]:
    """:func:`multipliers_damped`; no multipliers where they are not wanted.

    In the real modal coordinates of the states, which are found once for all mesh frequencies; where there are none, or
    they are ill-conditioned, by an exponential of each segment at each of them.
    """
    asked, m = contiguous(omega), generator.matrix.shape[-1]
    values = np.empty((*asked.shape, m) if multipliers else (len(asked), 0), dtype=complex)
    growth, scale = np.empty(asked.shape), np.empty(asked.shape)
    turning = generator.by_speed is not None
    fitted = not multipliers and m in FITTED
    given = _of_generators(pattern, generator, asked, fitted) if turning else _of_modes(pattern, generator)
    own = [asked.shape[1], asked, growth, scale, values, *([LIMITS] if generator.symplectic else [])]

    def part(first: int, last: int) -> None:
        ckernel.library.scan_damped(ckernel.simd(), *given, first, last, *own)

    in_threads(part, len(asked), float(asked.shape[1] * len(pattern.states) * (m / 2) ** 3), limit)
    if not turning:
        left = np.flatnonzero(~generator.well_conditioned | np.isnan(growth).any(axis=1))
        if len(left):
            none = np.empty((len(left), 0, m, m))
            rest = Generators(generator.matrix[left], none, np.empty((len(left), 0, 3)), generator.symplectic)
            found = _scan_periods(pattern.subset(left), rest, asked[left], multipliers, limit)
            growth[left], scale[left], values[left] = found
    return growth, scale, values


def _of_generators(pattern: Succession, generator: Generators, omega: Array, fitted: bool) -> tuple[Any, ...]:
    """A pattern whose states go with the mesh frequency as the C functions take it; fitted: whether polynomials may
    stand for propagation.
    """
    matrix, by_speed, laws = generator.matrix, generator.by_speed, generator.laws
    assert by_speed is not None
    assert laws is not None
    mean = np.trace(matrix, axis1=-2, axis2=-1) / matrix.shape[-1]
    rows, count, m = matrix.shape[:3]
    apart = np.zeros((rows, count, m))
    if fitted:
        # How fast solutions vary: it decides where polynomials pay, which are checked.
        ends = np.stack([omega.min(axis=1), omega.max(axis=1)], axis=1)
        apart = np.sort(np.abs(np.linalg.eigvals(generator.at(ends)) - mean[:, None, :, None]), axis=-1).max(axis=1)
        # They rest on a determinant that does not go with the mesh frequency.
        traces = np.abs(np.trace(by_speed, axis1=-2, axis2=-1))
        apart[(traces > TRACELESS * np.abs(by_speed).max(axis=(-2, -1))).any(axis=1)] = 0.0
    numbers = (rows, len(pattern.states), count, count, m, by_speed.shape[1], float(pattern.cycles))
    states = np.ascontiguousarray(pattern.states, dtype=np.int64)
    decay = np.repeat(mean[:, :, None], m, axis=2)
    given = map(contiguous, (decay, apart, pattern.fractions))
    return (numbers, *given, states, states, *map(contiguous, (matrix, by_speed, laws)))


def damped_arguments(
    cycles: float, values: Array, fractions: Array, states: Array, change: Array, index: Array
) -> tuple[Any, ...]:
    """A damped pattern as the C functions take it."""
    rows, count, size = values.shape
    numbers = (rows, len(states), count, change.shape[1], size, -1, float(cycles))
    indices = (np.ascontiguousarray(part, dtype=np.int64) for part in (states, index))
    return (numbers, *map(contiguous, (values.real, values.imag, fractions)), *indices, contiguous(change), *NOTHING)


def _of_modes(pattern: Succession, generator: Generators) -> tuple[Any, ...]:
    """A damped pattern in the real modes of its states."""
    values, basis, inverse = generator.real_modes
    return damped_arguments(pattern.cycles, values, pattern.fractions, pattern.states, *pattern.pairs(inverse, basis))


def whole_numbers(values: Array) -> Array:
    """As the C functions take whole numbers."""
    return np.ascontiguousarray(values, dtype=np.int64)


def contiguous(values: Array) -> Array:
    """As the C functions take numbers."""
    return np.ascontiguousarray(values, dtype=float)


def portions(rows: int, segments: int, size: int) -> Iterator[slice]:
    """Rows in pieces whose changes of modes fit in memory."""
    step = max(1, ENTRIES_AT_ONCE // (segments * size**2)) if size else max(1, rows)
    for first in range(0, rows, step):
        yield slice(first, min(rows, first + step))


def pattern_arguments(pattern: Pattern, rows: slice | Array = slice(None)) -> tuple[Any, ...]:
    """Some rows of a conservative pattern as the C functions take it."""
    squared = pattern.squared_frequency[rows]
    numbers = (len(squared), len(pattern.states), *squared.shape[1:], float(pattern.cycles), LIMITS)
    state = np.ascontiguousarray(pattern.states, dtype=np.int64)
    change = contiguous(pattern.changes(rows))
    return numbers, contiguous(squared), contiguous(pattern.fractions[rows]), state, change


def cost(pattern: Pattern) -> float:
    """Operations of a monodromy matrix, about."""
    return float(len(pattern.states) * pattern.size**3)
