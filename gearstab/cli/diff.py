"""``gearstab diff``: what differs between two results."""

from __future__ import annotations

import json
from pathlib import Path

import click

from gearstab.cli.terminal import options
from gearstab.cli.terminal.console import say
from gearstab.errors import FAILED

FRACTION = click.FloatRange(min=0)


@click.command(name="diff", short_help="Compare two results.")
@click.argument("first", metavar="A.h5", type=options.FILE)
@click.argument("second", metavar="B.h5", type=options.FILE)
@click.option("--tolerance", type=FRACTION, default=1e-9, show_default=True, help="Of a variable's largest magnitude.")
@click.option("--edges", type=FRACTION, default=1e-9, show_default=True, help="Of edges of regions, relative to them.")
@click.option("--verdicts", type=click.IntRange(min=0), default=0, show_default=True, help="Points that may change.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(first: Path, second: Path, tolerance: float, edges: float, verdicts: int, as_json: bool) -> None:
    """Compare the results A.h5 and B.h5: verdicts and edges that changed, the largest difference of each variable.

    Exit code 0: the same within the tolerances; 1: different; 2: one of them cannot be read.
    """
    from gearstab.info.difference import Tolerances, difference, report
    from gearstab.results.read import reading

    tolerances = Tolerances(tolerance, edges, verdicts)
    with reading(first) as old, reading(second) as new:
        found = difference(old, new, tolerances)
    if as_json:
        say(json.dumps({"first": str(first), "second": str(second), **found}, indent=2, allow_nan=False))
    else:
        say(report(found, (str(first), str(second)), tolerances))
    if not found["same"]:
        raise click.exceptions.Exit(FAILED)
