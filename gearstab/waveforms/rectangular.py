"""Rectangular mesh stiffness of any contact ratio, and trapezoidal ones, which are means of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Quantity
from gearstab.waveforms.base import Array, Keys, Waveform, as_array, stiff_fraction, wrapped


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


class TrapezoidalKeys(Keys):
    """A ramp in place of each jump."""

    ramp: Annotated[float, Field(ge=0, le=1), Quantity()] | None = None
    """trapezoidal: each jump is a linear ramp of this fraction of the period, centred on the jump (1)."""


@dataclass(frozen=True)
class Trapezoidal(Waveform):
    """The rectangular wave whose jumps are linear ramps, of width r and centred on the jumps.

        w(x) = -d + sum_j [S(x - j) - S(x - j - d)],    S(y) = 0 for y < -r/2, 1/2 + y/r, 1 for y > r/2,

    which is the mean of the rectangular wave over x - r/2 .. x + r/2. Whole periods of r leave nothing: beyond r = 1 it
    is the wave of the remaining part of r, smaller by that part over r. Ramps that overlap, d < r <= 1 or
    1 - d < r <= 1, add up by this rule: the plateau between them is not reached and the peak-to-peak is

        min(1, d/r) - max(0, 1 - (1 - d)/r) <= 1

    instead of 1. So the wave is a continuous function of the contact ratio, and vanishes at the integers, where the
    rectangular one jumps; the level of floor(c) + 1 pairs stays what it is when a plateau gets too short to reach it.
    """

    said: ClassVar[str] = "with ramps"
    keys: ClassVar[type[Keys]] = TrapezoidalKeys
    required: ClassVar[tuple[str, ...]] = ("ramp",)
    # The least value rises with the ramp.
    worst_at_ends: ClassVar[tuple[str, ...]] = ("ramp",)

    contact_ratio: Array | float
    ramp: Array | float

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        return cls(as_array(contact_ratio), as_array(spec.ramp))

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(np.shape(self.contact_ratio), np.shape(self.ramp))

    @property
    def stiff_fraction(self) -> Array:
        """d = c - floor(c)."""
        return stiff_fraction(self.contact_ratio)

    @property
    def delay(self) -> Array | float:
        """Periods by which the ramps come later than centred on the jumps."""
        return 0.0

    def value(self, x: Array) -> Array:
        d, phase = self.stiff_fraction, wrapped(np.asarray(x) + self._ahead)
        # A ramp is at most one period wide: of the other periods' pulses only those of the neighbours reach here.
        pulses = (self._step(phase - j) - self._step(phase - j - d) for j in (-1, 0, 1))
        return self._share * sum(pulses, -d)

    @cached_property
    def _width(self) -> Array:
        """The part of r beyond whole periods, 0 where it is shorter than phases are told apart."""
        r = np.asarray(self.ramp, dtype=float)
        part = r - np.floor(r) if np.any(r > 1) else r
        return np.where(part > np.finfo(float).eps, part, 0.0)

    @cached_property
    def _share(self) -> Array:
        """Return that part over r, 1 up to a period."""
        r = np.asarray(self.ramp, dtype=float)
        return np.where(r > 1, self._width / np.maximum(r, 1.0), 1.0)

    @cached_property
    def _ahead(self) -> Array:
        """Phase by which the ramps come earlier: half of each whole period of r, less the delay."""
        r = np.asarray(self.ramp, dtype=float)
        return np.where(r > 1, 0.5 * np.floor(r), 0.0) - self.delay

    def _step(self, y: Array) -> Array:
        """S, a jump for r = 0."""
        r = self._width
        return np.where(r > 0, np.clip(y / np.where(r > 0, r, 1.0) + 0.5, 0.0, 1.0), np.where(y >= 0, 1.0, 0.0))

    def breakpoints(self) -> Array:
        d, half, ahead = np.broadcast_arrays(self.stiff_fraction, 0.5 * self._width, self._ahead)
        return wrapped(np.stack([-half, half, d - half, d + half], axis=-1) - ahead[..., None])

    def extremes(self) -> tuple[Array, Array]:
        """Return the values in the middle of the soft and of the stiff part."""
        d, r = np.broadcast_arrays(self.stiff_fraction, self._width)
        safe = np.where(r > 0, r, 1.0)
        low = np.where(r > 0, np.maximum(0.0, 1.0 - (1.0 - d) / safe), 0.0)
        high = np.where(r > 0, np.minimum(1.0, d / safe), np.where(d > 0, 1.0, 0.0))
        return self._share * (low - d), self._share * (high - d)

    @property
    def stiffer_level(self) -> Array:
        """Stiffness of floor(c) + 1 pairs, also where ramps or an integer contact ratio let the wave not reach it."""
        return 1.0 - self.stiff_fraction

    def fourier(self, order: int) -> tuple[Array, Array]:
        """Return the coefficients of the rectangular wave times sin(s pi r)/(s pi r), turned by the delay."""
        angle = np.pi * order * self.stiff_fraction
        factor = 2 * np.sin(angle) / (np.pi * order) * np.sinc(order * np.asarray(self.ramp, dtype=float))
        turned = angle + 2 * np.pi * order * np.asarray(self.delay)
        return factor * np.sin(turned), factor * np.cos(turned)


@dataclass(frozen=True)
class Helical(Trapezoidal):
    """The rectangular wave of helical teeth: its mean over the overlap ratio eps_beta, here ``ramp``, of any size.

    A ramp begins where a pair enters at one face, or leaves there, and ends where it does at the other. contact_ratio:
    eps_alpha, of the transverse section.
    """

    @property
    def delay(self) -> Array | float:
        return 0.5 * np.asarray(self.ramp, dtype=float)

    @property
    def total_contact_ratio(self) -> Array:
        """eps_alpha + eps_beta."""
        return np.asarray(self.contact_ratio, dtype=float) + self.ramp
