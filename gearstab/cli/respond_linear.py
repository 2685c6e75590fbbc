"""The response of a linear system as a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.sections.respond import Respond
    from gearstab.response import Response
    from gearstab.response.measures.spectra import Spectra
    from gearstab.results import ResultTree
    from gearstab.system import GearSystem

HARMONICS = 8
"""A harmonic is stored for every so many samples of a common period."""
MOST_HARMONICS = 4000


def result(config: Config, wanted: Respond, system: GearSystem, found: Response, kernel: str) -> ResultTree:
    """The response as a result: its root, ``/modes`` and ``/response``; ``kernel``: the one that ran."""
    from gearstab.cli import respond_teeth
    from gearstab.response import RESPONSE_FLAGS
    from gearstab.response.linear.equilibrium import static_mesh_force
    from gearstab.results import Group, ResultTree, fields_of
    from gearstab.results.guard import RESPOND
    from gearstab.results.provenance import modes_group, root_attributes
    from gearstab.results.units import in_units_of
    from gearstab.results.variables import RESPONSE, TOOTH_LOADS, flagged

    histories = ("time", "displacement", "velocity", "mesh_deflection", "mesh_force", "energy")
    kept = len(found.time)
    if wanted.stored_cycles is not None:
        kept = min(kept, round(wanted.stored_cycles * wanted.samples_per_cycle) + 1)
    values = {
        "dof": list(system.coordinates),
        "dof_units": list(system.coordinate_units),
        "mesh": [mesh.name for mesh in system.meshes],
        "status": found.flags,
        **{name: getattr(found, name)[:kept] for name in histories},
    }
    if system.load is not None:
        values["static_mesh_force"] = static_mesh_force(system)
    if found.drift is not None:
        values["mean_velocity"] = found.drift
    values |= spectral(wanted, system, found)
    loads = respond_teeth.values(config, wanted, system, found)
    values |= loads
    attributes = {
        "status": found.status,
        "mesh_frequency": found.mesh_frequency,
        "common_period": found.common_period,
        "growth_rate": found.growth_rate,
        "largest_multiplier": found.largest_multiplier,
        "comment": _comment(wanted, system),
    }
    table = (*RESPONSE, *(TOOTH_LOADS if loads else ()))
    fields = fields_of(in_units_of(system, flagged(table, RESPONSE_FLAGS)), values)
    groups = {"modes": modes_group(system), "response": Group(fields, attributes)}
    return ResultTree(Group((), root_attributes(RESPOND, config, kernel)), groups)


def _comment(wanted: Respond, system: GearSystem) -> str:
    from gearstab.results.units import in_brackets

    kind = "periodic steady state" if wanted.steady_state else "driven response" if system.forced else "free response"
    return (
        f"{kind}; growth_rate: largest real part of the characteristic exponents{in_brackets(system, '1/s')}; "
        f"largest_multiplier: growth over a common_period{in_brackets(system, 's')} of all that varies and drives"
    )


def spectral(wanted: Respond, system: GearSystem, found: Response) -> dict[str, Any]:
    """Amplitudes of the harmonics of a steady state, else power spectral densities of the history."""
    from gearstab.response import harmonics
    from gearstab.response.measures.spectra import amplitudes, densities

    if not wanted.steady_state:
        spectra = densities(found)
        return {} if spectra is None else _named(spectra, "density", system)
    if found.status == "failed":
        return {}
    order = max(1, min((len(found.time) - 1) // HARMONICS, MOST_HARMONICS))
    return _named(amplitudes(harmonics(system, found.mesh_frequency, order)), "amplitude", system)


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
