"""Remains of an earlier run at the output of a sweep, and whether the new result may take its place.

A sweep replaces results of sweeps of the same configuration file (with the same ``--set``), whatever that file said
then, when the new result is complete. What is something else is refused: the result of another configuration unless
``--overwrite`` is given, everything else always.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from gearstab.config import Config
from gearstab.errors import OutputError
from gearstab.results.guard import SWEEP, result_of
from gearstab.results.read import attributes, is_sealed
from gearstab.results.seal import holds
from gearstab.results.tree import FORMAT
from gearstab.sweep.plan import Plan
from gearstab.version import __version__

Identity = tuple[int, int]


@dataclass(frozen=True)
class Earlier:
    """The file at the output.

    complete: whether it is the result of the very plan, whole. retitled: whether only its title is another one.
    note: why it is replaced; "" where that needs no word.
    """

    complete: bool = False
    retitled: bool = False
    note: str = ""


def look(plan: Plan, out: Path, overwrite: bool = False) -> Earlier:
    """Look at the output before anything is computed.

    Raises OutputError if it holds something that a sweep of this configuration must not replace.
    """
    result_of(SWEEP).refuse(out, plan.config.source)
    if not out.exists() or not out.stat().st_size:
        return Earlier()
    sealed, found = _read(out)
    same = _is_of(plan, out, found)
    if not same and not overwrite and not (found and same_origin(found, plan.config, out)):
        raise OutputError(f"{out}: {_other(found)}; choose another output, or use --overwrite")
    if overwrite:
        return Earlier()
    if not same:
        return Earlier(note="is of an earlier state of the configuration, and is replaced when the sweep is complete")
    if not sealed:
        what = "is damaged" if sealed is False else "was changed after it was written"
        return Earlier(note=f"{what}: it is computed again, and replaced when the sweep is complete")
    if (found["gearstab_version"], found["format_version"]) != (__version__, str(FORMAT)):
        return Earlier(note=f"was computed by gearstab {found['gearstab_version']}: it is computed again")
    return Earlier(complete=True, retitled=found.get("title") != plan.config.title)


def _read(out: Path) -> tuple[bool | None, dict[str, str]]:
    """Whether the seal of a result fits, and its attributes: none of a damaged one, which HDF5 must not open."""
    sealed = is_sealed(out)
    return sealed, {} if sealed is False else attributes(out)


def _is_of(plan: Plan, out: Path, found: dict[str, str]) -> bool:
    """Whether a result with these attributes is of a configuration; a damaged one, whether this stands in it."""
    digest = plan.config.digest
    return found.get("config_digest") == digest if found else holds(out, digest)


def _other(found: dict[str, str]) -> str:
    if not found:
        return "is a damaged result, of this or another configuration"
    origin = f", {found['config_file']}" if "config_file" in found else ""
    return f"is the result of another configuration{origin} ('{found.get('title', '')}')"


def look_again(plan: Plan, out: Path, before: Identity | None) -> None:
    """Look at the output when the new result is to take its name; ``before``: its identity when the sweep started.

    Raises OutputError if another process has put something else there; an equal sweep may have.
    """
    now = identity(out)
    if now in (None, before):
        return
    result_of(SWEEP).refuse(out)
    if not _is_of(plan, out, _read(out)[1]):
        raise OutputError(f"{out}: meanwhile another sweep has put its result there; choose another output")


def identity(path: Path) -> Identity | None:
    """Return what tells a file from one that was there before; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size


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
