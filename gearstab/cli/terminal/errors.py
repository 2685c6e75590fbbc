"""How errors reach the user: one line each and an exit code for mistakes, a traceback for what should not happen."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from gearstab.cli.terminal.console import STANDARD_OUTPUT, lost, tell
from gearstab.errors import FAILED, WRONG_INPUT, UserError, one_line

if TYPE_CHECKING:
    from gearstab.config import Config

FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE)
"""Errors that an output can meet although the input is right."""

STARVED = ("failed to map segment", "cannot allocate memory", "can't start new thread")
"""Messages of the system where there is no memory to load a library or to start a thread."""


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn errors meant for the user into their text on standard error and an exit code."""
    try:
        yield
    except Exception as error:
        if isinstance(error, OSError) and error.filename == STANDARD_OUTPUT:
            lost(error)
        code = exit_code(error)
        if code is None:
            raise
        for line in text(error).splitlines():
            tell(line)
        raise click.exceptions.Exit(code) from error


def exit_code(error: Exception) -> int | None:
    """The exit code of an error meant for the user, None for any other."""
    if isinstance(error, UserError):
        return error.exit_code
    if isinstance(error, OSError) and error.filename is not None:
        return FAILED if error.errno in FAILURES else WRONG_INPUT
    return FAILED if _shortage(error) else None


def text(error: Exception) -> str:
    """Return the text of an error for the user."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {(error.strerror or 'cannot be used').lower()}"
    if not isinstance(error, UserError) and (short := _shortage(error)):
        said = one_line(short)
        return f"not enough memory{': ' if said else ''}{said}"
    return str(error)


def _shortage(error: BaseException | None) -> BaseException | None:
    """Return the error that says that memory was lacking: this one or its cause, as imports make other errors of
    one.
    """
    found = None
    while error is not None:
        told = isinstance(error, ImportError | RuntimeError) and any(text in str(error).lower() for text in STARVED)
        found = error if told or isinstance(error, MemoryError) else found
        error = error.__cause__
    return found


def warn(config: Config) -> None:
    """Print what is hardly meant in a configuration on standard error."""
    for doubt in config.doubts:
        tell(f"warning: {doubt}")
