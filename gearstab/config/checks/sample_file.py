"""Samples of a stiffness over a period from a file: CSV or HDF5."""

from __future__ import annotations

from collections.abc import Mapping
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
from gearstab.config.model.axes import Array
from gearstab.config.model.columns import columns_of, factor
from gearstab.config.model.units import Quantity
from gearstab.waveforms import Waveform
from gearstab.waveforms.samples import MOST_SAMPLES

SUFFIXES = (".csv", ".txt", ".h5", ".hdf5")


def read_samples(
    path: FilePath, wave: type[Waveform], interpolation: str, quantities: Mapping[str, Quantity]
) -> tuple[Array, str]:
    """``(columns, N)``: the columns that the wave takes, phase and stiffness, in some waves also torque, in SI; and
    what is doubtful about them, "" for nothing.

    A text file has one sample a line, numbers separated by a comma, a semicolon or blanks; empty lines and what follows
    a # do not count, and the first line may name the columns, with units in brackets. An HDF5 file has a dataset of one
    dimension for each, and maybe its unit in the attribute ``units``.

    wave, interpolation: which say what samples it takes. quantities: what each column may be.
    Raises DataFileError, with the line of a text.
    """
    usable(path, ".csv or .h5", SUFFIXES)
    lines = path.suffix.lower() in (".csv", ".txt")
    places, columns = columns_of(text(path), quantities) if lines else _datasets(path, quantities)
    table = np.array(columns, dtype=float)
    rows, phase, doubt = wave.measured(table)
    table, places = table[:, rows], [places[row] for row in rows]
    table[list(wave.columns).index("phase")] = phase
    found = wave.wrong_samples(table.tolist(), interpolation)
    if found is not None:
        index, _, message, hint = found
        raise DataFileError(message if index is None else f"{places[index]}: {message}", hint)
    return table, doubt


def _datasets(path: FilePath, quantities: Mapping[str, Quantity]) -> tuple[list[str], list[list[float]]]:
    names, units = tuple(quantities), dict[str, str]()
    found = arrays(path, names, MOST_SAMPLES, units)
    for name in names:
        if found.get(name) is None:
            hint = f"it needs the datasets {', '.join(names[:-1])} and {names[-1]}, and holds {present(found)}"
            raise DataFileError(f"holds no {name}", hint)
    columns = [numbers(name, found[name]) for name in names]
    if columns[0].ndim != 1 or len({column.shape for column in columns}) > 1:
        shapes = [f"{name} {column.shape}" for name, column in zip(names, columns, strict=True)]
        message = f"{shapes[0].replace(' ', ' has the shape ', 1)}, {', '.join(shapes[1:])}"
        raise DataFileError(message, "save one dimension of real numbers, as many of each")
    factors = [factor(units.get(name, ""), quantities[name], name) for name in names]
    scaled = [(column * each).tolist() for column, each in zip(columns, factors, strict=True)]
    return [f"sample {i}" for i in range(len(columns[0]))], scaled
