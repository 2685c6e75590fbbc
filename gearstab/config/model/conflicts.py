"""What contradicts itself in a section as written, beyond what each value by itself may be, and how it is read.

The section may hold anything: what is of another type than its field is reported elsewhere, and counts as not given.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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


def below(key: str | int, conflicts: Iterable[Conflict]) -> Iterator[Conflict]:
    """Yield the conflicts of what stands at a key."""
    for path, message, hint in conflicts:
        yield (key, *path), message, hint


def mapping(raw: Any, key: str) -> dict[str, Any]:
    """Return the mapping at a key, an empty one where there is none."""
    inner = raw.get(key) if isinstance(raw, dict) else None
    return inner if isinstance(inner, dict) else {}


def entries(raw: Any, key: str) -> list[Any]:
    """Return the list at a key, an empty one where there is none."""
    inner = raw.get(key) if isinstance(raw, dict) else None
    return inner if isinstance(inner, list) else []


def mappings(raw: Any, key: str) -> list[tuple[int, dict[str, Any]]]:
    """Return those entries of the list at a key that are mappings, with their indices."""
    return [(i, item) for i, item in enumerate(entries(raw, key)) if isinstance(item, dict)]


def wrong_length(raw: Any, key: str, size: int | None, what: str = "coordinate") -> Iterator[Conflict]:
    """Yield a conflict where the list at a key does not have as many entries as there are; None: nobody knows."""
    inner = raw.get(key) if isinstance(raw, dict) else None
    if isinstance(inner, list) and size is not None and len(inner) != size:
        yield (key,), f"has {len(inner)} entries", f"give {size}, one a {what}"


def no_direction(raw: Any, key: str, size: int | None, hint: str) -> Iterator[Conflict]:
    """Yield a conflict where the list at a key is no vector of the size of the system, or has only zeros."""
    wrong, vector = list(wrong_length(raw, key, size)), entries(raw, key)
    yield from wrong
    if vector and not wrong and all(entry == 0 for entry in vector):
        yield (key,), "has only zeros", hint


def repeated_names(items: Iterable[tuple[str | int, Any]], several: str, one: str) -> Iterator[Conflict]:
    """Yield a conflict for each name of an entry that one before it has. several, one: what the entries are."""
    seen: set[str] = set()
    for key, item in items:
        name = item.get("name") if isinstance(item, dict) else None
        if isinstance(name, str) and name in seen:
            yield (key, "name"), f"two {several} are called '{name}'", f"give each {one} a name of its own"
        elif isinstance(name, str):
            seen.add(name)
