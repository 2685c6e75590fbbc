"""Result files as xarray trees."""

from __future__ import annotations

import io
import os
import stat
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial
from itertools import product
from math import ceil, prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gearstab.errors import ResultError, UserError, one_line
from gearstab.results.hdf5 import holds_text, intact
from gearstab.results.output import FIGURES, OTHERS, TABLES, Content
from gearstab.results.tree import FORMAT, NO_VARIABLE

if TYPE_CHECKING:
    import h5py
    import xarray as xr

SIGNATURE = b"\x89HDF\r\n\x1a\n"

REMEDY = "; compute it again or restore a copy"
STILL = 2.0
"""Seconds: a file that changed so recently may change again, without another time stamp."""
MOST_COMPRESSED = 1100
"""No data are deflated by more: 1032 at best."""


def open_result(path: str | Path, chunks: Mapping[str, int] | Literal["auto"] | None = None) -> xr.DataTree:
    """Open a result file; values are read when they are used. Close it, or use it in a ``with`` statement.

    chunks: with dask installed variables are dask arrays in pieces of these sizes by dimension, ``auto`` or, ``{}``, as
    they are stored, so that what is computed of them needs memory for some pieces only; None: NumPy arrays.

    The file is not locked: it can be read while another process reads or replaces it.

    Raises ResultError, with one line, for a file that is missing, no HDF5, cut short, damaged, of another version of
    the format, or written by another program.
    """
    found = attributes(path)
    if found["format_version"] != str(FORMAT):
        raise ResultError(
            f"{path}: has version {found['format_version']} of the format of results, written by gearstab "
            f"{found['gearstab_version']}; this gearstab reads version {FORMAT}: compute it again"
        )
    refuse_hollow(path)
    import xarray as xr

    try:
        return xr.open_datatree(path, engine="h5netcdf", driver_kwds={"locking": False}, chunks=chunks)
    except Exception as error:
        raise ResultError(f"{path}: cannot be read as a result: {one_line(error)}") from error


def from_bytes(data: memoryview) -> xr.DataTree:
    """Return the result that a file of these bytes holds, all of it in memory."""
    import xarray as xr

    with xr.open_datatree(io.BytesIO(data), engine="h5netcdf") as tree:
        # Group by group: `DataTree.load` leaves out a variable that has the name of a group.
        groups = {node.path: node.to_dataset(inherit=False).load() for node in tree.subtree}
        return type(tree).from_dict(groups, name=tree.name)


@contextmanager
def reading(path: str | Path) -> Iterator[xr.DataTree]:
    """Open a result for a command, and blame the file for what goes wrong with it if it is not as gearstab wrote it.

    A file whose seal fits is right, and an exception is a fault of the program. Anything may be missing in another one,
    which somebody changed: then it is a ResultError.
    """
    with open_result(path) as tree:
        try:
            yield tree
        except UserError:
            raise
        except OSError as error:
            # With a name it is about another file.
            if error.filename is not None:
                raise
            raise ResultError(f"{path}: cannot be read: {one_line(error)}") from error
        except Exception as error:
            if intact(path):
                raise
            said = f"{type(error).__name__}: {one_line(error)}"
            raise ResultError(f"{path}: was changed after it was written and cannot be used ({said})") from error


def is_sealed(path: str | Path) -> bool | None:
    """Return whether the seal of an HDF5 file fits, None without one. Raises ResultError for what is no such file."""
    _refuse_other_files(path)
    try:
        found = os.stat(path)
        changed = max(found.st_mtime, found.st_ctime)
        if time.time() - changed > STILL:
            return _seen(str(path), (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns))
        return intact(path)
    except OSError as error:
        raise ResultError(f"{path}: cannot be read: {error.strerror}") from None


@lru_cache(maxsize=16)
def _seen(path: str, identity: tuple[int, ...]) -> bool | None:
    """Whether a seal fits: a file that lies still is read once."""
    return intact(path)


def refuse_damaged(path: str | Path) -> None:
    """Raise ResultError for a file that is damaged, or no HDF5 file: before HDF5 opens it, which may never return."""
    if is_sealed(path) is False:
        raise ResultError(f"{path}: is damaged, it does not match its checksum{REMEDY}")


def _refuse_other_files(path: str | Path) -> None:
    """Raise ResultError unless a file begins as HDF5 does; a pipe is not even opened."""
    try:
        if not stat.S_ISREG(Path(path).stat().st_mode):
            raise ResultError(f"{path}: is {'a folder' if Path(path).is_dir() else 'no regular file'}")
        with open(path, "rb") as file:
            start = file.read(len(SIGNATURE))
        if start != SIGNATURE:
            raise ResultError(f"{path}: is no result file (netCDF-4/HDF5)")
    except FileNotFoundError:
        raise ResultError(f"{path}: there is no such file") from None
    except OSError as error:
        raise ResultError(f"{path}: cannot be read: {error.strerror}") from None


