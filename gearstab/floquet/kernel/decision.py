"""Stable, unstable or doubtful: verdicts on conservative systems, from a polynomial or from the monodromy matrix.

For n <= 3 no eigenvalue solver is needed. A conservative system is stable when all roots rho = lambda + 1/lambda of
p(x) = x^n - s1 x^(n-1) + ... are real and in (-2, 2). That is a matter of signs: of the discriminant, and of p and its
derivatives at +-2. Where a sign rests on rounding errors the point is *doubtful*; :func:`conservative` has the last
word on it, and on systems of more coordinates.

A multiplier of a conservative system that is off the unit circle by a rounding error may be truly unstable (two
multipliers of opposite Krein signature have met) or a harmless multiple one (eps = 0 on a collision, identical twin
modes). The rule, with the excess |lambda| - 1:

1. up to ON_CIRCLE, or what the symplectic defect of the computed matrix allows: on the circle;
2. above OFF_CIRCLE: unstable;
3. between: the cluster of multipliers around it decides by the Hermitian form v^H (iJ) v on its invariant subspace:
   definite means stable (Krein 1950, Gelfand & Lidskii 1955; Yakubovich & Starzhinskii 1975), else unstable.

Rigid-body modes never come here (:mod:`gearstab.floquet.segments.reduction`).
"""

from __future__ import annotations

from functools import cache

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

ON_CIRCLE = 1e-12
OFF_CIRCLE = 1e-5
CLUSTER = 20.0
"""Multipliers within this many times the excess belong to one cluster: a colliding pair parts by twice the excess."""
DEFINITE = 1e-5
"""Relative size below which an eigenvalue of the Krein form counts as zero; a defective double multiplier perturbed
by 1e-14 has a form of about its square root, 1e-7."""


def growth_of(rho: Array) -> Array:
    """ln max |lambda| ``(P,)`` from rho ``(n, P)``: lambda = exp(g + i theta) has rho/2 = cosh(g + i theta)."""
    return np.abs(np.arccosh(0.5 * rho).real).max(axis=0)


def conservative(m: Array) -> tuple[Array, Array, Array]:
    """Decide ``(P, 2n, 2n)`` symplectic matrices.

    Returns (stable ``(P,)`` bool, growth = ln max |lambda| ``(P,)``, exactly 0 where stable, used Krein ``(P,)`` bool).
    """
    values = np.linalg.eigvals(m)
    # A multiplier inside the circle mirrors one outside, less accurately: the largest tells the excess.
    excess = np.log(np.maximum(np.abs(values).max(axis=-1), 1.0))
    # A large matrix has a large defect, which must not excuse a large excess.
    near = excess <= np.clip(10 * _defect(m), ON_CIRCLE, OFF_CIRCLE)
    open_case = ~near & (excess <= OFF_CIRCLE)
    stable = near.copy()
    for k in np.flatnonzero(open_case):
        stable[k] = _definite(m[k])
    growth = np.where(stable, 0.0, excess)
    return stable, growth, open_case


@cache
def symplectic_form(n: int) -> Array:
    """J = [[0, I], [-I, 0]]."""
    form = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(n)) + 0.0  # no negative zeros
    form.flags.writeable = False
    return form


def _defect(m: Array) -> Array:
    """max |M^T J M - J|, what rounding has left of symplecticity."""
    j = symplectic_form(m.shape[-1] // 2)
    return np.abs(np.swapaxes(m, -1, -2) @ j @ m - j).max(axis=(-1, -2))


def _definite(m: Array) -> bool:
    """Whether every cluster that leaves the circle has a definite Krein form."""
    values, vectors = np.linalg.eig(m)
    excess = np.abs(np.log(np.abs(values)))
    form = 1j * symplectic_form(len(m) // 2)
    for value, off in zip(values, excess, strict=True):
        if off <= ON_CIRCLE:
            continue
        members = np.abs(values - value) <= CLUSTER * off
        basis, _ = np.linalg.qr(vectors[:, members])
        signs = np.linalg.eigvalsh(basis.conj().T @ form @ basis)
        if signs.min() < DEFINITE and signs.max() > -DEFINITE:
            return False
    return True
