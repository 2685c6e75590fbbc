"""Instability regions of many systems over an operating range: exact, and to first order."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from gearstab.floquet.boundaries import boundaries
from gearstab.grouping import numbered
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order
from gearstab.system import Array, GearSystem

TOLERANCE, FLOOR = 1e-9, 1e-6
"""Tolerance of edges and floor of a region's width, relative to the mesh frequency."""
REACH = 0.5
"""How far beyond a range regions are looked for, in lengths of the range; not below half of its lower end."""
AT_LEAST = 0.25
"""The same in its upper end, for narrow ranges."""
MOST_HARMONICS = 8


@dataclass(frozen=True)
class DisjointRegions:
    """Disjoint regions ``(rows, K)`` by ascending mesh frequency, NaN where a row has fewer."""

    lower: Array
    upper: Array

    def width(self, low: float, high: float) -> Array:
        """``(rows,)``, how much of low .. high is unstable."""
        inside = np.minimum(self.upper, high) - np.maximum(self.lower, low)
        return np.asarray(np.nansum(np.maximum(inside, 0.0), axis=1))

    def distance(self, low: float, high: float) -> Array:
        """``(rows,)``, from low .. high to the nearest region, 0 where one reaches into it; infinite without any."""
        away = np.maximum(np.maximum(self.lower - high, low - self.upper), 0.0)
        return np.asarray(np.min(np.where(np.isnan(away), np.inf, away), axis=1, initial=np.inf))


def exact(
    system: GearSystem, low: float, high: float, tolerance: float = TOLERANCE, floor: float = FLOOR
) -> DisjointRegions:
    """Find all regions of all rows between two mesh frequencies by root finding on the Floquet problem."""
    found = boundaries(system, low, high, tolerance, floor)
    return _by_row(found.row, found.lower, found.upper, found.rows)


def _by_row(row: Array, lower: Array, upper: Array, rows: int) -> DisjointRegions:
    count = np.bincount(row, minlength=rows)
    _, place = numbered(count)
    edges = np.full((2, rows, max(1, int(count.max(initial=0)))), np.nan)
    order = np.lexsort((lower, row))
    edges[:, row[order], place] = lower[order], upper[order]
    return DisjointRegions(edges[0], edges[1])


def reach(low: float, high: float) -> tuple[float, float]:
    """The range within which regions outside of an operating range are looked for."""
    away = max(REACH * (high - low), AT_LEAST * high)
    return max(low - away, 0.5 * low), high + away


def harmonics(system: GearSystem, low: float) -> int:
    """Up to which harmonic of the meshes the sum of two natural frequencies can be met above ``low``."""
    fastest = float(np.nanmax(mean_modes(system).natural_frequency))
    slowest = min(float(ratio) for ratio in system.frequency_ratios)
    return int(np.clip(ceil(2 * fastest / (low * slowest)), 1, MOST_HARMONICS))


def predicted(system: GearSystem, low: float, high: float) -> DisjointRegions:
    """Predict the regions of all rows by first-order theory; united where they overlap."""
    near = reach(low, high)
    found = first_order(system, harmonics(system, near[0]))
    rows = system.rows
    edges = np.asarray(found.boundary_frequency).reshape(len(found.index), 2, rows)
    lower, upper = edges[:, 0].T, edges[:, 1].T
    open_ = (upper - lower > FLOOR * upper) & (upper > near[0]) & (lower < near[1])
    keep = open_.any(axis=0)
    return united(np.where(open_, lower, np.nan)[:, keep], np.where(open_, upper, np.nan)[:, keep])


def united(lower: Array, upper: Array) -> DisjointRegions:
    """Unite intervals ``(rows, K)`` that overlap; NaN for none."""
    order = np.argsort(lower, axis=1)
    lower, upper = np.take_along_axis(lower, order, 1), np.take_along_axis(upper, order, 1)
    furthest = np.fmax.accumulate(upper, axis=1)
    before = np.concatenate([np.full((len(lower), 1), -np.inf), furthest[:, :-1]], axis=1)
    # What an earlier interval covers is taken off; one that lies in it wholly is none.
    start = np.maximum(lower, np.minimum(before, upper))
    empty = ~(upper > start)
    return DisjointRegions(np.where(empty, np.nan, start), np.where(empty, np.nan, upper))
