"""Matrix polynomials on [-1, 1] in ball arithmetic, whose last coefficient is a ball that holds all the rest.

A polynomial is the list of its coefficients c_0, ..., c_p; what it stands for is every function of z with values in
c_0 + c_1 z + ... + c_p z^p, where the ball c_p may be another of its matrices at every z.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import factorial

import numpy as np
from flint import arb, arb_mat

Array = np.ndarray

SMALL, TERMS = 0.25, 14
"""Size up to which an exponential is summed, the larger ones being squares; how many of its terms: 0.25^15/15! is below
1e-21.
"""


def product(a: Sequence[arb_mat], b: Sequence[arb_mat], degree: int) -> list[arb_mat]:
    """Multiply two polynomials; terms of higher degree are added to the last coefficient."""
    found = [0 * a[0]] * (min(degree, len(a) + len(b) - 2) + 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            term = left * right if i + j <= degree else left * right * arb(0, 1)
            found[min(i + j, degree)] = found[min(i + j, degree)] + term
    return found


def exponential(exponent: Sequence[arb_mat], degree: int) -> list[arb_mat]:
    """exp(E(z)): a sum of powers of E/2^k, whose rest is below |E/2^k|^15/15! exp |E/2^k|, squared k times."""
    total = sum((size(term) for term in exponent), arb(0))
    halvings = max(0, int(np.ceil(np.log2(float(total.upper()) / SMALL)))) if total > 0 else 0
    scale, m = arb(2) ** -halvings, exponent[0].nrows()
    small = [term * scale for term in exponent]
    found = [identity(m)] + [0 * exponent[0]] * degree
    for order in range(TERMS, 0, -1):  # Horner's scheme
        found = [term / order for term in product(small, found, degree)]
        found[0] = found[0] + identity(m)
    bound = total * scale
    rest = (bound ** (TERMS + 1) / factorial(TERMS + 1) * bound.exp()).abs_upper()
    found[0] = found[0] + anything(m) * rest
    for _ in range(halvings):
        found = product(found, found, degree)
    return found


def pulled_back(terms: Sequence[arb_mat], flow: Sequence[arb_mat], slope: arb_mat | None, degree: int) -> list[arb_mat]:
    """F(z)^T P(z) F(z) with F(z) = flow, or flow exp(z B) where there is a slope B: flow is then a matrix."""
    if slope is None:
        return product([term.transpose() for term in flow], product(terms, flow, degree), degree)
    (step,) = flow
    moved = [step.transpose() * term * step for term in terms]
    found = moved + [0 * slope] * (degree + 1 - len(moved))
    for order in range(1, degree + 1):
        share = slope / order
        moves = [term * share for term in moved[: degree + 1 - order]]
        moved = [move + move.transpose() for move in moves]
        for k, term in enumerate(moved):
            found[k + order] = found[k + order] + term
    # R^T P R with |R - I| <= r is within (2 r + r^2) |P| of P.
    rest, last = excess(slope), found[-1]
    return [*found[:-1], last + anything(slope.nrows()) * (rest * (2 + rest) * size(last)).upper()]


def moving(flow: Sequence[arb_mat], slope: arb_mat | None, degree: int) -> list[arb_mat]:
    """Return a flow, times exp(z B) where there is a slope B, as one polynomial."""
    terms = list(flow)
    if slope is not None:
        for k in range(1, degree + 1):
            terms.append(terms[-1] * slope / k)
        terms[-1] = terms[-1] * remainder(slope)
    return terms


def remainder(slope: arb_mat) -> arb_mat:
    """All exp(u z B), 0 <= u <= 1, |z| <= 1."""
    m = slope.nrows()
    return identity(m) + anything(m) * excess(slope)


def excess(slope: arb_mat) -> arb:
    """Bound |exp(u z B) - I|, 0 <= u <= 1, |z| <= 1."""
    return (size(slope).exp() - 1).abs_upper()


def definite(matrix: arb_mat) -> bool:
    """Whether a symmetric matrix is shown to be positive definite. Raises LinAlgError where it seems not to be."""
    middle = near(matrix)
    lower = exact(np.linalg.inv(np.linalg.cholesky(0.5 * (middle + middle.T))))
    turned = lower * matrix * lower.transpose()
    if size(turned - identity(matrix.nrows())) < 1:
        return True
    return all(2 * row[i] > sum(map(abs, row), arb(0)) for i, row in enumerate(turned.tolist()))


@cache
def identity(m: int) -> arb_mat:
    """Return the unit matrix."""
    return exact(np.eye(m))


@cache
def anything(m: int) -> arb_mat:
    """Return all matrices with entries between -1 and 1."""
    return arb_mat(m, m, [arb(0, 1)] * (m * m))


def centre(low: arb, high: arb) -> tuple[arb, arb]:
    """A number in the middle, and how far at most from there what lies between two balls is."""
    middle = ((low + high) / 2).mid()
    return middle, (high - middle).max(middle - low).upper()


def size(matrix: arb_mat) -> arb:
    """The norm that is the root of the sum of squares, from above."""
    return (matrix.transpose() * matrix).trace().abs_upper().sqrt().upper()


def exact(matrix: Array) -> arb_mat:
    """Doubles as they are."""
    return arb_mat(matrix.tolist())


def near(matrix: arb_mat) -> Array:
    """Doubles near the midpoints."""
    return np.array([*map(float, matrix.entries())]).reshape(matrix.nrows(), matrix.ncols())
