"""Mistakes in a configuration, in the words of the one who wrote it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from gearstab.config.document.codes import Code
from gearstab.errors import UserError

Path = tuple[str | int, ...]
"""Where a value stands in a document: keys and 0-based indices."""

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
    path: dotted, from the top of the document; value: what stands there, shortened, or "".
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
        last = float("inf")
        self.problems = sorted(set(problems), key=lambda p: (last if p.line is None else p.line, p.path, p.message))
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
