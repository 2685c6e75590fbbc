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

from gearstab.floquet.magnus.compare import Scan, difference, scan
from gearstab.floquet.magnus.schemes import Scheme
from gearstab.floquet.magnus.steps import Division
from gearstab.floquet.segments import Pattern
from gearstab.system import Array

SAFETY = 10.0
"""Estimate over the error that a converged scheme would have."""
USUAL = 0.2
"""The least estimate, as a part of the median one."""
FINEST = 6
"""Resolutions tried beyond the first choice: a factor 8 in the number of steps."""
MOST_SEGMENTS = 2**16
"""Of a common period."""
PILOTS = 9
"""Points a row that are looked at first."""
LEAST = 1e-15
"""Smaller differences are rounding."""
RADIANS = 2.0
"""Of the fastest mode that a step takes at the resolution tried first."""
AIM = 0.5
"""The estimate aimed at, as a part of the tolerance."""


@dataclass
class Ladder:
    """Patterns of one division at all resolutions, made when first asked for."""

    division: Division
    scheme: Scheme
    made: dict[int, Pattern] = field(default_factory=dict)

    def pattern(self, resolution: int) -> Pattern:
        """All rows at a resolution."""
        if resolution not in self.made:
            self.made[resolution] = self.division.pattern(self.scheme, resolution)
        return self.made[resolution]

    def segments(self, resolution: int) -> int:
        """Of a common period."""
        still = int(self.division.constant.sum())
        return (int(self.division.counts(resolution).sum()) - still) * self.scheme.exponentials + still

    @property
    def finest(self) -> int:
        """The last resolution of at most MOST_SEGMENTS."""
        first = self.segments(2)
        return 2 + max(0, int(2 * np.log2(MOST_SEGMENTS / max(first, 1))))


@dataclass
class Estimates:
    """What is known of points ``(r, P)``.

    growth, verdict: as of :class:`~gearstab.floquet.magnus.compare.Scan`. error: estimated, of the multipliers.
    rounding: the part of it that more steps would not lessen. changed: whether the verdict did at the last doubling.
    resolution: at which they were computed.
    """

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
        np.full(shape, np.nan), np.zeros(shape, dtype=np.int8), np.full(shape, np.nan), np.zeros(shape),
        np.zeros(shape, dtype=bool), wanted.copy(),
    )  # fmt: skip
    last = np.minimum(found.resolution + FINEST, ladder.finest)
    pending = np.ones(shape, dtype=bool)
    while pending.any():
        current = int(found.resolution[pending].min())
        chosen = pending & (found.resolution == current)
        for rows, points, valid in rectangles(chosen):
            _improve(found, ladder, rows, points, valid, omega, decay)
        pending &= ~chosen
        error, rounding = found.error[chosen], found.rounding[chosen]
        # Where rounding has the last word more steps do not help.
        steps = _more(np.maximum(error - rounding, 0.0) / np.maximum(AIM * tolerance, rounding), ladder.scheme.order)
        again = (error > tolerance) & (error > 2 * rounding) & (found.resolution[chosen] < last[chosen])
        found.resolution[chosen] = np.minimum(current + np.where(again, np.maximum(steps, 1), 0), last[chosen])
        pending[chosen] = again
    return found


def _more(ratio: Array, order: int) -> Array:
    """Resolutions by which an error must fall by a factor ``ratio``."""
    with np.errstate(divide="ignore"):
        wanted = 2 * np.log2(ratio) / order
    return np.ceil(np.clip(np.nan_to_num(wanted, nan=1.0), -100, 100)).astype(int)


