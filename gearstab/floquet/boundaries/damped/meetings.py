"""Where two multipliers meet, and only there, a tongue may hide between samples, or a stable gap in one.

Let L = ln lambda of two multipliers, Delta their difference modulo 2 pi i. Where the phases turn against each other at
the rate S along the cycle c = 1/Omega, losses a period differ by kappa, and the two modes are coupled by b,

    Delta^2 = (i S (c - c0) - kappa)^2 + 4 b,        Re(Delta Delta') = -S^2 (c - c0).

Delta has branch points at the edges of an undamped tongue, Delta^2 has none. So the range is sampled a few times a
meeting, and each pair that a sample expects to meet within its cell is pursued to c0: a step S^-2 Re(Delta Delta'),
with S from where the two are still apart, and further ones from there, with S from the last two. Sums and differences
of frequencies are pairs alike: where a growing solution meets one that decays, and the system is not symmetric, both
may decay.

Growth is greatest at c0 where b is real, as it is without damping. Else, with 4 b = p + i q, the real part of Delta has
its extrema where S (c - c0) = kappa (p -+ |4 b|) / q, and is zero, both solutions growing equally, at q / (2 kappa) if
Delta^2 is negative there. A tongue or a stable gap may be about each of them, away from c0. The derivatives come from a
second matrix M' a tiny step in the cycle later, as the diagonal of X^-1 M' X.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.damped.proof import MODULI
from gearstab.floquet.boundaries.damped.scan import Scan
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import Chain
from gearstab.grouping import Columns, numbered
from gearstab.system import Array

RASTER = 4
"""Samples a meeting."""
WITHIN = 4
"""Parts of a cell in which it is sampled where the system is unstable."""
APART = 1e-8
"""Relative step of the derivative: rounding leaves it half of the digits."""
LOST = 15.0
"""ln |lambda| below the largest one at which a multiplier is lost in rounding, and far from growing."""
UPPER = -1e-9
"""Smallest imaginary part of a product: of two complex conjugate pairs, the one above it is taken."""
SEQUENCE = 3.0
"""Ratio of the distances of samples beside an edge."""
REACH = 1.1
"""Cells from a sample up to which a meeting is expected: beyond the next one, which may lie inside of a tongue where
damping keeps it stable, but phases are locked and tell nothing."""
ROUNDS = 5
"""Steps of a pursuit at most; two or three do."""
VARIES = 8.0
"""Factor by which S^2 changes at most from one point of a pursuit to the next."""
LONGER = 2.0
"""Factor by which a step is longer at most than the one before it."""
DOUBTFUL = 0.05
"""Part of |Delta| by which its real part may be wrong at the extrema."""
CLOSE = 0.03
"""Part of the width floor to which a meeting is pursued."""
BESIDE = 0.25
"""Cells beside a meeting at which it is looked at, at most."""
AT_ONCE = 2**18
"""Entries of the tables of pairs that are made at once."""


def pursue(scan: Scan, cell: Array, floor: float) -> None:
    """Sample the rows that have a finite ``cell`` ``(r,)``, the distance of their samples in the cycle, more closely
    where they are unstable, at all meetings, and beside these.
    """
    chosen = np.isfinite(cell[scan.row]) & scan.within(scan.row, scan.x)
    row, x = scan.row[chosen], scan.x[chosen]
    scan.add(*_between(scan, cell / WITHIN))
    scan.refine(floor)
    _look(scan, row, x, REACH * cell[row], cell, floor)


def pursue_beside(scan: Scan, row: Array, edge: Array, cell: Array, floor: float) -> None:
    """Pursue the meetings near edges of regions (row, cycle) ``(E,)``: there the two multipliers that have met turn as
    fast as a square root, so that what they meet next is expected only from samples in a geometric sequence.
    """
    steps = np.ceil(np.log(np.maximum(cell[row] / (floor * edge), 1.0)) / np.log(SEQUENCE)).astype(int)
    owner, number = numbered(steps)
    distance = cell[row[owner]] * SEQUENCE ** -(number + 1.0)
    row, away = np.tile(row[owner], 2), np.tile(distance, 2)
    cycle = np.tile(edge[owner], 2) + np.concatenate([distance, -distance])
    chosen = np.flatnonzero(scan.within(row, np.log(np.maximum(cycle, np.finfo(float).tiny))))
    chosen = chosen[np.lexsort((cycle[chosen], row[chosen]))]
    row, x, away = row[chosen], np.log(cycle[chosen]), away[chosen]
    scan.add(row, x)
    _look(scan, row, x, (SEQUENCE - 1) * away, cell, floor)


def _look(scan: Scan, row: Array, x: Array, near: Array, cell: Array, floor: float) -> None:
    """Sample at and beside the meetings that samples (row, x) ``(P,)``, ascending, expect within ``near`` ``(P,)``."""
    chain, samples = scan.cover.chain, row
    expected = approaches(chain, row, np.exp(x), near, scan.partly_stable(row, x))
    expected = expected.chosen(np.flatnonzero(scan.within(expected.row, np.log(expected.cycle))))
    seen = pursued(chain, expected, CLOSE * floor)
    row, cycle, width = (np.concatenate([getattr(one, name) for one in seen]) for name in ("row", "cycle", "width"))
    extrema = np.concatenate([one.extrema for one in seen])
    for looked in (samples, row):
        scan.cover.count(looked, MODULI + chain.exponential)
    width = np.clip(width, floor * cycle, BESIDE * cell[row])
    k, which = np.nonzero(np.abs(extrema) < cell[row][:, None])
    cycle = np.concatenate([cycle, cycle - width, cycle + width, cycle[k] + extrema[k, which]])
    row = np.concatenate([np.tile(row, 3), row[k]])
    inside = scan.within(row, np.log(np.maximum(cycle, np.finfo(float).tiny)))
    scan.add(row[inside], np.log(cycle[inside]))


def _between(scan: Scan, spacing: Array) -> tuple[Array, Array]:
    """Further points between samples one of which is unstable, so that their cycles are no farther apart than
    ``spacing`` ``(r,)``; more where the sign changes, which may hide two further changes.
    """
    cycle = np.exp(scan.x)
    width = np.diff(cycle)
    above = np.stack([scan.growth[1:], scan.growth[:-1]]) > 0
    limit = spacing[scan.row[1:]] * np.where(above.all(axis=0), 1.0, 0.25)
    inside = (np.diff(scan.row) == 0) & above.any(axis=0)
    # Samples may lie on each other, where gaps have ends in common.
    count = np.where(inside, np.maximum(np.ceil(width / limit) - 1, 0), 0).astype(int)
    owner, number = numbered(count)
    return scan.row[owner], np.log(cycle[owner] + width[owner] * (number + 1) / (count[owner] + 1))


@dataclass(frozen=True)
class Logarithms:
    """ln lambda ``(P, m)`` of all multipliers at points, and the derivatives along the cycle; NaN of those lost."""

    value: Array
    slope: Array

    @classmethod
    def at(cls, chain: Chain, row: Array, cycle: Array) -> Logarithms:
        """Return the logarithms at points (row, cycle) ``(P,)``."""
        here, scale = c_points.products(chain, row, cycle)
        later, other = c_points.products(chain, row, cycle * (1 + APART))
        values, vectors = (part.astype(complex) for part in np.linalg.eig(here))
        try:
            inverse = np.linalg.inv(vectors)
        except np.linalg.LinAlgError:
            # Two multipliers have one vector: exactly on the edge of an undamped tongue.
            inverse = np.linalg.pinv(vectors)
        with np.errstate(all="ignore"):
            moved = np.einsum("pij,pji->pi", inverse @ later, vectors) / values
            value = np.log(values) + scale[:, None]
            slope = (np.log(moved) + (other - scale)[:, None]) / (APART * cycle[:, None])
        lost = ~(np.isfinite(value) & np.isfinite(slope)) | (value.real < value.real.max(axis=1)[:, None] - LOST)
        return cls(np.where(lost, np.nan, value), np.where(lost, np.nan, slope))


@dataclass(frozen=True)
class Approaches(Columns):
    """Pairs of multipliers, and where they are expected to meet.

    row, cycle ``(A,)``. mean: half of the sum of their logarithms there. squared: S^2. step: how far the cycle is from
    where that was found.
    """

    row: Array
    cycle: Array
    mean: Array
    squared: Array
    step: Array


def approaches(chain: Chain, row: Array, cycle: Array, near: Array, every: Array) -> Approaches:
    """Return the meetings that samples expect no farther than ``near`` ``(P,)`` from their cycles; of pairs with a
    growing solution only, unless ``every`` ``(P,)`` one is wanted.
    """
    at_once = max(1, AT_ONCE // chain.size**2)
    given = row, cycle, near, every
    pieces = range(0, max(len(row), 1), at_once)
    return Approaches.joined([_approaches(chain, *(part[i : i + at_once] for part in given)) for i in pieces])


def _approaches(chain: Chain, row: Array, cycle: Array, near: Array, every: Array) -> Approaches:
    logs = Logarithms.at(chain, row, cycle)
    first, second = np.triu_indices(chain.size, 1)
    difference = _within_a_turn(logs.value[:, first] - logs.value[:, second])
    speed = logs.slope[:, first] - logs.slope[:, second]
    with np.errstate(all="ignore"):
        turning = np.abs(speed.imag) > np.abs(speed.real)
        growing = np.maximum(logs.value[:, first].real, logs.value[:, second].real) > 0
        # Inside of a tongue phases are locked. One that grows is found already; of others S is found on the way.
        locked = ~turning & ~growing & (np.abs(difference.imag) < np.abs(difference.real))
        change = (difference * speed).real
        squared = np.where(turning, speed.imag**2, np.abs(change) / (0.5 * near[:, None]))
        step = change / squared
        upper = np.sin((logs.value[:, first] + logs.value[:, second]).imag) > UPPER
        wanted = (turning | locked) & (every[:, None] | growing)
        p, k = np.nonzero(upper & wanted & (np.abs(step) <= near[:, None]))
    i, j, ahead = first[k], second[k], step[p, k]
    mean = logs.value[p, j] + 0.5 * (difference[p, k] + (logs.slope[p, i] + logs.slope[p, j]) * ahead)
    return Approaches(row[p], cycle[p] + ahead, mean, squared[p, k], ahead)


@dataclass(frozen=True)
class Meetings:
    """Points on the ways to the meetings of pairs.

    row, cycle ``(A,)``. difference, total: Delta, and the sum of the real parts of both logarithms. change: Delta
    Delta', which is -S^2 (c - c0) - i S kappa. squared: S^2.
    """

    row: Array
    cycle: Array
    difference: Array
    total: Array
    change: Array
    squared: Array

    @property
    def width(self) -> Array:
        """Half-width in the cycle of a tongue without damping, or of the bump that damping makes."""
        return np.nan_to_num(np.maximum(np.abs(self.difference), np.abs(self.total)) / np.sqrt(self.squared))

    @property
    def extrema(self) -> Array:
        """``(A, 3)``: how far in the cycle growth has its extrema, and is equal in both; NaN where its sign is unlikely
        to change there.
        """
        speed = np.sqrt(self.squared)
        here = self.change / speed  # -s - i kappa, with s = S (c - c0)
        coupling = self.difference**2 - (1j * here) ** 2
        with np.errstate(all="ignore"):
            p, q, kappa = coupling.real, coupling.imag, -here.imag
            most = kappa * (p + np.array([[-1.0], [1.0]]) * np.abs(coupling)) / q
            s = np.stack([*most, 0.5 * q / kappa], axis=1)
            delta = np.sqrt((1j * s - kappa[:, None]) ** 2 + coupling[:, None])
            low, high = (self.total[:, None] + np.abs(delta.real) + sign * DOUBTFUL * np.abs(delta) for sign in (-1, 1))
        growing = (self.total + np.abs(self.difference.real) > 0)[:, None]
        return np.where(np.where(growing, low < 0, high > 0), (s + here.real[:, None]) / speed[:, None], np.nan)


def pursued(chain: Chain, found: Approaches, tolerance: float) -> list[Meetings]:
    """Points on the ways to the meetings, each to a relative tolerance."""
    seen = []
    for _ in range(ROUNDS):
        logs = Logarithms.at(chain, found.row, found.cycle)
        away = np.abs(_within_a_turn(logs.value - found.mean[:, None]))
        nearest = np.argsort(np.where(np.isnan(away), np.inf, away), axis=1)[:, :2]
        value, slope = (np.take_along_axis(part, nearest, axis=1) for part in (logs.value, logs.slope))
        difference = _within_a_turn(value[:, 0] - value[:, 1])
        change = difference * (slope[:, 0] - slope[:, 1])
        with np.errstate(all="ignore"):
            squared = found.squared - change.real / found.step
            squared = np.clip(squared, found.squared / VARIES, found.squared * VARIES)
            step = change.real / squared
        seen.append(Meetings(found.row, found.cycle, difference, value.real.sum(axis=1), change, squared))
        mean = value[:, 1] + 0.5 * (difference + slope.sum(axis=1) * step)
        moves = (np.abs(step) < LONGER * np.abs(found.step)) & (np.abs(step) > tolerance * found.cycle)
        found = Approaches(found.row, found.cycle + step, mean, squared, step).chosen(np.flatnonzero(moves))
    return seen


def _within_a_turn(values: Array) -> Array:
    """Complex numbers with imaginary parts within half a turn."""
    return np.asarray(values.real + 1j * (np.mod(values.imag + np.pi, 2 * np.pi) - np.pi))
