"""Rectangular mesh stiffness of any contact ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from gearstab.waveforms.base import Array, Waveform, as_array, stiff_fraction, wrapped


@dataclass(frozen=True)
class Rectangular(Waveform):
    """Stiff for the fraction d = c - floor(c) of the period, from phase 0 on.

        w = 1 - d for 0 <= x < d,    w = -d for d <= x < 1

    An integer contact ratio keeps the number of tooth pairs constant: d = 0 and w = 0.

    Source: Lin & Parker 2002, Fig. 2 and (4), with the sign of the physical wave (stiff while
    floor(c) + 1 pairs are in contact; the paper's (4) is the negative of it); Parker 2009, (7), (8).
    """

    said: ClassVar[str] = "stiff for the fraction c - floor(c) of the period"
    fraction_sets_levels: ClassVar[bool] = True

    contact_ratio: Array | float

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        return cls(as_array(contact_ratio))

    @property
    def piecewise_constant(self) -> bool:
        return True

    @property
    def batch(self) -> tuple[int, ...]:
        return np.shape(self.contact_ratio)

    @property
    def stiff_fraction(self) -> Array:
        """d = c - floor(c)."""
        return stiff_fraction(self.contact_ratio)

    def value(self, x: Array) -> Array:
        d = self.stiff_fraction
        return np.where(wrapped(x) < d, 1.0 - d, -d)

    def breakpoints(self) -> Array:
        d = self.stiff_fraction
        return np.stack([np.zeros_like(d), d], axis=-1)

    def extremes(self) -> tuple[Array, Array]:
        d = self.stiff_fraction
        return -d, np.where(d > 0, 1.0 - d, 0.0)

    @property
    def stiffer_level(self) -> Array:
        """Stiffness of floor(c) + 1 pairs, also where an integer contact ratio lets the wave not reach it."""
        return 1.0 - self.stiff_fraction

    def fourier(self, order: int) -> tuple[Array, Array]:
        """a_s = (2/s pi) sin^2(s pi d), b_s = (2/s pi) cos(s pi d) sin(s pi d)."""
        angle = np.pi * order * self.stiff_fraction
        factor = 2 * np.sin(angle) / (np.pi * order)
        return factor * np.sin(angle), factor * np.cos(angle)
