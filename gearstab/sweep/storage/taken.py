"""Values that a sweep takes over from an earlier result, ``--extend``: points that are the same there, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.errors import ResultError, SweepError, one_line
from gearstab.methods import Key, Outcome
from gearstab.perturbation import Tongue
from gearstab.results.variables import OCCURRENCE, TEXT, TONGUE, Variable
from gearstab.system import Array

if TYPE_CHECKING:
    import h5py

Identity = tuple[int, int, int]
"""Data that distinguish a file from another one that took its name, or from itself before a change."""


def identity(path: Path) -> Identity:
    """Return the identity of a file. Raises OSError."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns


@dataclass(frozen=True)
class Taken:
    """The points of an earlier result that a sweep needs not compute.

    path, identity: of its file, which is only read.
    places: by method, for every axis of its results the index in the earlier result of each of its points, -1 where
    that lacks it. A point is taken over where all its axes have it.
    """

    path: Path
    identity: Identity
    places: Mapping[str, tuple[Array, ...]]

    def known(self, method: str, start: Sequence[int], shape: Sequence[int]) -> tuple[Array, ...] | None:
        """Return where the points of a block stand in the earlier result, axis by axis; None where it has none."""
        if method not in self.places:
            return None
        parts = zip(self.places[method], start, shape, strict=True)
        found = tuple(place[first : first + count] for place, first, count in parts)
        return found if all((place >= 0).any() for place in found) else None

    def outcome(
        self, method: str, variables: Sequence[Variable], places: Sequence[Array], inner: int | None
    ) -> Outcome:
        """Read the points at these indices of the axes, rows in the order of a block.

        inner: number of the axis that is the mesh frequency, if any. Raises SweepError if the file is no longer the one
        it was, ResultError if it cannot be read: damaged, and then sealed anew.
        """
        import h5py

        try:
            with h5py.File(self.path, "r", locking=False) as file:
                group = file[method]
                if identity(self.path) != self.identity:
                    raise OSError
                if any(variable.listed for variable in variables):
                    return _listed(group, variables, places)
                return Outcome({v.name: _over_points(group[v.name], places, inner) for v in variables})
        except OSError as error:
            raise self._blame(method, error) from None
        except (KeyError, ValueError, TypeError, IndexError, RuntimeError) as error:
            # A seal that fits says nothing of who made it.
            said = f"{type(error).__name__}: {one_line(error)}"
            text = f"{self.path}: {method} in it is not as a sweep writes it ({said}); compute it again"
            raise ResultError(text) from error

    def _blame(self, method: str, error: OSError) -> ResultError | SweepError:
        with suppress(OSError):
            if identity(self.path) == self.identity:
                text = f"{self.path}: {method} in it cannot be read ({one_line(error)}); compute it again"
                return ResultError(text)
        return SweepError(f"{self.path}: was changed while the sweep took its points over; run the command again")


def misshapen(path: Path, method: str, variables: Sequence[Variable], shape: Sequence[int]) -> str:
    """Name a variable of a method that a result lacks, or has in another type or shape; "" for none.

    shape: of the axes of the method's results there. Raises OSError.
    """
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        for variable in variables:
            name = f"{method}/{variable.name}"
            data = file.get(name) if _has(file, name) else None
            lead = variable.lead
            if (
                not isinstance(data, h5py.Dataset)
                or data.dtype != variable.dtype
                or data.shape[lead : lead + len(shape)] != tuple(shape)
            ):
                return name
    return ""


def _has(file: h5py.File, name: str) -> bool:
    """Whether there is such an object, that can be opened."""
    try:
        return name in file and file[name] is not None
    except (KeyError, RuntimeError):
        return False


def _over_points(data: h5py.Dataset, places: Sequence[Array], inner: int | None) -> Array:
    """``(rows, P, ...)`` of a variable over all axes."""
    values = _cut(data, 0, places)
    rest = values.shape[len(places) :]
    if inner is None:
        return values.reshape(-1, 1, *rest)
    return np.moveaxis(values, inner, len(places) - 1).reshape(-1, values.shape[inner], *rest)


def _cut(data: h5py.Dataset, lead: int, places: Sequence[Array]) -> Array:
    """Values at indices of the axes, which begin at dimension ``lead``; only their neighbourhood is read."""
    spans = [slice(int(place.min()), int(place.max()) + 1) for place in places]
    values = np.asarray(data[(slice(None),) * lead + tuple(spans)])
    for k, (place, span) in enumerate(zip(places, spans, strict=True)):
        values = values.take(place - span.start, axis=lead + k)
    return values


def _listed(group: h5py.Group, variables: Sequence[Variable], places: Sequence[Array]) -> Outcome:
    """Results over tongues or stretches, those left out that none of the rows has."""
    values: dict[str, Array] = {}
    rows = prod(len(place) for place in places)
    for variable in variables:
        lead = variable.lead
        read = _cut(group[variable.name], lead, places)
        values[variable.name] = read.reshape(*read.shape[:lead], rows, *read.shape[lead + len(places) :])
    keys = tongues(group)
    present = np.zeros(len(keys), dtype=bool)
    for variable in variables:
        there = _filled(variable, values[variable.name])
        if "tongue" in variable.dims:
            present |= there
        elif variable.of_parts:
            last = np.flatnonzero(there)[-1] + 1 if there.any() else 0
            values[variable.name] = values[variable.name][:last]
    new = np.where(present, np.cumsum(present) - 1, -1)
    for variable in variables:
        if "tongue" in variable.dims:
            part = values[variable.name][present]
            values[variable.name] = np.append(new, -1)[part] if variable.index_of == "tongue" else part
    return Outcome(values, tuple(key for key, kept in zip(keys, present, strict=True) if kept))


def _filled(variable: Variable, values: Array) -> Array:
    """Which entries of a list have a value in any row, ``(entries,)``."""
    flat = values.reshape(len(values), prod(values.shape[1:]))
    missing = np.isnan(flat) if flat.dtype.kind == "f" else flat == variable.fill
    return np.asarray(~missing.all(axis=1))


def tongues(group: h5py.Group) -> tuple[Key, ...]:
    """Return what the dimension ``tongue`` of a group consists of."""
    columns: dict[str, list[Any]] = {}
    for variable in TONGUE:
        data = group[variable.name]
        columns[variable.name] = (data.asstr()[...] if variable.dtype == TEXT else data[...]).tolist()
    named = [Tongue(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]
    return tuple(zip(named, group[OCCURRENCE.name][...].tolist(), strict=True))
