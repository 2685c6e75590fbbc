"""Result files as xarray trees."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gearstab.results.errors import ResultError

if TYPE_CHECKING:
    import xarray as xr

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def open_result(path: str | Path) -> xr.DataTree:
    """Open a result file; values are read when they are used. Close it, or use it in a ``with`` statement.

    The file is not locked: it can be read while another process reads or replaces it.

    Raises ResultError, with one line, for a file that is missing, no HDF5, cut short, or written by another program.
    """
    check(path)
    import xarray as xr

    try:
        return xr.open_datatree(path, engine="h5netcdf", driver_kwds={"locking": False})
    except (OSError, ValueError, KeyError) as error:
        raise ResultError(f"{path}: cannot be read as a result: {one_line(error)}") from error


def check(path: str | Path) -> None:
    """Raise ResultError unless the file is a complete result of this program."""
    attributes(path)


def attributes(path: str | Path) -> dict[str, str]:
    """The attributes of a result's root, as texts. Raises ResultError as :func:`open_result` does."""
    try:
        with open(path, "rb") as file:
            start = file.read(len(SIGNATURE))
    except FileNotFoundError:
        raise ResultError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise ResultError(f"{path}: is a folder") from None
    except OSError as error:
        raise ResultError(f"{path}: cannot be read: {error.strerror}") from None
    if start != SIGNATURE:
        raise ResultError(f"{path}: is no result file (netCDF-4/HDF5)")
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: str(value) for name, value in file.attrs.items()}
    except OSError as error:
        raise ResultError(f"{path}: is damaged or incomplete: {one_line(error)}") from None
    if "gearstab_version" not in found:
        raise ResultError(f"{path}: was not written by gearstab")
    return found


def one_line(error: Exception) -> str:
    """An exception's text without line breaks."""
    return " ".join(str(error).split())
