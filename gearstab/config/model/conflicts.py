"""What contradicts itself in a section, beyond what each value by itself may be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearstab.config.document.problems import Path

Conflict = tuple[Path, str, str]
"""Path below the section, message, remedy."""


def exactly_one(raw: dict[str, Any], names: tuple[str, ...], what: str = "") -> Iterator[Conflict]:
    """A conflict unless exactly one of the keys is given."""
    either = " or ".join(names)
    if all(raw.get(name) is None for name in names):
        yield (), f"{either} is missing", what or f"add {either}"
    yield from at_most_one(raw, names)


def at_most_one(raw: dict[str, Any], names: tuple[str, ...]) -> Iterator[Conflict]:
    """A conflict for each of the keys that is given beside another one."""
    given = [name for name in names if raw.get(name) is not None]
    for extra in given[1:]:
        yield (extra,), f"{given[0]} is given already", f"keep one of {', '.join(names)}"
