"""Zeros of polynomials p that depend on T: counted at one T, and what tells that none crosses the unit circle.

Polynomials of z on [-1, 1] are cut off at a degree: the last coefficient is then a ball that holds the rest, and may be
another of its numbers at every z.
"""

from __future__ import annotations

from functools import cache
from math import comb

from flint import arb, arb_mat, arb_poly

CUT, DEGREE, SHORT = 26, 32, 20
"""Degree at which factors of D are cut off, p(1) p(-1) D, and what this is on an interval."""
HALVINGS = 12
"""How often an interval is halved."""


def crossing(a: list[arb_poly]) -> arb_poly:
    """p(1) p(-1) D. Row j < n/2 of D's matrix ends with a_n = 1 in column n - j, zeros behind: these are eliminated."""
    n, no = len(a) - 1, arb_poly([])
    even, odd = sum(a[::2], no), sum(a[1::2], no)
    entry = dict(enumerate(a))
    rows = [[entry.get(j + k, no) - entry.get(j - k, no) for k in range(1, n)] for j in range(1, n)]
    for _ in range((n - 1) // 2):
        pivot, *others = rows
        rows = [[e - cut(row[-1] * p, CUT) for e, p in zip(row[:-1], pivot[:-1], strict=True)] for row in others]
    return cut((even + odd) * (even - odd) * _determinant(rows), DEGREE)


def _determinant(rows: list[list[arb_poly]]) -> arb_poly:
    """By the first row, but for its sign."""
    if not rows:
        return arb_poly([1])
    found = arb_poly([])
    for k, entry in enumerate(rows[0]):
        minor = _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
        found = found + cut(entry * minor, CUT) * (-1) ** k
    return found


def cut(p: arb_poly, degree: int) -> arb_poly:
    """A polynomial of this degree whose last coefficient holds the rest on [-1, 1]."""
    if p.degree() <= degree:
        return p
    return p.truncate(degree) + arb_poly([p.right_shift(degree)(arb(0, 1))]).left_shift(degree)


def nonzero(p: arb_poly, left: arb, right: arb, halvings: int = HALVINGS) -> bool:
    """Whether a polynomial has no zero in an interval."""
    middle = (left + right) / 2
    moved = cut(p(arb_poly([middle, (right - left) / 2])), SHORT).coeffs()
    found = (_bernstein(len(moved) - 1) * arb_mat(len(moved), 1, moved)).entries()
    if all(c > 0 for c in found) or all(c < 0 for c in found):
        return True
    if not halvings or found[0] * found[-1] < 0:
        return False
    return nonzero(p, left, middle, halvings - 1) and nonzero(p, middle, right, halvings - 1)


def outside(p: arb_poly) -> int | None:
    """Zeros outside the unit circle; None where they cannot be told from those inside."""
    try:
        sizes = [abs(zero) for zero in p.complex_roots()]
    except ValueError:  # not isolated
        return None
    told = len(sizes) == p.degree() and all(size > 1 or size < 1 for size in sizes)
    return sum(bool(size > 1) for size in sizes) if told else None


@cache
def _bernstein(n: int) -> arb_mat:
    """From coefficients of a polynomial on [-1, 1] to those of Bernstein."""
    shift = [[arb(comb(k, j) * 2**j * (-1) ** (k - j)) for k in range(n + 1)] for j in range(n + 1)]
    return arb_mat([[arb(comb(i, k)) / comb(n, k) for k in range(n + 1)] for i in range(n + 1)]) * arb_mat(shift)
