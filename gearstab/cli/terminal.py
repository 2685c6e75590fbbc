"""Parts that commands share: output, errors as lines with an exit code, options.

Results asked for go to standard output, everything else to standard error. Mistakes are one line each; what should not
happen is a traceback.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.decorators import FC

from gearstab.errors import FAILED, WRONG_INPUT, UserError, one_line

if TYPE_CHECKING:
    from gearstab.config import Config

STANDARD_OUTPUT = "standard output"
QUIET = "gearstab.quiet"
"""Key of the context of a command under which it stands whether messages are wanted."""


def say(text: str) -> None:
    """Print a result. Where it cannot be written the command ends: exit code 1."""
    try:
        click.echo(text)
    except OSError as error:
        lost(error)


def tell(text: str) -> None:
    """Print a message for the user; one that cannot be written, to a terminal that was closed, ends nothing."""
    with suppress(OSError):
        click.echo(text, err=True)


def note(text: str) -> None:
    """Print a message that ``--quiet`` leaves out."""
    if not is_quiet():
        tell(text)


def is_quiet() -> bool:
    """Return whether the command that runs was called with ``--quiet``."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(QUIET))


def lost(error: OSError) -> NoReturn:
    """End a command whose standard output is full or closed; without a word where its reader had enough."""
    if not isinstance(error, BrokenPipeError):
        tell(f"{STANDARD_OUTPUT}: {(error.strerror or str(error)).lower()}")
    # What the stream still holds would be tried again when the interpreter ends.
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    raise click.exceptions.Exit(FAILED) from error


class StandardOutput(io.RawIOBase):
    """Standard output as a binary file, whose errors carry its name."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        try:
            count = sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        except OSError as error:
            raise OSError(error.errno, error.strerror or str(error), STANDARD_OUTPUT) from error
        return count


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
        note(f"warning: {doubt}")


FILE = click.Path(path_type=Path)
"""A name of a file, as a path; whether it is there is for the command to say."""

config = click.argument("config", type=FILE)
overrides = click.option(
    "--set", "overrides", metavar="PATH=VALUE", multiple=True,
    help="Replace a value of CONFIG for this run; repeatable.",
)  # fmt: skip
quiet = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, help="No messages but errors.",
    callback=lambda context, _, value: context.meta.update({QUIET: value}),
)  # fmt: skip


def output(text: str) -> Callable[[FC], FC]:
    """Return the option for the file to write; ``text`` says what it is and where it goes by default."""
    return click.option("-o", "--output", type=FILE, help=text)


select = click.option(
    "--select",
    multiple=True,
    metavar="AXIS=VALUE",
    help="Fix an axis at the value nearest to a number, which may have a unit, or at a label; repeatable.",
)
unit = click.option(
    "--unit",
    multiple=True,
    metavar="[AXIS=]UNIT",
    help="Show axes in this unit, such as rpm, Hz, SI, or order for spectra, or amplitudes over the speed in dB "
    "[default: as they were typed]; repeatable.",
)


def selections(texts: tuple[str, ...]) -> dict[str, str]:
    """Return ``AXIS=VALUE`` texts as a mapping; a label may hold an equals sign. Raises ResultError for other texts."""
    from gearstab.errors import ResultError

    chosen: dict[str, str] = {}
    for text in texts:
        axis, equals, value = (part.strip() for part in text.partition("="))
        if not (axis and equals and value):
            raise ResultError(f"--select {text!r}: write AXIS=VALUE, for instance epsilon=0.3")
        if axis in chosen:
            raise ResultError(f"--select names {axis} twice")
        chosen[axis] = value
    return chosen
