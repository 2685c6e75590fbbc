"""Edges of all instability regions of a (batched) gear system along the mesh frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearstab.floquet.boundaries import damped, labels
from gearstab.floquet.boundaries.labels import Unnamed
from gearstab.floquet.boundaries.regions import Boundaries, tongue_of
from gearstab.floquet.boundaries.search import Interval, Search, search
from gearstab.floquet.segments import Pattern, prepare
from gearstab.modal import mean_modes
from gearstab.perturbation.tongues import Tongue
from gearstab.system import Array, GearSystem

ASIDE = 0.03
"""Points near the edges of merged regions at which their tongues are looked for, as a part of the width."""


def boundaries(
    system: GearSystem, start: float, stop: float, tolerance: float = 1e-10, width_floor: float = 1e-6
) -> Boundaries:
    """All instability regions between the mesh frequencies ``start`` and ``stop`` of the first mesh.

    Conservative rows: no region wider than ``width_floor`` is missed, by an integer count of the collisions of multipliers
    (:mod:`~gearstab.floquet.boundaries.krein`). Edges lie in brackets between a stable and an unstable point. Damped rows: the
    zeros of the growth rate, looked for in and around the regions of the same system without damping and on a scan uniform in
    the period (:mod:`~gearstab.floquet.boundaries.damped`); a region of which the scan and the undamped tongues give no hint would be missed.

    Parameters
    ----------
    system: any batch shape; rows of the result are those of the flattened batch.
    start, stop: range of Omega, rad per unit time, 0 < start < stop.
    tolerance, width_floor: of the edges and of a region, relative to Omega. Below 1e-13 rounding has the last word.

    Raises
    ------
    ValueError: an empty range, or a tolerance or floor that is not positive.
    """
    if not 0 < start < stop < np.inf:
        raise ValueError(f"mesh frequencies must satisfy 0 < start < stop, not {start}, {stop}")
    if not (tolerance > 0 and width_floor > 0):
        raise ValueError(f"tolerance and width floor must be positive, not {tolerance}, {width_floor}")
    rows = int(np.prod(system.batch, dtype=int))
    found = _Collected(system, start, stop, width_floor)
    if system.damping is None:
        for pattern in prepare(system):
            found.add(pattern, pattern, _undamped(pattern, start, stop, tolerance, width_floor))
        return found.result(rows)
    for pattern, guide in _guided(system):
        found.add(pattern, guide, damped.search(pattern, guide, *_range(pattern, start, stop), tolerance, width_floor))
    return found.result(rows)


def _range(pattern: Pattern, start: float, stop: float) -> tuple[Array, Array]:
    """Cycles 1/Omega in the pattern's units, from the highest to the lowest mesh frequency."""
    return pattern.elastic.rate / stop, pattern.elastic.rate / start


def _undamped(pattern: Pattern, start: float, stop: float, tolerance: float, floor: float) -> Search:
    return search(pattern, *_range(pattern, start, stop), tolerance, floor)


def _guided(system: GearSystem) -> list[tuple[Pattern, Pattern]]:
    """Patterns of a damped system and, row by row, those of the system without its damping."""
    free = replace(system, damping=None)
    pairs = []
    plain = prepare(free)
    for pattern in prepare(system):
        for guide in plain:
            common = np.intersect1d(pattern.rows, guide.rows)
            if len(common):
                pairs.append((_only(pattern, common), _only(guide, common)))
    return pairs


def _only(pattern: Pattern, rows: Array) -> Pattern:
    """The given ones of a pattern's rows."""
    k = np.searchsorted(pattern.rows, rows)
    return replace(
        pattern,
        rows=rows,
        fractions=pattern.fractions[k],
        start=pattern.start[k],
        levels=pattern.levels[k],
        elastic=pattern.elastic.subset(k),
        stiffness=pattern.stiffness[k],
    )


