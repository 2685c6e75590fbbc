"""``gearstab plot``: a figure from a result file."""

from __future__ import annotations

from pathlib import Path

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import note
from gearstab.plots import KINDS

KINDS_HELP = "; ".join(f"{name}: {kind.summary}" for name, kind in KINDS.items())


@click.command()
@click.argument("result", type=terminal.FILE)
@terminal.output("Figure: .png, .pdf or .svg, or a page to look around in: .html [default: RESULT with .png].")
@click.option("--kind", metavar="|".join(KINDS), help=f"What to draw [default: by what RESULT holds]. {KINDS_HELP}.")
@click.option("--x", metavar="AXIS", help="Axis along x [default: mesh_frequency].")
@click.option("--y", metavar="AXIS", help="Axis along y [default: epsilon, else the longest other axis].")
@terminal.select
@terminal.unit
@click.option("--variable", help="Variable to draw [default: growth_rate].")
@click.option(
    "--level",
    multiple=True,
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    help="Probability at which a line is drawn (kind probability); may be given again [default: 0.01, 0.1, 0.5, 0.9].",
)
@click.option(
    "--mark", multiple=True, metavar="NAME=X,Y", help="Mark a point of a map, in units of its axes; may be repeated."
)
@click.option("--title", metavar="TEXT", help="Title over the figure [default: that of the result].")
@click.option("--no-title", is_flag=True, help="Write no title over the figure.")
@click.option("--size", metavar="single|double", help="One journal column (88 mm) or two (180 mm).")
@click.option(
    "--style", default="", metavar="NAME|FILE", help="A style of matplotlib, a style sheet, or latex: text by LaTeX."
)
@terminal.quiet
@click.option("--dpi", type=click.IntRange(50, 2400), help="Resolution of pixels [default: 300].")
def command(
    result: Path, output: Path | None, kind: str | None, x: str | None, y: str | None, select: tuple[str, ...],
    unit: tuple[str, ...], variable: str | None, mark: tuple[str, ...], level: tuple[float, ...], title: str | None,
    no_title: bool, size: str | None, dpi: int | None, style: str,
) -> None:  # fmt: skip
    """Draw a figure from the file RESULT alone; nothing is computed again."""
    from gearstab.errors import PlotError
    from gearstab.plots import draw
    from gearstab.plots.drawing.style import FIGURE, checked_extension, save, title_of
    from gearstab.plots.interactive import PAGE, save_page
    from gearstab.plots.view import Request
    from gearstab.results.read import reading

    target = output or result.with_suffix(".png")
    interactive = target.suffix.lower() == ".html"
    if not interactive:
        checked_extension(target)
    (PAGE if interactive else FIGURE).refuse(target, result)
    chosen = terminal.selections(select)
    request = Request(
        x, y, chosen, variable, size, not no_title and (title or True), dpi, unit,
        levels=level, marks=points(mark), style=style,
    )  # fmt: skip
    if interactive:
        if kind not in (None, "map") or variable is not None or mark:
            raise PlotError("a page shows the map of growth rates alone: leave --kind, --variable and --mark out")
        with reading(result) as tree:
            save_page(tree, request, target, title or title_of(tree))
        note(f"page: {target}")
        return
    with reading(result) as tree:
        figure, artists = draw(tree, kind, request)
        save(figure, target, title_of(tree), style)
    note(f"figure: {target}")
    for text in [*artists["nearest"], *([artists["left_out"]] if artists.get("left_out") else [])]:
        note(f"note: {text}")


def points(texts: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """``NAME=X,Y`` texts as a mapping. Raises PlotError for anything else."""
    from gearstab.errors import PlotError

    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, place = text.rpartition("=")
        try:
            x, y = (float(part) for part in place.split(","))
        except ValueError:
            raise PlotError(f"--mark {text!r}: write NAME=X,Y, for instance A=4.2,0.3") from None
        found[name.strip()] = x, y
    return found
