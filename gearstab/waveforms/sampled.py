"""Mesh stiffness given by samples over a period, at one torque or at several: keys, checks and waves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, StrictStr

from gearstab.config.model import vector
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import Choice, Quantity, optional
from gearstab.config.model.reading import WRONG
from gearstab.errors import NotPossible
from gearstab.waveforms.base import (
    POSITION,
    SAMPLED,
    Array,
    Keys,
    OfStiffness,
    Waveform,
    WrongSample,
    as_array,
    wrapped,
)
from gearstab.waveforms.splines import FEWEST, Pieces, interpolate

MOST_SAMPLES = 10_000
"""Far more than a cycle of a mesh needs, and each is a kink that the integration must stop at."""
NARROWEST = 1e-9
"""Distance of two samples; closer ones make slopes that double precision cannot hold."""

DRIFT = 1e-6
"""Relative difference of a stiffness one period later that the digits of a file explain."""
MOST_WITHIN = 0.5
FEW = 5
"""Samples as many as these or more, all within this part of the period, are likely to be phases of another period."""

Position = Annotated[float, BeforeValidator(POSITION.number)]
"""A fraction of a turn that no axis sets."""


class FileKeys(Keys):
    """Samples in a file, and what is between them."""

    file: StrictStr | None = optional("file of samples")
    """sampled, pair: a .csv or .h5 file of phase and stiffness, relative to the configuration; table: of torque, phase
    and stiffness."""
    interpolation: Annotated[str, Choice("interpolation", ("linear", "cubic"))] | None = None
    """sampled, pair, table: linear (order 2, the default) or cubic, a spline (order 4, overshoots at jumps)."""


class SampleKeys(FileKeys):
    """Samples, in the section or in a file."""

    phase: list[Position] | None = optional("phases of the samples")
    """sampled: in [0, 1), ascending; pair: from 0 to 1 along the contact of one pair (1)."""
    stiffness: list[Annotated[float, SAMPLED]] | None = optional("sampled stiffness")
    """sampled, pair: one value per phase (N/m)."""


def in_one_period(columns: Array) -> tuple[Array, Array, str]:
    """Return which rows of a measured table make one period, in order, their phases, and what is doubtful about them.

    A row one period after the first one, which closes the curve, is left out; phases then may begin anywhere.

    columns: ``(2, N)`` phase and stiffness, or ``(3, N)`` with the torque before, at each of which there is a period.
    """
    *torque, phase, stiffness = columns
    phase = phase.copy()
    order = np.lexsort((phase, *torque))
    starts = np.flatnonzero(np.any([np.diff(level[order]) != 0 for level in (*torque, np.zeros(len(order)))], axis=0))
    kept, drifts = [], [(0.0, "")]
    for rows in np.split(order, starts + 1):
        closed = len(rows) > 1 and abs(phase[rows[-1]] - phase[rows[0]] - 1) < NARROWEST
        if closed:
            first, last = stiffness[rows[0]], stiffness[rows[-1]]
            drift = abs(last - first) / max(abs(last), abs(first), np.finfo(float).tiny)
            ends = f"from {first:.6g} to {last:.6g} N/m ({100 * drift:.2g} %)"
            drifts.append((drift, f"the stiffness drifts {ends} over the period; the row that closes it is left out"))
            rows = rows[:-1]
            inside = phase[rows] - np.floor(phase[rows])
            phase[rows] = np.where(1 - inside < NARROWEST, 0.0, inside)
            rows = rows[np.argsort(phase[rows], kind="stable")]
        kept.append(rows)
    found = np.concatenate(kept)
    drift, doubt = max(drifts, key=lambda one: one[0])
    width = np.ptp(phase[found]) if len(found) else 1.0
    if len(found) >= FEW and width < MOST_WITHIN:
        doubt = f"all samples lie within {100 * width:.3g} % of the mesh period, of which 360 deg are one"
        return found, phase[found], doubt + ", not a turn of a gear"
    return found, phase[found], doubt if drift > DRIFT else ""


def missing_source(wave: type[Waveform], section: Any) -> Conflict | None:
    """Return the conflict of phases without the stiffness that belongs to them."""
    if section.phase is not None and all(section[key] is None for key in wave.sources):
        return ("stiffness",), "missing", "is missing", "add stiffness: one number for each phase"
    return None


def sample_conflicts(wave: type[Waveform], section: Any) -> Iterator[Conflict]:
    """Yield what contradicts itself in samples as written: phases for the stiffness, as many, in order."""
    phase, stiffness = section.phase, section.stiffness
    if section.file is not None and phase is not None:
        yield ("phase",), "already_given", "file is given already", "keep one of file, phase"
    elif stiffness is not None and phase is None:
        yield ("phase",), "missing", "is missing", "add phase: one number for each stiffness"
    if phase is not None and stiffness is not None and all(value is not WRONG for value in phase):
        if len(phase) != len(stiffness):
            hint = f"give {len(phase)}, one per phase"
            yield ("stiffness",), "wrong_count", f"has {len(stiffness)} entries", hint
        elif found := wave.wrong_phase(phase, str(section.interpolation or "linear")):
            index, code, message, hint = found
            yield ("phase",) if index is None else ("phase", index), code, message, hint


def wrong_number(phase: Sequence[float], fewest: int, interpolation: str) -> WrongSample | None:
    """Return what is wrong with the number of samples."""
    if len(phase) < fewest:
        hint = f"give at least {fewest} for {interpolation} interpolation"
        return None, "wrong_count", f"has {len(phase)} sample{'s' * (len(phase) != 1)}", hint
    if len(phase) > MOST_SAMPLES:
        return None, "wrong_count", f"has {len(phase)} samples", f"give at most {MOST_SAMPLES}"
    return None


def wrong_order(i: int, phase: Sequence[float]) -> WrongSample | None:
    """Return what is wrong with a phase beside the one before it."""
    value = phase[i]
    if i and value == phase[i - 1]:
        return i, "equal_values", f"phase {value:g} is given twice", "give each phase once; a jump is a steep slope"
    if i and value - phase[i - 1] < NARROWEST:
        apart = "is not above the one before" if value < phase[i - 1] else "is too close to the one before"
        return i, "wrong_order", f"phase {value:g} {apart}", "sort the samples by phase"
    return None


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
