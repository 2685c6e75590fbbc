"""The response while the speed changes: run-ups and coast-downs."""

from __future__ import annotations

from dataclasses import replace
from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.propagation.path import Path
from gearstab.response import RESPONSE_FLAGS, RampResponse, ramp_response
from gearstab.response.command import tree
from gearstab.response.spectra import HARMONICS, waterfall
from gearstab.results import Group, ResultTree, Variable, coordinate, fields_of
from gearstab.results.display import CYCLES, FACTOR, FREQUENCY, in_brackets, in_units_of, typed, unit_of
from gearstab.results.variables import SPEED, flagged
from gearstab.results.variables.responses import MESH_ORDER, ORDERS, RAMP_RESPONSE
from gearstab.system import GearSystem

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.config.model import SpeedAxis
    from gearstab.systems.parts.respond import Respond


def path_of(section: Respond) -> Path:
    """Return the mesh frequency over time."""
    assert section.ramp is not None
    first, last = section.mesh_frequency, section.ramp.to
    return Path(np.array([0.0, abs(last - first) / section.ramp.rate]), np.array([first, last]))


def samples(section: Respond, system: GearSystem) -> float:
    """Return how many samples the response has, about."""
    path, ratio = path_of(section), float(system.meshes[0].frequency_ratio)
    return float(path.time[-1] * path.range[1] * ratio / tau * section.samples_per_cycle) + 1


def response(config: Config, section: Respond, system: GearSystem) -> tuple[RampResponse, ResultTree]:
    """Compute the response, and the result to be written. Raises NotPossible."""
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
