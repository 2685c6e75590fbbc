"""``gearstab respond``: the response of a configuration's base system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import tell, warn

if TYPE_CHECKING:
    from gearstab.response import RampResponse, Response
    from gearstab.response.backlash import BacklashResponse
    from gearstab.response.rotating_pair import PairResponse


@click.command(name="respond", short_help="Compute a time response.")
@terminal.config
@terminal.output("Result file [default: results/NAME.response.h5].")
@terminal.overrides
@terminal.quiet
def command(config: Path, output: Path | None, overrides: tuple[str, ...], quiet: bool) -> None:
    """Compute the response that the section `respond` of CONFIG describes and write it to a file."""
    from gearstab.config import load
    from gearstab.response.command import respond
    from gearstab.results.output import prepare
    from gearstab.results.read import RESPOND, result_of

    out = output or Path("results") / f"{config.stem}.response.h5"
    result_of(RESPOND).refuse(out, config)
    loaded = load(config, overrides, needs=("respond",))
    prepare(out)
    if not quiet:
        warn(loaded)
    found = respond(loaded, out, None if quiet else lambda text: tell(f"note: {text}"))
    if not quiet:
        tell(summary(found, out))


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
