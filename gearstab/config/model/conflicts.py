"""Contradictions within a section, beyond the limits of each value by itself.

Rules look at typed sections; :mod:`gearstab.config.model.reading` says what they find of values that are wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from gearstab.config.document.codes import Code
from gearstab.config.document.problems import Path
from gearstab.config.document.tree import entries, is_number
from gearstab.config.document.yaml import Document
from gearstab.config.model.reading import WRONG, is_known, known

Conflict = tuple[Path, Code, str, str]
"""Path below the section, code, message, remedy."""


def items(section: Any) -> list[tuple[Any, Any]]:
    """Return key and value of every known entry of a list, or of a section by name; none where it is not given."""
    return [(key, value) for key, value in entries(section) if value is not None and value is not WRONG]


def exactly_one(section: Any, names: tuple[str, ...], what: str = "") -> Iterator[Conflict]:
    """A conflict unless exactly one of the fields is given."""
    either = " or ".join(names)
    if all(getattr(section, name) is None for name in names):
        yield (), "missing", f"{either} is missing", what or f"add {either}"
    yield from at_most_one(section, names)


def at_most_one(section: Any, names: tuple[str, ...]) -> Iterator[Conflict]:
    """A conflict for each of the fields that is given beside another one."""
    given = [name for name in names if getattr(section, name) is not None]
    for extra in given[1:]:
        yield (extra,), "already_given", f"{given[0]} is given already", f"keep one of {', '.join(names)}"


def below(key: str | int, conflicts: Iterable[Conflict]) -> Iterator[Conflict]:
    """Yield the conflicts of what stands at a key."""
    for path, code, message, hint in known(conflicts):
        yield (key, *path), code, message, hint


def plain_number(value: Any) -> float | None:
    """Return a number as written, or as a parameter; None for a text with a unit and what is no number."""
    return float(value) if is_number(value) else None


def within(section: Any, key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in the section at a key, where it is given."""
    inner = getattr(section, key)
    if inner is not None and inner is not WRONG:
        yield from below(key, rule(inner))


def within_each(section: Any, key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in each entry of the list or section at a key."""
    for place, item in items(getattr(section, key)):
        yield from below(key, below(place, rule(item)))


def wrong_length(section: Any, key: str, size: int | None, what: str = "coordinate") -> Iterator[Conflict]:
    """Yield a conflict where the list at a key has another number of entries than ``size``; None: it is unknown."""
    inner = getattr(section, key)
    if inner is not None and inner is not WRONG and size is not None and len(inner) != size:
        yield (key,), "wrong_count", f"has {len(inner)} entries", f"give {size}, one per {what}"


def no_direction(section: Any, key: str, size: int | None, hint: str) -> Iterator[Conflict]:
    """Yield a conflict where the list at a key is no vector of the size of the system, or has only zeros."""
    wrong, vector = list(wrong_length(section, key, size)), getattr(section, key)
    yield from wrong
    if vector and not wrong and all(entry == 0 for entry in vector):
        yield (key,), "only_zeros", "has only zeros", hint


def repeated_names(section: Any, key: str, one: str) -> Iterator[Conflict]:
    """Yield a conflict for each name of an entry of the list at a key that one before it has. one: what an entry is."""
    seen: set[str] = set()
    for place, item in items(getattr(section, key)):
        name = getattr(item, "name", None)
        if not isinstance(name, str):
            continue
        if name in seen:
            hint = f"give each {one} a name of its own"
            yield (key, place, "name"), "repeated_name", f"two {key} are called '{name}'", hint
        seen.add(name)


def report(document: Document, path: Path, conflicts: Iterable[Conflict], section: Any) -> None:
    """Report what contradicts itself in a section, but for what is said of wrong values."""
    for inner, code, message, hint in known(conflicts):
        if is_known(section, inner):
            document.report((*path, *inner), code, message, hint)
