"""A user's mistake is one line on standard error and exit code 2, never a traceback."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

WRONG_INPUT = 2


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what is wrong with the user's configuration, files or paths into lines on standard error and exit code 2.

    Put it around the reading of what the user gave, not around a computation, whose failures are not theirs.
    """
    try:
        yield
    except BrokenPipeError:  # the reader of standard output has gone, which click knows how to end
        raise
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        place = f"{error.filename}: " if error.filename is not None else ""
        _leave([" ".join(f"{place}{reason[:1].lower()}{reason[1:]}".split())])
    except ValueError as error:
        # Imported here: who got so far without a configuration need not load it.
        from gearstab.config.problems import ConfigError

        if not isinstance(error, ConfigError):
            raise
        _leave([str(problem) for problem in error.problems])


def _leave(lines: list[str]) -> None:
    for line in lines:
        click.echo(line, err=True)
    sys.exit(WRONG_INPUT)
