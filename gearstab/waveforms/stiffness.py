"""Waves made from a stiffness, whose mean and size are taken out."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np

from gearstab.waveforms.base import Array, Waveform

LEVEL = 1e-13
"""A variation below this part of the largest stiffness is rounding: the wave is taken as constant."""


class OfStiffness(Waveform):
    """w = (k - mean k)/(max k - min k) of a stiffness k(x); 0 where k is constant.

    Such a wave overrides ``stiffness_at``, ``mean_stiffness``, ``stiffness_range`` and ``stiffness_harmonic``.
    """

    own_variation: ClassVar[bool] = True

    def stiffness_at(self, x: Array) -> Array:
        """Return k at the phase x (in periods)."""
        raise NotImplementedError

    @cached_property
    def stiffness_range(self) -> tuple[Array, Array]:
        """The least and the greatest value of k, ``(...)`` each."""
        raise NotImplementedError

    def stiffness_harmonic(self, order: int) -> tuple[Array, Array]:
        """Return (a_s, b_s) of k - mean k, as :meth:`fourier` does of w."""
        raise NotImplementedError

    @cached_property
    def _size(self) -> Array:
        """max k - min k, or 0 where that is but rounding."""
        low, high = self.stiffness_range
        size = np.asarray(high) - low
        return np.where(size > LEVEL * np.maximum(np.abs(low), np.abs(high)), size, 0.0)

    def _over_size(self, values: Array) -> Array:
        return np.where(self._size > 0, values / np.where(self._size > 0, self._size, 1.0), 0.0)

    @property
    def amplitude(self) -> Array:
        """(max k - min k)/2, ``(...)``."""
        return 0.5 * self._size

    def value(self, x: Array) -> Array:
        return self._over_size(self.stiffness_at(x) - self.mean_stiffness)

    def extremes(self) -> tuple[Array, Array]:
        low, high = self.stiffness_range
        return self._over_size(low - self.mean_stiffness), self._over_size(high - self.mean_stiffness)

    def fourier(self, order: int) -> tuple[Array, Array]:
        sine, cosine = self.stiffness_harmonic(order)
        return self._over_size(sine), self._over_size(cosine)
