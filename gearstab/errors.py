"""Errors whose text is meant for the user. A command prints them, without a traceback, and exits with their code.

Everything else that is raised, a plain ValueError or LinAlgError of the numerics among it, is a fault of the program
and keeps its traceback. This module imports nothing of the package, so that every room may use it.
"""

from __future__ import annotations

from collections.abc import Iterable

FAILED, WRONG_INPUT, CONDITION_MET, INTERRUPTED = 1, 2, 3, 130
"""Exit codes: a run failed, the input is wrong, a condition of ``--fail-if`` is met, the run was interrupted."""


class UserError(Exception):
    """Something the user can mend; ``str(error)`` says what is wrong and what to do, one line for each mistake."""

    exit_code = WRONG_INPUT


class DoubtWarning(UserWarning):
    """Something in a configuration that is right and hardly meant; from Python only, commands print it."""


class NotPossible(UserError, ValueError):
    """A request that a system cannot meet, or numbers that describe no such system.

    message: what is wrong; remedy: what to do, "" where nothing can be said.
    """

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(f"{message}; {remedy}" if remedy else message)
        self.message, self.remedy = message, remedy


class SettingError(UserError, ValueError):
    """An environment variable of gearstab has a value that cannot be used here."""


class ResultError(UserError, ValueError):
    """A file cannot be read as a result."""


class OutputError(UserError, ValueError):
    """A file must not be written, for what is there or for its name. Nothing was computed or written."""


class PlotError(UserError, ValueError):
    """The requested figure cannot be drawn from this result. The message is one line and lists the alternatives."""


class RequestError(UserError, ValueError):
    """The request is too large. Nothing was computed."""


class SweepError(UserError, RuntimeError):
    """The sweep could not be finished; what is finished is kept."""

    exit_code = FAILED


class Interrupted(UserError, RuntimeError):
    """The user or the system asked the sweep to stop; what is finished is kept."""

    exit_code = INTERRUPTED


def one_line(error: object) -> str:
    """Return the text of an exception without line breaks."""
    return " ".join(str(error).split())


def listed(names: Iterable[str], most: int = 12) -> str:
    """Return ``a, b, c`` for a message; long lists are cut and counted, so that it stays one line."""
    items = [str(name) for name in names]
    shown = ", ".join(items[:most]) or "none"
    return shown if len(items) <= most else f"{shown}, ... ({len(items)} in all)"
