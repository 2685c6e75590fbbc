"""Files that a configuration names: arrays in files of NumPy, HDF5 and MATLAB, and columns of numbers in texts."""

from __future__ import annotations

import io
import json
import math
import os
import re
import stat
import subprocess
import sys
import zipfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from gearstab.config.document import shown
from gearstab.config.document.yaml import LARGEST_TEXT, NO_REGULAR
from gearstab.config.model.fields import Quantity
from gearstab.config.model.units import UnitError, to_si
from gearstab.errors import one_line

SLOWEST = 60
"""Seconds that reading a file of MATLAB may take."""


class DataFileError(ValueError):
    """A file holds nothing that can be used; ``hint`` says what it should hold."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


def usable(path: FilePath, what: str, suffixes: Sequence[str]) -> None:
    """Raises DataFileError for a file that is not there, of another kind or no regular one. what: ``.csv or .h5``."""
    if path.suffix.lower() not in suffixes:
        raise DataFileError(f"is no {what} file", f"save it as one of {', '.join(suffixes)}")
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        hint = "the path is relative to the folder of the configuration"
        raise DataFileError("there is no such file", hint) from None
    except (OSError, ValueError) as error:
        raise DataFileError(f"cannot be read: {getattr(error, 'strerror', None) or error}".lower()) from None
    if stat.S_ISDIR(mode):
        raise DataFileError("is a folder", "name a file")
    if not stat.S_ISREG(mode):
        raise DataFileError(NO_REGULAR, "save the data in a file")


def text(path: FilePath) -> str:
    """Return the contents of a text file. Raises DataFileError."""
    try:
        if path.stat().st_size > LARGEST_TEXT:
            raise DataFileError(f"is larger than {LARGEST_TEXT // 10**6} MB", "save fewer samples")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise DataFileError(f"cannot be read: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        raise DataFileError("is not UTF-8 text", "save the file in UTF-8") from None


def arrays(path: FilePath, names: Collection[str], most: int, units: dict[str, str] | None = None) -> dict[str, Any]:
    """The arrays of these names in a .npz, .h5 or .mat file, and None under the name of any other.

    most: entries along a dimension, told from what the file declares, before anything is read.
    units: filled with the attributes ``units`` of the datasets of a .h5 file.
    Raises DataFileError.
    """
    try:
        if path.suffix.lower() == ".npz":
            return _npz(path, names, most)
        import h5py

        matlab = path.suffix.lower() == ".mat" and not h5py.is_hdf5(path)
        return _matlab(path, names, most) if matlab else _hdf5(path, names, most, units)
    except DataFileError:
        raise
    except Exception as error:  # each library has errors of its own for a broken file
        raise _broken(error) from None


def _broken(error: Exception) -> DataFileError:
    reason = one_line(error) or type(error).__name__
    return DataFileError(f"cannot be read: {reason}", "save the data again")


def _npz(path: FilePath, names: Collection[str], most: int) -> dict[str, Any]:
    found: dict[str, Any] = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            name = member.removesuffix(".npy")
            found[name] = None
            if name not in names:
                continue
            with archive.open(member) as stream:
                version = np.lib.format.read_magic(stream)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                _checked(name, read(stream)[0], most)
            with archive.open(member) as stream:
                found[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return found


def _hdf5(path: FilePath, names: Collection[str], most: int, units: dict[str, str] | None) -> dict[str, Any]:
    import h5py

    found: dict[str, Any] = {}
    with h5py.File(path, "r", locking=False) as file:
        for name in file:
            link, item = file.get(name, getlink=True), None
            # What lies in other files is not looked at: it may be anything.
            if name in names and isinstance(link, h5py.HardLink) and isinstance(file[name], h5py.Dataset):
                item = file[name]
                if item.external or item.is_virtual:
                    raise DataFileError(f"{name} lies in other files", "save it in this one")
                _checked(name, item.shape, most)
                _real(name, item.dtype)  # before it is read: HDF5 trusts lists of any length, and may never return
                if units is not None and "units" in item.attrs:
                    given = item.attrs["units"]
                    units[name] = given.decode(errors="replace") if isinstance(given, bytes) else str(given)
                item = item[()]
            found[name] = item
    # MATLAB's own HDF5 files hold the columns of a matrix as its rows.
    turned = path.suffix.lower() == ".mat"
    return {name: np.transpose(values) if turned and values is not None else values for name, values in found.items()}


def _matlab(path: FilePath, names: Collection[str], most: int) -> dict[str, Any]:
    """Read in a process of its own: on a damaged file SciPy's reader may crash."""
    reader = "from gearstab.config.model.files import main; main()"
    command = [sys.executable, "-c", reader, str(path), str(most), *names]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=SLOWEST, check=False)
    if done.returncode == 1 and done.stdout:
        raise DataFileError(*json.loads(done.stdout))
    if done.returncode:
        raise DataFileError("cannot be read: it is damaged", "save the data again")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        return {name: archive[name] if name in names else None for name in archive.files}


