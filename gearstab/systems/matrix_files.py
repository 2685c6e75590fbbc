"""Matrices of a model from files (.npz, HDF5, MATLAB, Matrix Market), and vectors written by coordinate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from pydantic import Field, StrictStr

from gearstab.config.document import Document, Path, nearest, sequence, value_at
from gearstab.config.model import Array
from gearstab.config.model.fields import Section, optional
from gearstab.config.model.files import DataFileError, arrays, numbers, present, usable
from gearstab.errors import one_line

REQUIRED = ("mass", "stiffness")
OF_ROTATION = ("gyroscopic", "centripetal", "circulatory")
"""They belong to the first entry of ``rotation``."""
OPTIONAL = ("damping", *OF_ROTATION)
SYMBOLS = {"mass": "M", "stiffness": "K", "damping": "C", "gyroscopic": "G"}
"""Other names of the matrices in a file."""
SUFFIXES = (".npz", ".h5", ".hdf5", ".mat")
MARKET = (".mtx", ".mm")
MOST_COORDINATES = 4000
"""A matrix of so many takes 128 MB."""


class MatrixFiles(Section):
    """A Matrix Market file for each matrix."""

    mass: StrictStr = Field(title="file of the mass matrix")
    """A Matrix Market file (.mtx)."""
    stiffness: StrictStr = Field(title="file of the stiffness matrix")
    """A Matrix Market file (.mtx)."""
    damping: StrictStr | None = optional("file of the damping matrix")
    """A Matrix Market file (.mtx)."""
    gyroscopic: StrictStr | None = optional("file of the gyroscopic matrix")
    """A Matrix Market file (.mtx)."""
    centripetal: StrictStr | None = optional("file of the centripetal matrix")
    """A Matrix Market file (.mtx)."""
    circulatory: StrictStr | None = optional("file of the circulatory matrix")
    """A Matrix Market file (.mtx)."""


def read_market(path: FilePath) -> Array:
    """The matrix ``(n, n)`` of a Matrix Market file, filled. Raises DataFileError."""
    from scipy.io import mminfo, mmread

    usable(path, "Matrix Market (.mtx)", MARKET)
    try:
        rows, columns, _, _, kind, _ = mminfo(path)
        held = mmread(path) if max(rows, columns) <= MOST_COORDINATES and kind != "pattern" else None
    except Exception as error:  # whatever a broken file makes the reader raise
        raise DataFileError(f"cannot be read: {one_line(error)}", "save the matrix again") from None
    if rows != columns or not 0 < rows <= MOST_COORDINATES:
        hint = f"save a square matrix of at most {MOST_COORDINATES} rows"
        raise DataFileError(f"holds a matrix of the shape {(rows, columns)}", hint)
    if held is None:
        raise DataFileError("holds a pattern without numbers", "save real numbers")
    return numbers("the matrix", held)


def read_matrices(path: FilePath) -> dict[str, Array]:
    """Return ``mass``, ``stiffness`` and, if given, OPTIONAL ones as float arrays (n, n).

    They may be called M, K, C and G. Sparse matrices of a .mat file are filled. Raises DataFileError.
    """
    if path.suffix.lower() in MARKET:
        hint = "write files: {mass: M.mtx, stiffness: K.mtx, damping: C.mtx}"
        raise DataFileError("is a Matrix Market file, which holds one matrix", hint)
    usable(path, ".npz, .h5 or .mat", SUFFIXES)
    found = arrays(path, (*REQUIRED, *OPTIONAL, *SYMBOLS.values()), MOST_COORDINATES)
    for name, symbol in SYMBOLS.items():
        if found.get(symbol) is not None:
            if found.get(name) is not None:
                raise DataFileError(f"holds {name} and {symbol}, which mean the same", "keep one of the two")
            found[name] = found[symbol]
    missing = [name for name in REQUIRED if found.get(name) is None]
    if missing:
        message = f"holds no {' and no '.join(missing)}"
        raise DataFileError(message, f"it needs mass and stiffness (or M and K), and holds {present(found)}")
    result = {name: numbers(name, found[name]) for name in REQUIRED + OPTIONAL if found.get(name) is not None}
    check_shapes(result)
    return result


def check_shapes(result: Mapping[str, Array]) -> None:
    """Raise DataFileError unless all matrices are square, of the shape of ``mass`` and with both triangles."""
    for name, values in result.items():
        if values.ndim != 2 or values.shape[0] != values.shape[1] or values.shape[0] == 0:
            raise DataFileError(f"{name} has the shape {values.shape}", "save a square matrix")
        if np.any(np.triu(values, 1)) != np.any(np.tril(values, -1)):
            raise DataFileError(f"{name} has entries on one side of its diagonal alone", "save both triangles")
    shape = result["mass"].shape
    for name, values in result.items():
        if values.shape != shape:
            raise DataFileError(f"{name} has the shape {values.shape}, mass {shape}", "make them equal")


SECTIONS = {"meshes": ("direction",), "forces": ("direction",), "terms": ("left", "right")}
"""Lists of the section ``system`` and the vectors of their entries; ``load`` is one by itself."""


def write_out(document: Document, raw: dict[str, Any], size: int | None) -> None:
    """Replace every such mapping by the list of its entries, zero where it names none; report unknown coordinates.

    size: number of coordinates. If it is unknown, which is reported elsewhere, the entries stand for all.
    """
    named: Any = raw.get("coordinates")
    known = named if len(sequence(named)) == size else default_names(size or 0)
    for holder, key, path in list(_mappings(raw)):
        given = holder[key]
        names = known if size is not None else list(given)
        values: list[Any] = [0.0] * len(names)
        for name, value in given.items():
            if name in names:
                values[names.index(name)] = value
                document.move(("system", *path, name), ("system", *path, names.index(name)))
            else:
                message = "there is no such coordinate"
                hint = nearest(name, map(str, names))
                document.report(("system", *path, name), "unknown_name", message, hint, at_key=True)
        holder[key] = values


def default_names(size: int) -> list[str]:
    """Return the names of coordinates that are given none: q1, q2, ..."""
    return [f"q{i + 1}" for i in range(size)]


def _mappings(raw: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, Path]]:
    """Yield the section that holds each vector written so, its key there, and its path below ``system``."""
    if isinstance(raw.get("load"), dict):
        yield raw, "load", ("load",)
    for section, keys in SECTIONS.items():
        for i, item in enumerate(sequence(raw.get(section))):
            for key in keys:
                if isinstance(value_at(item, (key,)), dict):
                    yield item, key, (section, i, key)
