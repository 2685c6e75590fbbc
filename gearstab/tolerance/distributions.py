"""Distributions of a number, cut off where the number cannot be."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.system import Array


class Distribution(ABC):
    """A continuous distribution by its distribution function F and the inverse of it."""

    @abstractmethod
    def below(self, x: Array) -> Array:
        """Return F(x), the probability of less than x."""

    @abstractmethod
    def inverse(self, u: Array) -> Array:
        """Return the x with F(x) = u."""

    @property
    @abstractmethod
    def central(self) -> float:
        """A number in its middle, where it is most likely."""

    @staticmethod
    @abstractmethod
    def mistake(numbers: Sequence[float]) -> tuple[str, str] | None:
        """Return what is wrong with the numbers that are to describe it, and what to do; None for nothing."""

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
class Normal(Distribution):
    """Normal distribution of mean ``mean`` and standard deviation ``deviation``."""

    mean: float
    deviation: float

    def below(self, x: Array) -> Array:
        from scipy.special import ndtr

        return np.asarray(ndtr((np.asarray(x) - self.mean) / self.deviation))

    def inverse(self, u: Array) -> Array:
        from scipy.special import ndtri

        return np.asarray(self.mean + self.deviation * ndtri(u))

    @property
    def central(self) -> float:
        return self.mean

    @staticmethod
    def mistake(numbers: Sequence[float]) -> tuple[str, str] | None:
        if numbers[1] > 0:
            return None
        return f"has the standard deviation {numbers[1]:g}", "write [mean, standard deviation], the latter > 0"


@dataclass(frozen=True)
class Uniform(Distribution):
    """Equally likely everywhere between ``low`` and ``high``."""

    low: float
    high: float

    def below(self, x: Array) -> Array:
        return np.clip((np.asarray(x) - self.low) / (self.high - self.low), 0.0, 1.0)

    def inverse(self, u: Array) -> Array:
        return np.asarray(self.low + (self.high - self.low) * u)

    @property
    def central(self) -> float:
        return 0.5 * (self.low + self.high)

    @staticmethod
    def mistake(numbers: Sequence[float]) -> tuple[str, str] | None:
        if numbers[0] < numbers[1]:
            return None
        return f"has no range from {numbers[0]:g} to {numbers[1]:g}", "write [low, high], low < high"


@dataclass(frozen=True)
class Triangular(Distribution):
    """Triangular distribution: a density that rises from zero at ``low`` to its peak at ``mode`` and falls to zero at
    ``high``.
    """

    low: float
    mode: float
    high: float

    def below(self, x: Array) -> Array:
        x = np.clip(x, self.low, self.high)
        width = self.high - self.low
        # A side of no width is never divided by.
        left = (x - self.low) ** 2 / (width * ((self.mode - self.low) or width))
        right = 1.0 - (self.high - x) ** 2 / (width * ((self.high - self.mode) or width))
        return np.where(x < self.mode, left, right)

    def inverse(self, u: Array) -> Array:
        width, u = self.high - self.low, np.asarray(u)
        left = self.low + np.sqrt(u * width * (self.mode - self.low))
        right = self.high - np.sqrt((1.0 - u) * width * (self.high - self.mode))
        return np.where(u * width < self.mode - self.low, left, right)

    @property
    def central(self) -> float:
        return self.mode

    @staticmethod
    def mistake(numbers: Sequence[float]) -> tuple[str, str] | None:
        if numbers[0] <= numbers[1] <= numbers[2] and numbers[0] < numbers[2]:
            return None
        return "is not in the order of a triangle", "write [low, mode, high], low <= mode <= high and low < high"


DISTRIBUTIONS: dict[str, type[Distribution]] = {"normal": Normal, "uniform": Uniform, "triangular": Triangular}
"""By the key of a configuration."""
