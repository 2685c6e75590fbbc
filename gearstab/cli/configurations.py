"""``gearstab init``, ``schema`` and ``check``: a configuration to start from, what it may hold, whether it is right."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import say, tell, warn

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from gearstab.config import Config, Problem

STANDARD_INPUT = "standard input"


@click.command(name="check", short_help="Validate configurations.")
@click.argument("configs", metavar="CONFIG...", type=terminal.FILE, nargs=-1, required=True)
@terminal.overrides
@click.option("--json", "as_json", is_flag=True, help="Print JSON, mistakes included; of several files a list.")
def check_command(configs: tuple[Path, ...], overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate every CONFIG (- is standard input): exit code 0, or 2 with every mistake at once, each with its line and
    what to do about it.
    """
    from gearstab.config import ConfigError

    reports, failed = [], 0
    for config in configs:
        try:
            found = checked(config, overrides)
        except ConfigError as error:
            failed = error.exit_code
            reports.append(report(named(config), problems=error.problems))
            if not as_json:
                tell(str(error))
            continue
        reports.append(report(named(config), found.doubts, summary=summary(found)))
        if not as_json:
            warn(found)
            say(f"{named(config)}: {summary(found)}")
    if as_json:
        say(json.dumps(reports if len(reports) > 1 else reports[0], indent=2, ensure_ascii=False))
    if failed:
        raise click.exceptions.Exit(failed)


def named(config: Path) -> str:
    """Return what messages call a configuration."""
    return STANDARD_INPUT if str(config) == "-" else str(config)


def checked(config: Path, overrides: tuple[str, ...]) -> Config:
    """Return a configuration in which nothing is wrong. Raises ConfigError."""
    from gearstab.config import load
    from gearstab.config.document.yaml import decoded

    if named(config) == STANDARD_INPUT:
        document = decoded(sys.stdin.buffer.read(), STANDARD_INPUT)
        found = load(document, overrides, source=Path(STANDARD_INPUT))
    else:
        found = load(config, overrides)
    if found.methods.chosen:
        from gearstab.config.readers import check_options

        check_options(found, found.system.build())
    if found.design is not None:
        from gearstab.design import check as check_design

        check_design(found)
    return found


def report(
    name: str, doubts: Sequence[Problem] = (), problems: Sequence[Problem] = (), summary: str | None = None
) -> dict[str, Any]:
    """Return what was found as data: of each mistake and doubt its file, line, path, value, code, message and hint."""
    said = {"file": name, "valid": not problems, "summary": summary}
    lists = {"problems": [asdict(p) for p in problems], "doubts": [asdict(p) for p in doubts]}
    return said | lists


def summary(config: Config) -> str:
    """A valid configuration in one line."""
    parts = [f"valid {config.kind}"]
    if config.axes:
        shape = " x ".join(f"{axis.name} ({axis.size})" for axis in config.axes)
        points = prod(axis.size for axis in config.axes)
        parts.append(f"{shape} = {points:,} point{'s' * (points != 1)}")
    if config.methods.chosen:
        parts.append(f"methods {', '.join(config.methods.chosen)}")
    if config.respond is not None:
        parts.append("respond")
    if config.design is not None:
        names = ", ".join(variable.name for variable in config.design.variables)
        parts.append(f"design of {names}")
    return "; ".join(parts)


def kinds(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the name of a kind."""
    from click.shell_completion import CompletionItem

    from gearstab.systems import KINDS

    return [CompletionItem(name) for name in KINDS if name.startswith(incomplete)]


@click.command(name="init", short_help="Print a configuration to start from.")
@click.argument("kind", required=False, shell_complete=kinds)
def init_command(kind: str | None) -> None:
    """Print a commented configuration that runs, for a KIND of system: gearstab init two_stage > train.yaml.

    Without KIND: print the kinds.
    """
    from gearstab.config.schema import commented, starts

    if kind is None:
        there = starts()
        width = max(map(len, there))
        say("\n".join(f"{name:<{width}}  {start.title}" for name, start in there.items()))
    else:
        say(commented(kind))


@click.command(name="schema", short_help="Print the JSON schema of the configuration.")
def schema() -> None:
    """Print the JSON schema of the configuration, for completion and checks in an editor."""
    from gearstab.config.schema import schema as of_configurations

    say(json.dumps(of_configurations(), indent=2, ensure_ascii=False))
