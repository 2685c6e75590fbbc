"""``gearstab sweep``: from a configuration to a result file."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import note, say, tell, warn
from gearstab.errors import CONDITION_MET

if TYPE_CHECKING:
    from gearstab.config import Axis
    from gearstab.info.outcome import Condition
    from gearstab.sweep import Plan, Reporter, Summary
    from gearstab.sweep.forecast import Estimate


@click.command(name="sweep", short_help="Compute a grid.")
@terminal.config
@terminal.output("Result file [default: results/<CONFIG's name>.h5].")
@click.option("-j", "--jobs", type=click.IntRange(min=1), help="Threads or processes [default: one per processor].")
@terminal.overrides
@click.option(
    "--resume/--overwrite", default=None, help="Go on with what an interrupted run finished (default), or start anew."
)
@click.option("--extend", metavar="OLD.h5", type=terminal.FILE, help="Take over the points that an earlier result has.")
@click.option(
    "--keep-going/--fail-fast",
    default=None,
    help="After a block that fails compute all others, or nothing more [default: stop after ten that fail].",
)
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT|local",
    help="Compute with the workers of a Dask scheduler, or of a new one.",
)
@click.option("--dry-run", is_flag=True, help="Print size, time, memory and file size; compute and write nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as JSON; docs/files.md describes it.")
@click.option(
    "--fail-if",
    "limits_of",
    multiple=True,
    metavar="CONDITION",
    help="Exit with 3 where the outcome meets it: 'unstable', 'unstable > 0.1', 'growth > 0.05', 'flagged', 'failed', "
    "'regions'; repeatable.",
)
@click.option("--yes", is_flag=True, help="Begin a sweep of very many points, hours or gigabytes, too.")
@terminal.quiet
def command(
    config: Path, output: Path | None, jobs: int | None, overrides: tuple[str, ...], resume: bool | None,
    extend: Path | None, keep_going: bool | None, scheduler: str | None, dry_run: bool, as_json: bool,
    limits_of: tuple[str, ...], yes: bool,
) -> None:  # fmt: skip
    """Compute stability over the grid of CONFIG with all its methods.

    Exit code 3: the result is written, and a condition of --fail-if is met.
    """
    start = time.perf_counter()
    target = output or Path("results") / f"{config.stem}.h5"
    from gearstab.cli import messages
    from gearstab.config import load
    from gearstab.info import outcome
    from gearstab.results.read import SWEEP, result_of
    from gearstab.sweep import MOST_FAILURES, plan, run
    from gearstab.sweep.forecast import estimate, refuse

    conditions = [outcome.condition(text) for text in limits_of]
    result_of(SWEEP).refuse(target, config)
    planned = plan(load(config, overrides, needs=("sweep", "methods")))
    outcome.refuse(config, conditions, [own.name for layout in planned.layouts for own in layout.method.variables()])
    warn(planned.config)
    for text in filter(None, (layout.method.note() for layout in planned.layouts)):
        note(f"note: {text}")
    if dry_run:
        say(forecast(planned, estimate(planned, jobs), target))
        return
    told = messages.reporter()
    wanted = planned if extend is None else grown(planned, extend, told)
    found = refuse(planned, target, jobs, yes)
    failures = {None: MOST_FAILURES, True: None, False: 1}[keep_going]
    summary = run(wanted, target, jobs, resume is True, resume is False, told, failures, scheduler, found)
    note(final_line(target, summary, time.perf_counter() - start))
    for line in messages.searched(summary.searches):
        note(line)
    if summary.certified is not None:
        part = messages.percent(summary.certified)
        note(f"certificates: {part} of the mesh frequencies; gearstab verify proves them")
    for text in [] if summary.complete else messages.notes(planned, summary):
        note(f"note: {text}")
    if as_json or conditions:
        judge(target, conditions, as_json)


def judge(target: Path, conditions: list[Condition], as_json: bool) -> None:
    """Print the outcome of a result if asked for, and exit with CONDITION_MET if it meets one of the conditions."""
    from gearstab.info import outcome
    from gearstab.results.read import reading

    with reading(target) as tree:
        found = outcome.outcome(tree)
    if as_json:
        say(json.dumps({"result": str(target), **found}, indent=2, allow_nan=False))
    lines = outcome.judged(target, conditions, found)
    for line in lines:
        tell(line)
    if lines:
        raise click.exceptions.Exit(CONDITION_MET)


def grown(plan: Plan, old: Path, told: Reporter) -> Plan:
    """Return the plan that takes over what an earlier result has, and tell what that is."""
    from gearstab.sweep.extension import extended

    found, words = extended(plan, old)
    for text in words:
        told.message(text)
    return found


def final_line(target: Path, summary: Summary, seconds: float) -> str:
    """Return the line that ends a sweep."""
    from gearstab.sweep.progress import duration

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


def forecast(plan: Plan, found: Estimate, target: Path) -> str:
    """Return the text that ``--dry-run`` prints."""
    from gearstab.info import columns
    from gearstab.sweep.forecast import large

    axes = [[axis.name, f"{axis.size:,}", extent(axis)] for axis in plan.config.axes]
    methods = [[m.name, f"{m.points:,}", f"{m.blocks:,}", m.time, size(m.file_size)] for m in found.methods]
    lines = [plan.config.title, ""]
    lines += [*columns(["axis", "values", "from .. to"], axes), ""]
    lines += [*columns(["method", "points", "blocks", "time", "in the file"], methods), ""]
    outlooks = [(layout.method.name, layout.method.outlook()) for layout in plan.layouts]
    said = [f"{name}: {text}" for name, text in outlooks if text is not None]
    lines += [*said, ""] if said else []
    lines.append(f"points        {plan.points:,} of {plan.systems:,} system{'s' * (plan.systems != 1)}")
    processors = f"{found.jobs} processor{'s' * (found.jobs != 1)}"
    lines.append(f"time          {found.time} on {processors}")
    lines.append(f"memory        {size(found.memory)}")
    lines.append(f"file          {size(found.file_size)}, {target}")
    if reasons := large(plan, found):
        lines.append(f"begin         with --yes only: {', '.join(reasons)}")
    return "\n".join(lines)


def extent(axis: Axis) -> str:
    """The values of an axis in short."""
    if isinstance(axis.values, list):
        shown = "; ".join(axis.values[:4])
        return shown if axis.size <= 4 else f"{shown}; ..."
    from gearstab.results.display import typed

    found = typed(axis.typed_units, axis.units)
    unit, one = found.get("display_units", "" if axis.units == "1" else axis.units), found.get("display_scale", 1.0)
    ends = [axis.values[0], axis.values[-1]] if axis.size > 1 else [axis.values[0]]
    return f"{' .. '.join(f'{end / one:.6g}' for end in ends)} {unit}".rstrip()


def size(count: float) -> str:
    """A number of bytes, as little as is worth telling."""
    from gearstab.sweep.progress import octets

    return octets(max(count, 1000.0))
