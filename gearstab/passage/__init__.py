"""Growth along paths of the mesh frequency: from the growth rate of every moment, and exactly.

Where a mode alone, or two of them, pass one region at a constant rate, the amplitude equations are those of Landau and
Zener with the sign of instability,

    a' = i r t a + c b,    b' = c a - i r t b.

From far before to far behind the region |a| + |b| grows by arccosh(exp g) e-folds, g = pi c^2/2r being the integral of
the growth rate: by up to ln 2 more than g. Between the best two moments, near its edges, it is more, see
:func:`excess`. Regions of different modes do not add, and those of the same modes may interfere. This is what the
stated error is made of.

**From the growth rate** at the mesh frequency of every moment, as if it changed infinitely slowly: between the edges of
the instability regions it, sigma, is a smooth function of the mesh frequency, but for roots at the edges. With Omega =
middle + half-width sin(pi phi/2) it is one of phi, so that a Chebyshev series in phi and its integral give S(Omega) =
int sigma dOmega', and a path that changes by r per unit time has gained the differences of S over r.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries, union
from gearstab.passage.propagator import MOST, FreeMotion, growth, motions, swing
from gearstab.perturbation.tongues import Tongue
from gearstab.propagation.path import Path
from gearstab.system import Array, GearSystem

NODES = 33
"""Nodes of the series of an interval."""
BATCH = 1 << 18
"""Points that are solved together."""
STATUS_FLAGS = {"too_long": 1, "failed": 2, "rounding": 4, "sampled": 8, "coarse": 16}
"""The exact motion was not followed, as the path has too many segments; the growth rate could not be computed; motions
grow so much that rounding errors become as large as them; regions were looked for by samples where two multipliers
meet; or in equal steps only, so that narrower ones may be missing."""


MOST_GROWTH = 30.0
"""E-folds beyond which what rounding leaves of a motion that has decayed may be what grows in the next region."""
MOST_SEARCHED = 400_000
"""Segments of the slowest ramp that is followed in search of the slowest rate: some ten of them are."""
FASTER, MOST_STEPS = 1.6, 12
ACCURACY = 1e-3
"""Tolerance of the slowest rate: far below what an amplification needs to be known to."""


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


def passage(
    system: GearSystem,
    paths: list[Path],
    amplification: float,
    rates: Array,
    tolerance: float,
    floor: float,
    regions: bool = True,
) -> tuple[dict[str, Array], tuple[tuple[Tongue, int], ...]]:
    """Return the variables of the group ``passage`` of all rows, and the regions.

    amplification: of the amplitude, that the slowest rate admits. rates ``(R,)``: of the paths, for that.
    regions: whether they are looked for; without, all that comes from growth rates is NaN.
    """
    index: tuple[tuple[Tongue, int], ...] = ()
    over: list[GrowthOverSpeed] = []
    of_region = np.empty(0, dtype=int)
    if regions:
        ends = [end for path in paths for end in path.range]
        found = boundaries(system, min(ends), max(ends), tolerance, floor)
        keys = found.leading()
        index = union([keys])
        place = {key: k for k, key in enumerate(index)}
        of_region = np.array([place[key] for key in keys], dtype=int)
        over = growth_over_speed(system, found, 1e-9)
    shape = (system.rows, len(paths))
    names = ("growth", "growth_exact", "growth_error", "growth_through")
    values: dict[str, Array] = {name: np.full(shape, np.nan) for name in names}
    values["status"] = np.zeros(shape, dtype=np.int16)
    values["growth_by_tongue"] = np.full((len(index), *shape), np.nan)
    values["slowest_rate"] = np.full(shape[0], np.nan)
    values["slowest_rate_exact"] = np.full(shape[0], np.nan)
    for name in ("dwell_frequency", "dwell_growth_rate"):
        values[name] = np.full((len(index), shape[0]), np.nan)
    for row, motion in enumerate(motions(system)):
        if regions:
            _dwelling(values, row, over[row], of_region)
        for k, path in enumerate(paths):
            if regions:
                _adiabatic(values, row, k, gains(over[row], path), of_region, swing(motion, path))
            if motion.segments(path) > MOST:
                values["status"][row, k] |= STATUS_FLAGS["too_long"]
                continue
            exact = growth(motion, path)
            values["growth_exact"][row, k], values["growth_through"][row, k] = exact.largest, exact.through
            if exact.largest > MOST_GROWTH:
                values["status"][row, k] |= STATUS_FLAGS["rounding"]
        if not regions:
            continue
        if found.sampled_step[row] > 0:
            values["status"][row] |= STATUS_FLAGS["coarse" if found.coarse[row] else "sampled"]
        failed = ~np.isfinite(values["growth"][row])
        values["status"][row, failed] |= STATUS_FLAGS["failed"]
        values["slowest_rate"][row] = np.abs(rates[0]) * values["growth"][row, 0] / np.log(amplification)
        if len(paths[0].rate) == 1:
            part = values["growth"][row, 0] / np.log(amplification)
            values["slowest_rate_exact"][row] = np.abs(rates[0]) * _slowest(motion, paths[0], amplification, part)
    return values, index


def _slowest(motion: FreeMotion, ramp: Path, amplification: float, start: float) -> float:
    """Return the rate at which the exact motion gains the amplification and no more, over that of a ramp.

    Between the best two moments of slower ramps it gains more. As regions of the same modes interfere, growth is no
    monotonic function of the rate: the crossing found is the first one below rates that pass.

    start: what the growth rate alone says, 0 where nothing grows. NaN where the ramp has too many segments.
    """
    from scipy.optimize import brentq

    if start <= 0:
        return 0.0 if swing(motion, ramp) < np.log(amplification) else np.nan
    rate, (low, high) = float(ramp.rate[0]), ramp.range

    @cache
    def beyond(inverse: float) -> float:
        """E-folds over those admitted, by 1/rate, in which growth is nearly linear."""
        path = Path.ramp(low, high, rate / inverse)
        if motion.segments(path) > MOST_SEARCHED:
            return np.nan
        return growth(motion, path).largest - float(np.log(amplification))

    inverse = 1 / start
    step = 1 / FASTER if beyond(inverse) > 0 else FASTER
    for _ in range(MOST_STEPS):
        following = inverse * step
        if not beyond(following) * beyond(inverse) > 0:
            break
        inverse = following
    if not beyond(inverse) * beyond(following) <= 0:
        return np.nan
    return float(1 / brentq(beyond, inverse, following, rtol=ACCURACY))


def excess(gain: Array) -> Array:
    """Return by how much more a region is passed, between the best two moments, than the growth rate says, at most.

    Numerical solutions of the amplitude equations for g from 0.001 to 100 give 1.86 sqrt(g) below 0.01, 1.11 at 1 and
    ln 2 + (ln g + 0.8)/3 far above; this is no less, and at most 0.12 more.
    """
    g = np.maximum(gain, 0.0)
    return np.asarray(np.minimum(1.9 * np.sqrt(g), np.log(2.0) + np.log1p(2.6 * g) / 3))


def _adiabatic(values: dict[str, Array], row: int, k: int, along: Gains, of_region: Array, jump: float) -> None:
    """Return the growth of one row and path by the growth rate, and its error.

    jump: e-folds by which the energy changes with the mesh stiffness alone.
    """
    total, begin, end = along.largest()
    values["growth"][row, k] = total
    regions = along.region >= 0
    values["growth_by_tongue"][of_region[along.region[regions]], row, k] = 0.0
    np.add.at(values["growth_by_tongue"][:, row, k], of_region[along.region[regions]], along.gain[regions])
    more = np.where(regions, along.gain + excess(along.gain), along.gain)
    highest = Gains(along.region, more, along.error).largest()[0] + jump
    lowest = max(float(along.gain[regions].max(initial=0.0)) - jump, 0.0)
    rough = float(along.error[begin:end].sum())
    values["growth_error"][row, k] = max(highest - total, total - lowest) + rough


def _dwelling(values: dict[str, Array], row: int, over: GrowthOverSpeed, of_region: Array) -> None:
    """Where in each region motions grow fastest."""
    for k in np.flatnonzero(over.region >= 0):
        tongue = of_region[over.region[k]]
        values["dwell_frequency"][tongue, row] = over.at[k]
        values["dwell_growth_rate"][tongue, row] = over.peak[k]
