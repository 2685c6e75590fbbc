"""``gearstab respond``: the free response of a configuration's base system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.respond import Respond
    from gearstab.response import Response
    from gearstab.response.pair import PairResponse
    from gearstab.results import ResultTree
    from gearstab.system import GearSystem

MOST_NUMBERS = 250_000_000
"""Numbers that a result may hold (2 GB); working on them takes some five times as much memory."""


@click.command(name="respond", short_help="Compute a time response.")
@click.argument("config", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Result file [default: results/NAME.response.h5]."
)
@click.option(
    "--set", "overrides", metavar="PATH=VALUE", multiple=True, help="Replace a value for this run; repeatable."
)
@click.option("-q", "--quiet", is_flag=True, help="No messages but errors.")
def command(config: Path, output: Path | None, overrides: tuple[str, ...], quiet: bool) -> None:
    """Compute the free response that the section `respond` of CONFIG describes, exactly, and write it to a file."""
    from gearstab.cli.errors import user_errors

    with user_errors():
        from gearstab.config import load
        from gearstab.results.guard import refuse_foreign, refuse_inputs

        out = output or Path("results") / f"{config.stem}.response.h5"
        refuse_inputs(out, config)
        loaded = load(config, overrides)
        refuse_foreign(out)
        found = respond(loaded, out)
    if not quiet:
        click.echo(summary(found, out), err=True)


def respond(config: Config, out: Path) -> Response | PairResponse:
    """Compute the response and write the result file ``out``; raises ConfigError and OSError."""
    import numpy as np

    from gearstab.cli.respond_pair import respond_pair
    from gearstab.config.respond_pair import PairRespond
    from gearstab.response import free_response
    from gearstab.results import write_result
    from gearstab.systems import build

    if isinstance(config.respond, PairRespond):
        return respond_pair(config, config.respond, out)
    wanted, system = _wanted(config), build(config.parameters)
    _affordable(config, wanted, system)
    rest = np.zeros(system.size)
    found = free_response(
        system,
        wanted.mesh_frequency,
        np.array(wanted.initial.displacement or rest),
        np.array(wanted.initial.velocity or rest),
        _duration(wanted, system),
        wanted.samples_per_cycle,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_result(out, result(config, system, found))
    return found


def _wanted(config: Config) -> Respond:
    from gearstab.config.respond import Respond

    if not isinstance(config.respond, Respond):
        hint = "add respond: {mesh_frequency: .., cycles: .., initial: {displacement: [..]}}"
        _refuse(config, "", "no section 'respond'", hint)
    return config.respond


def _period(wanted: Respond, system: GearSystem) -> float:
    """Of the first mesh."""
    from math import tau

    return tau / (wanted.mesh_frequency * float(system.meshes[0].frequency_ratio))


def _duration(wanted: Respond, system: GearSystem) -> float:
    if wanted.duration is not None:
        return wanted.duration
    return (wanted.cycles or 0.0) * _period(wanted, system)


def _affordable(config: Config, wanted: Respond, system: GearSystem) -> None:
    """Refuse what would exhaust the memory."""
    samples = _duration(wanted, system) / _period(wanted, system) * wanted.samples_per_cycle + 1
    numbers = samples * (2 * system.size + 2 * len(system.meshes) + 2)
    if numbers > MOST_NUMBERS:
        path = "respond.duration" if wanted.cycles is None else "respond.cycles"
        message = (
            f"{samples:.3g} samples would make a file of {8e-9 * numbers:.3g} GB, more than {8e-9 * MOST_NUMBERS:g} GB"
        )
        _refuse(
            config,
            path,
            message,
            f"ask for less than {MOST_NUMBERS / numbers:.2g} times that or fewer samples_per_cycle",
        )


def _refuse(config: Config, path: str, message: str, hint: str) -> NoReturn:
    from gearstab.config.problems import ConfigError, Problem

    raise ConfigError([Problem(str(config.source), None, path, "", message, hint)])


def result(config: Config, system: GearSystem, found: Response) -> ResultTree:
    """The response as a result: its root, ``/modes`` and ``/response``."""
    from gearstab.floquet import kernel
    from gearstab.results import Group, ResultTree, fields_of
    from gearstab.results.provenance import modes_group, root_attributes
    from gearstab.results.variables import RESPONSE

    histories = ("time", "displacement", "velocity", "mesh_deflection", "mesh_force", "energy")
    values = {
        "dof": list(system.coordinates),
        "mesh": [mesh.name for mesh in system.meshes],
        **{name: getattr(found, name) for name in histories},
    }
    attributes = {
        "status": found.status,
        "mesh_frequency": found.mesh_frequency,
        "common_period": found.common_period,
        "growth_rate": found.growth_rate,
        "largest_multiplier": found.largest_multiplier,
        "comment": "free response; growth_rate: largest real part of the characteristic exponents (1/s); "
        "largest_multiplier: growth over a common_period (s) of all meshes",
    }
    groups = {"modes": modes_group(system), "response": Group(fields_of(RESPONSE, values), attributes)}
    return ResultTree(Group((), root_attributes(config, kernel.name())), groups)


def summary(found: Response | PairResponse, out: Path) -> str:
    """What came out, in one line; a second one if the history was cut."""
    from gearstab.cli.respond_pair import summary as pair_summary
    from gearstab.response.pair import PairResponse

    if isinstance(found, PairResponse):
        return pair_summary(found, out)
    lines = [f"response: {out}: {len(found.time):,} samples to t = {found.time[-1]:.6g}, {_long_run(found)}"]
    if found.status == "overflow":
        lines.append("warning: the response outgrew double precision there; the history ends")
    return "\n".join(lines)


def _long_run(found: Response) -> str:
    if found.growth_rate > 0:
        return f"unstable: grows as exp({found.growth_rate:.4g} t)"
    return f"decays as exp({found.growth_rate:.4g} t)" if found.growth_rate < 0 else "bounded"
