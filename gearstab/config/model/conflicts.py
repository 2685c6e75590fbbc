"""Contradictions within a section, beyond the limits of each value by itself.

A section as meant (:func:`as_meant`) has mappings, lists and texts only where its model has them, so that no rule looks
at types again; its numbers are as written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, get_origin

import numpy as np

from gearstab.config.document.codes import Code
from gearstab.config.document.problems import Path, closest
from gearstab.config.document.tree import entries, is_number
from gearstab.config.document.yaml import Document, value_at
from gearstab.config.model.introspection import bare, entry_type, field_types, is_model

Conflict = tuple[Path, Code, str, str]
"""Path below the section, code, message, remedy."""


class Unknown(dict[str, Any]):
    """Stands for a value that is no mapping, list or text where its field is one, or that has no field.

    It has no entries, and whatever it is asked for counts as given and is unknown as well. That it is of the wrong type
    is reported by itself, and nothing else is said of it.
    """

    def get(self, key: str, default: Any = None) -> Unknown:
        """Return the unknown value at a key."""
        return self

    __missing__ = get

    def __bool__(self) -> bool:
        return True

    __eq__, __hash__ = object.__eq__, object.__hash__  # type: ignore[assignment]


def as_meant(value: Any, annotation: Any) -> Any:
    """Return a section as written, with misspelt keys as what they were meant to be and Unknown for wrong types.

    So what is said about the section as a whole does not miss a key whose spelling is reported.
    """
    if value is None or isinstance(value, np.ndarray):
        return value
    if annotation is None:
        return Unknown()
    if is_model(annotation):
        return _section_as_meant(value, annotation) if isinstance(value, dict) else Unknown()
    if get_origin(bare(annotation)) in (list, tuple):
        if not isinstance(value, list):
            return Unknown()
        inner = [as_meant(item, entry_type(annotation, i)) for i, item in enumerate(value)]
        return [Unknown() if item is None else item for item in inner]
    return Unknown() if bare(annotation) is str and not isinstance(value, str) else value


def _section_as_meant(value: dict[str, Any], model: Any) -> dict[str, Any]:
    known = field_types(model)
    right = {key: key if key in known else right_name(key, model) for key in value}
    names = {key: key if name is None or (name != key and name in value) else name for key, name in right.items()}
    return {names[key]: as_meant(item, known.get(names[key])) for key, item in value.items()}


def right_name(key: str, model: Any) -> str | None:
    """Return the key that an unknown one was meant to be, None where none is like it."""
    if not is_model(model) or key in getattr(model, "misplaced", ()):
        return None
    return closest(key, model.model_fields)


def is_known(section: Any, path: Path = ()) -> bool:
    """Whether nothing on the way to a path is unknown."""
    return not any(isinstance(value_at(section, path[:k]), Unknown) for k in range(len(path) + 1))


def items(section: Any) -> list[tuple[Any, Any]]:
    """Return key and value of every known entry of a list, or of a mapping by name; none where it is not given."""
    return [(key, value) for key, value in entries(section) if value is not None and not isinstance(value, Unknown)]


def exactly_one(raw: dict[str, Any], names: tuple[str, ...], what: str = "") -> Iterator[Conflict]:
    """A conflict unless exactly one of the keys is given."""
    either = " or ".join(names)
    if all(raw.get(name) is None for name in names):
        yield (), "missing", f"{either} is missing", what or f"add {either}"
    yield from at_most_one(raw, names)


def at_most_one(raw: dict[str, Any], names: tuple[str, ...]) -> Iterator[Conflict]:
    """A conflict for each of the keys that is given beside another one."""
    given = [name for name in names if raw.get(name) is not None]
    for extra in given[1:]:
        yield (extra,), "already_given", f"{given[0]} is given already", f"keep one of {', '.join(names)}"


def below(key: str | int, conflicts: Iterable[Conflict]) -> Iterator[Conflict]:
    """Yield the conflicts of what stands at a key."""
    for path, code, message, hint in conflicts:
        yield (key, *path), code, message, hint


def plain_number(value: Any) -> float | None:
    """Return a number as written, or as a parameter; None for a text with a unit and what is no number."""
    return float(value) if is_number(value) else None


def within(raw: dict[str, Any], key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in the section at a key, where it is given."""
    if raw.get(key) is not None:
        yield from below(key, rule(raw[key]))


def within_each(raw: dict[str, Any], key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in each entry of the list or mapping at a key."""
    for place, item in items(raw.get(key)):
        yield from below(key, below(place, rule(item)))


def wrong_length(raw: dict[str, Any], key: str, size: int | None, what: str = "coordinate") -> Iterator[Conflict]:
    """Yield a conflict where the list at a key has another number of entries than ``size``; None: it is unknown."""
    inner = raw.get(key)
    if inner is not None and size is not None and len(inner) != size:
        yield (key,), "wrong_count", f"has {len(inner)} entries", f"give {size}, one per {what}"


def no_direction(raw: dict[str, Any], key: str, size: int | None, hint: str) -> Iterator[Conflict]:
    """Yield a conflict where the list at a key is no vector of the size of the system, or has only zeros."""
    wrong, vector = list(wrong_length(raw, key, size)), raw.get(key)
    yield from wrong
    if vector and not wrong and all(entry == 0 for entry in vector):
        yield (key,), "only_zeros", "has only zeros", hint


def repeated_names(raw: dict[str, Any], key: str, one: str) -> Iterator[Conflict]:
    """Yield a conflict for each name of an entry of the list at a key that one before it has. one: what an entry is."""
    seen: set[str] = set()
    for place, item in items(raw.get(key)):
        name = item.get("name")
        if name in seen:
            yield (
                (key, place, "name"),
                "repeated_name",
                f"two {key} are called '{name}'",
                f"give each {one} a name of its own",
            )
        elif name is not None:
            seen.add(name)


def report(document: Document, path: Path, conflicts: Iterable[Conflict], section: Any) -> None:
    """Report what contradicts itself in a section as meant, but for what is unknown there."""
    for inner, code, message, hint in conflicts:
        if is_known(section, inner):
            document.report((*path, *inner), code, message, hint)
