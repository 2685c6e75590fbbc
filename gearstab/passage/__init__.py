"""Growth along paths of the mesh frequency: from the growth rate of every moment, and exactly.

Where a mode alone, or two of them, pass one region at a constant rate, the amplitude equations are those of Landau and
Zener with the sign of instability,

    a' = i r t a + c b,    b' = c a - i r t b.

From far before to far behind the region |a| + |b| grows by arccosh(exp g) e-folds, g = pi c^2/2r being the integral of
the growth rate: by up to ln 2 more than g. Between the best two moments, near its edges, it is more, see
:func:`excess`. Regions of different modes do not add, and those of the same modes may interfere. This is what the
stated error is made of.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from gearstab.floquet.boundaries import boundaries, union
from gearstab.passage.adiabatic import Gains, GrowthOverSpeed, gains, growth_over_speed
from gearstab.passage.propagator import MOST, FreeMotion, growth, motions, swing
from gearstab.perturbation.tongues import Tongue
from gearstab.propagation.path import Path
from gearstab.system import Array, GearSystem

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
