"""The part of ``gearstab respond`` for systems whose teeth may part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.sections.respond import Respond
    from gearstab.response.backlash import BacklashResponse
    from gearstab.results import ResultTree
    from gearstab.system import GearSystem


def respond_backlash(
    config: Config, wanted: Respond, system: GearSystem, duration: float, out: Path
) -> BacklashResponse:
    """Compute the response and write the result file ``out``.

    Raises OSError, and ValueError for what cannot be computed.
    """
    from math import tau

    import numpy as np

    from gearstab.response.backlash import backlash_response
    from gearstab.results import write_result

    start = None
    if wanted.initial is not None:
        start = np.array(wanted.initial.displacement), np.array(wanted.initial.velocity)
    discard = None
    if wanted.discard is not None:
        discard = wanted.discard * tau / (wanted.mesh_frequency * float(system.meshes[0].frequency_ratio))
    found = backlash_response(system, wanted.mesh_frequency, duration, start, wanted.samples_per_cycle, discard)
    write_result(out, result(config, wanted, system, found))
    return found


def result(config: Config, wanted: Respond, system: GearSystem, found: BacklashResponse) -> ResultTree:
    """The response as a result: its root, ``/modes`` and ``/response``."""
    import numpy as np

    from gearstab.cli.respond_linear import spectral
    from gearstab.response.backlash import BACKLASH_FLAGS, KINDS
    from gearstab.response.linear.equilibrium import static_mesh_force
    from gearstab.results import Group, ResultTree, fields_of
    from gearstab.results.guard import RESPOND
    from gearstab.results.provenance import modes_group, root_attributes
    from gearstab.results.units import in_units_of
    from gearstab.results.variables import BACKLASH_RESPONSE, flagged

    histories = (
        "time", "displacement", "velocity", "mesh_deflection", "mesh_velocity", "mesh_force", "contact", "energy",
    )  # fmt: skip
    names = [mesh.name for mesh in system.meshes]
    values: dict[str, Any] = {
        "dof": list(system.coordinates),
        "dof_units": list(system.coordinate_units),
        "mesh": names,
        "status": found.flags,
        "play": np.stack([found.teeth.low, found.teeth.high], axis=1),
        "bound": ["lower", "upper"],
        "event": np.arange(1, len(found.events) + 1),
        "event_time": np.array([event.time for event in found.events]),
        "event_mesh": [names[event.mesh] for event in found.events],
        "event_kind": [KINDS[event.kind] for event in found.events],
        "event_velocity": np.array([event.speed for event in found.events]),
        **{name: getattr(found, name) for name in histories},
    }
    if system.load is not None:
        values["static_mesh_force"] = static_mesh_force(system)
    values |= spectral(wanted, system, found)
    attributes = _attributes(system, found)
    if found.cycle is not None:
        cycle = found.cycle
        values |= {"peak_to_peak": cycle.peak_to_peak, "rms": cycle.rms}
        values |= {"mesh_force_peak": cycle.force_peak, "contact_loss_ratio": cycle.contact_loss}
    fields = fields_of(in_units_of(system, flagged(BACKLASH_RESPONSE, BACKLASH_FLAGS)), values)
    groups = {"modes": modes_group(system), "response": Group(fields, attributes)}
    return ResultTree(Group((), root_attributes(RESPOND, config, "none")), groups)


def _attributes(system: GearSystem, found: BacklashResponse) -> dict[str, Any]:
    from gearstab.results.units import in_brackets

    attributes: dict[str, Any] = {
        "status": found.status,
        "mesh_frequency": found.mesh_frequency,
        "common_period": found.common_period,
        "growth_rate": found.growth_rate,
        "largest_multiplier": found.largest_multiplier,
        "comment": "response with loss of contact; growth_rate, largest_multiplier: of the linear system with teeth "
        f"in contact; settled: from settled_from to settled_until{in_brackets(system, 's')}; period: number of "
        "common periods after which the motion repeats itself, 0 if it does not, by section_difference, relative to "
        "the extent of the motion",
    }
    if found.cycle is not None:
        attributes |= {"settled_from": found.cycle.begin, "settled_until": found.cycle.end}
        attributes |= {"period": found.cycle.period, "section_difference": found.cycle.difference}
    return attributes


ENDED = {
    "overflow": "the response outgrew double precision there; the history ends",
    "chatter": "too many impacts in too short a time there; the history ends",
}


def summary(found: BacklashResponse, out: Path) -> str:
    """What came out, in a few lines."""
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
