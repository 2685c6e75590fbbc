r"""Multipliers outside the unit circle, counted over whole intervals of the mesh frequency in ball arithmetic.

With few states this takes larger pieces than a form (verifier.py, whose notation is used here) and no coordinates. Let
chi(z; T) = det(z - Phi(T)), real with leading coefficient 1, m states.

**Theorem 3.** Let p = chi, or, where nothing is damped and a form Q is kept, p = chi'/m; n its degree, a_0, ..., a_n = 1
its coefficients (others are 0) and D = det(a_(j+l) - a_(j-l)), j, l = 1, ..., n - 1. If p(1) p(-1) D is not 0 for any T
of an interval, as many zeros of p are outside the unit circle at all these T. If there are none, all solutions decay
exponentially or, where p = chi'/m, are bounded, also for all A_s near enough that keep Q. Else some grow exponentially.
*Proof.* Zeros are continuous. One that crosses the circle is 1 or -1 there, or one of a pair e^(+-it) that are not
real. Then 0 = Im(e^(-ijt) p(e^(it))) = sum_k a_k sin((k - j) t) = sum_l (a_(j+l) - a_(j-l)) sin(l t) for 1 <= j < n, so
that D = 0. For p = chi the rest is known. Else z^m chi(1/z) = chi(z), as Phi^-1 is similar to Phi^T, and

    z chi'(z) + z^(m-1) chi'(1/z) = m chi(z).

If all zeros of chi' are inside, |chi'(z)| > |z^(m-1) chi'(1/z)| for |z| > 1, factor by factor: chi has no zero outside,
none inside, as 1/z would be outside, and no double one on the circle, where chi' would have it too. Simple multipliers
on the circle cannot leave it: 1/conj(z) would be another one. If chi' has a zero outside, chi has one too, as zeros of
a derivative are within the convex hull of those of the polynomial (Gauss and Lucas).

**On an interval.** The coefficients of chi are computed at equidistant T and interpolated by polynomials of NODES nodes
on cells, the middle thirds of these; T = T_0 + h z, -1 <= z <= 1. The rest is f^(NODES) h^NODES/NODES! times the product
of all z - z_j, at most. Here f = +-tr L^k Phi, L^k the action on products of k vectors. Each factor E of Phi has |L^k E|
<= |E|^k, and a derivative puts before it f_s A_s^[k], the action of f_s A_s on such products, so that

    |f^(N)| <= (m over k) (product of all |E_s|)^k (sum of all f_s |A_s^[k]|)^N.

With A = K + S, K skew with eigenvalues +-i v_j, S symmetric, |A^[k]| <= v_1 + v_2 + ... + k |S|, and the sum of all v_j,
half the sum of all singular values of K, is at most half the sum of the lengths of its columns. |E(T)| is
bounded by |E|^2 = |E^T E| at the beginning of a block of nodes and grows from there with the largest eigenvalue of S at
most; both by Gershgorin's discs. For k > m/2, tr L^k Phi = det Phi tr L^(m-k) Phi^-1 is bounded likewise, det Phi =
exp(sum f_s tr A_s T). Norms are spectral ones in coordinates X of choices.py; any choice is right.

Products of polynomials are cut off at a degree, the last coefficient a ball that holds the rest on [-1, 1]. A
polynomial has no zero where its Bernstein coefficients have one sign; intervals are halved until they have.

**Not covered**: matrices that follow the speed, and what verifier.py does not cover either.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache, reduce
from math import comb, factorial, floor

import numpy as np
from flint import arb, arb_mat, arb_poly, ctx, fmpq

from gearstab.certificates.choices import modal
from gearstab.certificates.polynomials import exact, near
from gearstab.certificates.verifier import COUNTED, Certificate, Flow, proves

BITS, STEP = 128, 0.7
"""Bits of the midpoints; by how much the fastest function can turn from one T to the next."""
CELL, NODES, RUN, BLOCK = 4, 36, 8, 64
"""T of a cell; around its middle, of an interpolation; between two bounds of |E|; between two exponentials."""
CUT, DEGREE, SHORT = 30, 36, 20
"""Degree at which factors of D are cut off, p(1) p(-1) D on a cell, and on an interval of that."""
HALVINGS, LONGEST = 12, 100_000
"""How often an interval is halved; cells of a piece that is too long."""
ROUGH = 1e-7
"""Rest of an interpolation that is of no use."""

MANY, LONG = 10, 100
"""States and segments up to which this is cheaper than a form."""

Key = tuple[int, float]
Cell = tuple[list[arb_poly], arb_poly]


def countable(flow: Flow) -> bool:
    """Whether Theorem 3 is about a flow, and few enough states and segments for it."""
    return not flow.following and flow.generators[0].nrows() <= MANY and len(flow.states) <= LONG


def proved(flow: Flow, pieces: Sequence[Certificate]) -> list[bool]:
    """Which claims are proved: by Theorem 3 those whose rate is COUNTED, the others by verifier.py."""
    known = Counter(flow) if countable(flow) and any(piece.rate == COUNTED for piece in pieces) else None
    return [_counted(known, piece) if piece.rate == COUNTED else proves(flow, piece) for piece in pieces]


def _counted(known: Counter | None, piece: Certificate) -> bool:
    if known is None or piece.outside not in (0, 1) or not 0 < piece.low <= piece.high < np.inf:
        return False
    found = known.outside(piece.low, piece.high)
    return found is not None and (found > 0) == (piece.outside == 1)


class Counter:
    """Functions of one flow at T = 0, step, 2 step, ..., found where they are asked for. Raises ZeroDivisionError."""

    def __init__(self, flow: Flow) -> None:
        ctx.prec = BITS
        self.cycles, self.keeps = flow.cycles, flow.form is not None
        x = exact(modal(np.array([near(a) for a in flow.generators]), np.bincount(flow.states, flow.fractions)))
        back, self.order = x.inv(), [*zip(flow.states, flow.fractions, strict=True)]
        self.m, own = x.nrows(), [back * a * x for a in flow.generators]
        self.every = {(s, f): own[s] * arb(f) for s, f in self.order}
        segments = [self.every[key] for key in self.order]
        self.trace = sum((a.trace() for a in segments), arb(0))
        self.grows, self.shrinks = (sum((_discs(sign * (a + a.transpose()))[1] for a in segments), arb(0)) / 2
                                    for sign in (1, -1))  # fmt: skip
        self.fastest = sum((_turning(a) for a in segments), arb(0))
        self.step = arb(STEP / float(self.fastest.upper()))
        self.steps = {key: (a * self.step).exp() for key, a in self.every.items()}
        self.reached: dict[int, tuple[int, dict[Key, arb_mat]]] = {}
        self.values: dict[int, list[arb]] = {}
        self.bounds: dict[int, list[arb]] = {}
        self.cells: dict[int, Cell | None] = {}

    def outside(self, low: float, high: float) -> int | None:
        """How many zeros of p are outside at all low <= Omega <= high; None where that is not shown."""
        ctx.prec = BITS
        start, end = self.place(high), self.place(low)
        if not end < LONGEST:
            return None
        first, last = floor(float(start.lower())), floor(float(end.upper()))
        for b in range(first, last + 1):
            left = (2 * (start - b) - 1).lower() if b == first else arb(-1)
            right = (2 * (end - b) - 1).upper() if b == last else arb(1)
            cell = self.cell(b)
            if cell is None or not _nonzero(cell[1], left, right, HALVINGS):
                return None
        return _outside(arb_poly([a((left + right) / 2) for a in cell[0]]))

    def place(self, omega: float) -> arb:
        """Return T in cells from the beginning of cell 0 on."""
        return (2 * arb.pi() * arb(self.cycles) / arb(omega) / self.step + arb(0.5)) / CELL

    def cell(self, b: int) -> Cell | None:
        """p's coefficients and p(1) p(-1) D as polynomials on a cell, of T/step from 4 b - 1/2 to 4 b + 7/2."""
        if b not in self.cells:
            start = (2 * b + 1) * CELL // 2 - NODES // 2
            nodes = range(start, start + NODES)
            values = [self.value(j) for j in nodes]
            bounds = zip(*(self.bounds[run] for run in range(nodes[0] // RUN, nodes[-1] // RUN + 1)), strict=True)
            rest = self.rest(*map(_largest, bounds))
            self.cells[b] = self.found(values, rest) if all(r < ROUGH for r in rest) else None
        return self.cells[b]

    def found(self, values: list[list[arb]], rest: list[arb]) -> Cell:
        """What a cell is, from what interpolates it and what that leaves."""
        lines = (_interpolation() * arb_mat(values)).transpose().tolist()
        chi = [_cut(arb_poly([line[0] + arb(0, 1) * r, *line[1:]]), CUT) for line, r in zip(lines, rest, strict=True)]
        chi.append(arb_poly([1]))
        p = [a * (arb(k) / self.m) for k, a in enumerate(chi)][1:] if self.keeps else chi
        return p, _crossing(p)

    def value(self, j: int) -> list[arb]:
        """The coefficients of chi at T = j step, but the last; on the way there, those from the beginning of a block on."""
        start = j // BLOCK * BLOCK
        at, flows = self.reached.get(start) or (
            start,
            {key: (a * (self.step * start)).exp() for key, a in self.every.items()},
        )
        while j not in self.values:
            if at % RUN == 0:
                self.bounds[at // RUN] = self.bounded(flows, at)
            period = flows[self.order[0]]
            for key in self.order[1:]:
                period = flows[key] * period
            self.values[at] = period.charpoly().coeffs()[:-1]
            at, flows = at + 1, {key: self.steps[key] * flow for key, flow in flows.items()}
            self.reached[start] = at, flows
        return self.values[j]

    def bounded(self, flows: dict[Key, arb_mat], j: int) -> list[arb]:
        """Bounds for a run from T = j step on."""
        discs, run = {key: _discs(flow.transpose() * flow) for key, flow in flows.items()}, self.step * RUN
        most, least = arb(1), arb(1)
        for key in self.order:
            least, most = least * discs[key][0], most * discs[key][1]
        volume = _largest([(self.trace * self.step * k).exp() for k in (j, j + RUN)])
        return [most.sqrt() * (self.grows * run).exp(), (self.shrinks * run).exp() / least.sqrt(), volume]

    def rest(self, grows: arb, shrinks: arb, volume: arb) -> list[arb]:
        """What the interpolation of each coefficient of chi but the last leaves, at most."""
        found = []
        for k in range(self.m, 0, -1):
            inverse = 2 * k > self.m
            speed = self.fastest + (abs(self.trace) if inverse else 0)
            size = volume * shrinks ** (self.m - k) if inverse else grows**k
            found.append(comb(self.m, k) * size * (speed * self.step) ** NODES * _bend())
        return found


def _crossing(a: list[arb_poly]) -> arb_poly:
    """p(1) p(-1) D. Row j < n/2 of D's matrix ends with a_n = 1 in column n - j, zeros behind: these are eliminated."""
    n, no = len(a) - 1, arb_poly([])
    ends = [sum((c * sign**k for k, c in enumerate(a)), no) for sign in (1, -1)]
    entry = {k: c for k, c in enumerate(a)}
    rows = [[entry.get(j + k, no) - entry.get(j - k, no) for k in range(1, n)] for j in range(1, n)]
    for _ in range((n - 1) // 2):
        pivot, *others = rows
        rows = [[e - _cut(row[-1] * p, CUT) for e, p in zip(row[:-1], pivot[:-1], strict=True)] for row in others]
    return _cut(ends[0] * ends[1] * _determinant(rows), DEGREE)


def _determinant(rows: list[list[arb_poly]]) -> arb_poly:
    """By the first row, but for its sign."""
    if not rows:
        return arb_poly([1])
    found = arb_poly([])
    for k, entry in enumerate(rows[0]):
        minor = _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
        found = found + _cut(entry * minor, CUT) * (-1) ** k
    return found


def _cut(p: arb_poly, degree: int) -> arb_poly:
    """A polynomial of this degree whose last coefficient holds the rest on [-1, 1]."""
    if p.degree() <= degree:
        return p
    return p.truncate(degree) + arb_poly([p.right_shift(degree)(arb(0, 1))]).left_shift(degree)


def _nonzero(p: arb_poly, left: arb, right: arb, halvings: int) -> bool:
    """Whether a polynomial has no zero in an interval."""
    middle = (left + right) / 2
    moved = _cut(p(arb_poly([middle, (right - left) / 2])), SHORT).coeffs()
    found = (_bernstein(len(moved) - 1) * arb_mat(len(moved), 1, moved)).entries()
    if all(c > 0 for c in found) or all(c < 0 for c in found):
        return True
    if not halvings or found[0] * found[-1] < 0:
        return False
    return _nonzero(p, left, middle, halvings - 1) and _nonzero(p, middle, right, halvings - 1)


def _outside(p: arb_poly) -> int | None:
    """Zeros outside the unit circle; None where they cannot be told from those inside."""
    try:
        sizes = [abs(zero) for zero in p.complex_roots()]
    except ValueError:  # not isolated
        return None
    found = [size > 1 for size in sizes]
    return sum(found) if all(size > 1 or size < 1 for size in sizes) else None


def _turning(a: arb_mat) -> arb:
    """Bound |A^[k]| for all k <= m/2."""
    lengths = [sum((x * x for x in row), arb(0)).sqrt() for row in ((a - a.transpose()) / 2).tolist()]
    return sum(lengths, arb(0)) / 2 + a.nrows() // 2 * _largest([abs(end) for end in _discs((a + a.transpose()) / 2)])


def _discs(a: arb_mat) -> tuple[arb, arb]:
    """Bounds of the eigenvalues of a symmetric matrix, the least and the largest: Gershgorin's discs."""
    discs = [(row[i], sum(map(abs, row[:i] + row[i + 1 :]), arb(0))) for i, row in enumerate(a.tolist())]
    return -_largest([r - c for c, r in discs]), _largest([c + r for c, r in discs])


def _largest(values: Iterable[arb]) -> arb:
    return reduce(lambda a, b: a.max(b), (value.upper() for value in values))


@cache
def _bend() -> arb:
    """What NODES numbers z_j at distances 1, symmetric to 0, make of the product of all |z - z_j| on a cell, divided
    by NODES!: in pairs, |z^2 - z_j^2|.
    """
    found = fmpq(1)
    for k in range(NODES // 2):
        square = fmpq(2 * k + 1, 2) ** 2
        found *= max(square, fmpq(CELL * CELL, 4) - square)
    return arb(found / factorial(NODES))


@cache
def _interpolation() -> arb_mat:
    """From values at the nodes to coefficients in z, which is -1 and 1 at the ends of a cell."""
    with ctx.workprec(4 * BITS):
        nodes = [arb(fmpq(2 * j - NODES + 1, CELL)) for j in range(NODES)]
        return arb_mat([[z**k for k in range(NODES)] for z in nodes]).inv()


@cache
def _bernstein(n: int) -> arb_mat:
    """From coefficients of a polynomial on [-1, 1] to those of Bernstein."""
    shift = [[arb(comb(k, j) * 2**j * (-1) ** (k - j)) for k in range(n + 1)] for j in range(n + 1)]
    return arb_mat([[arb(comb(i, k)) / comb(n, k) for k in range(n + 1)] for i in range(n + 1)]) * arb_mat(shift)
