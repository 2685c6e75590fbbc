"""What can go wrong with a sweep; every message is one line for the user."""

from __future__ import annotations

from gearstab.errors import FAILED, INTERRUPTED, UserError


class SweepError(UserError, RuntimeError):
    """The sweep could not be finished; what is finished is kept."""

    exit_code = FAILED


class RequestError(UserError, ValueError):
    """What was asked for is too large. Nothing was computed."""


class Interrupted(UserError, RuntimeError):
    """The user or the system asked the sweep to stop; what is finished is kept."""

    exit_code = INTERRUPTED
