"""Mistakes in a configuration, in the words of the one who wrote it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Literal

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
