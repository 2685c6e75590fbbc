"""The kernel in NumPy: exact propagation over one period, vectorised over rows and mesh frequencies.

Each segment is n rotations in the modal coordinates of its state followed by the change to the next state's modes.
The eigenproblems were solved once per state and serve the whole frequency axis. The arrays are laid out with the mesh
frequency last, so that every operation runs over contiguous memory.

For a conservative system the monodromy matrix M is symplectic, M^-1 = -J M^T J, and W = M + M^-1 = [[E, F], [G,
E^T]] with skew F and G has every rho = lambda + 1/lambda twice. Their elementary symmetric functions are
polynomials in E, F, G:

    n = 1: s1 = E;    n = 2: s1 = tr E, s2 = det E + F_12 G_12;
    n = 3: s1 = tr E, s2 = e2(E) + f.g, s3 = det E + f^T E g   (F = [f]x, G = [g]x)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from gearstab.floquet.kernel import damped, lyapunov
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.kernel.graded import log_multipliers as graded
from gearstab.floquet.kernel.invariants import DOUBTFUL, STABLE, UNSTABLE, classify, growth_of, roots
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

CHUNK = 1024
"""Mesh frequencies treated at once: the 2n x 2n matrices of a chunk then stay in the processor's cache."""
LARGE = 2.0**200
"""Entries above this are scaled down, so that a product of any length stays finite."""

ENTRIES_AT_ONCE = 2**22
"""Entries of all factors of a product, or of the monodromy matrices of points in doubt: 32 MB."""
SPREAD = np.log(100.0)
"""Damped monodromy matrices whose ln |lambda| differ by more have small multipliers that an eigenvalue solver would
blur."""

RESCALE_EVERY = 8
"""Segments without exponential growth; as in modal.h, so that both kernels round alike."""

products, moduli, radii = lyapunov.products, lyapunov.moduli, lyapunov.radii


def propagate(pattern: Pattern, row: int, omega: Array) -> tuple[Array, Array]:
    """The scaled monodromy matrix of one row.

    Parameters: ``omega`` (P,), mesh frequency in units of the pattern's rate.
    Returns: M exp(-scale) as ``(2n, 2n, P)`` in the modes of the first segment, (positions, velocities), and
    ``scale`` (P,).
    """
    n, points = pattern.size, len(omega)
    frequency = pattern.squared_frequency[row]
    inverse = pattern.cycles / omega
    scale = np.zeros(points)
    x = np.zeros((2, n, 2 * n, points))
    for s, state in enumerate(pattern.states):
        terms, growth = rotation(frequency[state], pattern.fractions[row, s], inverse)
        scale += growth
        cosine, over, times = terms[:, :, None, :]
        if s == 0:
            index = np.arange(n)
            x[0, index, index], x[0, index, n + index] = cosine[:, 0], over[:, 0]
            x[1, index, index], x[1, index, n + index] = times[:, 0], cosine[:, 0]
        else:
            position = cosine * x[0]
            position += over * x[1]
            x[1] *= cosine
            x[1] += times * x[0]
            x[0] = position
        if len(pattern.states) > 1:
            x = np.matmul(pattern.change(s)[row], x.reshape(2, n, -1)).reshape(x.shape)
        if s % RESCALE_EVERY == RESCALE_EVERY - 1 or np.any(growth > 0):
            _rescale(x, scale)
    _unscale(x, scale)
    return x.reshape(2 * n, 2 * n, points), scale


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


def _rescale(x: Array, scale: Array) -> None:
    """Divide the columns of points that have grown beyond LARGE, in place."""
    size = np.abs(x).max(axis=(0, 1, 2))
    big = size > LARGE
    if np.any(big):
        x[..., big] /= size[big]
        scale[big] += np.log(size[big])


def _unscale(x: Array, scale: Array) -> None:
    """Undo the scaling of points that did not need it in the end, in place."""
    with np.errstate(divide="ignore"):
        modest = (scale != 0) & (scale + np.log(np.abs(x).max(axis=(0, 1, 2))) < np.log(LARGE))
    x[..., modest] *= np.exp(scale[modest])
    scale[modest] = 0.0


