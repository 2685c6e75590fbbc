"""Mesh stiffness given by samples over a period, at one torque or at several."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from gearstab.config.model import vector
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import Quantity
from gearstab.errors import NotPossible
from gearstab.waveforms.base import Array, Keys, OfStiffness, Waveform, WrongSample, as_array, wrapped
from gearstab.waveforms.samples import (
    FileKeys,
    SampleKeys,
    in_one_period,
    missing_source,
    sample_conflicts,
    wrong_number,
    wrong_order,
)
from gearstab.waveforms.splines import FEWEST, Pieces, interpolate

TORQUE = Quantity("N m")


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
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        return cls(vector(spec.phase), vector(spec.stiffness), spec.interpolation or "linear")

    @classmethod
    def conflicts(cls, section: Any) -> Iterator[Conflict]:
        """One source of the stiffness, and samples that are a function."""
        if missing := missing_source(cls, section):
            yield missing
            return
        yield from exactly_one(section, cls.sources)
        if any(section[key] is None for key in cls.sources):
            yield from sample_conflicts(cls, section)

    @classmethod
    def has_own_mean(cls, section: Any) -> bool:
        return True

    @classmethod
    def measured(cls, columns: Array) -> tuple[Array, Array, str]:
        return in_one_period(columns)

    @classmethod
    def wrong_phase(cls, phase: Sequence[float], interpolation: str) -> WrongSample | None:
        """Phases in [0, 1), ascending."""
        if found := wrong_number(phase, FEWEST.get(interpolation, 2), interpolation):
            return found
        for i, value in enumerate(phase):
            if not 0 <= value < 1:
                again = "; leave it out, phase 1 is phase 0 again" if value == 1 else ""
                hint = f"a phase is a fraction of the mesh period{again}"
                return i, "out_of_range", f"phase {value:g} is outside [0, 1)", hint
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


class TableKeys(FileKeys):
    """The file, and at which of its torques the mesh runs."""

    torque: Annotated[float, TORQUE] | None = None
    """table: at which the mesh runs, within those of the file (N m)."""


@dataclass(frozen=True)
class TorqueTable(Sampled):
    """The wave of samples k(phase) at a torque between those of a table: linear in the torque.

    Under load the profiles touch earlier and leave later, so that shape, mean and amplitude change with the torque.
    """

    said: ClassVar[str] = "stiffness over a period at several torques"
    keys: ClassVar[type[Keys]] = TableKeys
    required: ClassVar[tuple[str, ...]] = ("file", "torque")
    sources: ClassVar[tuple[str, ...]] = ()
    columns: ClassVar[Mapping[str, Quantity]] = {"torque": TORQUE, **Waveform.columns}

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        """Raises NotPossible for a torque beyond the table, which is not extrapolated."""
        levels, phase, table = np.asarray(spec.torques), np.asarray(spec.phase), np.asarray(spec.stiffness)
        torque = as_array(spec.torque)
        if message := out_of_table(torque, levels):
            raise NotPossible(*message)
        lower = np.clip(np.searchsorted(levels, torque, side="right") - 1, 0, len(levels) - 2)
        part = ((torque - levels[lower]) / (levels[lower + 1] - levels[lower]))[..., None]
        stiffness = (1.0 - part) * table[lower] + part * table[lower + 1]
        return cls(phase, stiffness, spec.interpolation or "linear")

    @classmethod
    def from_file(cls, columns: Array) -> dict[str, Array]:
        """Torques ``(L,)`` and phases ``(N,)``, ascending, and the stiffness ``(L, N)``."""
        torque, phase, stiffness = columns
        levels, positions = np.unique(torque), np.unique(phase)
        table = stiffness[np.lexsort((phase, torque))].reshape(len(levels), len(positions))
        return {"torques": levels, "phase": positions, "stiffness": table}

    @classmethod
    def conflicts(cls, section: Any) -> Iterator[Conflict]:
        yield from ()

    @classmethod
    def wrong_samples(cls, columns: Sequence[Sequence[float]], interpolation: str) -> WrongSample | None:
        """Two torques or more, the same phases at each of them, and these as those of samples."""
        torque, phase, _ = (np.asarray(column, dtype=float) for column in columns)
        levels, positions = np.unique(torque), np.unique(phase)
        if len(levels) < 2:
            hint = "give at least 2, or choose kind: sampled"
            return None, "wrong_count", f"has {len(levels)} torque{'s' * (len(levels) != 1)}", hint
        if found := cls.wrong_phase(positions.tolist(), interpolation):
            first = None if found[0] is None else int(np.flatnonzero(phase == positions[found[0]])[0])
            return first, *found[1:]
        count = np.zeros((len(levels), len(positions)), dtype=int)
        np.add.at(count, (np.searchsorted(levels, torque), np.searchsorted(positions, phase)), 1)
        for row, column in np.argwhere(count != 1):
            said = f"stiffness at torque {levels[row]:g} and phase {positions[column]:g}"
            if count[row, column] == 0:
                return None, "missing", f"has no {said}", "give the same phases at every torque"
            again = np.flatnonzero((torque == levels[row]) & (phase == positions[column]))[1]
            return int(again), "equal_values", f"the {said} is given twice", "give it once"
        return None


def out_of_table(torque: Array, levels: Array) -> tuple[str, str] | None:
    """Message and remedy where a torque is beyond those of a table, ascending."""
    wrong = torque[~((torque >= levels[0]) & (torque <= levels[-1]))]
    if wrong.size == 0:
        return None
    reach = f"from {levels[0]:g} to {levels[-1]:g} N m"
    return f"torque {wrong.flat[0]:g} N m is beyond the table, {reach}", "choose a torque within, or extend the table"
