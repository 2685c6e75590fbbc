"""Polynomials in T on a cell: interpolation, signs, determinants; zeros of those that have them for coefficients.

Polynomials of z on [-1, 1] are cut off at a degree: the last coefficient is then a ball that holds the rest, and may be
another of its numbers at every z.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import comb, factorial

from flint import acb, arb, arb_mat, arb_poly, ctx, fmpq

CELL = 4
"""Distances of nodes of an interpolation that a cell is long."""
PRECISE = 512
"""Bits in which interpolation is turned into coefficients, which are large and cancel each other."""
CUT, DEGREE = 26, 40
"""Degree at which factors of a determinant are cut off, and this itself."""
SHORT, LONG = 9, 27
"""Degree of a polynomial on a short interval; what is added for a whole cell."""


class Factor:
    """A polynomial on a cell, of which signs are asked for."""

    def __init__(self, p: arb_poly) -> None:
        self.p, self.whole = p, _sign(p)

    def sign(self, left: arb, right: arb) -> int:
        """1 or -1 if it has this sign in an interval; 0 where that is not shown."""
        half = (right - left) / 2
        degree = SHORT + int(LONG * float(half))
        return self.whole or _sign(cut(self.p(arb_poly([(left + right) / 2, half])), degree))


def zeros(p: arb_poly) -> list[acb]:
    """Zeros, each in a ball of its own; none where they are not told apart."""
    try:
        return list(p.complex_roots())
    except ValueError:
        return []


def determinant(rows: list[list[arb_poly]]) -> arb_poly:
    """By minors of the first rows."""
    minors: dict[tuple[int, ...], arb_poly] = {(): arb_poly([1])}
    for size, row in enumerate(rows, 1):
        grown = {}
        for columns in combinations(range(len(rows)), size):
            terms = [
                row[k] * minors[columns[:i] + columns[i + 1 :]] * (-1) ** (size - 1 - i) for i, k in enumerate(columns)
            ]
            grown[columns] = cut(sum(terms, arb_poly([])), DEGREE)
        minors = grown
    return minors[tuple(range(len(rows)))]


def cut(p: arb_poly, degree: int) -> arb_poly:
    """A polynomial of this degree whose last coefficient holds the rest on [-1, 1]."""
    if p.degree() <= degree:
        return p
    return p.truncate(degree) + arb_poly([p.right_shift(degree)(arb(0, 1))]).left_shift(degree)


def _sign(p: arb_poly) -> int:
    """1 or -1 if a polynomial has this sign on [-1, 1]; 0 where that is not shown."""
    coefficients = p.coeffs()
    if not coefficients:
        return 0
    n = len(coefficients)
    found = (_bernstein(n - 1) * arb_mat(n, 1, coefficients)).entries()
    if all(c > 0 for c in found):
        return 1
    return -1 if all(c < 0 for c in found) else 0


@cache
def _bernstein(n: int) -> arb_mat:
    """From coefficients of a polynomial on [-1, 1] to those of Bernstein."""
    shift = [[arb(comb(k, j) * 2**j * (-1) ** (k - j)) for k in range(n + 1)] for j in range(n + 1)]
    return arb_mat([[arb(comb(i, k)) / comb(n, k) for k in range(n + 1)] for i in range(n + 1)]) * arb_mat(shift)


@cache
def bend(count: int) -> arb:
    """Bound the product of all |z - z_j| on a cell, of ``count`` numbers z_j at distances 1, symmetric to 0, divided
    by count!: in pairs, |z^2 - z_j^2|.
    """
    found = fmpq(1)
    for k in range(count // 2):
        square = fmpq(2 * k + 1, 2) ** 2
        found *= max(square, fmpq(CELL * CELL, 4) - square)
    return arb(found / factorial(count))


@cache
def to_coefficients(count: int) -> arb_mat:
    """From values at nodes, half of them on each side of a cell's middle, to coefficients in z, which is -1 and 1 at
    its ends.
    """
    with ctx.workprec(PRECISE):
        nodes = [arb(fmpq(2 * j - count + 1, CELL)) for j in range(count)]
        found = arb_mat([[z**k for k in range(count)] for z in nodes]).inv()
    return found * arb(1)  # rounded to the bits of all other matrices
