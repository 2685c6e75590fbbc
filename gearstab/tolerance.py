"""Samples of uncertain parameters, and what they say: a probability with its interval, and the Sobol indices.

A distribution is cut off where the number cannot be. The points are scrambled Sobol sequences, a few independent ones.
Each scramble is a sample of its own, whose points cover the cube far more evenly than random ones; that there are
several tells how far off they are. For Sobol indices the points of a scramble form matrices A, B and A_B(i), which is A
with the columns of group i from B (Saltelli et al. 2010, Computer Physics Communications 181, section 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np

from gearstab.system import Array

SCRAMBLES = 8
"""Independent samples. Of fewer an interval is wide, of more the single ones cover the cube less evenly."""
BITS = 30
"""Bits of the coordinates of a Sobol point."""
CONFIDENCE = 0.95
SAME = 1e-6
"""Chances that differ by no more than that are equal."""
LEAST_VARIANCE = 0.02
"""Least variance p (1 - p) of instability with probability p: where it is less, Sobol indices are a quotient of noise.
"""


@dataclass(frozen=True)
class DistributionKind:
    """A sort of distributions.

    law: that of ``scipy.stats`` and its parameters, from the numbers that a configuration gives. central: the number in
    its middle, where it is most likely. sound: whether numbers describe one; mistake: else, what they have or are, and
    what to do.
    """

    law: Callable[..., tuple[str, tuple[float, ...]]]
    central: Callable[..., float]
    sound: Callable[..., bool]
    mistake: tuple[str, str]


DISTRIBUTIONS: dict[str, DistributionKind] = {
    "normal": DistributionKind(
        lambda mean, deviation: ("norm", (mean, deviation)),
        lambda mean, deviation: mean,
        lambda mean, deviation: deviation > 0,
        ("has the standard deviation {1:g}", "write [mean, standard deviation], the latter > 0"),
    ),
    "uniform": DistributionKind(
        lambda low, high: ("uniform", (low, high - low)),
        lambda low, high: 0.5 * (low + high),
        lambda low, high: low < high,
        ("has no range from {0:g} to {1:g}", "write [low, high], low < high"),
    ),
    "triangular": DistributionKind(
        lambda low, mode, high: ("triang", ((mode - low) / (high - low), low, high - low)),
        lambda low, mode, high: mode,
        lambda low, mode, high: low <= mode <= high and low < high,
        ("is not in the order of a triangle", "write [low, mode, high], low <= mode <= high and low < high"),
    ),
}
"""By the key of a configuration."""


@dataclass(frozen=True)
class Distribution:
    """A continuous distribution: one of DISTRIBUTIONS, and its numbers."""

    key: str
    numbers: tuple[float, ...]

    @cached_property
    def _law(self) -> Any:
        from scipy import stats

        name, parameters = DISTRIBUTIONS[self.key].law(*self.numbers)
        return getattr(stats, name)(*parameters)

    @property
    def central(self) -> float:
        """A number in its middle, where it is most likely."""
        return DISTRIBUTIONS[self.key].central(*self.numbers)

    @property
    def mistake(self) -> tuple[str, str] | None:
        """The fault of the numbers, and what to do; None of sound ones."""
        kind = DISTRIBUTIONS[self.key]
        text, hint = kind.mistake
        return None if kind.sound(*self.numbers) else (text.format(*self.numbers), hint)

    def below(self, x: Array) -> Array:
        """Return F(x), the probability of less than x."""
        return np.asarray(self._law.cdf(x))

    def inverse(self, u: Array) -> Array:
        """Return the x with F(x) = u."""
        return np.asarray(self._law.ppf(u))

    def outside(self, low: Array, high: Array) -> Array:
        """Return the probability of less than ``low`` or more than ``high``."""
        return self.below(low) + 1.0 - self.below(high)

    def quantile(self, u: Array, low: Array, high: Array) -> Array:
        """Return x from u, uniform in (0, 1), so that x has this distribution given low <= x <= high.

        x = F^-1(F(low) + u [F(high) - F(low)]).
        """
        first, last = self.below(low), self.below(high)
        return np.clip(self.inverse(first + u * (last - first)), low, high)


@dataclass(frozen=True)
class SamplingDesign:
    """Samples of d numbers, uniform in (0, 1).

    groups: ``(d,)``, to which group each number belongs, from 0 on; what is correlated is in one group.
    base: points of one matrix of one scramble. indices: whether there are the matrices of Sobol indices too.
    seed: of the scrambles.
    """

    groups: tuple[int, ...]
    base: int
    indices: bool
    seed: int

    @classmethod
    def of(cls, groups: tuple[int, ...], samples: int, indices: bool, seed: int) -> SamplingDesign:
        """Return a design of ``samples`` samples, or the few more that make whole matrices."""
        # The index of a single group is one.
        indices = indices and max(groups) > 0
        matrices = max(groups) + 3 if indices else 1
        return cls(groups, max(2, ceil(samples / (SCRAMBLES * matrices))), indices, seed)

    @property
    def matrices(self) -> int:
        """Return the matrices of a scramble: A alone, or A, B and as many as there are groups."""
        return max(self.groups) + 3 if self.indices else 1

    @property
    def shape(self) -> tuple[int, int, int]:
        """(scrambles, matrices, points): what the samples are, one after the other."""
        return SCRAMBLES, self.matrices, self.base

    @property
    def size(self) -> int:
        """The number of samples."""
        return SCRAMBLES * self.matrices * self.base

    @cached_property
    def points(self) -> Array:
        """``(size, d)``, the same for the same fields."""
        scrambles = np.random.SeedSequence(self.seed).spawn(SCRAMBLES)
        return np.concatenate([self._matrices(np.random.default_rng(own)) for own in scrambles])

    def _matrices(self, generator: np.random.Generator) -> Array:
        """``(matrices base, d)`` of one scramble."""
        from scipy.stats import qmc

        count = len(self.groups)
        columns = 2 * count if self.indices else count
        sequence = qmc.Sobol(columns, scramble=True, bits=BITS, seed=generator)
        drawn = sequence.random_base2(int(np.ceil(np.log2(self.base))))[: self.base]
        # In the middle of the cells of the sequence: 0 has no finite normal deviate.
        drawn = np.floor(drawn * 2.0**BITS) * 2.0**-BITS + 0.5 ** (BITS + 1)
        if not self.indices:
            return np.asarray(drawn)
        a, b = drawn[:, :count], drawn[:, count:]
        own = np.asarray(self.groups)
        return np.concatenate([a, b, *(np.where(own == group, b, a) for group in range(max(self.groups) + 1))])


def groups_of(count: int, pairs: list[tuple[int, int]]) -> tuple[int, ...]:
    """Return the group of each of ``count`` numbers: those that pairs connect, directly or not, are in one."""
    group = list(range(count))
    for one, other in pairs:
        kept, gone = sorted((group[one], group[other]))
        group = [kept if own == gone else own for own in group]
    numbers = sorted(set(group))
    return tuple(numbers.index(own) for own in group)


def correlated(points: Array, correlation: Array) -> Array:
    """Return points ``(N, d)`` of independent uniform numbers as those of a Gaussian copula.

    correlation: ``(d, d)``, of the normal deviates Phi^-1(u); positive definite.
    """
    if np.array_equal(correlation, np.eye(len(correlation))):
        return points
    from scipy.special import ndtr, ndtri

    found = np.asarray(ndtr(ndtri(points) @ np.linalg.cholesky(correlation).T))
    alone = np.count_nonzero(correlation, axis=1) == 1
    return np.where(alone, points, np.clip(found, 2.0**-52, 1 - 2.0**-52))


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
