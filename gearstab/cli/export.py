"""``gearstab export``: a group of a result file as tidy CSV."""

from __future__ import annotations

from pathlib import Path

import click

from gearstab.cli.terminal import options
from gearstab.cli.terminal.console import StandardOutput, tell


@click.command(name="export", short_help="Write a result file as tidy CSV.")
@click.argument("result", type=options.FILE)
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path, allow_dash=True),
    help="CSV file; - for standard output.",
)
@click.option(
    "--group", metavar="NAME", help="Which group of the file [default: floquet, else the first one over the sweep]."
)
@click.option(
    "--over",
    metavar="DIM,..",
    help="The dimensions of the rows where there are several tables: of a response time,dof; time,mesh; frequency.",
)
@options.select
@options.unit
@options.quiet
def command(
    result: Path, output: Path, group: str | None, over: str | None, select: tuple[str, ...], unit: tuple[str, ...],
    quiet: bool,
) -> None:  # fmt: skip
    """Write the file RESULT as tidy CSV: one row per grid point, one column per axis or variable.

    Units other than SI units stand behind the names of their columns.
    """
    from gearstab.results.export import export

    out = None if str(output) == "-" else output
    rows, notes = export(result, out, StandardOutput(), group, over, options.selections(select), unit)
    if quiet:
        return
    if out is not None:
        tell(f"{out}: {rows:,} rows")
    for note in notes:
        tell(f"note: {note}")
