"""Mesh stiffness as the sum over the pairs of teeth in contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.waveforms.base import Array
from gearstab.waveforms.phase import stiff_fraction, wrapped
from gearstab.waveforms.sampled import normalised, significant
from gearstab.waveforms.splines import Pieces, cubic_extremes

PARABOLA_ENDS = 0.55
"""Stiffness at the ends of contact over that in its middle, of Cai & Hayashi's approximation."""


@dataclass(frozen=True)
class Pair:
    """w = (k - mean k)/(max k - min k) of k(x) = sum_j p((x + j)/c), j with 0 <= x + j < c; 0 where k is constant.

    p(u) is the stiffness of one pair of teeth along its contact, from its first point u = 0 to its last one u = 1, c
    base pitches later: the shape of a pair and the contact ratio, any c >= 1, make the wave. A constant p gives the
    rectangular wave. At phase 0 a pair comes into contact, and at phase c - floor(c) one leaves.

    Parameters
    ----------
    contact_ratio: ``(...)``, c.
    shape: p on [0, 1].
    """

    contact_ratio: Array | float
    shape: Pieces

    @property
    def piecewise_constant(self) -> bool:
        return self.shape.constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(np.shape(self.contact_ratio), self.shape.batch)

    @property
    def mean_stiffness(self) -> Array:
        """c times the mean of p, ``(...)``."""
        return np.asarray(self.contact_ratio) * self.shape.integral()

    @property
    def amplitude(self) -> Array:
        """(max k - min k)/2, ``(...)``."""
        return 0.5 * self._size

    @cached_property
    def _range(self) -> tuple[Array, Array]:
        points = self.breakpoints()
        return cubic_extremes(self._stiffness, np.broadcast_to(points, (*self.batch, points.shape[-1])))

    @cached_property
    def _size(self) -> Array:
        return significant(*self._range)

    def _stiffness(self, x: Array) -> Array:
        c, phase = np.asarray(self.contact_ratio, dtype=float), wrapped(x)
        total = np.zeros(np.broadcast_shapes(phase.shape, self.batch))
        for j in range(int(np.max(c, initial=0.0)) + 1):
            total = total + np.where(phase + j < c, self.shape.value((phase + j) / c), 0.0)
        return total

    def value(self, x: Array) -> Array:
        return normalised(self._stiffness(x) - self.mean_stiffness, self._size)

    def breakpoints(self) -> Array:
        """Where a pair comes and goes, and the kinks of p of all pairs."""
        c = np.asarray(self.contact_ratio, dtype=float)[..., None]
        ends = np.concatenate([np.zeros_like(c), stiff_fraction(c)], axis=-1)
        return np.concatenate([ends, wrapped(c * self.shape.knots[1:-1])], axis=-1)

    def extremes(self) -> tuple[Array, Array]:
        low, high = self._range
        mean = self.mean_stiffness
        return normalised(low - mean, self._size), normalised(high - mean, self._size)

    def fourier(self, order: int) -> tuple[Array, Array]:
        """From the transform of p: the sum over j of pieces of p is p over its whole contact."""
        c = np.asarray(self.contact_ratio, dtype=float)
        found = c * self.shape.transform(2 * np.pi * order * c)
        return normalised(-2 * found.imag, self._size), normalised(2 * found.real, self._size)


def constant(stiffness: Array | float = 1.0) -> Pieces:
    """A pair as stiff at every point of its contact."""
    return Pieces(np.array([0.0, 1.0]), np.asarray(stiffness, dtype=float)[..., None, None])


def parabolic(ends: Array | float = PARABOLA_ENDS, middle: Array | float = 1.0) -> Pieces:
    """p = middle [1 - (1 - ends) (2 u - 1)^2].

    Source: Cai & Hayashi 1994 (J. Mech. Des. 116, 558-564), the approximation of spur gears' stiffness, with ends 0.55.
    """
    rise = 1.0 - np.asarray(ends, dtype=float)
    return Pieces(np.array([0.0, 1.0]), _piece(middle * (1.0 - rise), 4 * middle * rise, -4 * middle * rise))


def _piece(*coefficients: Array) -> Array:
    """``(..., 1, D)`` from the coefficients of one polynomial."""
    return np.stack(np.broadcast_arrays(*coefficients), axis=-1)[..., None, :]
