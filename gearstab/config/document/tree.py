"""A document as plain data that remembers the place of everything: read from YAML, or given as data of Python.

Of plain data nothing is known yet: the functions here return what is there in one form, whatever it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Integral, Real
from pathlib import PurePath
from typing import Any

import numpy as np

from gearstab.config.document.problems import Code, ConfigError, Path, Problem, dotted, shown

NAME = "configuration"
"""Name of data in messages, in place of a file."""
NO_CHARACTER = re.compile("[\x00\ud800-\udfff]")
"""Characters that YAML can write and no file can hold: the end of a text, and halves of characters."""
DEEPEST = 200
"""Lists and mappings inside each other, aliases followed."""


def mapping(value: Any) -> dict[str, Any]:
    """Return the value itself if it is a mapping, else an empty one."""
    return value if isinstance(value, dict) else {}


def sequence(value: Any) -> list[Any]:
    """Return the value itself if it is a list, else an empty one."""
    return value if isinstance(value, list) else []


def entries(value: Any) -> Iterable[tuple[str | int, Any]]:
    """Return key or index and value of all direct entries of a mapping, section or list; nothing of others."""
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


@dataclass(frozen=True)
class Where:
    """A place the user can go to: a line of a file, or a ``--set`` option (then without a line)."""

    file: str
    line: int | None = None


@dataclass
class Document:
    """Plain data, the place of every value and key, and the problems found so far.

    data: nested dicts, lists, numbers, texts, booleans and None; a key is always text.
    values, keys: path -> place of the value and of its key. A block mapping or list counts as standing at its key.
    first: the line of what is not written in it, None of data without lines.
    """

    file: str
    data: Any = None
    values: dict[Path, Where] = field(default_factory=dict)
    keys: dict[Path, Where] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    first: int | None = 1

    def where(self, path: Path) -> Where:
        """The place of the value at a path, or of the innermost one around it that exists."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.values:
                return self.values[path[:length]]
        return Where(self.file, self.first)

    def get(self, path: Path) -> Any:
        """The value at a path, None where there is none."""
        return value_at(self.data, path)

    def problem(
        self, path: Path, code: Code, message: str, hint: str = "", *, value: Any = None, at_key: bool = False
    ) -> Problem:
        """A problem at a path; ``at_key`` when the key is what is wrong."""
        place = self.keys.get(path) if at_key else None
        place = place or self.where(path)
        return Problem(place.file, place.line, dotted(path), shown(value), code, message, hint)

    def report(
        self, path: Path, code: Code, message: str, hint: str = "", *, value: Any = None, at_key: bool = False
    ) -> None:
        """Add a problem at a path, as :meth:`problem` makes it."""
        self.problems.append(self.problem(path, code, message, hint, value=value, at_key=at_key))

    def stop(self) -> None:
        """Raise ConfigError if there are problems."""
        if self.problems:
            raise ConfigError(self.problems)

    def put(self, path: Path, value: Any, place: Where) -> None:
        """Set a value, all parts of which are then at ``place``; the container of the last key must exist."""
        for table in (self.values, self.keys):
            for known in [p for p in table if p[: len(path)] == path]:
                del table[known]
        container: Any = self.get(path[:-1])
        container[path[-1]] = value
        self.values[path] = place

    def fill(self, path: Path, value: Any, place: Where) -> bool:
        """Set a value that the mapping around it does not give; return whether it was set."""
        container = self.get(path[:-1])
        missing = isinstance(container, dict) and container.get(str(path[-1])) is None
        if missing:
            self.put(path, value, place)
        return missing

    def nest(self, path: Path, key: str | int) -> None:
        """Put the value at a path into a mapping or, for an index, a list, as its only entry."""
        container: Any = self.get(path[:-1])
        value = container[path[-1]]
        container[path[-1]] = {key: value} if isinstance(key, str) else [value]
        self.move(path, (*path, key))

    def move(self, source: Path, target: Path) -> None:
        """Let everything below ``source`` be found below ``target``; the data is the caller's."""
        for table in (self.values, self.keys):
            for known in [p for p in table if p[: len(source)] == source]:
                table[target + known[len(source) :]] = table[known]


def value_at(raw: Any, path: Path) -> Any:
    """The value at a path of nested mappings, lists and arrays; None where there is none."""
    for part in path:
        try:
            raw = raw[part]
        except (TypeError, LookupError):
            return None
    return raw


def document_of(data: Mapping[str, Any], name: str = NAME) -> Document:
    """Return the document that a file with this data would hold. Raises ConfigError for what no file can hold."""
    document = Document(name, first=None)
    document.data = plain(document, data, ())
    document.stop()
    return document


def plain(document: Document, value: Any, path: Path) -> Any:
    """Return a value as nested dicts, lists, numbers, texts, booleans and None.

    Arrays (NumPy's and SciPy's sparse ones) become lists, exact fractions and paths texts. What is none of these is
    reported to the document, and None stands for it.
    """
    if len(path) > DEEPEST:
        document.report((), "nesting", "is nested too deeply", "give flatter data")
        return None
    if isinstance(value, Mapping):
        return {str(key): plain(document, item, (*path, str(key))) for key, item in value.items()}
    if np.ma.is_masked(value):
        document.report(path, "wrong_type", "has masked entries, which have no value", "fill them or leave them out")
        return None
    if hasattr(value, "toarray"):
        value = value.toarray()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(document, item, (*path, k)) for k, item in enumerate(value)]
    return _scalar(document, value, path)


def _scalar(document: Document, value: Any, path: Path) -> Any:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Fraction | PurePath):
        return str(value)
    if isinstance(value, Real):
        return float(value)
    if isinstance(value, str):
        if NO_CHARACTER.search(value):
            document.report(path, "character", "holds what is no character", "remove it", value=ascii(value))
        return NO_CHARACTER.sub("", value)
    hint = "give numbers, texts, lists, mappings or arrays"
    document.report(path, "wrong_type", f"is of the type {type(value).__name__}", hint, value=str(value))
    return None
