"""``gearstab info``: what is known of a system before a sweep, and of a result after it."""

from __future__ import annotations

import json
from pathlib import Path

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import say, warn


@click.command()
@click.argument("config", metavar="CONFIG|RESULT", type=terminal.FILE)
@terminal.overrides
@click.option(
    "--harmonics", type=click.IntRange(1, 50), help="List tongues up to this harmonic [default: as in CONFIG]."
)
@terminal.unit
@click.option("--all", "every", is_flag=True, help="List all predicted tongues, however many and closed.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    config: Path, overrides: tuple[str, ...], harmonics: int | None, unit: tuple[str, ...], every: bool, as_json: bool
) -> None:
    """Show natural frequencies, modes and the tongues that perturbation theory predicts for CONFIG.

    Of a file RESULT: where it comes from, its groups, axes and variables.
    """
    from gearstab.info import result

    if result.is_result(config):
        if overrides or harmonics:
            raise click.UsageError(f"{config} is a result, which --set and --harmonics do not change")
        known = result.describe(config, unit, as_json)
        say(json.dumps(known, indent=2, allow_nan=False) if as_json else result.report(known))
        return
    from gearstab.config import load
    from gearstab.info import tables
    from gearstab.info.configuration import describe
    from gearstab.info.records import plain
    from gearstab.info.text import report

    loaded = load(config, overrides)
    warn(loaded)
    facts = describe(loaded, harmonics)
    if unit:
        facts = tables.shown_in(facts, unit[-1])
    if as_json:
        say(json.dumps(plain(facts), indent=2, allow_nan=False))
    else:
        say(report(facts, every or harmonics is not None))
