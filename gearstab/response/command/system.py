"""The response of a system of coordinates: free, driven or steady, of teeth that part, and while the speed changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import tau
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from gearstab.config import ConfigError
from gearstab.config.document import Code
from gearstab.errors import NotPossible
from gearstab.modal import static_equilibrium
from gearstab.propagation.path import Path
from gearstab.response import (
    RESPONSE_FLAGS,
    RampResponse,
    backlash,
    driven_response,
    free_response,
    harmonics,
    ramp_response,
    steady_state,
)
from gearstab.response.command import effort, tree
from gearstab.response.spectra import HARMONICS, Spectra, amplitudes, densities, waterfall
from gearstab.results import Group, ResultTree, Variable, coordinate, fields_of
from gearstab.results.display import CYCLES, FACTOR, FREQUENCY, in_brackets, in_units_of, typed, unit_of, with_orders
from gearstab.results.variables import SPEED, flagged
from gearstab.results.variables.responses import (
    BACKLASH_RESPONSE,
    MESH_ORDER,
    ORDERS,
    RAMP_RESPONSE,
    RESPONSE,
    TOOTH_LOADS,
)
from gearstab.system import GearSystem, shared_period

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.model import SpeedAxis
    from gearstab.response import Response
    from gearstab.response.backlash import BacklashResponse
    from gearstab.systems.respond import Respond

MOST_NUMBERS = 250_000_000
"""Numbers that a result may hold (2 GB); working on them takes some five times as much memory."""
SAMPLES_OF_HARMONIC = 8
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
            return _ramp_response(config, section, system)
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
        return effort.run_up(system, path_of(section), _samples_of_ramp(section, system))
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
    return max(1, min(samples // SAMPLES_OF_HARMONIC, MOST_HARMONICS))


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
        samples = _samples_of_ramp(section, system)
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


def path_of(section: Respond) -> Path:
    """Return the mesh frequency over time."""
    assert section.ramp is not None
    first, last = section.mesh_frequency, section.ramp.to
    return Path(np.array([0.0, abs(last - first) / section.ramp.rate]), np.array([first, last]))


def _samples_of_ramp(section: Respond, system: GearSystem) -> float:
    """Return how many samples the response has, about."""
    path, ratio = path_of(section), float(system.meshes[0].frequency_ratio)
    return float(path.time[-1] * path.range[1] * ratio / tau * section.samples_per_cycle) + 1


def _ramp_response(config: Config, section: Respond, system: GearSystem) -> tuple[RampResponse, ResultTree]:
    """Compute the response to a run-up or coast-down, and the result to be written. Raises NotPossible."""
    found = ramp_response(system, path_of(section), section.samples_per_cycle, tree.initial(section))
    values: dict[str, Any] = {
        name: getattr(found, name)
        for name in ("time", "displacement", "velocity", "mesh_deflection", "mesh_force")
    } | {
        "momentary_mesh_frequency": found.mesh_frequency, **tree.common(system, found),
    }  # fmt: skip
    attributes: dict[str, Any] = {
        "comment": "run-up or coast-down, without the rigid-body motion and what accelerates it"
    }
    forces = tree.values(system, values)
    values |= forces
    sounds = waterfall(system, found)
    if sounds is not None:
        ratios = [float(mesh.frequency_ratio) for mesh in system.whole_meshes]
        attributes |= {"window": sounds.width, "frequency_ratios": ratios}
        attributes["comment"] += f"; window: length of the windows of the spectrogram{in_brackets(system, 's')}"
        values |= {
            section.axis.key: sounds.mesh_frequency / section.axis.factor,
            "moment": sounds.moment,
            "frequency": sounds.frequency,
            "harmonic": np.arange(1, HARMONICS + 1),
            "mesh_force_spectrogram": sounds.spectrum,
            "mesh_force_harmonic": sounds.harmonics,
            **tree.harmonics(system, found, forces),
        }
    cycles = config.system.cycles_of_input()
    if cycles is not None:
        attributes[CYCLES] = cycles
    table = (*in_units_of(system, flagged(RAMP_RESPONSE, RESPONSE_FLAGS)), *tree.table(system, ramp=True))
    table = (ORDERS, *table) if MESH_ORDER in values else table
    key = section.axis.key
    table = tuple(replace(v, dims=tuple(key if dim == SPEED else dim for dim in v.dims)) for v in table)
    table = (_speed(section.axis, system), *table)
    return found, tree.result(config, system, Group(fields_of(table, values), attributes))


def _speed(axis: SpeedAxis, system: GearSystem) -> Variable:
    """The speed as the configuration gives it, in the middle of each window."""
    unit = unit_of(system, "rad/s")
    attributes = typed(axis.typed_units, unit) | ({} if axis.key == FREQUENCY else {FACTOR: axis.factor})
    own = coordinate(axis.key, axis.key, "f8", unit, axis.key.replace("_", " "))
    return replace(own, attributes=attributes)
