"""Axes of a grid, the parameters at chosen points of it, and arrays of parameters that may be arrays themselves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Generic, TypeVar, cast

import numpy as np

from gearstab.config.document import Path, is_section

Kind = TypeVar("Kind")
"""A kind of system."""

Array = np.ndarray

MESH_FREQUENCY: Path = ("mesh_frequency",)
"""Path of the mesh frequency, which is not a number of a system."""
EXACT = 2**53
"""Whole numbers up to this one are doubles."""
EXACT_POWER = 22
"""The largest power of ten that is a double."""
SPEEDS = ("mesh_frequency", "input_speed")
"""Names of axes of the mesh frequency itself, or of the speed of an input that sets it."""


@dataclass(frozen=True)
class Assignment:
    """One parameter that an axis sets.

    path: fields and indices below ``Config.system``; MESH_FREQUENCY is the mesh frequency itself.
    values: one per point of the axis: a float array, or a list where the parameter is no plain number (an exact ratio).
    factor: of the values over those of the axis.
    name: the path as one writes it, meshes by name; units and title: SI unit, "1" without one, and what it is.
    typed_units: the unit that the user wrote at every value, such as rpm; "" for plain numbers or several units.
    """

    path: Path
    values: Array | list[Any]
    factor: float = 1.0
    name: str = ""
    units: str = "1"
    title: str = ""
    typed_units: str = ""

    @property
    def structural(self) -> bool:
        """Whether points of different value cannot be computed together."""
        return isinstance(self.values, list)


@dataclass(frozen=True)
class Axis:
    """One dimension of the grid.

    name: the key in ``sweep``; size: number of points.
    values: the coordinate, ``(size,)`` floats, or texts: labels of cases, exact ratios.
    units: SI unit of the values, "1" without one; long_name: what they are.
    assignments: all parameters that the axis sets.
    ends: start and stop where the values are given as a range; None where they are listed.
    """

    name: str
    size: int
    values: Array | list[str]
    units: str
    long_name: str
    assignments: tuple[Assignment, ...]
    ends: tuple[float, float] | None = None

    @property
    def typed_units(self) -> str:
        """The unit that the user wrote at every value, such as rpm; "" for plain numbers, several units and labels."""
        found = {item.typed_units for item in self.assignments}
        return found.pop() if len(found) == 1 and not isinstance(self.values, list) else ""

    @property
    def mesh_frequency(self) -> Assignment | None:
        """The mesh frequency along the axis; None where something else sets it."""
        return next((item for item in self.assignments if item.path == MESH_FREQUENCY), None)

    @property
    def span(self) -> tuple[float, float]:
        """The least and the greatest number that the axis covers, a range from end to end even with few points."""
        if self.ends is not None:
            return min(self.ends), max(self.ends)
        values = np.asarray(self.values, dtype=float)
        return float(values.min()), float(values.max())


@dataclass(frozen=True)
class Grid(Generic[Kind]):
    """Systems that differ in what axes set.

    system: the section ``system``; SI numbers, exact ratios as Fraction.
    axes: in the order of ``sweep``, none without that section.
    """

    system: Kind
    axes: tuple[Axis, ...]

    def at(self, selection: Mapping[str, Array]) -> Kind:
        """Return the section ``system`` at points of the grid.

        selection: axis name -> index into its points, integer arrays of one shape (rows,). Axes that are not named keep
        the base values, and the mesh frequency is no number of a system.

        Numbers that the axes set are arrays (rows,); a matrix from a file of which they set entries has the shape
        (rows, n, n). A field that is no plain number must be the same in all rows, else ValueError: such rows are
        different systems.
        """
        system: Any = self.system
        for axis in self.axes:
            if axis.name not in selection:
                continue
            rows = np.asarray(selection[axis.name])
            for item in axis.assignments:
                if item.path != MESH_FREQUENCY:
                    system = replaced(system, item.path, _values(axis, item, rows))
        return cast(Kind, system)


def _values(axis: Axis, item: Assignment, rows: Array) -> Any:
    if not item.structural:
        return np.asarray(item.values)[rows]
    values = [item.values[i] for i in np.unique(rows)]
    if any(value != values[0] for value in values[1:]):
        raise ValueError(f"axis '{axis.name}' must be constant over the rows that are built together")
    return values[0]


def replaced(container: Any, path: Sequence[str | int], value: Any) -> Any:
    """Return a copy of nested sections, lists and matrices in which one entry is replaced; all else is shared."""
    if not path:
        return value
    key = path[0]
    if isinstance(container, np.ndarray):
        row, column = (int(part) for part in path)
        copy = np.array(np.broadcast_to(container, np.shape(value) + container.shape[-2:]))
        copy[..., row, column] = value
        return copy
    if is_section(container):
        return container.model_copy(update={str(key): replaced(getattr(container, str(key)), path[1:], value)})
    copied = list(container)
    copied[int(key)] = replaced(copied[int(key)], path[1:], value)
    return type(container)(copied)


def alike(axes: Sequence[Axis], rows: Mapping[str, Array], count: int) -> Iterator[Array]:
    """Positions of the points that can be computed together: of equal parameters that are no plain numbers.

    rows: of each axis, the index of each of ``count`` points.
    """
    keys = np.zeros((count, 0), dtype=int)
    for axis in axes:
        for item in axis.assignments:
            if item.structural:
                texts = [repr(value) for value in item.values]
                _, kind = np.unique(texts, return_inverse=True)
                keys = np.column_stack([keys, kind[rows[axis.name]]])
    if keys.shape[1] == 0:
        yield np.arange(count)
        return
    _, group = np.unique(keys, axis=0, return_inverse=True)
    for number in range(group.max() + 1):
        yield np.flatnonzero(np.ravel(group) == number)


@dataclass(frozen=True)
class SpeedAxis:
    """In what a response is given its speed: the key, the mesh frequency over it, and the unit that the user wrote."""

    key: str = "mesh_frequency"
    factor: float = 1.0
    typed_units: str = ""


def vector(values: Sequence[Any] | Array) -> Array:
    """``(..., n)`` from n numbers, any of which may be an array of batch shape."""
    if isinstance(values, np.ndarray):
        return values
    return np.stack(np.broadcast_arrays(*[np.asarray(v, dtype=float) for v in values]), axis=-1)


def matrix(rows: Sequence[Sequence[Any]] | Array) -> Array:
    """``(..., n, m)`` from nested numbers, any of which may be an array of batch shape."""
    if isinstance(rows, np.ndarray):
        return rows
    return np.stack(np.broadcast_arrays(*[vector(row) for row in rows]), axis=-2)


def given(number: Any) -> bool:
    """Return whether a number is there and not zero everywhere."""
    if number is None or isinstance(number, int | float):
        return bool(number)
    return bool(np.any(np.asarray(number) != 0))


def evenly(start: float, change: Decimal, parts: int, count: int) -> Array | None:
    """Return start + i change/parts for i < count, each rounded once; None unless all are short decimal numbers.

    Numerator and denominator are whole numbers that doubles hold exactly, so that 3 steps of 0.1 are 0.3.
    """
    first = Decimal(repr(start))
    digits = max(0, *(-int(number.as_tuple().exponent) for number in (first, change)))
    if digits > EXACT_POWER:
        return None
    a, b = (int(number.scaleb(digits)) for number in (first, change))
    endless = parts // math.gcd(b, parts)
    for factor in (2, 5):
        while endless % factor == 0:
            endless //= factor
    if endless > 1 or max(abs(a) * parts + abs(b) * count, parts * 10**digits) > EXACT:
        return None
    return np.asarray((a * parts + b * np.arange(count)) / (parts * 10**digits))
