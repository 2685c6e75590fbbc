"""A result as it goes to a file: groups of variables and their values."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.errors import OutputError
from gearstab.results.variables import TEXT, Variable

Array = np.ndarray

Offset = tuple[int, ...]

FORMAT = 1
"""Version of the layout of result files, the attribute ``format_version`` of the root (1 in files that lack it).

To be raised whenever older programs would misread what newer ones write."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""How netCDF-4 marks a dimension without coordinate."""


@dataclass(frozen=True)
class InFile:
    """A chunk that waits in a file: where it begins there, and how many bytes it has."""

    path: Path
    start: int
    length: int


Encoded = bytes | InFile
"""An encoded chunk."""


def octets(chunk: Encoded, last: bool = False) -> bytes:
    """The bytes of a chunk. Raises OSError, and OutputError where its file has become shorter.

    last: whether nobody will read it again: the memory in which the system keeps it is free for what is written next.
    """
    if isinstance(chunk, bytes):
        return chunk
    with open(chunk.path, "rb") as file:
        file.seek(chunk.start)
        data = file.read(chunk.length)
        if last and hasattr(os, "posix_fadvise"):
            os.posix_fadvise(file.fileno(), chunk.start, chunk.length, os.POSIX_FADV_DONTNEED)
    if len(data) != chunk.length:
        raise OutputError(f"{chunk.path}: was cut short while it was used")
    return data


@dataclass(frozen=True)
class Chunked:
    """Values that come as encoded chunks (:mod:`gearstab.results.hdf5`), a part of an array each.

    shape: of the whole; chunk: of every chunk, those at the upper ends filled up.
    pieces: gives (where the chunk begins, the chunk) once over; what no chunk covers is NaN, or 0 for integers.
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    pieces: Callable[[], Iterator[tuple[Offset, Encoded]]]


@dataclass(frozen=True)
class Field:
    """A variable and its values: an array, a sequence (of texts) or chunks."""

    variable: Variable
    values: Array | Sequence[Any] | Chunked

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the dimensions."""
        return self.values.shape if isinstance(self.values, Array | Chunked) else np.shape(self.values)

    def array(self) -> Array:
        """The values as the variable's type; texts as objects."""
        if isinstance(self.values, Chunked):
            raise TypeError(f"{self.variable.name} is made of chunks")
        return np.asarray(self.values, dtype=object if self.variable.dtype == TEXT else self.variable.dtype)


@dataclass(frozen=True)
class Group:
    """The variables of one group of a file and the group's attributes."""

    fields: tuple[Field, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ResultTree:
    """A whole result: its root, whose coordinates all groups inherit, and the groups by name."""

    root: Group
    groups: Mapping[str, Group]


def fields_of(variables: Sequence[Variable], values: Mapping[str, Any]) -> tuple[Field, ...]:
    """The variables of a table that there are values for, in its order. Raises KeyError for unknown names."""
    unknown = values.keys() - {variable.name for variable in variables}
    if unknown:
        raise KeyError(f"no variable declared for {', '.join(sorted(unknown))}")
    return tuple(Field(variable, values[variable.name]) for variable in variables if variable.name in values)
