"""Mesh stiffness as the sum over the pairs of teeth in contact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field

from gearstab.config.model import vector
from gearstab.config.model.conflicts import Conflict, at_most_one, exactly_one
from gearstab.config.model.fields import Choice, NonNegative, Quantity, optional
from gearstab.waveforms.base import Array, Keys, OfStiffness, WrongSample, as_array, stiff_fraction, wrapped
from gearstab.waveforms.sampled import SampleKeys, missing_source, sample_conflicts, wrong_number, wrong_order
from gearstab.waveforms.splines import Pieces, cubic_extremes, interpolate

PARABOLA_ENDS = 0.55
"""Stiffness at the ends of contact over that in its middle, of Cai & Hayashi's approximation."""


class ShapeKeys(Keys):
    """The stiffness of one pair along its contact, as a formula."""

    shape: Annotated[str, Choice("shape", ("constant", "parabolic"))] | None = optional("shape of a pair's stiffness")
    """pair: along the contact of one pair, constant or parabolic; or give file, or stiffness."""
    ends: NonNegative | None = optional("stiffness at the ends of contact")
    """pair: of a parabolic shape, over that in the middle (1); 0.55 without (Cai & Hayashi 1994)."""
    pair_stiffness: Annotated[float, Field(gt=0), Quantity("N/m", ("N m",))] | None = optional("stiffness of one pair")
    """pair: in the middle of its contact (N/m); the mesh then needs no mean_stiffness."""


class PairKeys(SampleKeys, ShapeKeys):
    """The stiffness of one pair along its contact; messages list its own keys first."""


@dataclass(frozen=True)
class ToothPair(OfStiffness):
    """w = (k - mean k)/(max k - min k) of k(x) = sum_j p((x + j)/c), j with 0 <= x + j < c; 0 where k is constant.

    p(u) is the stiffness of one pair of teeth along its contact, from its first point u = 0 to its last one u = 1, c
    base pitches later: the shape of a pair and the contact ratio, any c >= 1, make the wave. A constant p gives the
    rectangular wave. At phase 0 a pair comes into contact, and at phase c - floor(c) one leaves.

    Parameters
    ----------
    contact_ratio: ``(...)``, c.
    shape: p on [0, 1].
    """

    said: ClassVar[str] = "the sum over the pairs of teeth in contact"
    keys: ClassVar[type[Keys]] = PairKeys
    sources: ClassVar[tuple[str, ...]] = ("shape", "file", "stiffness")

    contact_ratio: Array | float
    shape: Pieces

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        return cls(as_array(contact_ratio), shape_of(spec))

    @classmethod
    def conflicts(cls, section: Any) -> Iterator[Conflict]:
        """One source of the shape with what belongs to it."""
        if missing := missing_source(cls, section):
            yield missing
            return
        yield from exactly_one(section, cls.sources)
        if sum(section[key] is not None for key in cls.sources) > 1:
            return
        if section.ends is not None and section.shape != "parabolic":
            yield ("ends",), "not_applicable", "belongs to a parabolic shape", "remove it, or choose shape: parabolic"
        if section.shape is not None:
            for key in ("phase", "interpolation"):
                if section[key] is not None:
                    hint = "remove it, or give stiffness instead of shape"
                    yield (key,), "not_applicable", "belongs to sampled stiffness", hint
        else:
            yield from at_most_one(section, ("pair_stiffness", "file", "stiffness"))
        yield from sample_conflicts(cls, section)

    @classmethod
    def has_own_mean(cls, section: Any) -> bool:
        return any(section[key] is not None for key in ("file", "stiffness", "pair_stiffness"))

    @classmethod
    def wrong_phase(cls, phase: Sequence[float], interpolation: str) -> WrongSample | None:
        """Phases from 0 to 1, ascending."""
        if found := wrong_number(phase, 2, interpolation):
            return found
        for i, value in enumerate(phase):
            if not 0 <= value <= 1:
                hint = "0 is the first point of a pair's contact, 1 the last one"
                return i, "out_of_range", f"phase {value:g} is outside [0, 1]", hint
            if found := wrong_order(i, phase):
                return found
        if phase[0] != 0 or phase[-1] != 1:
            hint = "give a pair's whole contact, from phase 0 to 1"
            return None, "out_of_range", f"runs from {phase[0]:g} to {phase[-1]:g}", hint
        return None

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

    @cached_property
    def stiffness_range(self) -> tuple[Array, Array]:
        points = self.breakpoints()
        return cubic_extremes(self.stiffness_at, np.broadcast_to(points, (*self.batch, points.shape[-1])))

    def stiffness_at(self, x: Array) -> Array:
        c, phase = np.asarray(self.contact_ratio, dtype=float), wrapped(x)
        total = np.zeros(np.broadcast_shapes(phase.shape, self.batch))
        for j in range(int(np.max(c, initial=0.0)) + 1):
            total = total + np.where(phase + j < c, self.shape.value((phase + j) / c), 0.0)
        return total

    def breakpoints(self) -> Array:
        """Return where a pair comes and goes, and the kinks of p of all pairs."""
        c = np.asarray(self.contact_ratio, dtype=float)[..., None]
        ends = np.concatenate([np.zeros_like(c), stiff_fraction(c)], axis=-1)
        return np.concatenate([ends, wrapped(c * self.shape.knots[1:-1])], axis=-1)

    def stiffness_harmonic(self, order: int) -> tuple[Array, Array]:
        """Compute it from the transform of p: the sum over j of pieces of p is p over its whole contact."""
        c = np.asarray(self.contact_ratio, dtype=float)
        found = c * self.shape.transform(2 * np.pi * order * c)
        return -2 * found.imag, 2 * found.real


def shape_of(spec: Any) -> Pieces:
    """Return the stiffness of one pair along its contact from the section ``waveform``."""
    middle = as_array(1.0 if spec.pair_stiffness is None else spec.pair_stiffness)
    if spec.shape == "constant":
        return constant(middle)
    if spec.shape == "parabolic":
        return parabolic(as_array(PARABOLA_ENDS if spec.ends is None else spec.ends), middle)
    kind = spec.interpolation or "linear"
    return interpolate(vector(spec.phase), vector(spec.stiffness), kind, periodic=False)


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
