"""``gearstab export``: a group of a result file as tidy CSV."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from gearstab.cli.errors import user_errors


@click.command(name="export", short_help="Write a result file as tidy CSV.")
@click.argument("result", type=click.Path(path_type=Path))
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
def command(result: Path, output: Path, group: str | None, over: str | None) -> None:
    """Write the file RESULT as tidy CSV: one row a grid point, one column an axis or variable."""
    with user_errors():
        from gearstab.results import export

        if str(output) == "-":
            export.to_stream(result, sys.stdout, group, over)
        else:
            rows = export.export_csv(result, output, group, over)
            click.echo(f"{output}: {rows:,} rows", err=True)
        if note := export.left_out(result, group, over):
            click.echo(f"note: {note}", err=True)
