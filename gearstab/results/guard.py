"""What a result must not be written over."""

from __future__ import annotations

from pathlib import Path

from gearstab.results.errors import ResultError
from gearstab.results.read import check


def refuse_inputs(out: Path, *inputs: Path) -> None:
    """Raise ResultError if ``out`` is one of the files that are read, under whatever name."""
    for path in inputs:
        if out.exists() and path.exists() and out.samefile(path):
            raise ResultError(f"{out}: is the input itself; choose another output")


def refuse_foreign(out: Path) -> None:
    """Raise ResultError if ``out`` is there and is no result: then nobody meant to replace it."""
    if not out.exists():
        return
    try:
        check(out)
    except ResultError as error:
        raise ResultError(f"{error}; it is not overwritten: choose another output or remove it") from None
