"""``gearstab init`` and ``gearstab schema``: a configuration to start from, and what it may hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gearstab.cli.terminal.console import say

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


def kinds(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the name of a kind."""
    from click.shell_completion import CompletionItem

    from gearstab.systems import KINDS

    return [CompletionItem(name) for name in KINDS if name.startswith(incomplete)]


@click.command(name="init", short_help="Print a configuration to start from.")
@click.argument("kind", required=False, shell_complete=kinds)
def command(kind: str | None) -> None:
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
    import json

    from gearstab.config.schema import schema as of_configurations

    say(json.dumps(of_configurations(), indent=2, ensure_ascii=False))
