"""Options that commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click
from click.decorators import FC

FILE = click.Path(path_type=Path)
"""A name of a file, as a path; whether it is there is for the command to say."""

config = click.argument("config", type=FILE)
overrides = click.option(
    "--set", "overrides", metavar="PATH=VALUE", multiple=True,
    help="Replace a value of CONFIG for this run; repeatable.",
)  # fmt: skip
quiet = click.option("-q", "--quiet", is_flag=True, help="No messages but errors.")


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
