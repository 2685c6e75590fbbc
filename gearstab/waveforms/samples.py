"""Samples of a stiffness: the keys that give them, and what makes them a function of the phase."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, StrictStr

from gearstab.config.model.conflicts import Conflict
from gearstab.config.model.fields import Choice, optional
from gearstab.config.model.reading import WRONG
from gearstab.waveforms.base import POSITION, SAMPLED, Array, Keys, Waveform, WrongSample

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
