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


def growth_of(rho: Array) -> Array:
    """ln max |lambda| ``(P,)`` from rho ``(n, P)``: lambda = exp(g + i theta) has rho/2 = cosh(g + i theta)."""
    return np.abs(np.arccosh(0.5 * rho).real).max(axis=0)
