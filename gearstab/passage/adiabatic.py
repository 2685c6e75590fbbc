"""E-folds from the growth rate at the mesh frequency of every moment, as if it changed infinitely slowly.

Between the edges of the instability regions the growth rate sigma is a smooth function of the mesh frequency, but for
roots at the edges: with Omega = middle + half-width sin(pi phi/2) it is one of phi, so that a Chebyshev series in phi
and its integral give S(Omega) = int sigma dOmega', and a path that changes by r per unit time has gained the
differences of S over r.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries
from gearstab.propagation.path import Path
from gearstab.system import Array, GearSystem

NODES = 33
"""Nodes of the series of an interval."""
BATCH = 1 << 18
"""Points that are solved together."""


@dataclass(frozen=True)
class GrowthOverSpeed:
    """One row: the growth rate between the least and the greatest mesh frequency.

    edges ``(K + 1,)``: of the regions and of the gaps between them. region ``(K,)``: number of the region among those
    of all rows, -1 for a gap. series ``(NODES + 1, K)``: of S in each interval, from its beginning on. error ``(K,)``:
    estimated one of the integral over each. peak, at ``(K,)``: the largest growth rate of each and where it is.
    """

    edges: Array
    region: Array
    series: Array
    error: Array
    peak: Array
    at: Array

    @property
    def gained(self) -> Array:
        """``(K,)``, the integral of the growth rate over each interval."""
        return np.asarray(self.series.sum(axis=0))

    def integral(self, interval: Array, mesh_frequency: Array) -> Array:
        """Return S at mesh frequencies ``(X,)`` of given intervals ``(X,)``, from the beginning of each."""
        low, high = self.edges[interval], self.edges[interval + 1]
        sine = np.clip((2 * mesh_frequency - low - high) / (high - low), -1.0, 1.0)
        phi = np.arcsin(sine) * 2 / np.pi
        return np.asarray(chebyshev.chebval(phi, self.series[:, interval], tensor=False))

    def rate_at(self, interval: int, mesh_frequency: float) -> float:
        """Return the growth rate itself."""
        low, high = self.edges[interval], self.edges[interval + 1]
        sine = np.clip((2 * mesh_frequency - low - high) / (high - low), -1 + 1e-12, 1 - 1e-12)
        slope = chebyshev.chebval(np.arcsin(sine) * 2 / np.pi, chebyshev.chebder(self.series[:, interval]))
        return float(slope / (np.cos(np.arcsin(sine)) * 0.5 * (high - low) * np.pi / 2))


def growth_over_speed(system: GearSystem, found: Boundaries, tolerance: float) -> list[GrowthOverSpeed]:
    """Compute the growth rate of all rows between the limits of their boundaries."""
    low, high = found.limits
    rows = []
    for row in range(found.rows):
        own = np.flatnonzero(found.row == row)
        edges = np.unique(np.concatenate([found.limits, found.lower[own], found.upper[own]]))
        middle = 0.5 * (edges[1:] + edges[:-1])[:, None]
        k, which = np.nonzero((found.lower[own] < middle) & (middle < found.upper[own]))
        region = np.full(len(middle), -1)
        region[k] = own[which]
        rows.append((edges, region))
    nodes = chebyshev.chebpts1(NODES)
    count = max(len(region) for _, region in rows)
    omega = np.full((len(rows), count, NODES), 0.5 * (low + high))
    for row, (ends, region_of) in enumerate(rows):
        middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * np.diff(ends)
        omega[row, : len(region_of)] = middle[:, None] + half[:, None] * np.sin(0.5 * np.pi * nodes)
    rate = _rates(system, omega.reshape(len(rows), -1), tolerance).reshape(omega.shape)
    return [
        _row(ends, region_of, omega[row, : len(region_of)], rate[row, : len(region_of)], nodes)
        for row, (ends, region_of) in enumerate(rows)
    ]


def _rates(system: GearSystem, omega: Array, tolerance: float) -> Array:
    whole = system.over(system.batch)
    step = max(1, BATCH // len(omega))
    parts = [solve(whole, omega[:, k : k + step], tolerance=tolerance) for k in range(0, omega.shape[1], step)]
    return np.concatenate([part.growth_rate for part in parts], axis=1)


def _row(edges: Array, region: Array, omega: Array, rate: Array, nodes: Array) -> GrowthOverSpeed:
    half = 0.5 * np.diff(edges)[:, None]
    values = rate * half * np.cos(0.5 * np.pi * nodes) * 0.5 * np.pi
    transform = chebyshev.chebvander(nodes, NODES - 1) * (2 / NODES)
    transform[:, 0] *= 0.5
    coefficients = transform.T @ values.T
    series = chebyshev.chebint(coefficients, lbnd=-1, axis=0)
    # Odd functions integrate to nothing: the last six coefficients bound what the next ones would add.
    error = np.abs(coefficients[-6:]).sum(axis=0)
    best = rate.argmax(axis=1)
    along = np.arange(len(region))
    return GrowthOverSpeed(edges, region, series, error, rate[along, best], omega[along, best])


@dataclass(frozen=True)
class Gains:
    """Gains along a path, pieces in the order of time, in e-folds. region: as in GrowthOverSpeed."""

    region: Array
    gain: Array
    error: Array

    def largest(self) -> tuple[float, int, int]:
        """The largest sum of gains of pieces i to j - 1, and i, j: between any two moments."""
        total = np.append(0.0, np.cumsum(self.gain))
        rise = total - np.minimum.accumulate(total)
        end = int(rise.argmax())
        return float(rise[end]), int(total[: end + 1].argmin()), end


def gains(over: GrowthOverSpeed, path: Path) -> Gains:
    """Follow a path through the intervals of a row."""
    region, gain, error = [], [], []
    for k, rate in enumerate(path.rate):
        first, last = float(path.mesh_frequency[k]), float(path.mesh_frequency[k + 1])
        if rate == 0:
            place = _interval(over, first)
            duration = float(path.time[k + 1] - path.time[k])
            region.append(over.region[place])
            gain.append(over.rate_at(place, first) * duration)
            error.append(0.0)
            continue
        low, high = min(first, last), max(first, last)
        inner = over.edges[(over.edges > low) & (over.edges < high)]
        stops = np.concatenate([[low], inner, [high]])
        places = np.array([_interval(over, 0.5 * (a + b)) for a, b in pairwise(stops)])
        found = (over.integral(places, stops[1:]) - over.integral(places, stops[:-1])) / abs(rate)
        order = slice(None) if last > first else slice(None, None, -1)
        region += list(over.region[places][order])
        gain += list(found[order])
        error += list((over.error[places] / abs(rate))[order])
    return Gains(np.array(region, dtype=int), np.array(gain), np.array(error))


def _interval(over: GrowthOverSpeed, mesh_frequency: float) -> int:
    return int(np.clip(np.searchsorted(over.edges, mesh_frequency, side="right") - 1, 0, len(over.region) - 1))
