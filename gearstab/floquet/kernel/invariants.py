"""Stable, unstable or doubtful from the polynomial of rho = lambda + 1/lambda, n <= 3, without an eigenvalue solver.

A conservative system is stable when all roots rho of p(x) = x^n - s1 x^(n-1) + ... are real and in (-2, 2). That is
a matter of signs: of the discriminant, and of p and its derivatives at +-2. Where a sign rests on rounding errors
the point is *doubtful* and is left to :mod:`gearstab.floquet.kernel.decision`.
"""

from __future__ import annotations

import numpy as np

from gearstab.system import Array

UNSTABLE, STABLE, DOUBTFUL = 0, 1, 2

DISCRIMINANT_NOISE = 3e-10
"""Scaled discriminants below this may have the wrong sign: products of up to 16 segments leave 1e-14 on the
coefficients, and a discriminant is of sixth degree in roots of size 2."""
EDGE_NOISE = 3e-12
"""The same for p(+-2)."""
GROWTH_NOISE = 1e-6
"""Below this scaled discriminant the closed form of a root loses more than 1e-13; unstable points are recomputed."""
LARGEST = 1e120
"""Coefficients above this are left to the eigenvalue solver: products of them would overflow."""


def classify(s: Array) -> Array:
    """``(P,)`` int8 of UNSTABLE, STABLE or DOUBTFUL from the coefficients s1..sn ``(n, P)``, n <= 3."""
    n = len(s)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.maximum(1.0, np.abs(s).max(axis=0) / 3.0)
        edges = np.stack([_taylor(s, 2.0)[0], _taylor(s, -2.0)[0]])
        inside = _inside(s)
        doubtful = np.abs(edges).min(axis=0) < EDGE_NOISE * size
        if n > 1:
            discriminant = scaled_discriminant(s)
            inside &= discriminant > 0
            doubtful |= np.abs(discriminant) < DISCRIMINANT_NOISE
            near = np.abs(discriminant) < GROWTH_NOISE
            doubtful |= near & ~inside
        doubtful |= ~(size < LARGEST)
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


def growth_of(rho: Array) -> Array:
    """ln max |lambda| ``(P,)`` from rho ``(n, P)``: lambda = exp(g + i theta) has rho/2 = cosh(g + i theta)."""
    return np.abs(np.arccosh(0.5 * rho).real).max(axis=0)
