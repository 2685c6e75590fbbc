"""Estimates from samples: a probability with its interval, and the Sobol indices of the parameters."""

from __future__ import annotations

import numpy as np

from gearstab.system import Array
from gearstab.tolerance import SCRAMBLES, SamplingDesign

CONFIDENCE = 0.95
SAME = 1e-6
"""Chances that differ by no more than that are equal."""
LEAST_VARIANCE = 0.02
"""Least variance p (1 - p) of instability with probability p: where it is less, Sobol indices are a quotient of noise.
"""


def probability(unstable: Array, failed: Array, design: SamplingDesign) -> tuple[Array, Array, Array]:
    """Return the probability ``(...)`` and the ends of its interval of 95 %.

    The interval is that of Clopper & Pearson (1934) for as many independent samples as would have the variance that the
    scrambles have among each other, reduced for the few of them (Korn & Graubard 1998, Survey Methodology 24, 193-201).
    Scrambles that agree tell probabilities apart by no less than one point of them, which is a variance of up to
    1/(4 n^2), so that no less is assumed. What failed counts as stable in the lower and as unstable in the upper end.

    unstable, failed: ``(..., scrambles, matrices, points)`` truth values, ``failed`` of one entry where nothing has.
    """
    share = _mean(unstable)
    if failed.any():
        undecided = _mean(failed)
        lower, upper = _interval(share, design)[0], _interval(share + undecided, design)[1]
        total = undecided.mean(axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(total < 1, share.mean(axis=-1) / (1 - total), np.nan), lower, upper
    return (share.mean(axis=-1), *_interval(share, design))


def mean_of_chances(chances: Array, design: SamplingDesign) -> tuple[Array, Array, Array]:
    """Return the mean ``(...)`` of conditional probabilities and the ends of its interval of 95 %.

    The interval is that of :func:`probability`, but that what one point of a scramble tells is no more than the range
    of the chances. Where no sample has a chance of as much as one of them, up to 1 - 0.025^(1/N) of all systems may yet
    be unstable; so of stable ones.

    chances: ``(..., scrambles, matrices, points)``, of a design of one matrix.
    """
    every = (-3, -2, -1)
    least, most = chances.min(axis=every), chances.max(axis=every)
    share = chances.mean(axis=(-2, -1))
    lower, upper = _interval(share, design, most - least)
    unseen = 1 - (0.5 * (1 - CONFIDENCE)) ** (1 / design.size)
    lower = np.where(least >= 1 - 1 / design.size, np.minimum(lower, 1 - unseen), lower)
    upper = np.where(most <= 1 / design.size, np.maximum(upper, unseen), upper)
    return share.mean(axis=-1), lower, upper


def _mean(samples: Array) -> Array:
    """``(..., scrambles)``."""
    return np.asarray(samples.sum(axis=(-2, -1), dtype=np.int64) / (samples.shape[-2] * samples.shape[-1]))


def _interval(share: Array, design: SamplingDesign, extent: Array | float = 1.0) -> tuple[Array, Array]:
    """Both ends of the interval of the mean of ``(..., scrambles)``; extent: by how much samples differ."""
    from scipy.special import betaincinv, stdtrit

    tail = 0.5 * (1 - CONFIDENCE)
    total, mean = float(design.size), share.mean(axis=-1)
    # A and B are the independent ones of the matrices.
    least = 0.25 * np.maximum(extent, SAME) ** 2 / design.base**2 / min(design.matrices, 2)
    variance = np.maximum(share.var(axis=-1, ddof=1), least) / SCRAMBLES
    # Student's quantile for the scrambles over that for the samples.
    shrink = (stdtrit(total - 1, tail) / stdtrit(SCRAMBLES - 1, tail)) ** 2
    independent = mean * (1 - mean) / variance * shrink
    sure = (mean <= 0) | (mean >= 1)
    independent = np.where(sure, total, independent)
    found = mean * independent
    with np.errstate(invalid="ignore"):
        lower = np.where(mean <= 0, 0.0, betaincinv(np.maximum(found, 1e-300), independent - found + 1, tail))
        upper = np.where(mean >= 1, 1.0, betaincinv(found + 1, np.maximum(independent - found, 1e-300), 1 - tail))
    return np.minimum(lower, mean), np.maximum(upper, mean)


def sobol_indices(unstable: Array, design: SamplingDesign) -> tuple[Array, Array, Array, Array]:
    """Return first-order and total indices ``(..., d)``, and the half-widths of their intervals of 95 %.

    S_i = Var E(y | x_i)/Var y by Janon et al. (2014, ESAIM: Probability and Statistics 18, equation 6) and
    T_i = E Var(y | all but x_i)/Var y by Jansen (1999, Computer Physics Communications 117, 35-43), y being whether the
    system is unstable; the intervals from leaving out one scramble after the other. A group of correlated parameters
    has one index, that of all of them, which stands at each. NaN where y hardly varies.

    unstable: ``(..., scrambles, matrices, points)`` truth values.
    """
    share = unstable.mean(axis=(-3, -2, -1))
    varies = (share * (1 - share) >= LEAST_VARIANCE)[..., None]
    place = np.asarray(design.groups)
    if not design.indices:
        one = np.where(varies, 1.0, np.nan) * np.ones(len(place))
        return one, one.copy(), 0 * one, 0 * one
    a, b, mixed = unstable[..., 0, :], unstable[..., 1, :], unstable[..., 2:, :]
    # Sums over the points of each scramble, (..., scrambles, groups).
    both, differ, of_mixed = map(_counted, (b[..., None, :] & mixed, a[..., None, :] ^ mixed, mixed))
    of_a, of_b = (_counted(part)[..., None] for part in (a, b))

    def indices(keep: Array) -> tuple[Array, Array]:
        """Return the indices of the scrambles that are kept."""
        count = len(keep) * design.base

        def mean(sums: Array) -> Array:
            return np.asarray(sums[..., keep, :].sum(axis=-2) / count)

        middle, other = 0.5 * (mean(of_b) + mean(of_mixed)), 0.5 * (mean(of_a) + mean(of_mixed))
        with np.errstate(invalid="ignore", divide="ignore"):
            first = (mean(both) - middle**2) / (middle - middle**2)
            return first, 0.5 * mean(differ) / (other - other**2)

    every = np.arange(SCRAMBLES)
    whole = indices(every)
    without = [indices(np.delete(every, k)) for k in every]
    found = []
    for value, others in zip(whole, zip(*without, strict=True), strict=True):
        found.append((np.where(varies, value, np.nan)[..., place], np.where(varies, _jackknife(others), np.nan)))
    (first, first_interval), (total, total_interval) = found
    return first, total, first_interval[..., place], total_interval[..., place]


def _counted(samples: Array) -> Array:
    return np.asarray(np.sum(samples, axis=-1, dtype=np.int64))


def _jackknife(without: tuple[Array, ...]) -> Array:
    """Half of the interval of an estimate from those that leave out one scramble each."""
    from scipy.special import stdtrit

    spread = np.sum((np.stack(without) - np.mean(without, axis=0)) ** 2, axis=0)
    quantile = stdtrit(SCRAMBLES - 1, 0.5 * (1 + CONFIDENCE))
    return np.asarray(quantile * np.sqrt((SCRAMBLES - 1) / SCRAMBLES * spread))