def main() -> None:
    """Write the arrays of a MATLAB file, as the arguments ask for them, to standard output, or what is wrong."""
    from scipy.io import loadmat, whosmat

    path, most, names = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    try:
        held = {name: shape for name, shape, _ in whosmat(path)}
        for name in held.keys() & set(names):
            _checked(name, held[name], most)
        wanted = loadmat(path, variable_names=names)
        values = {name: numbers(name, wanted[name]) if name in names else np.zeros(0) for name in held}
        np.savez(sys.stdout.buffer, allow_pickle=False, **values)
    except Exception as error:
        if not isinstance(error, DataFileError):
            error = _broken(error)
        sys.stdout.write(json.dumps([str(error), error.hint]))
        sys.exit(1)


def _checked(name: str, shape: Sequence[int], most: int) -> None:
    if shape is None or len(shape) > 2 or any(not 0 <= size <= most for size in shape):
        described = "no shape" if shape is None else f"the shape {tuple(shape)}"
        raise DataFileError(f"{name} has {described}", f"save one or two dimensions of at most {most:,} entries")


def _real(name: str, kind: np.dtype[Any]) -> None:
    if kind.kind not in "fiu":
        raise DataFileError(f"{name} holds no real numbers but {kind}", "save real numbers")


def numbers(name: str, values: Any) -> np.ndarray:
    """The array as floats. Raises DataFileError where it holds something else."""
    if hasattr(values, "toarray"):
        values = values.toarray()
    array = np.asarray(values)
    _real(name, array.dtype)
    array = np.ascontiguousarray(array, dtype=float)
    endless = np.argwhere(~np.isfinite(array))
    if len(endless):
        place = ".".join(map(str, endless[0]))
        raise DataFileError(f"entry {place} of {name} is not finite", "save finite numbers")
    return array


def present(found: Mapping[str, Any]) -> str:
    """Names of what a file holds, for messages."""
    return ", ".join(sorted(name for name in found if not name.startswith("__"))[:12]) or "nothing"


COUNTS = {2: "two", 3: "three"}
HEADER = re.compile(r"\s*(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))?\s*", re.DOTALL)
"""A name, and a unit in brackets."""
PLAIN = ("", "-", "1", "fraction")
"""Units of a column whose numbers are taken as they are."""
BLANKS = r"\s+(?![\[(])(?![^\[(]*[\])])"
"""Blanks that separate columns: not those before a unit in brackets or within it."""


