"""``gearstab schema``: the JSON schema of the configuration, for editors."""

from __future__ import annotations

import click

from gearstab.cli.terminal.console import say


@click.command(name="schema", short_help="Print the JSON schema of the configuration.")
def command() -> None:
    """Print the JSON schema of the configuration, for completion and checks in an editor."""
    import json

    from gearstab.config.schema import schema

    say(json.dumps(schema(), indent=2, ensure_ascii=False))
