"""Samples of a stiffness over a period from a file: CSV or HDF5."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from gearstab.config.axes import Array
from gearstab.config.model_file import ModelFileError
from gearstab.config.problems import shown
from gearstab.config.waveforms import wrong_phase

NAMES = ("phase", "stiffness")
SUFFIXES = (".csv", ".txt", ".h5", ".hdf5")


def read_samples(path: FilePath, kind: str, interpolation: str) -> Array:
    """``(2, N)``: phase and stiffness.

    A text file has one sample a line, phase and stiffness separated by a comma, a semicolon or blanks; empty lines and
    what follows a # do not count, and the first line may name the columns. An HDF5 file has two datasets, ``phase`` and
    ``stiffness``, of one dimension.

    kind, interpolation: of the wave, which say what phases it takes. Raises ModelFileError, with the line of a text.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ModelFileError("is no .csv or .h5 file", f"save the samples in one of {', '.join(SUFFIXES)}")
    if path.is_dir():
        raise ModelFileError("is a folder", "name a file")
    if not path.exists():
        raise ModelFileError("there is no such file", "the path is relative to the folder of the configuration")
    text = path.suffix.lower() in (".csv", ".txt")
    places, phase, stiffness = _text(path) if text else _datasets(path)
    found = wrong_phase(phase, kind, interpolation)
    if found is not None:
        index, message, hint = found
        raise ModelFileError(message if index is None else f"{places[index]}: {message}", hint)
    return np.array([phase, stiffness], dtype=float)


def _text(path: FilePath) -> tuple[list[str], list[float], list[float]]:
    """The place of each sample, its phase and its stiffness."""
    try:
        content = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ModelFileError(f"cannot be read: {(error.strerror or str(error)).lower()}", "") from None
    except UnicodeDecodeError:
        raise ModelFileError("is not UTF-8 text", "save the file in UTF-8") from None
    columns, first = (0, 1), True
    places: list[str] = []
    samples: dict[str, list[float]] = {name: [] for name in NAMES}
    for number, line in enumerate(content.splitlines(), start=1):
        fields = _fields(line.partition("#")[0])
        if not fields:
            continue
        place = f"line {number}"
        if first and all(_number(field) is None for field in fields):
            columns, first = _columns(fields, place), False
            continue
        first = False
        if len(fields) <= max(columns) or (len(fields) != 2 and columns == (0, 1)):
            hint = "write two numbers a line, phase and stiffness, or name the columns in the first line"
            raise ModelFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(NAMES, columns, strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise ModelFileError(message, "write a number such as 2.5e8")
            samples[name].append(value)
        places.append(place)
    return places, samples["phase"], samples["stiffness"]


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


def _columns(header: Sequence[str], place: str) -> tuple[int, int]:
    """Which columns are phase and stiffness; those of a header of two other names are taken in this order."""
    names = [name.lower() for name in header]
    if all(name in names for name in NAMES):
        return names.index("phase"), names.index("stiffness")
    if len(names) == 2:
        return 0, 1
    raise ModelFileError(f"{place}: names no columns phase and stiffness", "call the two columns that")


def _datasets(path: FilePath) -> tuple[list[str], list[float], list[float]]:
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: np.asarray(item[()]) for name, item in file.items() if isinstance(item, h5py.Dataset)}
    except OSError as error:
        raise ModelFileError(f"cannot be read: {str(error).splitlines()[0]}", "save the samples again") from None
    for name in NAMES:
        if name not in found:
            present = ", ".join(sorted(found)) or "nothing"
            raise ModelFileError(f"holds no {name}", f"it needs the datasets phase and stiffness, and holds {present}")
        values = found[name]
        if values.dtype.kind not in "fiu" or values.ndim != 1 or len(values) != len(found["phase"]):
            described = f"{values.dtype} of the shape {values.shape}"
            raise ModelFileError(f"{name} is {described}", "save one dimension of real numbers, as many of both")
        if not np.all(np.isfinite(values)):
            index = int(np.argmin(np.isfinite(values)))
            raise ModelFileError(f"sample {index}: {name} is no finite number", "save finite numbers")
    phase, stiffness = (found[name].astype(float).tolist() for name in NAMES)
    return [f"sample {i}" for i in range(len(phase))], phase, stiffness
