"""Earlier results: at the output of a sweep, which replaces them, and those whose points it takes over, ``--extend``.

A sweep replaces results of sweeps of the same configuration file (with the same ``--set``), whatever that file said
then, when the new result is complete. What is something else is refused: the result of another configuration unless
``--overwrite`` is given, everything else always. Points are taken over that are the same in both, bit for bit.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config import Config
from gearstab.errors import OutputError, ResultError, SweepError, one_line
from gearstab.methods import Key, Outcome
from gearstab.results.hdf5 import holds_text
from gearstab.results.read import SWEEP, attributes, is_sealed, result_of
from gearstab.results.tree import FORMAT
from gearstab.results.variables import OCCURRENCE, TEXT, TONGUE, Variable
from gearstab.system import Array
from gearstab.version import __version__

if TYPE_CHECKING:
    import h5py

Identity = tuple[int, int, int]
"""Data that distinguish a file from another one that took its name, or from itself before a change."""


def identity(path: Path) -> Identity | None:
    """Return the identity of a file; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def replaced(path: Path, before: Identity | None) -> bool:
    """Return whether another file has come to a path, or gone from it; another time stamp alone makes none."""
    now = identity(path)
    return (now and now[:2]) != (before and before[:2])


@dataclass(frozen=True)
class Previous:
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
            message = f"{type(error).__name__}: {one_line(error)}"
            text = f"{self.path}: {method} in it is not as a sweep writes it ({message}); compute it again"
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
    from gearstab.perturbation import Tongue  # takes as long to load as a small sweep to run

    columns: dict[str, list[Any]] = {}
    for variable in TONGUE:
        data = group[variable.name]
        columns[variable.name] = (data.asstr()[...] if variable.dtype == TEXT else data[...]).tolist()
    named = [Tongue(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]
    return tuple(zip(named, group[OCCURRENCE.name][...].tolist(), strict=True))


@dataclass(frozen=True)
class AtOutput:
    """The file at the output.

    complete: whether it is the whole result of the very configuration. retitled: whether only its title is another one.
    note: why it is replaced; "" where that needs no word.
    """

    complete: bool = False
    retitled: bool = False
    note: str = ""


def look(config: Config, out: Path, overwrite: bool = False) -> AtOutput:
    """Look at the output before anything is computed.

    Raises OutputError if it holds something that a sweep of this configuration must not replace.
    """
    result_of(SWEEP).refuse(out, config.source)
    if not out.exists() or not out.stat().st_size:
        return AtOutput()
    sealed, found = _read(out)
    same = _is_of(config, out, found)
    if not same and not overwrite and not (found and same_origin(found, config, out)):
        raise OutputError(f"{out}: {_other(found)}; choose another output, or use --overwrite")
    if overwrite:
        return AtOutput()
    if not same:
        return AtOutput(note="is of an earlier state of the configuration, and is replaced when the sweep is complete")
    if not sealed:
        what = "is damaged" if sealed is False else "was changed after it was written"
        return AtOutput(note=f"{what}: it is computed again, and replaced when the sweep is complete")
    if (found["gearstab_version"], found["format_version"]) != (__version__, str(FORMAT)):
        return AtOutput(note=f"was computed by gearstab {found['gearstab_version']}: it is computed again")
    return AtOutput(complete=True, retitled=found.get("title") != config.title)


def _read(out: Path) -> tuple[bool | None, dict[str, str]]:
    """Whether the seal of a result fits, and its attributes: none of a damaged one, which HDF5 must not open."""
    sealed = is_sealed(out)
    return sealed, {} if sealed is False else attributes(out)


def _is_of(config: Config, out: Path, found: dict[str, str]) -> bool:
    """Whether a result with these attributes is of a configuration; a damaged one, whether this stands in it."""
    digest = config.digest
    return found.get("config_digest") == digest if found else holds_text(out, digest)


def _other(found: dict[str, str]) -> str:
    if not found:
        return "is a damaged result, of this or another configuration"
    origin = f", {found['config_file']}" if "config_file" in found else ""
    return f"is the result of another configuration{origin} ('{found.get('title', '')}')"


def look_again(config: Config, out: Path, before: Identity | None) -> None:
    """Look at the output when the new result is to take its name; ``before``: its identity when the sweep started.

    Raises OutputError if another process has put something else there; an equal sweep may have.
    """
    if not out.exists() or not replaced(out, before):
        return
    result_of(SWEEP).refuse(out)
    if not _is_of(config, out, _read(out)[1]):
        raise OutputError(f"{out}: meanwhile another sweep has put its result there; choose another output")


def origin(config: Config, out: Path) -> dict[str, str]:
    """Return the attributes of a result that say where its configuration stands: relative to its own folder."""
    return {"config_file": _relative(config.source, out), "config_overrides": "\n".join(config.overrides)}


def same_origin(found: dict[str, str], config: Config, out: Path) -> bool:
    """Whether a result with these attributes comes from the file of a configuration, with the same overrides."""
    mine = origin(config, out)
    return all(found.get(name) == value for name, value in mine.items())


def _relative(path: Path, out: Path) -> str:
    folder = os.path.dirname(os.path.realpath(out))
    try:
        return Path(os.path.relpath(os.path.realpath(path), folder)).as_posix()
    except ValueError:  # another drive
        return path.name
