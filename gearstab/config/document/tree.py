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
    """Return key or index and value of all that stands directly in a mapping, section or list; nothing of others."""
    if isinstance(value, list | tuple):
        return enumerate(value)
    return value.items() if isinstance(value, dict) else iter(value) if is_section(value) else ()


def is_section(value: Any) -> bool:
    """Return whether a value is a section that was read; it is iterated over as pairs of field and value."""
    return hasattr(value, "model_fields_set")


def scalars(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield the path and the value of everything below a value that is neither mapping nor list."""
    if not isinstance(value, dict | list | tuple) and not is_section(value):
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
