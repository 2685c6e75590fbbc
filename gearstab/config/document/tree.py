"""Plain data as read, of which nothing is known yet: each function gives what is there in one form, whatever it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any

from gearstab.config.document.problems import Path


def mapping(value: Any) -> dict[str, Any]:
    """Return the value itself if it is a mapping, else an empty one."""
    return value if isinstance(value, dict) else {}


def sequence(value: Any) -> list[Any]:
    """Return the value itself if it is a list, else an empty one."""
    return value if isinstance(value, list) else []


def entries(value: Any) -> Iterable[tuple[str | int, Any]]:
    """Return key or index and value of all that stands directly in a mapping or list; nothing of other values."""
    return mapping(value).items() or enumerate(sequence(value))


def scalars(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield the path and the value of everything below a value that is neither mapping nor list."""
    if not isinstance(value, dict | list):
        yield path, value
    for key, item in entries(value):
        yield from scalars(item, (*path, key))


def texts(value: Any) -> Iterator[tuple[Path, str]]:
    """Yield the path and the text of every text below a value."""
    return ((path, text) for path, text in scalars(value) if isinstance(text, str))


def is_number(value: Any) -> bool:
    """Whether a value is a number: no text, and no truth value, which Python counts among the integers."""
    return isinstance(value, int | float | Fraction) and not isinstance(value, bool)


def names_set(name: str, spec: Any) -> set[str]:
    """Return the names of what an entry of ``sweep`` sets, in whichever form: its own, its targets, its cases' keys."""
    cases = [key for case in sequence(spec) for key in mapping(case)]
    return {name, *cases, *(target for target in sequence(mapping(spec).get("targets")) if isinstance(target, str))}
