"""``gearstab respond``, ``design``, ``bench`` and ``report``.

A response of one system, a better design, methods compared, and what was found out, put on pages, as HTML or PDF.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import is_quiet, note, say, warn

if TYPE_CHECKING:
    from gearstab.bench import Scene
    from gearstab.config import Config
    from gearstab.response import RampResponse, Response
    from gearstab.response.backlash import BacklashResponse
    from gearstab.response.rotating_pair import PairResponse
    from gearstab.system import GearSystem


@click.command(name="respond", short_help="Compute a time response.")
@terminal.config
@terminal.output("Result file [default: results/NAME.response.h5].")
@terminal.overrides
@terminal.quiet
def respond_command(config: Path, output: Path | None, overrides: tuple[str, ...]) -> None:
    """Compute the response that the section `respond` of CONFIG describes and write it to a file."""
    from gearstab.config import load
    from gearstab.response.command import respond
    from gearstab.results.output import prepare
    from gearstab.results.read import RESPOND, result_of

    out = output or Path("results") / f"{config.stem}.response.h5"
    result_of(RESPOND).refuse(out, config)
    loaded = load(config, overrides, needs=("respond",))
    prepare(out)
    warn(loaded)
    found = respond(loaded, out, None if is_quiet() else lambda text: note(f"note: {text}"))
    note(summary(found, out))


def summary(found: Response | RampResponse | PairResponse, out: Path) -> str:
    """Summarise a response in one line, and in a second one if the history was cut."""
    from gearstab.response import RampResponse
    from gearstab.response.backlash import BacklashResponse
    from gearstab.response.rotating_pair import PairResponse

    if isinstance(found, RampResponse):
        return ramp_summary(found, out)
    if isinstance(found, PairResponse):
        return pair_summary(found, out)
    if isinstance(found, BacklashResponse):
        return backlash_summary(found, out)
    if found.status == "failed":
        return f"response: {out}: no steady state: a Floquet multiplier is 1; see status"
    lines = [f"response: {out}: {len(found.time):,} samples to t = {found.time[-1]:.6g}, {_long_run(found)}"]
    if found.status == "overflow":
        lines.append("warning: the response outgrew double precision there; the history ends")
    return "\n".join(lines + [f"note: {NOTES[name]}" for name in found.findings if name in NOTES])


def ramp_summary(found: RampResponse, out: Path) -> str:
    """Summarise a run-up or coast-down: where each mesh force is largest."""
    import numpy as np

    from gearstab.response import RESPONSE_FLAGS

    first, last = found.mesh_frequency[[0, -1]]
    lines = [f"response: {out}: {len(found.time):,} samples, mesh frequency {first:.6g} to {last:.6g}"]
    at = np.abs(found.mesh_force).argmax(axis=0)
    peaks = [f"{abs(found.mesh_force[k, i]):.4g} at {found.mesh_frequency[k]:.4g}" for i, k in enumerate(at)]
    lines.append(f"largest mesh forces and mesh frequencies there: {', '.join(peaks)}")
    if found.flags & RESPONSE_FLAGS["overflow"]:
        lines.append("warning: the response outgrew double precision there; the history ends")
    return "\n".join(lines + [f"note: {NOTES['separation']}"] * bool(found.flags & RESPONSE_FLAGS["separation"]))


NOTES = {
    "separation": "the force of a loaded mesh changes its sign, where teeth would separate, as they cannot here",
    "unbalanced": "the load accelerates the train as a whole; a steady state leaves that part of it out",
    "ill_conditioned": "the steady state is sensitive: a Floquet multiplier is near 1, or the system grows strongly",
}


def _long_run(found: Response) -> str:
    if found.growth_rate > 0:
        return f"unstable: grows as exp({found.growth_rate:.4g} t)"
    return f"decays as exp({found.growth_rate:.4g} t)" if found.growth_rate < 0 else "bounded"


ENDED = {
    "overflow": "the response outgrew double precision there; the history ends",
    "chatter": "too many impacts in too short a time there; the history ends",
}


def backlash_summary(found: BacklashResponse, out: Path) -> str:
    """Summarise a motion with backlash in a few lines."""
    end = found.time[-1]
    lines = [f"response: {out}: {len(found.time):,} samples to t = {end:.6g}, {len(found.events):,} changes of contact"]
    if found.cycle is not None:
        cycle = found.cycle
        loss = ", ".join(f"{100 * part:.3g} %" for part in cycle.contact_loss)
        settled = f"period {cycle.period}" if cycle.period else "not periodic (yet)"
        span = ", ".join(f"{value:.4g}" for value in cycle.peak_to_peak)
        lines.append(f"settled: {settled}; peak-to-peak mesh deflection {span}; without contact {loss} of the time")
    if found.status in ENDED:
        lines.append(f"warning: {ENDED[found.status]}")
    if "grazing" in found.findings:
        lines.append("note: a flank is hardly touched or hardly missed: small changes may do much")
    if "unbalanced" in found.findings:
        lines.append("note: the load accelerates the train as a whole")
    return "\n".join(lines)


def pair_summary(found: PairResponse, out: Path) -> str:
    """Summarise the motion of a pair in one line, and in a second one if the history is chaotic."""
    from math import inf

    import numpy as np

    turned = f"{found.advance:,.4g} mesh cycle{'s' * (found.advance != 1)}"
    if found.asked is not None and found.advance < found.asked * (1 - 1e-9):
        turned = f"stopped after {turned} of the {found.asked:,g} asked for"
    text = f"response: {out}: {len(found.time):,} samples to t = {found.time[-1]:.6g}, {turned}, {found.status_text}"
    if found.predictable == inf:
        return text
    number = 1 + int(np.argmax(found.events.time >= found.predictable))
    return (
        f"{text}\nwarning: from t = {found.predictable:.6g} on (event {number:,}) this is one of many histories: "
        "rounding errors have grown to 1 % of phi by then, and the least change of the initial state gives another one"
    )


@click.command(name="design", short_help="Find a design without instability.")
@terminal.config
@terminal.output("Result file [default: results/NAME.design.h5].")
@terminal.overrides
@terminal.quiet
def design_command(config: Path, output: Path | None, overrides: tuple[str, ...]) -> None:
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
    warn(loaded)
    found = design(loaded, lambda text: note(f"design: {text}"))
    write_result(out, found)
    say(str(found.groups["design"].attributes["answer"]))
    note(f"design: {out}")


@click.command(name="bench")
@terminal.config
@terminal.output("Result file [default: results/NAME.bench.h5].")
@terminal.overrides
@click.option("--points", type=click.IntRange(1, 1000), default=8, show_default=True, help="Reference points.")
@click.option("--seconds", type=click.FloatRange(0.0), default=1.0, show_default=True, help="Time for each setting.")
@click.option("--no-plot", is_flag=True, help="Do not draw the work-precision diagram.")
@terminal.quiet
def bench_command(
    config: Path, output: Path | None, overrides: tuple[str, ...], points: int, seconds: float, no_plot: bool
) -> None:  # fmt: skip
    """Compare speed and true error of the methods on the base system of CONFIG.

    The reference is computed in high precision at points spread over the mesh frequencies of CONFIG. Prints a table,
    writes a result file and draws the work-precision diagram beside it. Of a system with matrices that act with a speed
    of rotation it prints what a point costs, and writes nothing.
    """
    from gearstab.config import load
    from gearstab.results.output import prepare

    target = output or Path("results") / f"{config.stem}.bench.h5"
    _guard(config, target, not no_plot)
    loaded = load(config, overrides)
    system = loaded.system.build()
    scene = _scene(loaded, system)
    if system.rotations:
        from gearstab.bench.costs import turning_costs

        for cost in turning_costs(system, scene.start, scene.stop):
            say(cost.text())
        return
    prepare(target)
    from gearstab.bench import bench_group, measure, table
    from gearstab.results import Group, ResultTree, write_result
    from gearstab.results.provenance import modes_group, root_attributes
    from gearstab.results.read import BENCH

    found = measure(scene, points, seconds, lambda text: note(f"measuring: {text}"))
    say(table(found, points))
    if loaded.methods.branches is not None:
        from gearstab.bench.costs import branch_cost

        cycles = loaded.methods.branches.cycles
        say(branch_cost(system, scene.start, scene.stop, cycles=cycles).text(cycles))
    groups = {"modes": modes_group(system), "bench": bench_group(scene, points, found)}
    write_result(target, ResultTree(Group((), root_attributes(BENCH, loaded)), groups))
    note(f"written: {target}")
    if not no_plot:
        _draw(target)


def _guard(config: Path, target: Path, plot: bool) -> None:
    """Raise OutputError if the result or its picture would replace the configuration, each other or something else."""
    from gearstab.plots.drawing.style import FIGURE
    from gearstab.results import OutputError
    from gearstab.results.read import BENCH, result_of

    picture = target.with_suffix(".png")
    if plot:
        if picture == target:
            raise OutputError(f"{target}: is the name of the picture too; choose another output or use --no-plot")
        FIGURE.refuse(picture, config)
    result_of(BENCH).refuse(target, config)


def _scene(loaded: Config, system: GearSystem) -> Scene:
    """The base system and the range of the mesh_frequency axis. Raises ConfigError without such an axis."""
    from gearstab.bench import Scene, without_rigid_modes
    from gearstab.config import ConfigError
    from gearstab.system import Feature, unsupported

    axis = next((axis for axis in loaded.axes if axis.name == "mesh_frequency"), None)
    if axis is None:
        hint = "add mesh_frequency: {start: .., stop: .., num: ..}"
        raise ConfigError(
            [loaded.problem(("sweep", "mesh_frequency"), "missing", "is missing, which bench needs", hint)]
        )
    values = [float(value) for value in axis.values]
    takes = {Feature.PERIODIC_TERMS, Feature.UNSYMMETRIC_DAMPING}
    if system.rotations:
        takes = {Feature.ROTATION, Feature.UNSYMMETRIC_DAMPING}
    if refused := unsupported(system, takes):
        apart = (i for i, mesh in enumerate(system.meshes) if isinstance(mesh.frequency_ratio, float))
        places: list[tuple[str | int, ...]] = [("meshes", i, "frequency_ratio") for i in apart]
        places += [("formulation",)] if system.formulations else [()]
        raise ConfigError([loaded.problem(("system", *places[0]), "needs_other", f"bench: {refused[0]}", refused[1])])
    return Scene(system if system.rotations else without_rigid_modes(system), min(values), max(values))


def _draw(target: Path) -> None:
    from gearstab.plots import draw
    from gearstab.plots.drawing.style import save
    from gearstab.results.read import reading

    picture = target.with_suffix(".png")
    with reading(target) as tree:
        figure, _ = draw(tree, "work-precision")
        save(figure, picture, title=str(tree.attrs["title"]))
    note(f"drawn: {picture}")


ENDINGS = (".html", ".pdf")


@click.command(name="report", short_help="Write a report to forward.")
@terminal.config
@click.option("-o", "--output", type=terminal.FILE, required=True, help="Report: .html or .pdf, one file.")
@terminal.overrides
@terminal.unit
@terminal.quiet
def report_command(config: Path, output: Path, overrides: tuple[str, ...], unit: tuple[str, ...]) -> None:
    """Write a page on the instability of CONFIG over its operating range: what it is, what closes it, how sure that is.

    The range is that of the section `design`, whose best design is searched and proposed, else that of the sweep.
    """
    from gearstab.cli.report import html
    from gearstab.cli.report.content import page
    from gearstab.cli.report.pdf import pdf
    from gearstab.config import load
    from gearstab.errors import OutputError
    from gearstab.results.output import FIGURES, RESULTS, TABLES, Content, write_bytes

    ending = output.suffix.lower()
    if ending not in ENDINGS:
        raise OutputError(f"{output}: a report has a name that ends in {' or '.join(ENDINGS)}")
    others = tuple(name for name in (*TABLES, *FIGURES, *RESULTS) if name not in ENDINGS)
    content = Content("a report", "/".join(ENDINGS), no_report, others, streams=False)
    content.refuse(output, config)
    loaded = load(config, overrides)
    warn(loaded)
    with shown() as step:
        found = page(loaded, step, *unit[-1:])
    write_bytes(output, memoryview((html if ending == ".html" else pdf)(found)), content.refuse)
    note(f"report: {output}")


@contextmanager
def shown() -> Iterator[Callable[[str], None]]:
    """Give the function that shows which step begins: on a bar where standard error is a terminal, else nowhere."""
    from gearstab.cli.report.content import STEPS
    from gearstab.sweep.progress import bar

    with bar(disable=is_quiet() or not sys.stderr.isatty()) as progress:
        task = progress.add_task("report", total=len(STEPS), speed="", unstable="")

        def step(text: str) -> None:
            done = STEPS.index(text) if text in STEPS else None
            progress.update(task, description=text, completed=done, refresh=True)

        yield step


def no_report(path: Path) -> str:
    """Return what a file is instead of a report, "" for one."""
    with open(path, "rb") as file:
        head = file.read(512)
    made = b'content="gearstab"' in head if head.startswith(b"<!DOCTYPE html>") else head.startswith(b"%PDF-")
    return "" if made else "is no report"
