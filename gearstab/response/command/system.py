"""The response of a system of coordinates: free, driven or steady, and that of teeth that part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import tau
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from gearstab.config import ConfigError
from gearstab.config.document import Code
from gearstab.errors import NotPossible
from gearstab.modal import static_equilibrium
from gearstab.response import RESPONSE_FLAGS, backlash, driven_response, free_response, harmonics, steady_state
from gearstab.response.command import effort, ramp, tree
from gearstab.response.spectra import Spectra, amplitudes, densities
from gearstab.results import Group, ResultTree, Variable, fields_of
from gearstab.results.display import in_brackets, in_units_of, with_orders
from gearstab.results.variables import flagged
from gearstab.results.variables.responses import BACKLASH_RESPONSE, RESPONSE, TOOTH_LOADS
from gearstab.system import GearSystem, shared_period

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.response import RampResponse, Response
    from gearstab.response.backlash import BacklashResponse
    from gearstab.systems.parts.respond import Respond

MOST_NUMBERS = 250_000_000
"""Numbers that a result may hold (2 GB); working on them takes some five times as much memory."""
HARMONICS = 8
"""A harmonic is stored for every so many samples of a common period."""
MOST_HARMONICS = 4000

HISTORIES = ("time", "displacement", "velocity", "mesh_deflection", "mesh_force", "energy")


def response(
    config: Config, section: Respond, say: Callable[[str], None] | None = None
) -> tuple[Response | RampResponse, ResultTree]:
    """Compute the response, and the result to be written; say: is told what takes long. Raises ConfigError."""
    system = config.system.build()
    try:
        _affordable(config, section, system)
        if say is not None and (long := _effort(config, section, system)) is not None:
            say(long)
        if section.ramp is not None:
            return ramp.response(config, section, system)
        if backlash.has_backlash(system):
            parting = _parting(section, system)
            return parting, _backlash_result(config, section, system, parting)
        if section.steady_state:
            found = steady_state(system, section.mesh_frequency, section.samples_per_cycle)
        else:
            found = _history(section, system)
    except NotPossible as error:
        _refuse(config, ("respond",), "impossible", error.message, error.remedy)
    return found, _linear_result(config, section, system, found)


def _effort(config: Config, section: Respond, system: GearSystem) -> str | None:
    """Say how long it takes, and why, where that is long."""
    if section.ramp is not None:
        return effort.run_up(system, ramp.path_of(section), ramp.samples(section, system))
    duration = _duration(section, system)
    if backlash.has_backlash(system):
        return effort.motion_with_backlash(system, duration)
    order = teeth = 0
    if section.steady_state:
        order = _order(round(duration / _period(section, system) * section.samples_per_cycle))
        teeth = 0 if system.load is None else len(tree.teeth(config))
    return effort.linear_motion(system, section.mesh_frequency, duration, section.samples_per_cycle, order, teeth)


def _order(samples: int) -> int:
    """The highest harmonic that is stored of a steady state of so many samples."""
    return max(1, min(samples // HARMONICS, MOST_HARMONICS))


def _history(section: Respond, system: GearSystem) -> Response:
    follow = driven_response if system.forced else free_response
    given = tree.initial(section)
    displacement, velocity = (static_equilibrium(system), np.zeros(system.size)) if given is None else given
    duration, samples = _duration(section, system), section.samples_per_cycle
    return follow(system, section.mesh_frequency, displacement, velocity, duration, samples)


def _parting(section: Respond, system: GearSystem) -> BacklashResponse:
    discard = None if section.discard is None else section.discard * _period(section, system)
    duration, start = _duration(section, system), tree.initial(section)
    samples = section.samples_per_cycle
    return backlash.backlash_response(system, section.mesh_frequency, duration, start, samples, discard)


def _period(section: Respond, system: GearSystem) -> float:
    """Return the period of the first mesh."""
    return tau / (section.mesh_frequency * float(system.meshes[0].frequency_ratio))


def _duration(section: Respond, system: GearSystem) -> float:
    if section.duration is not None:
        return section.duration
    if section.steady_state:
        return shared_period(system.all_ratios)[1][0] * _period(section, system)
    return (section.cycles or 0.0) * _period(section, system)


def _affordable(config: Config, section: Respond, system: GearSystem) -> None:
    """Refuse what would exhaust the memory."""
    if section.ramp is None:
        samples = _duration(section, system) / _period(section, system) * section.samples_per_cycle + 1
    else:
        samples = ramp.samples(section, system)
    numbers = samples * (2 * system.size + 2 * len(system.meshes) + len(system.connections) + 2)
    if numbers > MOST_NUMBERS:
        asked = next((key for key in ("duration", "cycles") if getattr(section, key) is not None), "samples_per_cycle")
        message = (
            f"{samples:.3g} samples would make a file of {8e-9 * numbers:.3g} GB, more than {8e-9 * MOST_NUMBERS:g} GB"
        )
        remedy = f"ask for less than {MOST_NUMBERS / numbers:.2g} times that or fewer samples_per_cycle"
        _refuse(config, ("respond", asked), "too_large", message, remedy)


def _refuse(config: Config, path: tuple[str, ...], code: Code, message: str, hint: str) -> NoReturn:
    raise ConfigError([config.problem(path, code, message, hint)])


def _linear_result(config: Config, section: Respond, system: GearSystem, found: Response) -> ResultTree:
    kept = len(found.time)
    if section.stored_cycles is not None:
        kept = min(kept, round(section.stored_cycles * section.samples_per_cycle) + 1)
    values = {name: getattr(found, name)[:kept] for name in HISTORIES}
    if found.drift is not None:
        values["mean_velocity"] = found.drift
    teeth = tree.tooth_values(config, section, system, found)
    table = flagged((*RESPONSE, *(TOOTH_LOADS if teeth else ())), RESPONSE_FLAGS)
    kind = "periodic steady state" if section.steady_state else "driven response" if system.forced else "free response"
    comment = (
        f"{kind}; growth_rate: largest real part of the characteristic exponents{in_brackets(system, '1/s')}; "
        f"largest_multiplier: growth over a common_period{in_brackets(system, 's')} of all that varies and drives"
    )
    return _tree(config, section, system, found, table, values | teeth, {"comment": comment})


def _backlash_result(config: Config, section: Respond, system: GearSystem, found: BacklashResponse) -> ResultTree:
    events = found.events
    values: dict[str, Any] = {
        "play": np.stack([found.teeth.low, found.teeth.high], axis=1),
        "bound": ["lower", "upper"],
        "event": np.arange(1, len(events) + 1),
        "event_time": np.array([event.time for event in events]),
        "event_mesh": [system.meshes[event.mesh].name for event in events],
        "event_kind": [backlash.KINDS[event.kind] for event in events],
        "event_velocity": np.array([event.speed for event in events]),
        **{name: getattr(found, name) for name in (*HISTORIES, "mesh_velocity", "contact")},
    }
    attributes: dict[str, Any] = {
        "comment": "response with loss of contact; growth_rate, largest_multiplier: of the linear system with teeth "
        f"in contact; settled: from settled_from to settled_until{in_brackets(system, 's')}; period: number of "
        "common periods after which the motion repeats itself, 0 if it does not, by section_difference, relative to "
        "the extent of the motion"
    }
    if found.cycle is not None:
        cycle = found.cycle
        values |= {"peak_to_peak": cycle.peak_to_peak, "rms": cycle.rms}
        values |= {"mesh_force_peak": cycle.force_peak, "contact_loss_ratio": cycle.contact_loss}
        attributes |= {"settled_from": cycle.begin, "settled_until": cycle.end}
        attributes |= {"period": cycle.period, "section_difference": cycle.difference}
    table = flagged(BACKLASH_RESPONSE, backlash.BACKLASH_FLAGS)
    return _tree(config, section, system, found, table, values, attributes)


def _tree(
    config: Config, section: Respond, system: GearSystem, found: Response, table: Sequence[Variable],
    values: Mapping[str, Any], attributes: Mapping[str, Any],
) -> ResultTree:  # fmt: skip
    """The response as a result: its root, ``/modes`` and ``/response``."""
    names = ("status", "mesh_frequency", "common_period", "growth_rate", "largest_multiplier")
    cycles = config.system.cycles_of_input()
    table = with_orders(
        (*in_units_of(system, table), *tree.table(system)), None if cycles is None else found.mesh_frequency / cycles
    )
    common, forces = tree.common(system, found), tree.values(system, values)
    fields = fields_of(table, {**common, **forces, **values, **_spectral(section, system, found)})
    known = {name: getattr(found, name) for name in names}
    return tree.result(config, system, Group(fields, {**known, **attributes, **weak_shafts(system)}))


def _spectral(section: Respond, system: GearSystem, found: Response) -> dict[str, Any]:
    """Amplitudes of the harmonics of a steady state, else power spectral densities of the history."""
    if not section.steady_state:
        spectra = densities(found)
        return {} if spectra is None else _named(spectra, "density", system)
    if found.status == "failed":
        return {}
    coefficients = harmonics(system, found.mesh_frequency, _order(len(found.time) - 1))
    return _named(amplitudes(coefficients), "amplitude", system)


def _named(spectra: Spectra, what: str, system: GearSystem) -> dict[str, Any]:
    index, mesh = spectra.peak_index, spectra.peak_mesh
    return {
        "frequency": spectra.frequency,
        f"mesh_force_{what}": spectra.force,
        f"mesh_deflection_{what}": spectra.deflection,
        "peak": range(1, len(index) + 1),
        "peak_mesh": [system.meshes[i].name for i in mesh],
        "peak_frequency": spectra.frequency[index],
        f"peak_{what}": spectra.force[index, mesh],
    }


def weak_shafts(system: GearSystem) -> dict[str, Any]:
    """Attributes of a system with weak teeth or errors of a revolution.

    Their meshes and names, how many teeth their gears have, and frequencies of the shafts over Omega.
    """
    parts = [(mesh.part_of, mesh.name, mesh.frequency_ratio) for mesh in system.meshes if mesh.part_of]
    parts += [(mesh.name, one.name, one.frequency_ratio) for mesh in system.meshes for one in mesh.revolution_errors]
    if not parts:
        return {}
    ratios = {mesh.name: mesh.frequency_ratio for mesh in system.meshes}
    return {
        "weak_meshes": "\n".join(mesh for mesh, _, _ in parts),
        "weak_teeth": "\n".join(name for _, name, _ in parts),
        "weak_counts": [round(ratios[mesh] / ratio) for mesh, _, ratio in parts],
        "weak_ratios": [float(ratio) for _, _, ratio in parts],
    }
