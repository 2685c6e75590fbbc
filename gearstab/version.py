"""The version, which results carry, and the commit that it was built from.

This file imports nothing of the package: ``setup.py`` runs it by itself.
"""

from __future__ import annotations

from pathlib import Path

__version__ = "0.1.0"

BUILT = "commit.txt"
"""File beside this one: the commit, where the package was built from a repository."""
DIGITS = 12


def commit() -> str:
    """Return the commit of this package, abbreviated: as built, else as checked out; "" where it is not known.

    No program runs: the files of git are read.
    """
    here = Path(__file__).resolve().parent
    try:
        return (here / BUILT).read_text(encoding="ascii").strip()[:DIGITS]
    except (OSError, ValueError):
        pass
    try:
        return checked_out(here.parent)[:DIGITS]
    except (OSError, ValueError):
        return ""


def checked_out(root: Path) -> str:
    """Return the commit that is checked out in a repository. Raises OSError or ValueError where there is none."""
    folder = root / ".git"
    if folder.is_file():  # a second working tree
        folder = root / folder.read_text().removeprefix("gitdir:").strip()
    head = (folder / "HEAD").read_text().strip()
    if not head.startswith("ref:"):
        return _hexadecimal(head)
    name = head.removeprefix("ref:").strip()
    common = folder / "commondir"
    shared = (folder / common.read_text().strip()).resolve() if common.is_file() else folder
    for place in (folder / name, shared / name):
        if place.is_file():
            return _hexadecimal(place.read_text().strip())
    for line in (shared / "packed-refs").read_text().splitlines():
        found, _, named = line.partition(" ")
        if named == name:
            return _hexadecimal(found)
    raise ValueError(f"no commit of {name}")


def _hexadecimal(text: str) -> str:
    int(text, 16)
    return text


def full_version() -> str:
    """Return the version with its commit, where that is known: ``0.1.0 (commit 0123456789ab)``."""
    found = commit()
    return f"{__version__} (commit {found})" if found else __version__