def invariants(m: Array) -> Array:
    """Coefficients s1..sn of prod(x - rho_i), ``(n, P)``, from M ``(2n, 2n, P)`` of a conservative system, n <= 3."""
    n = m.shape[0] // 2
    a, b, c, d = m[:n, :n], m[:n, n:], m[n:, :n], m[n:, n:]
    if n == 1:
        return a[0] + d[0]
    e = a + np.swapaxes(d, 0, 1)
    if n == 2:
        f, g = b[0, 1] - b[1, 0], c[0, 1] - c[1, 0]
        return np.stack([e[0, 0] + e[1, 1], e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0] + f * g])
    f = np.stack([b[2, 1] - b[1, 2], b[0, 2] - b[2, 0], b[1, 0] - b[0, 1]])
    g = np.stack([c[2, 1] - c[1, 2], c[0, 2] - c[2, 0], c[1, 0] - c[0, 1]])
    cof = np.cross(e[1], e[2], axis=0)
    minors = cof[0] + e[0, 0] * e[2, 2] - e[0, 2] * e[2, 0] + e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0]
    s2 = minors + f[0] * g[0] + f[1] * g[1] + f[2] * g[2]
    s3 = e[0, 0] * cof[0] + e[0, 1] * cof[1] + e[0, 2] * cof[2] + np.einsum("ip,ijp,jp->p", f, e, g)
    return np.stack([e[0, 0] + e[1, 1] + e[2, 2], s2, s3])


def monodromy(pattern: Pattern, row: int | Array, omega: Array) -> tuple[Array, Array]:
    """(M exp(-scale) as ``(P, 2n, 2n)``, scale ``(P,)``) in the modes of the first segment.

    Parameters: ``row``, one for all points or one each ``(P,)``; ``omega`` (P,).
    """
    rows = np.broadcast_to(row, omega.shape)
    matrix, scale = np.empty((len(omega), 2 * pattern.size, 2 * pattern.size)), np.empty(len(omega))
    for r in np.unique(rows):
        members = np.flatnonzero(rows == r)
        for i in range(0, len(members), CHUNK):
            part = members[i : i + CHUNK]
            x, scale[part] = propagate(pattern, int(r), omega[part])
            matrix[part] = np.moveaxis(x, -1, 0)
    return matrix, scale


def trace_change(rho: Array, other: Array, weight: float) -> tuple[Array, Array]:
    """Bound how far the multipliers of two computations differ ``(...)``, and the size of the largest, at least 1.

    rho, other: lambda + 1/lambda ``(..., n)``, in any order. From |d ln lambda| = |d rho|/|lambda - 1/lambda| = |d
    rho|/|rho^2 - 4|^(1/2), but |d rho|^(1/2) where that is larger than the root; weighted by min(1, weight times the
    size of the multiplier over the largest).
    """
    root = np.sqrt(np.abs(rho * rho - 4))
    modulus = 0.5 * (np.abs(rho) + root)
    largest = modulus.max(axis=-1, initial=1.0)
    gap = np.abs(rho[..., :, None] - other[..., None, :]).min(axis=-1)
    moved = gap / np.maximum(np.maximum(root, np.sqrt(gap)), np.finfo(float).tiny)
    share = np.minimum(1.0, weight * modulus / largest[..., None])
    return (moved * share).max(axis=-1, initial=0.0), largest


