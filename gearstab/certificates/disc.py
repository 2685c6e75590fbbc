r"""Multipliers in the unit circle or not, counted over whole intervals of the mesh frequency.

Let chi(z) = det(z - Phi), real with leading coefficient 1, of degree m (verifier.py, whose notation is used).

**Theorem 3.** Let a_0, ..., a_m = 1 be the coefficients of chi (all others are 0) and D = det(a_(j+l) - a_(j-l)),
j, l = 1, ..., m - 1. If chi(1) chi(-1) D is not 0 for any T of an interval, as many zeros of chi are outside the unit
circle at all these T. If none are, all solutions decay exponentially. If some are, some grow.
*Proof.* Zeros are continuous. One that crosses the circle is 1 or -1 there, or one of a pair e^(+-it) that are not
real. Then 0 = Im(e^(-ijt) chi(e^(it))) = sum_k a_k sin((k - j) t) = sum_l (a_(j+l) - a_(j-l)) sin(l t), 1 <= j < m, so
that D = 0.

Where nothing is damped, multipliers are on the circle: circle.py has a theorem for them.
"""

from __future__ import annotations

from flint import arb, arb_poly

from gearstab.certificates.roots import CUT, Factor, cut, determinant, zeros


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


def _crossing(a: list[arb_poly]) -> arb_poly:
    """D. Row j < n/2 of its matrix ends with a_n = 1 in column n - j, zeros behind: these are eliminated."""
    n, no, entry = len(a) - 1, arb_poly([]), dict(enumerate(a))
    rows = [[entry.get(j + k, no) - entry.get(j - k, no) for k in range(1, n)] for j in range(1, n)]
    for _ in range((n - 1) // 2):
        pivot, *others = rows
        rows = [[e - cut(row[-1] * p, CUT) for e, p in zip(row[:-1], pivot[:-1], strict=True)] for row in others]
    return determinant(rows)
