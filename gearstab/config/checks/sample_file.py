"""Samples of a stiffness over a period from a file: CSV or HDF5."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from gearstab.config.document.files import (
    DataFileError,
    arrays,
    numbers,
    present,
    text,
    usable,
)
from gearstab.config.document.problems import shown
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


def read_path(path: FilePath) -> list[tuple[float, float]]:
    """Time and speed of each line of a text file of two columns. Raises DataFileError, with the line."""
    usable(path, ".csv", (".csv", ".txt"))
    _, time, speed = columns_of(text(path), ("time", "speed"))
    return list(zip(time, speed, strict=True))


def columns_of(content: str, names: tuple[str, str]) -> tuple[list[str], list[float], list[float]]:
    """The place of each line, and the numbers of its two columns. Raises DataFileError, with the line."""
    columns, first = (0, 1), True
    places: list[str] = []
    samples: dict[str, list[float]] = {name: [] for name in names}
    for number, line in enumerate(content.splitlines(), start=1):
        fields = _fields(line.partition("#")[0])
        if not fields:
            continue
        place = f"line {number}"
        if first and all(_number(field) is None for field in fields):
            columns, first = _columns(fields, place, names), False
            continue
        first = False
        if len(fields) <= max(columns) or (len(fields) != 2 and columns == (0, 1)):
            hint = f"write two numbers per line, {' and '.join(names)}, or name the columns in the first line"
            raise DataFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(names, columns, strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise DataFileError(message, "write a number such as 2.5e8")
            samples[name].append(value)
        places.append(place)
    return places, samples[names[0]], samples[names[1]]


def _fields(line: str) -> list[str]:
    """The entries of a line, none of an empty one."""
    line = line.strip()
    separator = r"\s*;\s*" if ";" in line else r"\s*,\s*" if "," in line else r"\s+"
    return [field.strip("\"' ") for field in re.split(separator, line)] if line else []


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _columns(header: Sequence[str], place: str, names: tuple[str, str]) -> tuple[int, int]:
    """Which columns have the two names; those of a header of two other names are taken in this order."""
    found = [name.lower() for name in header]
    if all(name in found for name in names):
        return found.index(names[0]), found.index(names[1])
    if len(found) == 2:
        return 0, 1
    raise DataFileError(f"{place}: names no columns {' and '.join(names)}", "call the two columns that")


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