def trace_condition(rho: Array, least: Array) -> tuple[Array, Array]:
    """(moved, apart) ``(P,)``: how far a change ``least`` (P,) of the matrix may move multipliers, and how close two of
    them are, as an angle.

    rho: lambda + 1/lambda ``(P, n)``. A change of the matrix moves rho the more the nearer another rho is, and a
    multiplier the more the nearer rho is to +-2, where it meets its inverse.
    """
    root = np.sqrt(np.abs(rho * rho - 4))
    gap = np.abs(rho[:, :, None] - rho[:, None, :])
    each = np.arange(rho.shape[-1])
    gap[:, each, each] = np.inf
    shift = least[:, None] / np.clip(gap.min(axis=-1, initial=np.inf), np.sqrt(least)[:, None], 1.0)
    moved = (shift / np.maximum(root, np.sqrt(shift))).max(axis=-1, initial=0.0)
    # Angles on the circle: 2 cos theta = rho, so that rho^2 - 4 = -(2 sin theta)^2.
    between = gap / np.maximum(np.maximum(root[:, :, None], root[:, None, :]), np.finfo(float).tiny)
    apart = np.minimum(root.min(axis=-1, initial=np.inf), between.min(axis=(-1, -2), initial=np.inf))
    return np.asarray(moved), np.asarray(apart)


def log_multipliers(pattern: Pattern, omega: Array, bound: float) -> Array:
    """ln lambda ``(r, P, 2n)`` from the eigenvalues of M; NaN where an entry of M exceeds the bound."""
    logs = np.full((*omega.shape, 2 * pattern.size), np.nan, dtype=complex)
    for row, frequencies in enumerate(omega):
        matrix, scale = monodromy(pattern, row, frequencies)
        with np.errstate(invalid="ignore"):
            plain = (scale == 0) & (np.abs(matrix).max(axis=(1, 2)) < bound)
        logs[row, plain] = np.log(np.linalg.eigvals(matrix[plain]).astype(complex))
    return logs


def scan_damped(pattern: Pattern, generator: Generators, omega: Array) -> tuple[Array, Array]:
    """ln max |lambda| and ln of the size of M, ``(r, P)`` each; NaN where M is not finite."""
    return multipliers_damped(pattern, generator, omega)[:2]


def multipliers_damped(pattern: Pattern, generator: Generators, omega: Array) -> tuple[Array, Array, Array]:
    """:func:`scan_damped` and all multipliers over exp(scale), ``(r, P, m)`` complex."""
    growth, scale = np.empty(omega.shape), np.empty(omega.shape)
    values = np.empty((*omega.shape, generator.matrix.shape[-1]), dtype=complex)
    for row, frequencies in enumerate(omega):
        matrix, scale[row] = damped.monodromy(generator, pattern, row, frequencies)
        finite = np.isfinite(matrix).all(axis=(1, 2))
        values[row] = np.linalg.eigvals(np.where(finite[:, None, None], matrix, 0.0))
        with np.errstate(divide="ignore"):
            largest = np.log(np.abs(values[row]).max(axis=-1))
        growth[row] = np.where(finite, largest + scale[row], np.nan)
    return growth, scale, values


