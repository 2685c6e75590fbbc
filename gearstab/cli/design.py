"""``gearstab design``: the numbers that suppress instability over a range of speeds."""

from __future__ import annotations

from pathlib import Path

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import say, tell, warn


@click.command(name="design", short_help="Find a design without instability.")
@terminal.config
@terminal.output("Result file [default: results/NAME.design.h5].")
@terminal.overrides
@terminal.quiet
def command(config: Path, output: Path | None, overrides: tuple[str, ...], quiet: bool) -> None:
    """Find the best values of the variables in the section `design` of CONFIG and write them to a file.

    Prints the answer in some ten lines.
    """
    from gearstab.config import load
    from gearstab.design import check, design
    from gearstab.results import write_result
    from gearstab.results.output import prepare
    from gearstab.results.read import DESIGN, result_of

    out = output or Path("results") / f"{config.stem}.design.h5"
    result_of(DESIGN).refuse(out, config)
    loaded = load(config, overrides, needs=("design",))
    check(loaded)
    prepare(out)
    if not quiet:
        warn(loaded)
    found = design(loaded, (lambda text: None) if quiet else (lambda text: tell(f"design: {text}")))
    write_result(out, found)
    say(str(found.groups["design"].attributes["answer"]))
    if not quiet:
        tell(f"design: {out}")
