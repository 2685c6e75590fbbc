"""As many steps as every point needs: error estimates by Richardson, and resolutions chosen by them.

Every point is computed at some resolution and at one with half of the steps. With a scheme of order p the difference is
2^p - 1 times the error of the finer one once that has converged. The estimate is SAFETY times as much, and nowhere less
than a part of what is usual for points of the row at that resolution, as differences vanish by chance where errors do
not; the rounding error is added. A few points of each row tell what resolution the others will need.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.smooth.compare import KernelAnswer, colliding, difference, scan
from gearstab.floquet.smooth.steps import Division, Scheme
from gearstab.propagation.magnus import AIM, StepControl, remainder
from gearstab.system import Array

SAFETY = 10.0
"""Estimate over the error that a converged scheme would have."""
SETTLED = 4
"""Resolutions below this take the longest steps there are, whose errors may not yet fall as they should everywhere."""
LONG = 1.5
"""Further safety there."""
USUAL = 0.5
"""The least estimate, as a part of the median one."""
FEW = 5
"""Points of a row that make a median of use."""
FINEST = 6
"""Resolutions tried beyond the first choice: a factor 8 in the number of steps."""
MOST_SEGMENTS, MOST_ENTRIES = 2**16, 2**22
"""Segments of a common period; more where the stiffness matrices of all rows have no more entries: about 250 MB."""
CRUDE = 0.1
"""Difference of two resolutions above which it is not known to fall, and the estimate is SAFETY times as much: phases
that are wrong by a turn come as near to each other as right ones."""
PILOTS = 8
"""Points a row that are looked at first."""
NEGLIGIBLE = 1e-3
"""Part of the tolerance below which differences need not fall any more."""
LEAST = 1e-15
"""Smaller differences are rounding."""
CONVERGING = 0.5
"""Part of the factor 2^p by which the differences of pilot points must fall."""
INTERPOLATED = 1e-11
"""Least tolerance for which matrices may be interpolated over mesh frequency, at some cost in rounding errors."""
WORTH_ALL = 0.7
"""The part of the rows at a resolution from which on the pattern is made for all of them, and kept."""
ALIKE = 3
"""Rows whose numbers of points have the same number of digits to the base 2^ALIKE go to the kernel together."""


@dataclass
class Ladder:
    """Patterns of one division at all resolutions, made when first asked for by many rows."""

    division: Division
    scheme: Scheme
    made: dict[int, Pattern] = field(default_factory=dict)

    def pattern(self, resolution: int, rows: Array | None = None) -> Pattern:
        """All or some of the rows, by position, at a resolution."""
        count = len(self.division.rows)
        if rows is not None and len(rows) == count:
            rows = None
        if resolution not in self.made:
            if rows is not None and len(rows) < WORTH_ALL * count:
                return self.division.subset(rows).pattern(self.scheme, resolution)
            self.made[resolution] = self.division.pattern(self.scheme, resolution)
        whole = self.made[resolution]
        return whole if rows is None else whole.subset(rows)

    def segments(self, resolution: int) -> int:
        """Return the number of segments of a common period."""
        still = int(self.division.constant.sum())
        return (int(self.division.counts(resolution).sum()) - still) * self.scheme.exponentials + still

    @property
    def finest(self) -> int:
        """The last resolution of no more segments than memory allows for."""
        first, rows, n = self.segments(2), len(self.division.rows), self.division.elastic.static.shape[-1]
        most = max(MOST_SEGMENTS, MOST_ENTRIES // max(1, rows * n * n))
        return 2 + max(0, int(2 * np.log2(most / max(first, 1))))


@dataclass
class Estimates:
    """State of points ``(r, P)``.

    omega, decay, tolerance: what they are and how exactly they are wanted, see :func:`estimates`.
    growth, verdict: as of :class:`~gearstab.floquet.smooth.compare.KernelAnswer`. error: estimated, of the multipliers.
    rounding: the part of it that more steps would not lessen. changed: whether the verdict did at the last doubling.
    resolution: at which they were computed. changed includes points whose multipliers are as close as their error.
    """

    omega: Array
    decay: Array
    tolerance: float
    growth: Array
    verdict: Array
    error: Array
    rounding: Array
    changed: Array
    resolution: Array


def estimates(ladder: Ladder, omega: Array, decay: Array, tolerance: float, wanted: Array) -> Estimates:
    """All points ``(r, P)`` (mesh frequencies in the pattern's units) to a tolerance, where it can be reached.

    decay ``(r, P)``: uniform decay a period that the pattern does not contain. wanted ``(r, P)``: the resolutions to
    begin with, see :func:`first`.
    """
    shape = omega.shape
    found = Estimates(
        omega, decay, tolerance, np.full(shape, np.nan), np.zeros(shape, dtype=np.int8), np.full(shape, np.nan),
        np.zeros(shape), np.zeros(shape, dtype=bool), wanted.copy(),
    )  # fmt: skip
    last = np.minimum(found.resolution + FINEST, ladder.finest)
    control = StepControl(found.resolution, last, tolerance, ladder.scheme.order, doubling=2)
    for _, chosen in control:
        for rows, points, valid in rectangles(chosen):
            _improve(found, ladder, rows, points, valid)
        control.judge(found.error[chosen], found.rounding[chosen])
    return found


def _improve(found: Estimates, ladder: Ladder, rows: Array, points: Array, valid: Array) -> None:
    """Compute points, given as by :func:`rectangles`, at their resolution and note the results."""
    resolution = int(found.resolution[rows[0], points[0, 0]])
    place = rows[:, None], points
    patterns = [ladder.pattern(k, rows) for k in (resolution, resolution - 2)]
    fine, coarse = (scan(pattern, found.omega[place], found.tolerance >= INTERPOLATED) for pattern in patterns)
    safety = SAFETY * (LONG if resolution < SETTLED else 1.0)
    factor = safety * remainder(ladder.scheme.order)
    error, rounding, unusual = estimated(fine, coarse, found.decay[place], factor, valid)
    # Points that stand for missing ones repeat others of their row, with the same result.
    found.growth[place], found.error[place], found.rounding[place] = fine.growth, error, rounding
    if fine.verdict is not None and coarse.verdict is not None:
        changed = fine.verdict != coarse.verdict
        changed[unusual] |= colliding(fine.values[unusual], error[unusual])
        found.verdict[place], found.changed[place] = fine.verdict, changed


def estimated(
    fine: KernelAnswer, coarse: KernelAnswer, decay: Array, factor: float, valid: Array
) -> tuple[Array, Array, Array]:
    """(error estimate, the part of it that is rounding, whether multipliers differ by much more than is usual) of the
    points of ``fine``, ``(r, P)`` each.

    factor: the estimate over the difference.
    """
    change, rounding = difference(fine, coarse, decay)
    usual = _medians(change, valid)[:, None]
    # Where rounding errors are amplified both resolutions have their own, and differ by more than others do.
    usual_of_many = np.where(valid.sum(axis=1) < FEW, 0.0, 1.0)[:, None] * usual
    rounding = np.minimum(rounding, fine.rounding + 4 * np.maximum(change - 2 * usual_of_many, 0.0))
    unusual = change > 4 * usual_of_many
    change = np.maximum(change, USUAL * usual)
    return np.where(change > CRUDE, SAFETY, factor) * change + rounding, rounding, unusual


def _medians(values: Array, valid: Array) -> Array:
    """``(r,)``, of the valid ones of ``values (r, P)``, of which every row has one."""
    if not valid.all():
        # Sorted to the end, so that the middle of the others is where it would be without them.
        values = np.where(valid, values, np.inf)
    middle = (valid.sum(axis=1) - 1) // 2
    return np.asarray(np.sort(values, axis=1)[np.arange(len(values)), middle])


def first(ladder: Ladder, omega: Array, decay: Array, tolerance: float) -> tuple[Array, float]:
    """``(r, P)``, the resolution that each point is likely to need, from a few points of each row; and what resolution
    half of these would do with if it were not for their convergence.

    These are interpolated without their outliers: next to a boundary multipliers are badly conditioned, which is
    better left to the few points that it concerns.
    """
    if ladder.division.constant.all():
        return np.full(omega.shape, 2), 2.0
    place = _pilots(omega)
    least, wanted = _tried(ladder, omega[place], decay[place], tolerance)
    enough = float(np.median(wanted))
    least = np.minimum(least, _without_outliers(least) + 2)
    wanted = np.maximum(_without_outliers(wanted), least)
    result = np.empty(omega.shape, dtype=int)
    for r, own in enumerate(np.log(omega)):
        result[r] = np.ceil(np.interp(own, own[place[1][r]], wanted[r]))
    return np.clip(result, 2, ladder.finest), enough


def _tried(ladder: Ladder, omega: Array, decay: Array, tolerance: float) -> tuple[Array, Array]:
    """Return two resolutions for pilot points ``(r, k)``: the least one at which errors fall as they should, and the
    wanted one.

    Steps are doubled until the differences of two resolutions fall by CONVERGING 2^p at least: then an estimate from
    the coarser of them is above its error, which is about the next difference.
    """
    order = ladder.scheme.order
    least, wanted = np.full(omega.shape, float(ladder.finest)), np.full(omega.shape, float(ladder.finest))
    pending = np.ones(omega.shape, dtype=bool)
    before, change = scan(ladder.pattern(0), omega), np.full(omega.shape, np.nan)
    for resolution in range(2, ladder.finest + 1, 2):
        now, last = scan(ladder.pattern(resolution), omega), change
        change, noise = difference(now, before, decay)
        change, before = np.maximum(change, LEAST), now
        settled = (change <= noise) | (change <= NEGLIGIBLE * tolerance)
        sure = pending & ((last >= CONVERGING * 2**order * change) | settled)
        need = resolution + 2 / order * np.log2(SAFETY * remainder(order) * change / (AIM * tolerance))
        least[sure], wanted[sure] = max(resolution - 2, 2), need[sure]
        pending &= ~sure
        if not pending.any():
            break
    return least, wanted


def _without_outliers(values: Array) -> Array:
    """Running median of three along the columns ``(r, k)``; at the ends with a straight continuation."""
    if values.shape[1] < 3:
        return values
    before = np.concatenate([2 * values[:, 1:2] - values[:, 2:3], values[:, :-1]], axis=1)
    after = np.concatenate([values[:, 1:], 2 * values[:, -2:-1] - values[:, -3:-2]], axis=1)
    return np.asarray(np.median([before, values, after], axis=0))


def _pilots(omega: Array) -> tuple[Array, Array]:
    """(rows ``(r, 1)``, points ``(r, k)``): a few points of each row, by mesh frequency."""
    order = np.argsort(omega, axis=1, kind="stable")
    pick = np.unique(np.linspace(0, omega.shape[1] - 1, PILOTS).round().astype(int))
    return np.arange(len(omega))[:, None], order[:, pick]


def rectangles(chosen: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Points ``(r, P)`` bool as arrays for a kernel: rows ``(q,)``, points ``(q, c)``, which of these count ``(q, c)``.

    Rows with fewer points than others repeat one of theirs; rows of very different numbers come apart.
    """
    columns = chosen.any(axis=0)
    if not columns.any():
        return
    if chosen[:, columns].all():
        points = np.broadcast_to(np.flatnonzero(columns), (len(chosen), int(columns.sum())))
        yield np.arange(len(chosen)), points, np.ones(points.shape, dtype=bool)
        return
    count = chosen.sum(axis=1)
    size = np.ceil(np.log2(np.maximum(count, 1)) / ALIKE).astype(int)
    for key in np.unique(size[count > 0]):
        rows = np.flatnonzero((count > 0) & (size == key))
        width = int(count[rows].max())
        order = np.argsort(~chosen[rows], axis=1, kind="stable")[:, :width]
        valid = np.arange(width) < count[rows][:, None]
        yield rows, np.where(valid, order, order[:, :1]), valid
