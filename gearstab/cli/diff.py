"""``gearstab diff``: what differs between two results, or between those of two folders."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from gearstab.cli.terminal import options
from gearstab.cli.terminal.console import say
from gearstab.errors import FAILED, ResultError

FRACTION = click.FloatRange(min=0)


@click.command(name="diff", short_help="Compare two results, or two folders of them.")
@click.argument("first", metavar="A", type=options.FILE)
@click.argument("second", metavar="B", type=options.FILE)
@click.option("--tolerance", type=FRACTION, default=1e-9, show_default=True, help="Of a variable's largest magnitude.")
@click.option("--edges", type=FRACTION, default=1e-9, show_default=True, help="Of edges of regions, relative to them.")
@click.option("--verdicts", type=click.IntRange(min=0), default=0, show_default=True, help="Points that may change.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(first: Path, second: Path, tolerance: float, edges: float, verdicts: int, as_json: bool) -> None:
    """Compare the results A and B: verdicts and edges that changed, the largest difference of each variable.

    Of two folders, all results (.h5) of the same name are compared.

    Exit code 0: the same within the tolerances; 1: different; 2: one of them cannot be read.
    """
    from gearstab.info.difference import Tolerances, difference, report
    from gearstab.results.read import reading

    tolerances = Tolerances(tolerance, edges, verdicts)

    def compared(old_path: Path, new_path: Path) -> dict[str, Any]:
        with reading(old_path) as old, reading(new_path) as new:
            return difference(old, new, tolerances)

    if first.is_dir() and second.is_dir():
        common, alone = _names(first, second)
        found = {name: compared(first / name, second / name) for name in common}
        told: dict[str, Any] = {"same": not any(alone.values()) and all(own["same"] for own in found.values())}
        told |= alone | {"results": found}
        differ = {name: own for name, own in found.items() if not own["same"]}
        texts = [report(own, (str(first / name), str(second / name)), tolerances) for name, own in differ.items()]
        texts += [
            f"only in the {key.removeprefix('only_')}: {', '.join(names)}" for key, names in alone.items() if names
        ]
        texts.append(f"{len(common):,} results in both, {len(differ):,} of them different")
    else:
        told = compared(first, second)
        texts = [report(told, (str(first), str(second)), tolerances)]
    if as_json:
        say(json.dumps({"first": str(first), "second": str(second), **told}, indent=2, allow_nan=False))
    else:
        say("\n".join(texts))
    if not told["same"]:
        raise click.exceptions.Exit(FAILED)


def _names(first: Path, second: Path) -> tuple[list[str], dict[str, list[str]]]:
    """Return the names of the results that both folders hold, and those that only one of them has."""
    old, new = ({path.name for path in folder.glob("*.h5")} for folder in (first, second))
    if not old & new:
        raise ResultError(f"{first} and {second}: no result (.h5) has the same name in both folders")
    return sorted(old & new), {"only_first": sorted(old - new), "only_second": sorted(new - old)}
