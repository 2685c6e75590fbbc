r"""Multipliers outside the unit circle, counted over whole intervals of the mesh frequency in ball arithmetic.

With few states pieces are larger than those of a form (verifier.py, whose notation is used here), and need no
coordinates: the coefficients of chi(z; T) = det(z - Phi(T)) say where multipliers are, by Theorem 3 or, where a form Q
is kept (nothing is damped), by Theorem 5. Both are in circle.py.

**On an interval.** The coefficients of chi are computed at N equidistant T and interpolated on a cell in their
middle, T = T_0 + h z, -1 <= z <= 1. The rest is h^N/N! f^(N), somewhere between the N nodes z_j, times the product of
all z - z_j. Here f = +-tr L^k Phi, L^k the action on exterior products of k vectors. A factor E_s = exp(f_s A_s T) of
Phi has |L^k E_s| <= |E_s|^k, and a derivative puts f_s A_s^[k] before it, f_s A_s as a derivation on such products:

    |f^(N)| <= (m over k) (product of all |E_s|)^k (sum of all f_s |A_s^[k]|)^N.

With A = K + S, K skew, eigenvalues +-i v_j, S symmetric, |A^[k]| <= v_1 + v_2 + ... + k |S|, and the sum of all v_j,
half the sum of all singular values of K, is at most half the sum of the lengths of its rows. |E_s|^2 = |E_s^T E_s| is
bounded at the beginning of a run of nodes; |E_s| then grows like exp(f_s T s) at most, s the largest eigenvalue of S.
Both are bounded by Gershgorin's discs. Where k > m/2, tr L^k Phi = det Phi tr L^(m-k) Phi^-1 is bounded likewise, with
det Phi = exp(T sum f_s tr A_s). Norms are spectral ones in coordinates of choices.py; any choice is right.
Where a form Q is kept, coefficients k and m - k are alike.

**Not covered**: matrices that follow the speed, and what verifier.py does not cover either.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import reduce
from math import comb

import numpy as np
from flint import arb, arb_mat, arb_poly, ctx

from gearstab.certificates.balls import exact, near
from gearstab.certificates.choices import modal
from gearstab.certificates.circle import CELL, CUT, Circle, Disc, bend, cut, to_coefficients
from gearstab.certificates.equations import Flow

BITS, STEP = 128, 0.65
"""Bits of the midpoints; by how much the fastest function can turn from one T to the next."""
DAMPED, UNDAMPED, RUN, BLOCK = 32, 48, 16, 128
"""T of an interpolation, more where multipliers that nearly meet are told apart; T between two bounds of |E|; between
two exponentials.
"""
ROUGH, LONGEST, HALVINGS = 1e-7, 5000, 14
"""Rest of an interpolation that is of no use; cells of a piece that is too long; how often a cell is halved."""

Key = tuple[int, float]
Stretch = tuple[arb, arb, int | None]
"""First and last T, in cells; multipliers outside (1: some, where nothing is damped), None where it is not shown."""


class Counter:
    """Functions of one flow at T = 0, step, 2 step, ..., found where they are asked for."""

    def __init__(self, flow: Flow) -> None:
        ctx.prec = BITS
        self.cycles, self.keeps = flow.cycles, flow.form is not None
        x = exact(modal(np.array([near(a) for a in flow.generators]), np.bincount(flow.states, flow.fractions)))
        back, self.order = x.inv(), [*zip(flow.states, flow.fractions, strict=True)]
        self.m, own = x.nrows(), [back * a * x for a in flow.generators]
        self.first, self.nodes = (self.m // 2, UNDAMPED) if self.keeps else (0, DAMPED)
        self.every = {(s, f): own[s] * arb(f) for s, f in self.order}
        segments = [self.every[key] for key in self.order]
        self.trace = sum((a.trace() for a in segments), arb(0))
        stretch = [[*map(_discs, (a + a.transpose(), -1 * a - a.transpose()))] for a in segments]
        self.grows, self.shrinks = (
            sum((d[1] / 2 for d in ways), arb(0)).max(arb(0)) for ways in zip(*stretch, strict=True)
        )
        self.fastest = sum((_turning(a) for a in segments), arb(0))
        self.step = arb(STEP / float(self.fastest.upper()))
        self.steps = {key: (a * self.step).exp() for key, a in self.every.items()}
        self.reached: dict[int, tuple[int, dict[Key, arb_mat]]] = {}
        self.values: dict[int, list[arb]] = {}
        self.bounds: dict[int, list[arb]] = {}
        self.cells: dict[int, Circle | Disc | None] = {}

    def outside(self, low: float, high: float) -> int | None:
        """How many multipliers are outside at all low <= Omega <= high; None where that is not shown."""
        number = None
        for k, (_, _, found) in enumerate(self.stretches(low, high)):
            if found is None or (k and found != number):
                return None
            number = found
        return number

    def stretches(self, low: float, high: float) -> Iterator[Stretch]:
        """Stretches of T that make up low <= Omega <= high, from the first on."""
        ctx.prec = BITS
        start, end = self.place(high), self.place(low)
        if not end < LONGEST:
            yield start, end, None
            return
        first, last = (int(float(at.floor())) for at in (start.lower(), end.upper()))
        for b in range(first, last + 1):
            left, right = (2 * (start - b) - 1).lower().max(arb(-1)), (2 * (end - b) - 1).upper().min(arb(1))
            cell = self.cell(b)
            parts = [(left, right, None)] if cell is None else _told(cell, left, right, HALVINGS)
            for left, right, number in parts:
                yield b + (left + 1) / 2, b + (right + 1) / 2, number

    def place(self, omega: float) -> arb:
        """Return T in cells from the beginning of cell 0 on."""
        return (2 * arb.pi() * arb(self.cycles) / arb(omega) / self.step + arb(0.5)) / CELL

    def omega(self, place: arb) -> float:
        """Return the mesh frequency at a T in cells, nearly."""
        return 2 * np.pi * self.cycles / float((place * CELL - 0.5) * self.step)

    def cell(self, b: int) -> Circle | Disc | None:
        """Return what is known of the zeros of chi at all T/step from 4 b - 1/2 to 4 b + 7/2; None if too little."""
        if b not in self.cells:
            start = (2 * b + 1) * CELL // 2 - self.nodes // 2
            nodes = range(start, start + self.nodes)
            values = [self.value(j) for j in nodes]
            bounds = zip(*(self.bounds[run] for run in range(nodes[0] // RUN, nodes[-1] // RUN + 1)), strict=True)
            rest = self.rest(*map(_largest, bounds))
            self.cells[b] = self.found(values, rest) if all(r < ROUGH for r in rest) else None
        return self.cells[b]

    def found(self, values: list[list[arb]], rest: list[arb]) -> Circle | Disc:
        """Return a cell, from the values that are interpolated on it and what that leaves."""
        lines = (to_coefficients(self.nodes) * arb_mat(values)).transpose().tolist()
        chi = [cut(arb_poly([line[0] + arb(0, 1) * r, *line[1:]]), CUT) for line, r in zip(lines, rest, strict=True)]
        chi.append(arb_poly([1]))
        return Circle(chi) if self.keeps else Disc(chi)

    def value(self, j: int) -> list[arb]:
        """Coefficients of chi at T = j step, from the first that is needed on, but the last; on the way those
        from the beginning of a block on.
        """
        start = j // BLOCK * BLOCK
        if start not in self.reached:
            self.reached[start] = start, {key: (a * (self.step * start)).exp() for key, a in self.every.items()}
        at, flows = self.reached[start]
        while j not in self.values:
            if at % RUN == 0:
                self.bounds[at // RUN] = self.bounded(flows, at)
            period = flows[self.order[0]]
            for key in self.order[1:]:
                period = flows[key] * period
            self.values[at] = period.charpoly().coeffs()[self.first : -1]
            at, flows = at + 1, {key: self.steps[key] * flow for key, flow in flows.items()}
            self.reached[start] = at, flows
        return self.values[j]

    def bounded(self, flows: dict[Key, arb_mat], j: int) -> list[arb]:
        """Bounds for a run from T = j step on."""
        discs, run = {key: _discs(flow.transpose() * flow) for key, flow in flows.items()}, self.step * RUN
        most, least = arb(1), arb(1)
        for key in self.order:
            least, most = least * discs[key][0].max(arb(0)), most * discs[key][1]
        volume = _largest([(self.trace * self.step * k).exp() for k in (j, j + RUN)])
        return [most.sqrt() * (self.grows * run).exp(), (self.shrinks * run).exp() / least.sqrt(), volume]

    def rest(self, grows: arb, shrinks: arb, volume: arb) -> list[arb]:
        """Bounds of what the interpolation of each of these coefficients leaves."""
        found = []
        for k in range(self.m - self.first, 0, -1):
            inverse = 2 * k > self.m
            speed = self.fastest + (abs(self.trace) if inverse else 0)
            size = volume * shrinks ** (self.m - k) if inverse else grows**k
            found.append(comb(self.m, k) * size * (speed * self.step) ** self.nodes * bend(self.nodes))
        return found


def _told(cell: Circle | Disc, left: arb, right: arb, halvings: int) -> Iterator[Stretch]:
    """Parts of a cell, of z, and how many zeros are outside on each."""
    number = cell.outside(left, right)
    if number is not None or not halvings:
        yield left, right, number
    else:
        middle = (left + right) / 2
        yield from _told(cell, left, middle, halvings - 1)
        yield from _told(cell, middle, right, halvings - 1)


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
