"""How errors reach the user: one line each and an exit code for mistakes, a traceback for what should not happen."""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

FAILED, WRONG_INPUT, INTERRUPTED = 1, 2, 130

EXPECTED = {
    ("gearstab.config.problems", "ConfigError"): WRONG_INPUT,
    ("gearstab.plots.errors", "PlotError"): WRONG_INPUT,
    ("gearstab.results.errors", "ResultError"): WRONG_INPUT,
    ("gearstab.sweep.errors", "RequestError"): WRONG_INPUT,
    ("gearstab.sweep.errors", "SweepError"): FAILED,
    ("gearstab.sweep.errors", "Interrupted"): INTERRUPTED,
}
"""Errors whose text is meant for the user, by module and name, and their exit codes."""


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn expected errors into their text on standard error and an exit code.

    A class is looked up only where its module has been imported: otherwise nothing can have raised it.
    """
    try:
        yield
    except Exception as error:
        code = exit_code(error)
        if code is None:
            raise
        for line in text(error).splitlines():
            click.echo(line, err=True)
        raise click.exceptions.Exit(code) from error


def exit_code(error: Exception) -> int | None:
    """The exit code of an expected error, None for any other."""
    for (module, name), code in EXPECTED.items():
        known = sys.modules.get(module)
        if known is not None and isinstance(error, getattr(known, name)):
            return code
    if isinstance(error, OSError) and error.filename is not None:
        return FAILED if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO) else WRONG_INPUT
    return None


def text(error: Exception) -> str:
    """What the user reads."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {(error.strerror or 'cannot be used').lower()}"
    return str(error)