def log_multipliers_damped(
    pattern: Pattern, generator: Generators, omega: Array, of_factors: Callable[[Sequence[Array]], Array] = graded
) -> Array:
    """ln lambda ``(r, P, m)`` of a damped pattern; the product is formed only where that costs no digits.

    of_factors: which ``graded`` serves where :mod:`gearstab.floquet.kernel.levels` does not.
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
        _, scale, values = multipliers_damped(*own, omega[row : row + 1, left])
        with np.errstate(divide="ignore", invalid="ignore"):
            logs[row, left] = np.log(values[0]) + scale[0, :, None]
        wide[row, left] = np.ptp(logs[row, left].real, axis=-1) > SPREAD
    for row, points in chains(wide, pattern):
        chain, growing = damped.factors(generator, pattern, row, omega[row, points], spread=1.0)
        logs[row, points] = of_factors(chain) + growing[:, None]
    return logs


def chains(chosen: Array, pattern: Pattern) -> Iterator[tuple[int, Array]]:
    """(row, points) of all chosen points ``(r, P)``, in pieces of which all factors of the product fit in memory."""
    step = max(1, ENTRIES_AT_ONCE // (len(pattern.states) * (2 * pattern.size) ** 2))
    for row in np.flatnonzero(chosen.any(axis=1)):
        points = np.flatnonzero(chosen[row])
        for i in range(0, len(points), step):
            yield int(row), points[i : i + step]


def scan_traces(pattern: Pattern, omega: Array, interpolate: bool = False) -> tuple[Array, Array, Array, Array]:
    """:func:`scan`, rho = lambda + 1/lambda ``(r, P, n)`` complex, in no order; NaN where M had to be scaled; and ones
    ``(r, P)``, as nothing is interpolated here, whether it may be or not.
    """
    verdict, growth = scan(pattern, omega)
    rho = np.full((*omega.shape, pattern.size), np.nan, dtype=complex)
    for row, frequencies in enumerate(omega):
        matrix, scale = monodromy(pattern, row, frequencies)
        plain = (scale == 0) & np.isfinite(matrix).all(axis=(1, 2))
        rho[row, plain] = _traces(matrix[plain])
    return verdict, growth, rho, np.ones(omega.shape)


def _traces(matrix: Array) -> Array:
    """rho ``(P, n)`` of symplectic ``(P, 2n, 2n)``: the eigenvalues of M + M^-1, which has each twice."""
    n = matrix.shape[-1] // 2
    j = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    left = np.linalg.eigvals(matrix - j @ np.swapaxes(matrix, -1, -2) @ j).astype(complex)
    each, result = np.arange(len(matrix)), np.empty((len(matrix), n), dtype=complex)
    for k in range(n):
        # One of the first and whatever is nearest to it.
        twin = 1 + np.abs(left[:, 1:] - left[:, :1]).argmin(axis=1)
        result[:, k] = left[:, 0]
        kept = np.ones(left.shape, dtype=bool)
        kept[:, 0] = kept[each, twin] = False
        left = left[kept].reshape(len(matrix), left.shape[1] - 2)
    return result


def scan(pattern: Pattern, omega: Array) -> tuple[Array, Array]:
    """Verdict (int8) and growth per period of every point, ``(r, P)`` each; mesh frequencies ``(r, P)``."""
    verdict = np.full(omega.shape, DOUBTFUL, dtype=np.int8)
    growth = np.zeros(omega.shape)
    if pattern.size > 3:
        return verdict, growth
    for row, frequencies in enumerate(omega):
        for i in range(0, len(frequencies), CHUNK):
            part = slice(i, i + CHUNK)
            m, scale = propagate(pattern, row, frequencies[part])
            s = np.atleast_2d(invariants(m))
            found = np.where(scale > 0, DOUBTFUL, classify(s)).astype(np.int8)
            unstable = found == UNSTABLE
            growth[row, part][unstable] = growth_of(roots(s[:, unstable]))
            verdict[row, part] = found
    return verdict, growth


def rates(pattern: Pattern, mesh_frequency: Array, place: Array, stable: Array, growth: Array) -> tuple[Array, Array]:
    """Flags and growth rates of every point, put in their places in a result (rows, points)."""
    shift, rate = pattern.elastic.shift[:, None], pattern.elastic.rate[:, None]
    omega = mesh_frequency / rate
    verdict, value = scan(pattern, omega)
    growth[place], inside = in_units(value, verdict == STABLE, 2 * np.pi * pattern.cycles / omega, shift, rate)
    stable[place] = inside
    row, point = np.nonzero((verdict == DOUBTFUL) | ~np.isfinite(value))
    return row, point


def in_units(growth: Array, stable: Array, period: Array, shift: Array, rate: Array) -> tuple[Array, Array]:
    """Growth a period as a growth rate less the uniform decay ``shift``, and whether it is stable.

    Without damping the verdict decides; with uniform damping a growth below the decay is stable.
    """
    value = growth / period
    return (value - shift) * rate, np.where(shift == 0, stable, value <= shift)


def factors(pattern: Pattern, row: int, omega: Array) -> list[Array]:
    """The monodromy matrix of one row as moderately conditioned factors ``(P, 2n, 2n)``, first segment first.

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
