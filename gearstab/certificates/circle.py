r"""Multipliers inside, on or outside the unit circle, over whole intervals of the mesh frequency.

Let chi(z) = det(z - Phi), real with leading coefficient 1, of degree m (verifier.py, whose notation is used).

**Theorem 3.** Let a_0, ..., a_m = 1 be the coefficients of chi (all others are 0) and D = det(a_(j+l) - a_(j-l)),
j, l = 1, ..., m - 1. If chi(1) chi(-1) D is not 0 for any T of an interval, as many zeros of chi are outside the unit
circle at all these T. If none are, all solutions decay exponentially. If some are, some grow.
*Proof.* Zeros are continuous. One that crosses the circle is 1 or -1 there, or one of a pair e^(+-it) that are not
real. Then 0 = Im(e^(-ijt) chi(e^(it))) = sum_k a_k sin((k - j) t) = sum_l (a_(j+l) - a_(j-l)) sin(l t), 1 <= j < m, so
that D = 0.

**Where nothing is damped**, a form Q is kept. Phi^-1 is then similar to Phi^T, and chi(z) = z^m chi(1/z), m = 2 n. With
w = z + 1/z, z^-n chi(z) is a real polynomial q(w) of degree n with leading coefficient 1: multipliers on the circle
belong to zeros w of q in [-2, 2]. Let p_k be the coefficients of q(2 + x) and r_k those of (-1)^n q(-2 - x),
polynomials in x, and d the discriminant of q, the product of all (w_i - w_j)^2, i < j, of its zeros.

**Theorem 5.** (i) If q has n different zeros in (-2, 2), all solutions are bounded, also for all A_s near enough that
keep Q. (ii) If one p_k or r_k or d is negative, or a zero of q is not in [-2, 2], some grow exponentially. (iii) If p_0
r_0 d is not 0 at any T of an interval, (i) is true at all these T, or some grow at all of them.
*Proof.* (i) All multipliers are simple and on the circle, which they cannot leave: 1/conj(z) would be another one
nearby. (ii) If all w_l are in [-2, 2], no coefficient of q(2 + x), the product of all x + 2 - w_l, is negative, none of
(-1)^n q(-2 - x), the product of all x + 2 + w_l, and neither is d. Else a multiplier z is off the circle, and so is
1/z: one of them is outside. (iii) Zeros are continuous: what (i) asks for begins or ends where two of them meet or one
is at 2 or -2. If none does, and they are not all in (-2, 2), one is not in [-2, 2].

**The discriminant.** Let C be the symmetric matrix, i, j = 0, ..., n - 2, of

    (f(x) g(y) - f(y) g(x))/(x - y) = sum c_ij x^i y^j,      f = n q - w q',  g = q'      (Bezout).

Its determinant is d but for a positive factor that depends on n alone. For let the zeros v_l of q' be different and
have V the entries v_l^j. V^T C V is diagonal with the entries f' g - f g' = -n q q'' at v_l. The product of all q(v_l)
is d but for a factor, that of all q''(v_l) is det V^2 but for a factor. Where all w_l are real and different, all
-q q'' are positive, the maxima of q being above 0 and the minima below: so is the factor.

**On a cell** polynomials of z on [-1, 1] are cut off at a degree: the last coefficient is then a ball that holds the
rest, and may be another of its numbers at every z.
"""

from __future__ import annotations

from functools import cache, cached_property
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


class Disc:
    """Zeros of chi and the unit circle, of its coefficients on a cell."""

    def __init__(self, a: list[arb_poly]) -> None:
        self.a, no = a, arb_poly([])
        even, odd = sum(a[::2], no), sum(a[1::2], no)
        self.barrier = [*map(Factor, (even + odd, even - odd, _crossing(a)))]

    def outside(self, left: arb, right: arb) -> int | None:
        """Zeros outside the unit circle at all z of an interval; None where that is not shown."""
        if not all(factor.sign(left, right) for factor in self.barrier):
            return None
        middle = (left + right) / 2
        sizes = [abs(zero) for zero in zeros(arb_poly([a(middle) for a in self.a]))]
        told = len(sizes) == len(self.a) - 1 and all(size > 1 or size < 1 for size in sizes)
        return sum(bool(size > 1) for size in sizes) if told else None


