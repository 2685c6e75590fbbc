"""``gearstab check``: is a configuration right?"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli.terminal import options
from gearstab.cli.terminal.console import say
from gearstab.cli.terminal.errors import warn

if TYPE_CHECKING:
    from gearstab.config import Config, Problem


@click.command(name="check", short_help="Validate a configuration.")
@options.config
@options.overrides
@click.option("--json", "as_json", is_flag=True, help="Print JSON, mistakes included.")
def command(config: Path, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate CONFIG: exit code 0, or 2 with every mistake at once, each with its line and what to do about it."""
    from gearstab.config import ConfigError

    try:
        found = checked(config, overrides)
    except ConfigError as error:
        if not as_json:
            raise
        say(report(config, problems=error.problems))
        raise click.exceptions.Exit(error.exit_code) from None
    if as_json:
        say(report(config, found.doubts, summary=summary(found)))
        return
    warn(found)
    say(f"{config}: {summary(found)}")


def checked(config: Path, overrides: tuple[str, ...]) -> Config:
    """Return a configuration in which nothing is wrong. Raises ConfigError."""
    from gearstab.config import load

    found = load(config, overrides)
    if found.methods.chosen:
        from gearstab.config.checks.options import check
        from gearstab.systems import build

        check(found, build(found.parameters))
    if found.design is not None:
        from gearstab.design import check as check_design

        check_design(found)
    return found


def report(
    config: Path, doubts: Sequence[Problem] = (), problems: Sequence[Problem] = (), summary: str | None = None
) -> str:
    """Return what was found as JSON: of each mistake and doubt its file, line, path, value, code, message and hint."""
    said = {"file": str(config), "valid": not problems, "summary": summary}
    lists = {"problems": [asdict(p) for p in problems], "doubts": [asdict(p) for p in doubts]}
    return json.dumps(said | lists, indent=2, ensure_ascii=False)


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
