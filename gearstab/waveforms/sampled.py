"""Mesh stiffness given by samples over a period."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from gearstab.config.model.arrays import vector
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.waveforms.base import Array, Keys, WrongSample
from gearstab.waveforms.phase import wrapped
from gearstab.waveforms.samples import SampleKeys, missing_source, sample_conflicts, wrong_number, wrong_order
from gearstab.waveforms.splines import FEWEST, Pieces, interpolate
from gearstab.waveforms.stiffness import OfStiffness


@dataclass(frozen=True)
class Sampled(OfStiffness):
    """w = (k - mean k)/(max k - min k), k the periodic interpolation of samples; 0 where k is constant.

    Mean and extremes are those of the interpolation, not of the samples.

    Parameters
    ----------
    phase: ``(N,)``, in [0, 1), ascending.
    stiffness: ``(..., N)``.
    interpolation: ``linear`` or ``cubic`` (:func:`~gearstab.waveforms.splines.interpolate`).
    """

    said: ClassVar[str] = "stiffness over a period"
    keys: ClassVar[type[Keys]] = SampleKeys
    sources: ClassVar[tuple[str, ...]] = ("file", "stiffness")
    has_contact_ratio: ClassVar[bool] = False

    phase: Array
    stiffness: Array
    interpolation: str = "linear"

    @classmethod
    def build(cls, spec: dict[str, Any], contact_ratio: Any = None) -> Self:
        return cls(vector(spec["phase"]), vector(spec["stiffness"]), spec.get("interpolation", "linear"))

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """One source of the stiffness, and samples that are a function."""
        if missing := missing_source(cls, raw):
            yield missing
            return
        yield from exactly_one(raw, cls.sources)
        if any(raw.get(key) is None for key in cls.sources):
            yield from sample_conflicts(cls, raw)

    @classmethod
    def has_own_mean(cls, raw: dict[str, Any]) -> bool:
        return True

    @classmethod
    def wrong_phase(cls, phase: Sequence[float], interpolation: str) -> WrongSample | None:
        """Phases in [0, 1), ascending."""
        if found := wrong_number(phase, FEWEST.get(interpolation, 2), interpolation):
            return found
        for i, value in enumerate(phase):
            if not 0 <= value < 1:
                again = "; leave it out, phase 1 is phase 0 again" if value == 1 else ""
                return (
                    i,
                    "out_of_range",
                    f"phase {value:g} is outside [0, 1)",
                    f"a phase is a fraction of the mesh period{again}",
                )
            if found := wrong_order(i, phase):
                return found
        return None

    @property
    def batch(self) -> tuple[int, ...]:
        return np.shape(self.stiffness)[:-1]

    @property
    def mean_stiffness(self) -> Array:
        """Mean of the interpolation, ``(...)``."""
        return self._pieces.integral()

    @cached_property
    def _pieces(self) -> Pieces:
        phase, stiffness = np.asarray(self.phase, dtype=float), np.asarray(self.stiffness, dtype=float)
        closed = np.concatenate([stiffness, stiffness[..., :1]], axis=-1)
        return interpolate(np.append(phase, phase[0] + 1.0), closed, self.interpolation, periodic=True)

    @cached_property
    def stiffness_range(self) -> tuple[Array, Array]:
        return self._pieces.extremes()

    def stiffness_at(self, x: Array) -> Array:
        phase = wrapped(x)
        return self._pieces.value(np.where(phase < np.asarray(self.phase)[0], phase + 1.0, phase))

    def breakpoints(self) -> Array:
        return np.asarray(self.phase, dtype=float)

    def stiffness_harmonic(self, order: int) -> tuple[Array, Array]:
        """Exactly, as the interpolation is made of polynomials."""
        found = self._pieces.transform(2 * np.pi * order)
        return -2 * found.imag, 2 * found.real