class Circle:
    """The zeros of q on a cell. a: the coefficients n, n + 1, ..., 2 n of chi, polynomials in z."""

    def __init__(self, a: list[arb_poly]) -> None:
        self.q = [arb_poly([])] * len(a)
        for factor, power in zip(a, _powers(len(a)), strict=True):
            self.q = [p + share * factor for p, share in zip(self.q, power, strict=True)]
        self.barrier = [*map(Factor, (_end(self.q, 0, 1), _end(self.q, 0, -1), _discriminant(self.q)))]

    @cached_property
    def others(self) -> list[Factor]:
        """p_k and r_k but for p_0 and r_0."""
        return [Factor(_end(self.q, k, side)) for k in range(1, len(self.q) - 1) for side in (1, -1)]

    def outside(self, left: arb, right: arb) -> int | None:
        """0 if all solutions are bounded at all z of an interval, 1 if some grow; None where neither is shown."""
        signs = [factor.sign(left, right) for factor in self.barrier]
        if min(signs) > 0:
            return self._at((left + right) / 2)
        return 1 if min(signs) < 0 or any(factor.sign(left, right) < 0 for factor in self.others) else None

    def _at(self, z: arb) -> int | None:
        """0 if (i) is true at z, 1 if a zero of q is not in [-2, 2]. If n real parts are apart, all zeros are real: a
        zero and its conjugate have the same.
        """
        found = zeros(arb_poly([p(z) for p in self.q]))
        if any(not w.imag.contains(0) or abs(w.real) > 2 for w in found):
            return 1
        real = sorted((w.real for w in found), key=float)
        apart = all(a < b for a, b in zip([arb(-2), *real], [*real, arb(2)], strict=True))
        return 0 if apart and len(real) == len(self.q) - 1 else None


def _crossing(a: list[arb_poly]) -> arb_poly:
    """D. Row j < n/2 of its matrix ends with a_n = 1 in column n - j, zeros behind: these are eliminated."""
    n, no, entry = len(a) - 1, arb_poly([]), dict(enumerate(a))
    rows = [[entry.get(j + k, no) - entry.get(j - k, no) for k in range(1, n)] for j in range(1, n)]
    for _ in range((n - 1) // 2):
        pivot, *others = rows
        rows = [[e - cut(row[-1] * p, CUT) for e, p in zip(row[:-1], pivot[:-1], strict=True)] for row in others]
    return determinant(rows)


def _end(q: list[arb_poly], k: int, side: int) -> arb_poly:
    """p_k, or r_k on the side -1."""
    n = len(q) - 1
    return sum((comb(j, k) * 2 ** (j - k) * side ** (n - j) * q[j] for j in range(k, n + 1)), arb_poly([]))


def _discriminant(q: list[arb_poly]) -> arb_poly:
    """det C."""
    n, no = len(q) - 1, arb_poly([])
    f, g = [(n - k) * q[k] for k in range(n)], [k * q[k] for k in range(1, n + 1)]
    form = [[no] * (n - 1) for _ in range(n - 1)]
    for i in range(n - 1):
        for j in range(i, n - 1):
            before = form[i - 1][j + 1] if i and j + 1 < n - 1 else no
            form[i][j] = form[j][i] = cut(f[j + 1] * g[i] - f[i] * g[j + 1], DEGREE) + before
    return determinant(form)


def _powers(count: int) -> list[list[int]]:
    """Coefficients of 1, z + 1/z, z^2 + 1/z^2, ... as polynomials in w: each is w times the one before, less the one
    before that.
    """
    found = [[2] + [0] * (count - 1), [0, 1] + [0] * (count - 2)]
    while len(found) < count:
        found.append([a - b for a, b in zip([0, *found[-1][:-1]], found[-2], strict=True)])
    return [[1] + [0] * (count - 1), *found[1:]]


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
