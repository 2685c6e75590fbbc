"""Samples of uncertain parameters: their distributions, and which points of the unit cube are taken.

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
