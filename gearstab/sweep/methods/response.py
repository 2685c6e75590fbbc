"""The periodic steady state over speed: ``methods.response``."""

from __future__ import annotations

from typing import Any

from gearstab.results.variables import SPEED_RESPONSE, Variable, flagged
from gearstab.sweep.methods.base import POINTS, Method, Outcome
from gearstab.system import Array, GearSystem


def _response_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    from gearstab.response.steady import STATUS_FLAGS as flags

    return flagged(SPEED_RESPONSE, flags)


def _mesh_names(options: Any, system: GearSystem) -> dict[str, Any]:
    return {"mesh": [mesh.name for mesh in system.meshes]}


def _response(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    from gearstab.response.speeds import speed_response

    found = speed_response(system, mesh_frequency, options.samples_per_cycle, options.tolerance)
    return Outcome(vars(found))


def _response_cost(options: Any, system: GearSystem) -> float:
    """Measured: 0.2 ms for 100 samples of three coordinates and two meshes; smooth waves ten times as much."""
    size = (2 * system.size + 5) / 11
    samples = options.samples_per_cycle * max(1, system.common_period()[1][0]) / 100
    return 1000 * size**2 * samples * (1 if system.piecewise_constant else 10)


def _response_check(options: Any, system: GearSystem) -> None:
    if not system.forced:
        raise ValueError("methods.response: nothing drives the system: give a load, forces or transmission errors")
    if not system.commensurate:
        raise ValueError("methods.response: mesh frequencies of irrational ratio have no periodic steady state")


METHOD = Method(
    name="response", frequency=POINTS, variables=_response_variables, constants=_mesh_names, run=_response,
    cost=_response_cost, check=_response_check,
)  # fmt: skip
