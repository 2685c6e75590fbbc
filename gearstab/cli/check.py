"""``gearstab check``: is a configuration right?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli import options
from gearstab.cli.console import say
from gearstab.cli.errors import warn

if TYPE_CHECKING:
    from gearstab.config import Config


@click.command(name="check", short_help="Validate a configuration.")
@options.config
@options.overrides
def command(config: Path, overrides: tuple[str, ...]) -> None:
    """Validate CONFIG: exit code 0, or 2 with every mistake at once, each with its line and what to do about it."""
    from gearstab.config import load

    found = load(config, overrides)
    if found.methods.chosen:
        from gearstab.sweep.plan import check
        from gearstab.systems import build

        check(found, build(found.parameters))
    if found.design is not None:
        from gearstab.design import check as check_design

        check_design(found)
    warn(found)
    say(f"{config}: {summary(found)}")


def summary(config: Config) -> str:
    """A valid configuration in one line."""
    parts = [f"valid {config.kind}"]
    if config.axes:
        shape = " x ".join(f"{axis.name} ({axis.size})" for axis in config.axes)
        points = 1
        for axis in config.axes:
            points *= axis.size
        parts.append(f"{shape} = {points:,} point{'s' * (points != 1)}")
    if config.methods.chosen:
        parts.append(f"methods {', '.join(config.methods.chosen)}")
    if config.respond is not None:
        parts.append("respond")
    if config.design is not None:
        names = ", ".join(variable.name for variable in config.design.variables)
        parts.append(f"design of {names}")
    return "; ".join(parts)