def columns_of(content: str, columns: Mapping[str, Quantity]) -> tuple[list[str], list[list[float]]]:
    """Return the place of each line, and the numbers of each column in SI units.

    The first line, or a comment before the numbers, may name the columns, each with a unit in brackets, or in a line of
    units that follows.

    columns: the names, and what each may be. Raises DataFileError, with the line.
    """
    names = tuple(columns)
    order: tuple[int, ...] | None = None
    named: list[str] = []
    factors = dict.fromkeys(names, 1.0)
    places: list[str] = []
    samples: dict[str, list[float]] = {name: [] for name in names}
    for number, line in enumerate(content.splitlines(), start=1):
        plain, _, comment = line.partition("#")
        fields = _fields(plain)
        place, heads = f"line {number}", _fields(comment)
        if not places and order is None:
            if not fields and _is_header(heads, names):
                fields = heads
            if fields and all(_number(field) is None for field in fields):
                order, factors = _header(fields, place, columns)
                named = fields
                continue
        elif not places and _are_units(fields, named):
            heads = [f"{name} [{unit.strip('[]()')}]" for name, unit in zip(named, fields, strict=True)]
            order, factors = _header(heads, place, columns)
            continue
        if not fields:
            continue
        if len(fields) <= max(order or (0,)) or (len(fields) != len(names) and order is None):
            hint = (
                f"write {COUNTS[len(names)]} numbers per line, {_listed(names)}, or name the columns in the first line"
            )
            raise DataFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(names, order or range(len(names)), strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise DataFileError(message, "write a number such as 2.5e8")
            samples[name].append(value * factors[name])
        places.append(place)
    return places, list(samples.values())


def head(field: str) -> tuple[str, str]:
    """Return the name of a column and its unit, "" without one: ``stiffness [N/um]``, ``stiffness (N/um)``."""
    found = HEADER.fullmatch(field)
    return (found[1], (found[2] or found[3] or "").strip()) if found else (field, "")


def factor(unit: str, quantity: Quantity, what: str) -> float:
    """Return the SI value of one of a unit, 1 without one. Raises DataFileError, which begins with ``what``."""
    try:
        return 1.0 if unit in PLAIN else quantity.number(f"1 {unit}")
    except PydanticCustomError as error:
        raise DataFileError(f"{what} {error.message()}", str((error.context or {}).get("hint", ""))) from None


def _fields(line: str) -> list[str]:
    """Return the entries of a line, none of an empty one."""
    line = line.strip()
    separator = r"\s*;\s*" if ";" in line else r"\s*,\s*" if "," in line else BLANKS
    return [field.strip("\"' ") for field in re.split(separator, line)] if line else []


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _is_header(fields: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether a comment names the columns, or gives each of as many columns a unit."""
    heads = [head(field) for field in fields]
    named = {name.lower() for name, _ in heads}
    return named.issuperset(names) or (len(heads) == len(names) and all(_is_unit(field) for field in fields))


def _is_unit(field: str) -> bool:
    """Return whether a field ends with a unit in brackets, and not with other words in them."""
    found = HEADER.fullmatch(field)
    unit = found and (found[2] or found[3])
    try:
        return bool(unit) and (unit in PLAIN or to_si(f"1 {unit}", ("m",)) is not None)
    except UnitError as error:
        return error.type != "unknown_unit"


def _are_units(fields: Sequence[str], named: Sequence[str]) -> bool:
    """Return whether a line gives columns their units, which have none in the line of their names."""
    if len(fields) != len(named) or any(head(name)[1] for name in named):
        return False
    return all(field in PLAIN or _is_unit(f"[{field.strip('[]()')}]") for field in fields) and any(
        _number(field) is None for field in fields
    )


def _header(
    fields: Sequence[str], place: str, columns: Mapping[str, Quantity]
) -> tuple[tuple[int, ...], dict[str, float]]:
    """Return which columns have the names, and the factor of the unit of each."""
    heads = [head(field) for field in fields]
    found = [name.lower() for name, _ in heads]
    missing = [name for name in columns if found.count(name) != 1]
    if missing:
        twice = [name for name in missing if name in found]
        fault = f"names {twice[0]} twice" if twice else f"names no column {_listed(missing)}"
        names, (last, quantity) = _listed(tuple(columns)), list(columns.items())[-1]
        unit = f'"{last} [{quantity.unit}]"'
        raise DataFileError(
            f"{place}: the header {shown(', '.join(fields))} {fault}",
            f"call the columns {names}; units stand in brackets, {unit}, and are SI without"
            + "; a phase is a fraction of the mesh period" * ("phase" in columns),
        )
    order = tuple(found.index(name) for name in columns)
    units = [
        (name, heads[k][1], f"{place}: the header {shown(fields[k])}") for name, k in zip(columns, order, strict=True)
    ]
    return order, {name: factor(unit, columns[name], what) for name, unit, what in units}


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
