"""Functions of patterns in the compiled kernel, in NumPy: short, clear and slow.

The mathematics stands in gearstab/floquet/kernel/c_kernel.py and decision.py.
"""

from __future__ import annotations

import numpy as np
import orthogonal_iteration
from scipy.linalg import expm

from gearstab.floquet.kernel import decision, factors
from gearstab.floquet.kernel.damped import Generators, exponential
from gearstab.floquet.kernel.decision import DOUBTFUL, STABLE, UNSTABLE, growth_of
from gearstab.floquet.kernel.factors import rotation
from gearstab.floquet.segments.pattern import Pattern, Succession, prepare
from gearstab.system import Array, GearSystem

LARGE = 2.0**200
"""Entries above this are scaled down, so that a product of any length stays finite."""


def propagate(pattern: Pattern, row: int, omega: Array) -> tuple[Array, Array]:
    """The monodromy matrix of one row in the modes of the first segment, ``(2n, 2n, P)`` over exp(scale), and scale."""
    n, points = pattern.size, len(omega)
    x, scale = np.broadcast_to(np.eye(2 * n)[:, :, None], (2 * n, 2 * n, points)), np.zeros(points)
    for s, state in enumerate(pattern.states):
        terms, growth = rotation(
            pattern.squared_frequency[row, state], pattern.fractions[row, s], pattern.cycles / omega
        )
        cosine, over, times = terms[:, :, None, :]
        x = np.concatenate([cosine * x[:n] + over * x[n:], times * x[:n] + cosine * x[n:]])
        if len(pattern.states) > 1:
            x = np.einsum("ij,jkp->ikp", np.kron(np.eye(2), pattern.change(s)[row]), x)
        size = np.abs(x).max(axis=(0, 1))
        size = np.where(size > LARGE, size, 1.0)
        x, scale = x / size, scale + growth + np.log(size)
    with np.errstate(divide="ignore"):
        modest = (scale != 0) & (scale + np.log(np.abs(x).max(axis=(0, 1))) < np.log(LARGE))
    x[..., modest] *= np.exp(scale[modest])
    scale[modest] = 0.0
    return x, scale


def monodromy(pattern: Pattern, row: int | Array, omega: Array) -> tuple[Array, Array]:
    """(M exp(-scale) as ``(P, 2n, 2n)``, scale ``(P,)``) at ``(P,)`` frequencies of one row or of a row each."""
    rows = np.broadcast_to(row, omega.shape)
    matrix, scale = np.empty((len(omega), 2 * pattern.size, 2 * pattern.size)), np.empty(len(omega))
    for r in np.unique(rows):
        x, scale[rows == r] = propagate(pattern, int(r), omega[rows == r])
        matrix[rows == r] = np.moveaxis(x, -1, 0)
    return matrix, scale


def coefficients(m: Array) -> Array:
    """s1..sn of prod(x - rho_i), ``(n, P)``, from M ``(2n, 2n, P)`` of a conservative system, n <= 3."""
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


def classify(s: Array) -> Array:
    """``(P,)`` int8 of UNSTABLE, STABLE or DOUBTFUL from the coefficients s1..sn ``(n, P)``, n <= 3."""
    n = len(s)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.maximum(1.0, np.abs(s).max(axis=0) / 3.0)
        edges = np.stack([_taylor(s, 2.0)[0], _taylor(s, -2.0)[0]])
        inside = _inside(s)
        doubtful = np.abs(edges).min(axis=0) < decision.EDGE_NOISE * size
        if n > 1:
            discriminant = scaled_discriminant(s)
            inside &= discriminant > 0
            doubtful |= np.abs(discriminant) < decision.DISCRIMINANT_NOISE
            near = np.abs(discriminant) < decision.GROWTH_NOISE
            doubtful |= near & ~inside
        doubtful |= ~(size < decision.LARGEST)
    return np.where(doubtful, DOUBTFUL, np.where(inside, STABLE, UNSTABLE)).astype(np.int8)


def _taylor(s: Array, x: float) -> list[Array]:
    """p, p', p''/2 at x, as far as they are not constant."""
    if len(s) == 1:
        return [x - s[0]]
    if len(s) == 2:
        return [x * x - s[0] * x + s[1], 2 * x - s[0]]
    return [((x - s[0]) * x + s[1]) * x - s[2], (3 * x - 2 * s[0]) * x + s[1], 3 * x - s[0]]


def _inside(s: Array) -> Array:
    """All roots lie in (-2, 2), provided they are real: p and its derivatives are positive at 2, alternate at -2."""
    n = len(s)
    result = np.ones(s.shape[1:], dtype=bool)
    for k, value in enumerate(_taylor(s, 2.0)):
        result &= value > 0
        result &= _taylor(s, -2.0)[k] * (-1.0) ** (n - k) > 0
    return result


def _depressed(s: Array) -> tuple[Array, Array]:
    """p and q of y^3 + p y + q, x = y + s1/3."""
    third = s[0] / 3.0
    return s[1] - 3 * third * third, (2 * third * third - s[1]) * (-third) - s[2]


def scaled_discriminant(s: Array) -> Array:
    """The discriminant of p over its own size, but not less than 1; n = 2 or 3."""
    if len(s) == 2:
        half = 0.5 * s[0]
        return (half * half - s[1]) / np.maximum(1.0, half * half + np.abs(s[1]))
    p, q = _depressed(s)
    a, b = -4 * p * p * p, 27 * q * q
    return (a - b) / np.maximum(1.0, np.abs(a) + b)


