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
