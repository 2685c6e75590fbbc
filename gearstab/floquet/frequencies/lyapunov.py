"""The largest Lyapunov exponent: what the growth rate becomes where mesh frequencies have no (short) common period.

    lambda = lim_(t -> inf) ln |x(t)| / t        for almost every start x(0)

is the largest real part of the characteristic exponents where there is a common period, and exists as well where there
is none (Oseledets 1968). A frame of start vectors is carried through the exact propagators between the switching times
of all meshes and made orthonormal again and again (Benettin et al. 1980). The increments of ln |x| are averaged with
the weight

    exp(-1/(s (1 - s))),   s = t/T in (0, 1),

which for quasi-periodic motion converges faster than any power of 1/T instead of as 1/T (Das, Saiki, Sander & Yorke
2017). The same average over each of BATCHES equal parts of the window gives the confidence interval (batch means).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from gearstab.floquet.frequencies.propagation import growths, windows
from gearstab.floquet.kernel import damped
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import Pattern, window
from gearstab.floquet.segments.reduction import Elastic
from gearstab.floquet.smooth.steps import CF6_5
from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability
from gearstab.propagation.magnus import StepControl
from gearstab.system import ONLY_MESHES, Array, GearSystem, require

BURN_IN = 0.21421356
"""Part of the window in which the vectors turn towards the fastest solution; it does not count. Parts of what is left
are no whole numbers of periods, which would make all batches alike."""
BATCHES = 16
RECORDS = 16
"""Records of the size, in a part of the window as long as a batch."""
RECORDED = round(BATCHES * RECORDS / (1 - BURN_IN))
DRIFTS = 2.0
"""Where ln |x| approaches lambda t + ln t, as with a defective multiplier, the halves differ by 3/4 of the error."""
SEPARATE = 10.0
"""Growths a window that differ by this are told apart."""
RESOLUTION = 0.5
"""Change of a solution's size that may stay hidden, over the length of the window: a change by a factor of 1.6."""
FEWEST_STEPS, DOUBLINGS = 8, 4
"""Magnus steps per period of the fastest mesh, and how often they are doubled at most."""
POINTS_AT_ONCE = 2048
"""Mesh frequencies carried side by side."""


def solve(
    system: GearSystem, mesh_frequency: Array, cycles: float = 500, confidence: float = 0.95, seed: int = 0
) -> FloquetStability:
    """The largest Lyapunov exponent of every row of a system at every mesh frequency of the first mesh.

    A conservative row cannot decay: it counts as stable, with growth rate 0, where its growth is within the interval.
    A damped one is decided by the sign of the estimate; where the interval contains 0 the status says ``undecided``.

    Parameters
    ----------
    system: any batch shape; ratios of the mesh frequencies as they are, rational or not.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``.
    cycles: length of the window in periods of the slowest mesh.
    confidence: of the interval.
    seed: of the start vectors.

    Stiffness that is not piecewise constant is cut into Magnus steps, twice as many again and again until the results
    agree within the interval, of which their difference is a part (:mod:`~gearstab.floquet.frequencies.propagation`).

    Raises ValueError for a system that has periodic terms besides its meshes.
    """
    require(system, ONLY_MESHES, "theory of Lyapunov exponents")
    omega = system.operating_points(mesh_frequency)
    growth, upper, lower = (np.full(omega.shape, -np.inf) for _ in range(3))
    status = np.zeros(omega.shape, dtype=np.int16)
    conservative = np.ones((system.rows, 1), dtype=bool)
    settings = (confidence, seed)
    found = (_piecewise if system.piecewise_constant else _smooth)(system, length(system, cycles), omega, settings)
    for row, elastic, negative, value, half in found:
        conservative[row] = not elastic.damped[0]
        by_itself = elastic.rigid_growth[0]
        for total, one in ((growth, value), (upper, value + half), (lower, value - half)):
            total[row] = np.maximum(total[row], np.maximum(one, by_itself))
        status[row] |= STATUS_FLAGS["negative_stiffness"] * negative
    return _decided(growth, upper, lower, status, conservative)


_Row = tuple[int, Elastic, bool, Array, Array]
"""row, its coordinates, whether a stiffness is negative, growth rates and half-widths of their intervals."""


def _piecewise(system: GearSystem, cycles: float, omega: Array, settings: tuple[float, int]) -> Iterator[_Row]:
    """All rows of all blocks of a piecewise constant system."""
    for pattern in window(system, cycles):
        for block in split(pattern):
            for r, row in enumerate(block.pattern.rows):
                part = block.pattern.row(r)
                negative = bool(np.any(part.stiffness_below_zero))
                yield row, part.elastic, negative, *_exponents(part, block.constant, omega[row], settings)


def _smooth(system: GearSystem, cycles: float, omega: Array, settings: tuple[float, int]) -> Iterator[_Row]:
    """All rows of any system without periodic terms."""
    for part in windows(system, cycles):
        pattern, own = part.pattern(FEWEST_STEPS), omega[part.row]
        constant = bool(np.all(pattern.levels == pattern.levels[:, :1]))
        negative = bool(np.any(pattern.stiffness_below_zero))
        found = {0: _exponents(pattern, constant, own, settings)}
        control = StepControl(np.array([1]), DOUBLINGS, 1.0, CF6_5.order)
        for level, _ in control:
            for k in (level - 1, level):
                found[k] = found.get(k) or _exponents(part.pattern(FEWEST_STEPS * 2**k), constant, own, settings)
            (before, _), (value, half) = found[level - 1], found[level]
            error = np.abs(value - before)
            with np.errstate(over="ignore"):
                control.judge(np.max(error / np.maximum(half, np.finfo(float).tiny)))
        yield part.row, part.elastic, negative, value, np.maximum(half, error)


