"""Samples of a stiffness over a period from files, CSV or HDF5, and what they exclude."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path, Problem, dotted, value_at
from gearstab.config.model import Array, Axis, replaced
from gearstab.config.model.conflicts import plain_number
from gearstab.config.model.fields import Quantity
from gearstab.config.model.files import DataFileError, arrays, columns_of, factor, numbers, present, text, usable
from gearstab.config.sections import quantity_at
from gearstab.waveforms import Sampled, TorqueTable, Waveform
from gearstab.waveforms.sampled import MOST_SAMPLES, out_of_table
from gearstab.waveforms.section import waveforms

SUFFIXES = (".csv", ".txt", ".h5", ".hdf5")


def with_samples(
    document: Document, system: Any, source: FilePath, axes: Sequence[Axis] | None
) -> tuple[Any, dict[str, Array], list[Problem]]:
    """Return a section ``system`` with what the files of waveforms hold, their columns by place, and what is doubtful.

    source: path of the configuration. axes: of the grid, None where the section has mistakes. Reported is what is wrong
    with the files, variations of constant samples, which no factor makes vary, and torques beyond the table of a file.
    """
    contents: dict[str, Array] = {}
    doubts: list[Problem] = []
    for path, section, wave in waveforms(system):
        name, place = getattr(section, "file", None), ("system", *path, "file")
        if isinstance(name, str) and wave is not None:
            try:
                quantities = {key: quantity_at(system, (*path, key), kind) for key, kind in wave.columns.items()}
                interpolation = section.interpolation if isinstance(section.interpolation, str) else "linear"
                columns, doubt = read_samples(source.parent / name, wave, interpolation, quantities)
            except DataFileError as error:
                document.report(place, "file", str(error), error.hint, value=name)
                continue
            contents[dotted(path)] = columns
            section = section.model_copy(update=wave.from_file(columns))
            system = replaced(system, path, section)
            if doubt:
                doubts.append(document.problem(place, "unusual", doubt, "check the measurement", value=name))
        if axes is None:
            continue
        if wave is Sampled and _constant(section.stiffness):
            _check_variation(document, system, path, axes)
        elif wave is TorqueTable and hasattr(section, "torques"):  # no file, no torques: said elsewhere
            _check_torque(document, section, path, axes)
    return system, contents, doubts


def _check_torque(document: Document, section: Any, path: Path, axes: Sequence[Axis]) -> None:
    place: Path = (*path, "torque")
    items = [(axis, item) for axis in axes for item in axis.assignments if item.path == place]
    given: list[tuple[Path, Any]] = [(("sweep", axis.name), item.values) for axis, item in items]
    if not given and section.torque is not None:
        given = [(("system", *place), section.torque)]
    for where, values in given:
        if found := out_of_table(np.asarray(values, dtype=float), section.torques):
            document.report(where, "out_of_range", *found, at_key=where[0] == "sweep")


def _check_variation(document: Document, system: Any, path: Path, axes: Sequence[Axis]) -> None:
    swept = [(axis, item) for axis in axes for item in axis.assignments]
    if any(item.path[: len(path)] == path for _, item in swept):
        return
    for key in ("epsilon", "amplitude"):
        place: Path = (*path[:-1], key)
        axis = next((axis for axis, item in swept if item.path == place and np.any(np.asarray(item.values) > 0)), None)
        value = value_at(system, place)
        message = f"the samples of the stiffness are constant, and no {key} makes them vary"
        if axis is not None:
            hint = "remove the axis, or check the samples"
            document.report(("sweep", axis.name), "not_applicable", message, hint, at_key=True)
        elif value is not None and np.any(value > 0):
            where, hint = ("system", *place), "leave it out, or check the samples"
            document.report(where, "not_applicable", message, hint, value=document.get(where))


def _constant(values: Any) -> bool:
    known = values is not None and len(values) > 1 and all(plain_number(value) is not None for value in values)
    return known and bool(np.ptp(np.asarray(values, dtype=float)) == 0)


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
