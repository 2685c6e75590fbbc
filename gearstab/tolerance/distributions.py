"""Distributions of a number, cut off where the number cannot be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gearstab.system import Array


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