def length(system: GearSystem, cycles: float) -> float:
    """The window in periods 2 pi/Omega: ``cycles`` periods of the slowest mesh."""
    return cycles / min(float(ratio) for ratio in system.frequency_ratios)


def _decided(growth: Array, upper: Array, lower: Array, status: Array, conservative: Array) -> FloquetStability:
    failed = ~np.isfinite(growth)
    interval = np.maximum(upper - growth, growth - lower)
    still = conservative & (lower <= 0)
    growth = np.where(still, 0.0, growth)
    stable = (growth <= 0).astype(np.int8)
    status |= STATUS_FLAGS["lyapunov"]
    status[~conservative & (np.abs(growth) <= interval)] |= STATUS_FLAGS["undecided"]
    stable[failed] = -1
    status[failed] |= STATUS_FLAGS["failed"]
    growth[failed], interval[failed] = np.nan, np.nan
    return FloquetStability(growth, stable, status, interval=interval)


def _exponents(pattern: Pattern, constant: bool, omega: Array, settings: tuple[float, int]) -> tuple[Array, Array]:
    """(growth rate, half-width) ``(P,)`` of a pattern of one row, in the system's own units of time."""
    elastic, (confidence, seed) = pattern.elastic, settings
    rate, shift = float(elastic.rate[0]), float(elastic.shift[0])
    if pattern.size == 0 or constant:
        value = _constant(pattern)
        return np.full(omega.shape, rate * value), np.zeros(omega.shape)
    found = np.empty((2, len(omega)))
    for i in range(0, len(omega), POINTS_AT_ONCE):
        part = slice(i, i + POINTS_AT_ONCE)
        own = omega[part] / rate
        times, logs = growths(pattern, own, RECORDED, seed)
        found[:, part] = estimate(
            times[:, None] * 2 * np.pi * pattern.cycles / own, logs, confidence, elastic.conservative
        )
    # The growth of a conservative system, before any uniform damping, is never negative.
    if elastic.conservative:
        found[0] = np.where(found[0] <= found[1], 0.0, found[0])
    return rate * (found[0] - shift), rate * found[1]


def _constant(pattern: Pattern) -> float:
    """The growth rate of a block whose stiffness does not vary; that of no coordinates is -inf."""
    if not pattern.elastic.conservative:
        return float(damped.generators(pattern).eigen[0].real.max(initial=-np.inf))
    if pattern.size == 0:
        return -np.inf
    unstable = np.sqrt(np.maximum(-pattern.squared_frequency, 0.0)).max()
    return float(unstable - pattern.elastic.shift[0])


def estimate(times: Array, logs: Array, confidence: float, conservative: bool) -> Array:
    """``(2, P)``: the exponent and the half-width of its interval.

    times: ``(R + 1, P)``, over the whole window, the burn-in included. logs: ``(R + 1, k + 1, P)``, ln of the growths.
        The one of the largest average counts: while they have not converged they are too small. Without damping it is
        the last one, as nothing that has grown decays.

    The half-width is the largest of three: Student's for the means of the batches; DRIFTS times the distance between
    the two halves of the window, for vectors that are still turning; and the distance to a cruder average. Where a
    third direction grows nearly as fast (two may be the real and imaginary part of one solution) it is at least what
    a window of this length can tell apart.
    """
    from scipy.special import stdtrit  # takes longer to load than a small sweep to run

    times = times[:, None]
    begin, end = times[0] + BURN_IN * (times[-1] - times[0]), times[-1]
    edges = begin + (end - begin) * np.linspace(0.0, 1.0, BATCHES + 1)[:, None, None]
    means = np.stack([average(times, logs, a, b) for a, b in pairwise(edges)])
    value = average(times, logs, begin, end)
    middle = 0.5 * (begin + end)
    drift = np.abs(average(times, logs, begin, middle) - average(times, logs, middle, end))
    spread = means.std(axis=0, ddof=1) / np.sqrt(BATCHES) * stdtrit(BATCHES - 1, 0.5 + confidence / 2)
    other = np.abs(value - average(times, logs, begin, end, hann))
    half = np.max([spread, DRIFTS * drift, other], axis=0)
    largest = np.argmax(value[-1:] if conservative else value, axis=0)[None]
    found, width = (
        np.take_along_axis(part[-1:] if conservative else part, largest, axis=0)[0] for part in (value, half)
    )
    span = (end - begin)[0]
    directions = np.sort(value[:-1], axis=0)[::-1]
    close = (found - directions[2]) * span < SEPARATE if len(directions) > 2 else np.zeros(found.shape, dtype=bool)
    return np.stack([found, np.where(close, np.maximum(width, RESOLUTION / span), width)])


def bump(s: Array) -> Array:
    """exp(-1/(s (1 - s)))."""
    return np.exp(-1 / (s * (1 - s)))


def hann(s: Array) -> Array:
    """sin^2(pi s), whose averages converge as 1/T^3 only."""
    return np.sin(np.pi * s) ** 2


def average(times: Array, logs: Array, begin: Array, end: Array, shape: Callable[[Array], Array] = bump) -> Array:
    """``(k, P)``, the weighted means of d ln|x|/dt between two times ``(1, P)``."""
    s = (0.5 * (times[1:] + times[:-1]) - begin) / (end - begin)
    inside = (s > 0) & (s < 1)
    weight = np.where(inside, shape(np.where(inside, s, 0.5)), 0.0)
    return np.asarray((weight * np.diff(logs, axis=0)).sum(axis=0) / (weight * np.diff(times, axis=0)).sum(axis=0))
