"""``gearstab bench``: speed against error of every method that fits a configuration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import say, tell

if TYPE_CHECKING:
    from gearstab.bench import Scene
    from gearstab.config import Config
    from gearstab.system import GearSystem


@click.command()
@terminal.config
@terminal.output("Result file [default: results/NAME.bench.h5].")
@terminal.overrides
@click.option("--points", type=click.IntRange(1, 1000), default=8, show_default=True, help="Reference points.")
@click.option("--seconds", type=click.FloatRange(0.0), default=1.0, show_default=True, help="Time for each setting.")
@click.option("--no-plot", is_flag=True, help="Do not draw the work-precision diagram.")
@terminal.quiet
def command(
    config: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    points: int,
    seconds: float,
    no_plot: bool,
    quiet: bool,
) -> None:
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

    found = measure(scene, points, seconds, lambda text: None if quiet else tell(f"measuring: {text}"))
    say(table(found, points))
    if loaded.methods.branches is not None:
        from gearstab.bench.costs import branch_cost

        cycles = loaded.methods.branches.cycles
        say(branch_cost(system, scene.start, scene.stop, cycles=cycles).text(cycles))
    groups = {"modes": modes_group(system), "bench": bench_group(scene, points, found)}
    write_result(target, ResultTree(Group((), root_attributes(BENCH, loaded)), groups))
    if not quiet:
        tell(f"written: {target}")
    if not no_plot:
        _draw(target, quiet)


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
    from gearstab.support import unsupported
    from gearstab.system import Feature

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


def _draw(target: Path, quiet: bool) -> None:
    from gearstab.plots import draw
    from gearstab.plots.drawing.style import save
    from gearstab.results.read import reading

    picture = target.with_suffix(".png")
    with reading(target) as tree:
        figure, _ = draw(tree, "work-precision")
        save(figure, picture, title=str(tree.attrs["title"]))
    if not quiet:
        tell(f"drawn: {picture}")
