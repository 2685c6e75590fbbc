"""Where two multipliers meet, and only there, a tongue may hide between samples, or a stable gap in one.

Let L = ln lambda of two multipliers, Delta their difference modulo 2 pi i. Where the phases turn against each other at
the rate S along the cycle c = 1/Omega, losses a period differ by kappa, and the two modes are coupled by b,

    Delta^2 = (i S (c - c0) - kappa)^2 + 4 b,        Re(Delta Delta') = -S^2 (c - c0).

Delta has branch points at the edges of an undamped tongue, Delta^2 has none. Without damping the growth rate is
greatest at c0, with it within |Delta| / S of that. So the range is sampled a few times a meeting, and each pair that a
sample expects to meet within its cell is pursued to c0: a step S^-2 Re(Delta Delta'), with S from where the two are
still apart, and further ones from there, with S from the last two. Sums and differences of frequencies are pairs alike:
where a growing solution meets one that decays, and the system is not symmetric, both may decay. There b is complex, and
both grow equally far away from c0, where Delta^2 is a negative number: a stable gap is about that point. The
derivatives come from a second matrix M' a tiny step in the cycle later, as the diagonal of X^-1 M' X.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from gearstab.floquet.boundaries.damped.proof import MODULI
from gearstab.floquet.boundaries.damped.scan import Scan
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel.chain import Chain
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
"""Of two pairs that are complex conjugates that is taken whose product has no smaller imaginary part than this."""
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
    owner = np.repeat(np.arange(len(row)), steps)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(steps) - steps, steps)
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
    row, cycle, width, level = pursued(chain, expected, CLOSE * floor)
    for looked in (samples, row):
        scan.cover.count(looked, MODULI)
    width = np.clip(width, floor * cycle, BESIDE * cell[row])
    equal = np.abs(level) < cell[row]
    cycle = np.concatenate([cycle, cycle - width, cycle + width, (cycle + level)[equal]])
    row = np.concatenate([np.tile(row, 3), row[equal]])
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
    owner = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 1
    return scan.row[owner], np.log(cycle[owner] + width[owner] * number / (count[owner] + 1))


@dataclass(frozen=True)
class Logarithms:
    """ln lambda ``(P, m)`` of all multipliers at points, and the derivatives along the cycle; NaN of those lost."""

    value: Array
    slope: Array

    @classmethod
    def at(cls, chain: Chain, row: Array, cycle: Array) -> Logarithms:
        """Those at points (row, cycle) ``(P,)``."""
        here, scale = kernel.products(chain, row, cycle)
        later, other = kernel.products(chain, row, cycle * (1 + APART))
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
class Approaches:
    """Pairs of multipliers, and where they are expected to meet.

    row, cycle ``(A,)``. mean: half of the sum of their logarithms there. squared: S^2. step: how far the cycle is from
    where that was found.
    """

    row: Array
    cycle: Array
    mean: Array
    squared: Array
    step: Array

    def chosen(self, index: Array) -> Approaches:
        """Some of them."""
        return Approaches(*(getattr(self, f.name)[index] for f in fields(self)))

    @classmethod
    def joined(cls, parts: list[Approaches]) -> Approaches:
        """All of several."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))


def approaches(chain: Chain, row: Array, cycle: Array, near: Array, every: Array) -> Approaches:
    """Those that samples expect no farther than ``near`` ``(P,)`` from their cycles; of pairs with a growing solution
    only, unless ``every`` ``(P,)`` one is wanted.
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
        squared = speed.imag**2
        step = (difference * speed).real / squared
        # Inside of a tongue phases are locked: it is found already.
        turning = np.abs(speed.imag) > np.abs(speed.real)
        upper = np.sin((logs.value[:, first] + logs.value[:, second]).imag) > UPPER
        wanted = every[:, None] | (np.maximum(logs.value[:, first].real, logs.value[:, second].real) > 0)
        p, k = np.nonzero(upper & turning & wanted & (np.abs(step) <= near[:, None]))
    i, j, ahead = first[k], second[k], step[p, k]
    mean = logs.value[p, j] + 0.5 * (difference[p, k] + (logs.slope[p, i] + logs.slope[p, j]) * ahead)
    return Approaches(row[p], cycle[p] + ahead, mean, squared[p, k], ahead)


def pursued(chain: Chain, found: Approaches, tolerance: float) -> tuple[Array, Array, Array, Array]:
    """(row, cycle, half-width in the cycle, way in it to where both grow equally, NaN where that opens no gap) of all
    points on the ways to the meetings, each to a relative tolerance.
    """
    seen: list[tuple[Array, Array, Array, Array]] = []
    for _ in range(ROUNDS):
        logs = Logarithms.at(chain, found.row, found.cycle)
        away = np.abs(_within_a_turn(logs.value - found.mean[:, None]))
        nearest = np.argsort(np.where(np.isnan(away), np.inf, away), axis=1)[:, :2]
        value, slope = (np.take_along_axis(part, nearest, axis=1) for part in (logs.value, logs.slope))
        difference, total = _within_a_turn(value[:, 0] - value[:, 1]), value.real.sum(axis=1)
        # Half of the derivative of Delta^2, -S^2 (c - c0) - i S kappa.
        change = difference * (slope[:, 0] - slope[:, 1])
        with np.errstate(all="ignore"):
            squared = found.squared - change.real / found.step
            squared = np.clip(squared, found.squared / VARIES, found.squared * VARIES)
            step, level = change.real / squared, -0.5 * (difference**2).imag / change.imag
        # As wide as a tongue is without damping, or as damping makes its bump.
        width = np.maximum(np.abs(difference), np.abs(total)) / np.sqrt(squared)
        gap = (total < 0) & (value.real.max(axis=1) > 0)
        seen.append((found.row, found.cycle, np.nan_to_num(width), np.where(gap, level, np.nan)))
        mean = value[:, 1] + 0.5 * (difference + slope.sum(axis=1) * step)
        moves = (np.abs(step) < LONGER * np.abs(found.step)) & (np.abs(step) > tolerance * found.cycle)
        found = Approaches(found.row, found.cycle + step, mean, squared, step).chosen(np.flatnonzero(moves))
    row, cycle, width, level = (np.concatenate(part) for part in zip(*seen, strict=True))
    return row, cycle, width, level


def _within_a_turn(values: Array) -> Array:
    """Complex numbers with imaginary parts within half a turn."""
    return np.asarray(values.real + 1j * (np.mod(values.imag + np.pi, 2 * np.pi) - np.pi))
