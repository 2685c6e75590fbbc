"""Files that a result must not replace."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from gearstab.errors import ResultError
from gearstab.results.output import FIGURES, OTHERS, TABLES, Content
from gearstab.results.read import REMEDY, attributes, is_sealed
from gearstab.results.seal import holds

SWEEP, RESPOND, BENCH, DESIGN = "sweep", "respond", "bench", "design"
"""The commands that write results; a result names its own in the attribute ``command``."""

INSTEAD = {".csv": "export", ".png": "plot", ".pdf": "plot", ".svg": "plot"}
"""Ending of a name -> the command that writes such a file from a result."""


def fault(command: str | None, path: Path) -> str:
    """Return what is wrong with a file that a result of ``command`` (None: of any) is to replace, "" for nothing.

    A damaged one counts as a result of the command if this still stands in it.
    """
    try:
        if command is not None and is_sealed(path) is False and holds(path, command):
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
