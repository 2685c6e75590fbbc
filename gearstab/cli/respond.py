"""``gearstab respond``: the response of a configuration's base system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

from gearstab.cli.console import tell

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.sections.respond import Respond
    from gearstab.response import Response
    from gearstab.response.rotating_pair import PairResponse
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
    """Compute the response that the section `respond` of CONFIG describes and write it to a file."""
    from gearstab.cli.errors import user_errors, warn

    with user_errors():
        from gearstab.config import load
        from gearstab.results.guard import RESPOND, result_of
        from gearstab.results.output import prepare

        out = output or Path("results") / f"{config.stem}.response.h5"
        result_of(RESPOND).refuse(out, config)
        loaded = load(config, overrides, needs=("respond",))
        prepare(out)
        if not quiet:
            warn(loaded)
        found = respond(loaded, out)
    if not quiet:
        tell(summary(found, out))


def respond(config: Config, out: Path) -> Response | PairResponse:
    """Compute the response and write the result file ``out``; raises ConfigError and OSError."""
    from gearstab.cli.respond_backlash import respond_backlash
    from gearstab.cli.respond_linear import result
    from gearstab.cli.respond_pair import respond_pair
    from gearstab.config.sections.respond_pair import PairRespond
    from gearstab.errors import NotPossible
    from gearstab.floquet.kernel import choice as kernel
    from gearstab.response.backlash import has_backlash
    from gearstab.results import write_result
    from gearstab.systems import build

    if isinstance(config.respond, PairRespond):
        return respond_pair(config, config.respond, out)
    if config.respond is None:
        raise ValueError("the configuration has no section respond")
    wanted, system = config.respond, build(config.parameters)
    try:
        _affordable(config, wanted, system)
        if has_backlash(system):
            return respond_backlash(config, wanted, system, _duration(wanted, system), out)
        with kernel.recorded() as ran:
            found = _steady(wanted, system) if wanted.steady_state else _history(wanted, system)
    except NotPossible as error:
        _refuse(config, ("respond",), error.message, error.remedy)
    write_result(out, result(config, wanted, system, found, kernel.said(ran)))
    return found


def _steady(wanted: Respond, system: GearSystem) -> Response:
    from gearstab.response import steady_state

    return steady_state(system, wanted.mesh_frequency, wanted.samples_per_cycle)


def _history(wanted: Respond, system: GearSystem) -> Response:
    import numpy as np

    from gearstab.response import driven_response, free_response
    from gearstab.response.linear.equilibrium import static_equilibrium

    follow = driven_response if system.forced else free_response
    if wanted.initial is None:
        start = static_equilibrium(system), np.zeros(system.size)
    else:
        start = np.array(wanted.initial.displacement), np.array(wanted.initial.velocity)
    return follow(system, wanted.mesh_frequency, *start, _duration(wanted, system), wanted.samples_per_cycle)


def _period(wanted: Respond, system: GearSystem) -> float:
    """Of the first mesh."""
    from math import tau

    return tau / (wanted.mesh_frequency * float(system.meshes[0].frequency_ratio))


def _duration(wanted: Respond, system: GearSystem) -> float:
    if wanted.duration is not None:
        return wanted.duration
    if wanted.steady_state:
        from gearstab.system import shared_period

        ratios = system.frequency_ratios + [force.frequency_ratio for force in system.forces]
        return shared_period(ratios)[1][0] * _period(wanted, system)
    return (wanted.cycles or 0.0) * _period(wanted, system)


def _affordable(config: Config, wanted: Respond, system: GearSystem) -> None:
    """Refuse what would exhaust the memory."""
    samples = _duration(wanted, system) / _period(wanted, system) * wanted.samples_per_cycle + 1
    numbers = samples * (2 * system.size + 2 * len(system.meshes) + 2)
    if numbers > MOST_NUMBERS:
        asked = next((key for key in ("duration", "cycles") if getattr(wanted, key) is not None), "samples_per_cycle")
        message = (
            f"{samples:.3g} samples would make a file of {8e-9 * numbers:.3g} GB, more than {8e-9 * MOST_NUMBERS:g} GB"
        )
        _refuse(
            config,
            ("respond", asked),
            message,
            f"ask for less than {MOST_NUMBERS / numbers:.2g} times that or fewer samples_per_cycle",
        )


def _refuse(config: Config, path: tuple[str, ...], message: str, hint: str) -> NoReturn:
    from gearstab.config import ConfigError

    raise ConfigError([config.problem(path, message, hint)])


def summary(found: Response | PairResponse, out: Path) -> str:
    """What came out, in one line; a second one if the history was cut."""
    from gearstab.cli.respond_backlash import summary as backlash_summary
    from gearstab.cli.respond_pair import summary as pair_summary
    from gearstab.response.backlash import BacklashResponse
    from gearstab.response.rotating_pair import PairResponse

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


NOTES = {
    "separation": "the force of a loaded mesh changes its sign, where teeth would separate, as they cannot here",
    "unbalanced": "the load accelerates the train as a whole; a steady state leaves that part of it out",
    "ill_conditioned": "the steady state is sensitive: a Floquet multiplier is near 1, or the system grows strongly",
}


def _long_run(found: Response) -> str:
    if found.growth_rate > 0:
        return f"unstable: grows as exp({found.growth_rate:.4g} t)"
    return f"decays as exp({found.growth_rate:.4g} t)" if found.growth_rate < 0 else "bounded"