def _improve(
    found: Estimates, ladder: Ladder, rows: Array, points: Array, valid: Array, omega: Array, decay: Array
) -> None:
    """Compute points at their resolution and note the results."""
    resolution = int(found.resolution[rows[0], points[0, 0]])
    place = rows[:, None], points
    patterns = [ladder.pattern(k) for k in (resolution, resolution - 2)]
    if len(rows) < len(patterns[0].rows):
        patterns = [pattern.subset(rows) for pattern in patterns]
    fine, coarse = (scan(pattern, omega[place]) for pattern in patterns)
    error, rounding = estimated(fine, coarse, decay[place], ladder.scheme.order, valid)
    target = place[0].repeat(points.shape[1], axis=1)[valid], points[valid]
    found.growth[target], found.error[target], found.rounding[target] = (
        part[valid] for part in (fine.growth, error, rounding)
    )
    if fine.verdict is not None and coarse.verdict is not None:
        found.verdict[target] = fine.verdict[valid]
        found.changed[target] = (fine.verdict != coarse.verdict)[valid]


def estimated(fine: Scan, coarse: Scan, decay: Array, order: int, valid: Array) -> tuple[Array, Array]:
    """(error estimate, the part of it that is rounding) of the points of ``fine``, ``(r, P)`` each."""
    change, rounding = difference(fine, coarse, decay)
    usual = np.nanmedian(np.where(valid, change, np.nan), axis=1, keepdims=True)
    change = np.maximum(change, USUAL * usual)
    return SAFETY / (2**order - 1) * change + rounding, rounding


def first(ladder: Ladder, omega: Array, decay: Array, tolerance: float) -> Array:
    """``(r, P)``, the resolution that each point is likely to need, from a few points of each row.

    These are interpolated without their outliers: next to a boundary multipliers are badly conditioned, which is
    better left to the few points that it concerns.
    """
    if ladder.division.constant.all():
        return np.full(omega.shape, 2)
    order = ladder.scheme.order
    place = _pilots(omega)
    resolution = _countable(ladder, omega[place])
    wanted = np.empty(resolution.shape)
    for k in np.unique(resolution):
        column = (resolution == k).any(axis=0)
        part = place[0], place[1][:, column]
        fine, coarse = (scan(ladder.pattern(int(each)), omega[part]) for each in (k, k - 2))
        change = SAFETY / (2**order - 1) * np.maximum(difference(fine, coarse, decay[part])[0], LEAST)
        found = k + 2 / order * np.log2(change / (AIM * tolerance))
        wanted[:, column] = np.where(resolution[:, column] == k, found, wanted[:, column])
    wanted = _without_outliers(np.nan_to_num(wanted, nan=2.0))
    result = np.empty(omega.shape)
    for r, own in enumerate(np.log(omega)):
        result[r] = np.interp(own, own[place[1][r]], wanted[r])
    return np.clip(np.ceil(result), 2, ladder.finest).astype(int)


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


def _countable(ladder: Ladder, omega: Array) -> Array:
    """Resolutions at which a step takes about RADIANS of the fastest mode."""
    base = ladder.pattern(2)
    fastest = np.sqrt(np.abs(base.squared_frequency)).max(axis=(1, 2), initial=0.0)[:, None]
    steps = 2 * np.pi * base.cycles * fastest / omega / RADIANS
    wanted = 2 * np.log2(np.maximum(steps / max(1, int(ladder.division.counts(0).sum())), 1.0))
    return np.clip(np.ceil(wanted), 2, ladder.finest).astype(int)


def rectangles(chosen: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Points ``(r, P)`` bool as arrays for a kernel: rows ``(q,)``, points ``(q, c)``, which of these count ``(q, c)``.

    Rows with fewer points than others repeat one of theirs; rows of very different numbers come apart.
    """
    count = chosen.sum(axis=1)
    size = np.ceil(np.log2(np.maximum(count, 1))).astype(int)
    for key in np.unique(size[count > 0]):
        rows = np.flatnonzero((count > 0) & (size == key))
        width = int(count[rows].max())
        order = np.argsort(~chosen[rows], axis=1, kind="stable")[:, :width]
        valid = np.arange(width) < count[rows][:, None]
        yield rows, np.where(valid, order, order[:, :1]), valid