def roots(s: Array) -> Array:
    """rho ``(n, P)`` complex, from the closed form and two steps of Newton."""
    if len(s) == 1:
        return s.astype(complex)
    if len(s) == 2:
        half = 0.5 * s[0]
        root = np.sqrt((half * half - s[1]).astype(complex))
        far = half + np.where(half >= 0, 1.0, -1.0) * root
        with np.errstate(divide="ignore", invalid="ignore"):
            near = np.where(far == 0, 0.0, s[1] / far)
        return np.stack([far, near])
    return _polished(s, _cubic(s))


def _cubic(s: Array) -> Array:
    p, q = _depressed(s)
    discriminant = (0.5 * q) ** 2 + (p / 3.0) ** 3
    root = np.sqrt(discriminant.astype(complex))
    # The sum of the larger modulus keeps the cube root free of cancellation.
    sign = np.where(q >= 0, -1.0, 1.0)
    u = (-0.5 * q + sign * root) ** (1.0 / 3.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.where(u == 0, 0.0, -p / (3.0 * u))
    turn = np.exp(2j * np.pi * np.arange(3) / 3.0)[:, None]
    y = u * turn + v / turn
    return y + s[0] / 3.0


def _polished(s: Array, x: Array) -> Array:
    for _ in range(2):
        value = ((x - s[0]) * x + s[1]) * x - s[2]
        slope = (3 * x - 2 * s[0]) * x + s[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            step = value / slope
        x = np.where(np.isfinite(step), x - step, x)
    return x


def scan(pattern: Pattern, omega: Array) -> tuple[Array, Array]:
    """Verdict (int8) and growth per period of every point, ``(r, P)`` each, n <= 3."""
    verdict, growth = np.full(omega.shape, DOUBTFUL, dtype=np.int8), np.zeros(omega.shape)
    for row, frequencies in enumerate(omega):
        m, scale = propagate(pattern, row, frequencies)
        s = np.atleast_2d(coefficients(m))
        verdict[row] = np.where(scale > 0, DOUBTFUL, classify(s))
        unstable = verdict[row] == UNSTABLE
        growth[row, unstable] = growth_of(roots(s[:, unstable]))
    return verdict, growth


def stability(item: GearSystem, omega: Array) -> tuple[Array, Array]:
    """(growth rate, whether stable) of a system without damping but a uniform one, ``(rows, P)``: eigenvalues of M."""
    rate, stable = np.empty((2, item.rows, len(omega)))
    for pattern in prepare(item):
        for row, place in enumerate(pattern.rows):
            unit, shift = pattern.elastic.rate[row], pattern.elastic.shift[row]
            matrix, scale = monodromy(pattern, row, omega / unit)
            period = 2 * np.pi * pattern.cycles * unit / omega
            inside, growth, _ = decision.conservative(matrix)
            large = scale > 0
            growth[large] = np.log(np.abs(np.linalg.eigvals(matrix[large])).max(axis=-1)) + scale[large]
            growth = growth / period
            rate[place] = (growth - shift) * unit
            stable[place] = inside & ~large if shift == 0 else growth <= shift
    return rate, stable == 1


def exponents(item: GearSystem, omega: Array) -> Array:
    """The same system's elastic exponents ``(rows, P, 2n)``, by orthogonal iteration."""
    found: list[Array | None] = [None] * item.rows
    for pattern in prepare(item):
        for row, place in enumerate(pattern.rows):
            unit = pattern.elastic.rate[row]
            logs = orthogonal_iteration.log_multipliers(factors.factors(pattern, row, omega / unit))
            period = 2 * np.pi * pattern.cycles * unit / omega
            found[place] = (logs / period[:, None] - pattern.elastic.shift[row]) * unit
    return np.stack([own for own in found if own is not None])


def products_damped(pattern: Succession, generator: Generators, omega: Array) -> tuple[Array, Array]:
    """(M exp(-scale) ``(r, P, m, m)``, scale ``(r, P)``).

    M is the product of the exponentials of all segments, whose generators may go with the mesh frequency.
    """
    scale, m = np.zeros(omega.shape), generator.matrix.shape[-1]
    product, every = np.broadcast_to(np.eye(m), (*omega.shape, m, m)), generator.at(omega)
    for s, state in enumerate(pattern.states):
        time = 2 * np.pi * pattern.cycles * pattern.fractions[:, s, None] / omega
        # Without its growth the exponential of a long segment neither overflows nor underflows.
        growth = np.linalg.eigvals(every[:, :, state]).real.max(axis=-1)
        if generator.by_speed is None:
            factor = np.stack([exponential(generator, row, int(state), t) for row, t in enumerate(time)])
        else:
            factor = expm((every[:, :, state] - growth[..., None, None] * np.eye(m)) * time[..., None, None])
        product = factor @ product
        size = np.abs(product).max(axis=(-2, -1))
        product, scale = product / size[..., None, None], scale + growth * time + np.log(size)
    return product, scale


def multipliers_damped(pattern: Succession, generator: Generators, omega: Array) -> tuple[Array, Array, Array]:
    """ln max |lambda| and ln of the size of M, ``(r, P)``, and all multipliers over exp(scale), ``(r, P, m)``."""
    product, scale = products_damped(pattern, generator, omega)
    values = np.linalg.eigvals(product)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(values).max(axis=-1)) + scale, scale, values


def scan_damped(pattern: Succession, generator: Generators, omega: Array) -> tuple[Array, Array]:
    """ln max |lambda| and ln of the size of M, ``(r, P)`` each."""
    return multipliers_damped(pattern, generator, omega)[:2]


def log_multipliers_damped(pattern: Succession, generator: Generators, omega: Array) -> Array:
    """ln lambda ``(r, P, m)``."""
    return factors.log_multipliers_damped(
        pattern, generator, omega, multipliers_damped, orthogonal_iteration.log_multipliers
    )


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
