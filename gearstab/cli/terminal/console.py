"""Output of commands: results asked for on standard output, everything else on standard error."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress
from typing import Any, NoReturn

import click

from gearstab.errors import FAILED

STANDARD_OUTPUT = "standard output"


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
