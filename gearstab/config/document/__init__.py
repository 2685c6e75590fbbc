"""A document as plain data that remembers the place of everything, and the mistakes in it.

It is read from YAML, or given as data of Python. Of plain data nothing is known yet: functions return what is there in
one form, whatever it is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from fractions import Fraction
from numbers import Integral, Real
from pathlib import PurePath
from typing import Any, Literal

import numpy as np

from gearstab.errors import UserError

Code = Literal[
    "alias", "already_given", "ambiguous_unit", "bad_name", "character", "data_file", "decimal_comma",
    "duplicate_key", "empty", "encoding", "equal_values", "file", "impossible", "inconsistent", "looks_like_range",
    "matrix", "missing", "needs_other", "nesting", "no_range", "no_unit", "not_a_number", "not_an_axis",
    "not_applicable", "not_exact", "not_finite", "not_whole", "only_zeros", "option", "out_of_range", "override",
    "repeated_name", "reserved_name", "revolutions", "set_twice", "syntax", "tag", "too_large", "unavailable",
    "unknown_choice", "unknown_key", "unknown_name", "unknown_target", "unknown_unit", "unusual", "wrong_count",
    "wrong_dimension", "wrong_order", "wrong_type",
]  # fmt: skip

CODES: dict[Code, str] = {
    "alias": "a YAML alias refers to itself, or stands for too many values",
    "already_given": "another key gives the same, or what follows from it",
    "ambiguous_unit": "the unit may count radians or turns",
    "bad_name": "a name cannot be used in a path",
    "character": "a character that no text can hold",
    "data_file": "a file of matrices, samples or choices cannot be used",
    "decimal_comma": "a comma in a number",
    "duplicate_key": "a key stands twice in a mapping",
    "empty": "nothing stands after a key, or in a file",
    "encoding": "a file is not UTF-8 text",
    "equal_values": "a value is given more than once",
    "file": "a configuration file cannot be read",
    "impossible": "no such gears exist, or their stiffness is not positive, or numbers go beyond double precision",
    "inconsistent": "several values contradict each other",
    "looks_like_range": "three values look like start, stop and number of values (doubt)",
    "matrix": "a matrix is not symmetric or not positive",
    "missing": "a key or section is missing",
    "needs_other": "something else must be given as well, or is of another form",
    "nesting": "mappings and lists are nested too deeply",
    "no_range": "a range where there can be none, or one that leads nowhere",
    "no_unit": "a quoted number without a unit",
    "not_a_number": "something else where a number or a ratio is expected",
    "not_an_axis": "a parameter that an axis cannot set",
    "not_applicable": "a key that means nothing together with the others",
    "not_exact": "a ratio that must be exact is not",
    "not_finite": "an infinite number, or none (.nan)",
    "not_whole": "a number that must be whole is not, or is too small",
    "only_zeros": "a vector without an entry other than zero",
    "option": "an option of a method does not fit the system",
    "out_of_range": "a number outside its limits",
    "override": "`--set` is not PATH=VALUE, or its path leads nowhere",
    "repeated_name": "two entries have the same name",
    "reserved_name": "an axis cannot have this name",
    "revolutions": "a mesh frequency in revolutions (doubt)",
    "set_twice": "two axes, cases, distributions or overrides set the same parameter",
    "syntax": "a text is not valid YAML",
    "tag": "an unknown YAML tag",
    "too_large": "more than can be computed or stored",
    "unavailable": "not available in this version",
    "unknown_choice": "none of the words that are allowed",
    "unknown_key": "a key that the section does not have",
    "unknown_name": "a name of a rotor, mesh, coordinate or other entry that does not exist",
    "unknown_target": "a path that leads to no parameter of the system",
    "unknown_unit": "a unit that does not exist",
    "unusual": "a number far from what gears have (doubt)",
    "wrong_count": "a list with too many or too few entries",
    "wrong_dimension": "a unit of another quantity",
    "wrong_order": "values in the wrong order",
    "wrong_type": "a mapping, list, text, number or truth value where another is expected",
}

Path = tuple[str | int, ...]
"""Place of a value in a document: keys and 0-based indices."""

LONGEST_VALUE = 60
"""Characters of a wrong value that a message shows."""

LONGEST_TEXT = 500
"""Characters of the text and of the remedy of a mistake: names in them are as long as the user makes them."""
LONGEST_LIST = 12
"""Names that a remedy lists."""


@dataclass(frozen=True)
class Problem:
    """One mistake: ``file:line: path: message (got value); hint``.

    file: the configuration as the user named it, or ``--set PATH`` for an override; line: from 1, None without one.
    path: dotted, from the top of the document; value: the value there, shortened, or "".
    code: the kind of mistake, one of :data:`CODES`; message: what is wrong; hint: what to do.
    """

    file: str
    line: int | None
    path: str
    value: str
    code: Code
    message: str
    hint: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        subject = f"{short(self.path)}: " if self.path else ""
        got = f" (got {self.value})" if self.value else ""
        remedy = f"; {short(self.hint)}" if self.hint else ""
        return " ".join(f"{place}: {subject}{short(self.message)}{got}{remedy}".split())


class ConfigError(UserError, ValueError):
    """A configuration cannot be used; ``problems`` lists every mistake that was found, by line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        found = sorted(set(problems), key=lambda p: (p.path, p.message, p.value))
        self.problems = sorted(found, key=lambda p: float("inf") if p.line is None else p.line)
        super().__init__("\n".join(map(str, self.problems)))


def dotted(path: Path) -> str:
    """``("meshes", 0, "epsilon")`` as ``meshes.0.epsilon``."""
    return ".".join(map(str, path))


def short(text: str) -> str:
    """A text of a message that is not too long."""
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."


def shown(value: Any) -> str:
    """A value as a message shows it, on one line and not too long; "" for no value at all."""
    if value is None:
        return ""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def closest(name: str, choices: Iterable[str]) -> str | None:
    """The choice that a name is most like, None where it is like none of them."""
    lowered = {choice.lower(): choice for choice in choices}
    found = get_close_matches(name.lower(), lowered, n=1, cutoff=0.6)
    return lowered[found[0]] if found else None


def nearest(name: str, choices: Iterable[str]) -> str:
    """The remedy for a name that does not exist: the nearest one that does, or all of them."""
    known = list(choices)
    if found := closest(name, known):
        return f"did you mean '{found}'?"
    return "available: " + ", ".join(known[:LONGEST_LIST]) + ", ..." * (len(known) > LONGEST_LIST)


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
