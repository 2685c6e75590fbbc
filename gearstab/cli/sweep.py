"""``gearstab sweep``: from a configuration to a result file."""

from __future__ import annotations

import os
import time
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli.errors import user_errors, warn

if TYPE_CHECKING:
    from gearstab.config import Axis
    from gearstab.sweep import Plan, Summary
    from gearstab.sweep.estimate import Estimate


SLOW_KERNEL = "note: the compiled kernel was not built; sweeps run on the slower NumPy kernel"


@click.command(name="sweep", short_help="Compute a grid.")
@click.argument("config", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Result file [default: results/<CONFIG's name>.h5]."
)
@click.option("-j", "--jobs", type=click.IntRange(min=1), help="Threads or processes [default: one a processor].")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help="Replace a value of CONFIG for this run; repeatable.",
)
@click.option(
    "--resume/--overwrite", default=None, help="Go on with what an interrupted run finished (default), or start anew."
)
@click.option("--dry-run", is_flag=True, help="Print size, time, memory and file size; compute and write nothing.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def command(
    config: Path,
    output: Path | None,
    jobs: int | None,
    overrides: tuple[str, ...],
    resume: bool | None,
    dry_run: bool,
    quiet: bool,
) -> None:
    """Compute stability over the grid of CONFIG with all its methods."""
    start = time.perf_counter()
    target = output or Path("results") / f"{config.stem}.h5"
    with user_errors():
        from gearstab.config import load
        from gearstab.results.guard import refuse_inputs
        from gearstab.sweep import plan, run

        refuse_inputs(target, config)
        planned = plan(load(config, overrides, needs=("sweep", "methods")))
        if not quiet:
            warn(planned.config)
            for note in notes(planned):
                click.echo(f"note: {note}", err=True)
        if dry_run:
            from gearstab.sweep.estimate import estimate

            click.echo(forecast(planned, estimate(planned, jobs), target))
            return
        from gearstab.cli.progress import reporter

        summary = run(planned, target, jobs, resume is True, resume is False, reporter(quiet))
    if not quiet:
        click.echo(final_line(target, summary, time.perf_counter() - start), err=True)
        if summary.proved:
            click.echo(proof_line(summary.proved, summary.counted or 0.0), err=True)
        if slow_kernel(planned, summary):
            click.echo(SLOW_KERNEL, err=True)


def notes(plan: Plan) -> list[str]:
    """What the user should know of choices that were made automatically."""
    found = [layout.method.note(layout.options, plan.base) for layout in plan.layouts]
    return [note for note in found if note is not None]


def slow_kernel(plan: Plan, summary: Summary) -> bool:
    """Whether a sweep ran on the NumPy kernel because there is no other, and not because the user chose it.

    Systems with periodic terms have no faster one.
    """
    from gearstab.floquet import kernel

    chosen = os.environ.get("GEARSTAB_KERNEL") or "c" in kernel.available()
    return "numpy" in summary.kernels and not chosen and not plan.base.terms


def final_line(target: Path, summary: Summary, seconds: float) -> str:
    """What the user reads at the end."""
    from gearstab.cli.progress import duration

    if summary.complete:
        return f"{target}: already complete; --overwrite computes it again"
    parts = [f"{summary.points:,} point{'s' * (summary.points != 1)} in {duration(seconds)}"]
    if summary.reused:
        parts.append(f"{summary.reused} of {summary.blocks} blocks from an earlier run")
    if summary.unstable is not None:
        parts.append(f"{100 * summary.unstable / summary.points:.1f} % unstable")
    if summary.failed:
        parts.append(f"{summary.failed:,} could not be computed (see status)")
    return f"{target}: {', '.join(parts)}"


def proof_line(proved: float, counted: float) -> str:
    """What the boundaries of a damped system rest on: which share of the stable mesh frequencies is proved stable."""
    parts = [f"{percent(proved)} proved stable (in floating point)"]
    parts += [f"{percent(share)} {word}" for share, word in ((counted, "counted"), (1 - proved - counted, "neither"))
              if share >= HUNDREDTH]  # fmt: skip
    return f"stable mesh frequencies: {', '.join(parts)}"


HUNDREDTH = 1e-4
"""Of a per cent: what is less is not told."""


def percent(share: float) -> str:
    """A share in hundredths of a per cent, rounded down: all is all."""
    return f"{floor(share / HUNDREDTH + 1e-6) / 100:g} %"


def forecast(plan: Plan, found: Estimate, target: Path) -> str:
    """What ``--dry-run`` prints."""
    from gearstab.cli.progress import duration

    axes = [[axis.name, f"{axis.size:,}", extent(axis)] for axis in plan.config.axes]
    methods = [
        [m.name, f"{m.points:,}", f"{m.blocks:,}", duration(m.seconds), size(m.file_size)] for m in found.methods
    ]
    lines = [plan.config.title, ""]
    lines += [*table(["axis", "values", "from .. to"], axes), ""]
    lines += [*table(["method", "points", "blocks", "time", "in the file"], methods), ""]
    outlooks = [(layout.method.name, layout.method.outlook(layout.options, plan.base)) for layout in plan.layouts]
    said = [f"{name}: {text}" for name, text in outlooks if text is not None]
    lines += [*said, ""] if said else []
    lines.append(f"points        {plan.points:,} of {plan.systems:,} system{'s' * (plan.systems != 1)}")
    lines.append(
        f"time          {duration(found.seconds)} on {found.jobs} processor{'s' * (found.jobs != 1)} "
        f"({plan.kernel} kernel)"
    )
    lines.append(f"memory        {size(found.memory)}")
    lines.append(f"file          {size(found.file_size)}, {target}")
    return "\n".join(lines)


def extent(axis: Axis) -> str:
    """The values of an axis in short."""
    if isinstance(axis.values, list):
        shown = "; ".join(axis.values[:4])
        return shown if axis.size <= 4 else f"{shown}; ..."
    unit = "" if axis.units == "1" else f" {axis.units}"
    ends = f"{axis.values[0]:.6g} .. {axis.values[-1]:.6g}" if axis.size > 1 else f"{axis.values[0]:.6g}"
    return ends + unit


def size(count: float) -> str:
    """A number of bytes."""
    from gearstab.cli.progress import quantity

    text = quantity(max(count, 1000.0))
    return f"{text}B"


def table(header: list[str], rows: list[list[str]]) -> list[str]:
    """Columns of text, two spaces apart."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]
