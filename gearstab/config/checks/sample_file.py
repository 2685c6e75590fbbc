"""Samples of a stiffness over a period from a file: CSV or HDF5."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np

from gearstab.config.document.columns import columns_of
from gearstab.config.document.files import (
    DataFileError,
    arrays,
    numbers,
    present,
    text,
    usable,
)
from gearstab.config.model.axes import Array
from gearstab.waveforms import Waveform
from gearstab.waveforms.samples import MOST_SAMPLES

NAMES = ("phase", "stiffness")
SUFFIXES = (".csv", ".txt", ".h5", ".hdf5")


def read_samples(path: FilePath, wave: type[Waveform], interpolation: str) -> Array:
    """``(2, N)``: phase and stiffness.

    A text file has one sample a line, phase and stiffness separated by a comma, a semicolon or blanks; empty lines and
    what follows a # do not count, and the first line may name the columns. An HDF5 file has two datasets, ``phase`` and
    ``stiffness``, of one dimension.

    wave, interpolation: which say what phases it takes. Raises DataFileError, with the line of a text.
    """
    usable(path, ".csv or .h5", SUFFIXES)
    lines = path.suffix.lower() in (".csv", ".txt")
    places, phase, stiffness = columns_of(text(path), NAMES) if lines else _datasets(path)
    found = wave.wrong_phase(phase, interpolation)
    if found is not None:
        index, _, message, hint = found
        raise DataFileError(message if index is None else f"{places[index]}: {message}", hint)
    return np.array([phase, stiffness], dtype=float)


def _datasets(path: FilePath) -> tuple[list[str], list[float], list[float]]:
    found = arrays(path, NAMES, MOST_SAMPLES)
    for name in NAMES:
        if found.get(name) is None:
            hint = f"it needs the datasets phase and stiffness, and holds {present(found)}"
            raise DataFileError(f"holds no {name}", hint)
    phase, stiffness = (numbers(name, found[name]) for name in NAMES)
    if phase.ndim != 1 or phase.shape != stiffness.shape:
        message = f"phase has the shape {phase.shape}, stiffness {stiffness.shape}"
        raise DataFileError(message, "save one dimension of real numbers, as many of both")
    return [f"sample {i}" for i in range(len(phase))], phase.tolist(), stiffness.tolist()