@dataclass
class _Collected:
    """Regions of all rows, gathered pattern by pattern."""

    system: GearSystem
    start: float
    stop: float
    floor: float

    def __post_init__(self) -> None:
        rows = int(np.prod(self.system.batch, dtype=int))
        self.regions: list[tuple[int, float, float, float, tuple[bool, bool], tuple[Tongue, ...]]] = []
        self.contacts, self.evaluations = np.zeros((2, rows), dtype=np.int64)
        modes = mean_modes(self.system)
        n = self.system.size
        self.squared = np.broadcast_to(modes.squared_frequency, (*self.system.batch, n)).reshape(rows, n)
        self.period = self.system.common_period()[0]
        self.tongues: dict[tuple[int, int, int], Tongue] = {}

    def add(self, pattern: Pattern, guide: Pattern, found: Search) -> None:
        """Name the regions of a pattern by the undamped solutions of ``guide`` and keep them."""
        self.contacts[pattern.rows] += found.contacts
        self.evaluations[pattern.rows] += found.evaluations
        unnamed, extra = _unnamed(guide, found.intervals)
        self.evaluations[pattern.rows] += extra
        rate = pattern.elastic.rate
        for k, row in enumerate(pattern.rows):
            mine = [(i, u) for i, u in zip(found.intervals, unnamed, strict=True) if i.row == k]
            mine.reverse()
            if not mine:
                continue
            numbers = self._modes(int(row), pattern.size)
            frequency = np.sqrt(np.maximum(self.squared[row, numbers], 0.0)) / rate[k]
            names = labels.assign([u for _, u in mine], frequency, pattern.cycles, once=pattern is guide)
            for (interval, _), roots in zip(mine, names, strict=True):
                self._keep(int(row), rate[k], interval, tuple(self._tongue(r, numbers) for r in roots))

    def _modes(self, row: int, elastic: int) -> Array:
        """Numbers from 0 of the elastic modes: rigid ones come between negative and positive squared frequencies."""
        below = int((self.squared[row] < 0).sum())
        rigid = self.system.size - elastic
        return np.array([k for k in range(self.system.size) if not below <= k < below + rigid])

    def _tongue(self, root: labels.Root, numbers: Array) -> Tongue:
        key = int(numbers[root.p]) + 1, int(numbers[root.q]) + 1, root.cycles
        if key not in self.tongues:
            self.tongues[key] = tongue_of(self.system, key[0], key[1], Fraction(root.cycles) / self.period)
        return self.tongues[key]

    def _keep(self, row: int, rate: float, interval: Interval, members: tuple[Tongue, ...]) -> None:
        error = 0.5 * max(interval.error[0] / interval.start, interval.error[1] / interval.stop)
        lower, upper = rate / interval.stop, rate / interval.start
        cut_upper, cut_lower = interval.cut
        # The ends of the range itself, not what two divisions make of them.
        lower, upper = (self.start if cut_lower else lower), (self.stop if cut_upper else upper)
        self.regions.append((row, lower, upper, error, (cut_lower, cut_upper), members))

    def result(self, rows: int) -> Boundaries:
        """Everything, by row and mesh frequency."""
        self.regions.sort(key=lambda r: r[:2])
        row, lower, upper, error, cut, members = zip(*self.regions, strict=True) if self.regions else [()] * 6
        return Boundaries(
            rows,
            np.array(row, dtype=int),
            np.array(lower, dtype=float),
            np.array(upper, dtype=float),
            np.array(error, dtype=float),
            np.array(cut, dtype=bool).reshape(-1, 2),
            tuple(members),
            self.contacts,
            self.evaluations,
            self.floor,
        )


def _unnamed(guide: Pattern, intervals: list[Interval]) -> tuple[list[Unnamed], Array]:
    """Look for the unstable solutions inside each region: in the middle, and near both edges of one that may hold several
    tongues. Also the number of evaluations of each row."""
    owner, cycle = [], []
    for k, i in enumerate(intervals):
        single = sum(i.meetings) <= 1 and not any(i.cut)
        aside = [] if single else [i.start + ASIDE * (i.stop - i.start), i.stop - ASIDE * (i.stop - i.start)]
        for point in [i.probe, *aside]:
            owner.append(k)
            cycle.append(point)
    row = np.array([intervals[k].row for k in owner], dtype=int)
    parts = labels.shares(guide, row, np.array(cycle)) if owner else []
    shares: list[labels.Shares] = [{} for _ in intervals]
    for k, part in zip(owner, parts, strict=True):
        for root, share in part.items():
            shares[k][root] = max(share, shares[k].get(root, 0.0))
    result = [
        Unnamed(i.probe, s, i.meetings if not any(i.cut) else (0, 0, 0)) for i, s in zip(intervals, shares, strict=True)
    ]
    return result, np.bincount(row, minlength=len(guide.rows))
