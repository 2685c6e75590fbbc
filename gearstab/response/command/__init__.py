"""The response that the section ``respond`` of a configuration asks for: computed, and as a result file.

The theory is in :mod:`gearstab.response`. The response of a gear pair that is given by its gears is here, that of a
system of coordinates in :mod:`gearstab.response.command.system`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from math import inf, tau
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from gearstab.config import ConfigError
from gearstab.errors import NotPossible
from gearstab.response import rotating_pair
from gearstab.response.command import system, tree
from gearstab.response.rotating_pair import STATUS, InitialState, PairResponse
from gearstab.response.spectra import SHORTEST, spectrum
from gearstab.results import Group, ResultTree, fields_of, write_result
from gearstab.results.display import in_brackets, unit_of, with_orders
from gearstab.results.variables import flagged
from gearstab.results.variables.responses import PAIR_RESPONSE
from gearstab.rotating_pair import RotatingPair
from gearstab.systems.respond import PairRespond

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.response import RampResponse, Response
MOST_SAMPLES, BYTES = 20_000_000, 64
"""Samples that a result may hold, and the bytes of each."""


def respond(
    config: Config, out: Path, say: Callable[[str], None] | None = None
) -> Response | RampResponse | PairResponse:
    """Compute the response and write the result file ``out``; raises ConfigError and OSError.

    say: is told beforehand what takes long.
    """
    found, written = computed(config, say)
    write_result(out, written)
    return found


def computed(
    config: Config, say: Callable[[str], None] | None = None
) -> tuple[Response | RampResponse | PairResponse, ResultTree]:
    """Compute the response, and the result to be written; say as for :func:`respond`. Raises ConfigError."""
    if config.respond is None:
        raise ValueError("the configuration has no section respond")
    if isinstance(config.respond, PairRespond):
        return _pair_response(config, config.respond)
    return system.response(config, config.respond, say)


def _pair_response(config: Config, section: PairRespond) -> tuple[PairResponse, ResultTree]:
    """Compute the response, and the result to be written; raises ConfigError."""
    pair = cast(RotatingPair, config.system.build())
    speed = section.speed * pair.numbers.teeth[0]
    step = tau / speed / section.samples_per_cycle
    _affordable(config, section, speed)
    initial, drive = section.initial, 0.0
    start = InitialState(speed, initial.phi, initial.phi_dot, initial.theta)
    if section.hold_speed:
        start, drive = _held(config, pair, speed)
    duration = inf if section.duration is None else section.duration
    found = rotating_pair.respond(pair, start, step, duration, section.cycles, MOST_SAMPLES, drive)
    group = _group(section, pair, found, step, {"holding_torque": drive} if section.hold_speed else {})
    return found, tree.result(config, pair, group)


def _held(config: Config, pair: RotatingPair, mesh_frequency: float) -> tuple[InitialState, float]:
    """State and torque on the periodic orbit; raises ConfigError where there is none."""
    try:
        return rotating_pair.held(pair, mesh_frequency)
    except NotPossible as error:
        hint = "choose another speed or a smaller torque"
        raise ConfigError([config.problem(("respond", "hold_speed"), "impossible", str(error), hint)]) from None


def _affordable(config: Config, section: PairRespond, speed: float) -> None:
    """Refuse what would exhaust the memory, as far as that is known beforehand."""
    cycles = section.cycles if section.duration is None else section.duration * speed / tau
    samples = 0.0 if cycles is None else cycles * section.samples_per_cycle
    if samples > MOST_SAMPLES:
        path = ("respond", "duration" if section.cycles is None else "cycles")
        most = f"{1e-9 * BYTES * MOST_SAMPLES:.2g} GB"
        message = f"{samples:.3g} samples would make a file of {1e-9 * BYTES * samples:.3g} GB, more than {most}"
        raise ConfigError([config.problem(path, "too_large", message, "ask for less, or fewer samples_per_cycle")])


def _group(
    section: PairRespond, pair: RotatingPair, found: PairResponse, step: float, holding: dict[str, float]
) -> Group:
    """The group ``/response``; holding: the attribute of a speed that is held."""
    sections, events = found.sections, found.events
    values: dict[str, Any] = {
        name: getattr(found, name) for name in ("time", "phi", "phi_dot", "theta", "theta_dot", "energy", "status")
    }
    values |= {
        "mesh": [mesh.name for mesh in pair.meshes],
        "mesh_stiffness": found.stiffness[:, None],
        "mesh_force": found.mesh_force[:, None],
        "cycle": sections.cycle,
        "section_theta": sections.theta,
        "event": np.arange(1, len(events.time) + 1),
    }
    values |= {f"section_{f.name}": getattr(sections, f.name) for f in fields(sections) if f.name != "cycle"}
    values |= {f"event_{f.name}": getattr(events, f.name) for f in fields(events)}
    table = flagged(PAIR_RESPONSE, STATUS)
    if pair.numbers.lever is None:
        words = "elastic mesh force times half the module"
        table = tuple(replace(v, units="N m", long_name=words) if v.name == "mesh_force" else v for v in table)
    table = with_orders([replace(v, units=unit_of(pair, v.units)) for v in table], section.speed)
    values |= _spectrum(section, pair, found, step)
    return Group(fields_of(table, values), _attributes(section, pair, found) | holding)


def _spectrum(section: PairRespond, pair: RotatingPair, found: PairResponse, step: float) -> dict[str, Any]:
    """Spectrum and peaks of phi; nothing for a response that is too short."""
    # The last sample is where the next period of a response that repeats itself begins.
    history = found.phi[round(section.spectrum.discard * section.samples_per_cycle) : -1]
    if len(history) < SHORTEST:
        return {}
    part = spectrum(history, step, section.spectrum.window, section.spectrum.peaks)
    unit = float(pair.numbers.damped_frequency) or np.nan
    return {
        "frequency": part.frequency,
        "normalised_frequency": part.frequency / unit,
        "power_spectral_density": part.density,
        "peak": np.arange(1, len(part.peaks) + 1),
        "peak_frequency": part.frequency[part.peaks],
        "peak_normalised_frequency": part.frequency[part.peaks] / unit,
        "peak_power_spectral_density": part.density[part.peaks],
    }


def _attributes(section: PairRespond, pair: RotatingPair, found: PairResponse) -> dict[str, Any]:
    numbers = pair.numbers
    speed, angle, time = (in_brackets(pair, unit) for unit in ("rad/s", "rad", "s"))
    overdamped = "; from the damping ratio 1 on there is no w_d, and normalised frequencies are NaN"
    known = {
        "formulation": pair.formulation,
        "status": found.status_text,
        "end_time": found.end,
        "mesh_cycles": found.advance,
        "mesh_frequency": section.speed * numbers.teeth[0],
        "natural_frequency": float(numbers.w0),
        "damped_natural_frequency": float(numbers.damped_frequency),
        "static_deflection": float(numbers.load),
        "comment": f"mesh_frequency: at the beginning{speed}; natural_frequency: w0 = sqrt(M2 (k1 + k2)/2){speed}; "
        f"damped_natural_frequency: w_d{speed}; static_deflection: T0/k0{angle}; end_time: when the run ended{time}; "
        "mesh_cycles: by how many theta has advanced then; predictable_until, where given: when rounding errors have "
        f"grown to 1 % of phi{time}" + overdamped * (not numbers.damped_frequency > 0),
    }
    known |= {"stall_time": found.stalled} if found.stalled < inf else {}
    return known | ({"predictable_until": found.predictable} if found.predictable < inf else {})
