"""Errors whose text is meant for the user. A command prints them, without a traceback, and exits with their code.

Everything else that is raised, a plain ValueError or LinAlgError of the numerics among it, is a fault of the program
and keeps its traceback. This module imports nothing, so that every room may use it.
"""

from __future__ import annotations

FAILED, WRONG_INPUT, INTERRUPTED = 1, 2, 130
"""Exit codes: a run failed, the input is wrong, the run was interrupted."""


class UserError(Exception):
    """Something the user can mend; ``str(error)`` says what is wrong and what to do, one line for each mistake."""

    exit_code = WRONG_INPUT


class NotPossible(UserError, ValueError):
    """A request that a system cannot meet, or numbers that describe no such system.

    message: what is wrong; remedy: what to do, "" where nothing can be said.
    """

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(f"{message}; {remedy}" if remedy else message)
        self.message, self.remedy = message, remedy


class SettingError(UserError, ValueError):
    """An environment variable of gearstab has a value that cannot be used here."""