def attributes(path: str | Path) -> dict[str, str]:
    """Return the attributes of a result's root, as texts, ``command`` and ``format_version`` always among them.

    Raises ResultError as :func:`open_result` does, but for a version of the format.
    """
    import h5py

    refuse_damaged(path)
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: _as_text(value) for name, value in file.attrs.items()}
            command = _command(file)
    except Exception as error:
        raise ResultError(f"{path}: is damaged or incomplete: {one_line(error)}") from None
    if "gearstab_version" not in found:
        raise ResultError(f"{path}: was not written by gearstab")
    return {"command": command, "format_version": str(FORMAT)} | found


def _as_text(value: Any) -> str:
    """The text of an attribute; other programs, xarray among them, write a number as a list of one."""
    import numpy as np

    value = np.asarray(value)
    single = value.item() if value.size == 1 else value
    return single.decode(errors="replace") if isinstance(single, bytes) else str(single)


def _command(file: h5py.File) -> str:
    """The command that wrote a result without saying so."""
    if "bench" in file:
        return "bench"
    return "respond" if "response" in file and "time" in file["response"] else "sweep"


def refuse_hollow(path: str | Path) -> None:
    """Raise ResultError if a variable is declared far larger than what is stored of it, or consists of lists.

    To read one would take memory that no value needs, terabytes perhaps. No result has lists, but where the bytes of a
    type are damaged numbers are taken for some, and HDF5 crashes.
    """
    import h5py

    hollow: list[str] = []

    def look(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or NO_VARIABLE in str(item.attrs.get("NAME", "")):
            return
        if item.id.get_type().detect_class(h5py.h5t.VLEN):  # texts are no lists to it
            hollow.append(f"{name} consists of lists, as no variable does")
        declared = item.size * item.id.get_type().get_size() if item.size else 0
        stored = item.id.get_storage_size()
        if declared > MOST_COMPRESSED * stored * _blocks(item):
            hollow.append(f"{name} declares {declared:.3g} bytes and holds {stored:.3g}")

    try:
        with h5py.File(path, "r", locking=False) as file:
            file.visititems(look)
    except Exception as error:
        raise ResultError(f"{path}: is damaged or incomplete: {one_line(error)}") from None
    if hollow:
        raise ResultError(f"{path}: is damaged or incomplete: {hollow[0]}")


def _blocks(item: h5py.Dataset) -> int:
    """In how many blocks of a sweep a tongue may be missing: they then hold nothing of it. At least one has it."""
    if item.chunks is None or item.ndim < 2 or item.chunks[0] != 1:
        return 1
    return max(1, prod(ceil(n / c) for n, c in zip(item.shape[1:], item.chunks[1:], strict=True)))


def groups_of(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    """Return the groups of a result by name, each with the axes over which it stands."""
    return {
        str(name): branches_of(tree) if name == "branches" else node.to_dataset()
        for name, node in tree.children.items()
    }


def branches_of(tree: xr.DataTree) -> xr.Dataset:
    """Return the group ``branches`` with the axes over which it stands, as a dataset that can be cut.

    Where these are in memory, in one of a sweep that was read before, ``mesh_frequency`` is a coordinate. Raises
    ResultError for one of an older layout.
    """
    own = tree.children["branches"].to_dataset(inherit=False)
    if "branch_frequency" in own or "kind" in own:
        raise ResultError("its branches were written by an older gearstab, in another layout: run the sweep again")
    own = own.reset_coords([name for name, item in own.coords.items() if item.ndim > 1])
    return own.assign_coords({name: tree.coords[name] for name in own.dims if name in tree.coords})


SWEEP, RESPOND, BENCH, DESIGN = "sweep", "respond", "bench", "design"
"""The commands that write results; a result names its own in the attribute ``command``."""

INSTEAD = {".csv": "export", ".png": "plot", ".pdf": "plot", ".svg": "plot"}
"""Ending of a name -> the command that writes such a file from a result."""


def fault(command: str | None, path: Path) -> str:
    """Return what is wrong with a file that a result of ``command`` (None: of any) is to replace, "" for nothing.

    A damaged one counts as a result of the command if this still stands in it.
    """
    try:
        if command is not None and is_sealed(path) is False and holds_text(path, command):
            return ""
        found = attributes(path)
    except ResultError as error:
        return str(error).removeprefix(f"{path}: ").removesuffix(REMEDY)
    other = found["command"]
    return f"is a result of gearstab {other}" if command not in (None, other) else ""


def result_of(command: str | None) -> Content:
    """Return what a command writes as its result, which may replace an earlier one of the same command only."""
    wrong = (*TABLES, *FIGURES, *OTHERS)
    return Content("a result", ".h5", partial(fault, command), wrong, streams=False, instead=INSTEAD)


def blocks(shape: Sequence[int], most: int) -> Iterator[tuple[slice, ...]]:
    """Slices that run over an array in order, with at most about so many points each."""
    lengths, left = [1] * len(shape), most
    for k in reversed(range(len(shape))):
        lengths[k] = max(1, min(shape[k], left))
        left //= lengths[k]
        if lengths[k] < shape[k]:
            break
    ranges = [range(0, max(1, n), step) for n, step in zip(shape, lengths, strict=True)]
    for start in product(*ranges):
        yield tuple(slice(s, s + step) for s, step in zip(start, lengths, strict=True))
