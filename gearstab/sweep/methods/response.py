"""The response over speed: ``methods.response``; the periodic steady state, or with backlash what motions settle to."""

from __future__ import annotations

from typing import Any

from gearstab.results.variables import BACKLASH_SPEED_RESPONSE, SPEED_RESPONSE, Variable, flagged
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods.base import POINTS, Method, Outcome, Run
from gearstab.system import Array, GearSystem

CYCLES = 200.0
"""How long motions with backlash are followed at every mesh frequency, if not said otherwise."""


def _response_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    if _parting(system):
        from gearstab.response.backlash import BACKLASH_FLAGS

        return flagged(BACKLASH_SPEED_RESPONSE, BACKLASH_FLAGS)
    from gearstab.response.linear.steady import STATUS_FLAGS as flags

    return flagged(SPEED_RESPONSE, flags)


def _mesh_names(options: Any, system: GearSystem) -> dict[str, Any]:
    return {"mesh": [mesh.name for mesh in system.meshes]}


def _response(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    from gearstab.response.linear.speeds import speed_response

    found = speed_response(system, mesh_frequency, options.samples_per_cycle, options.tolerance)
    return Outcome(vars(found))


def _cycles(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    from gearstab.response.backlash.speeds import speed_cycles

    down, cycles = options.continuation == "down", options.cycles or CYCLES
    found = speed_cycles(system, mesh_frequency, down, cycles, options.discard)
    return Outcome({name: values[None] for name, values in vars(found).items()})


def _parting(system: GearSystem) -> bool:
    """Whether the teeth of any mesh may part."""
    from gearstab.response.backlash import has_backlash

    return has_backlash(system)


def _singly(options: Any, system: GearSystem) -> Run | None:
    return _cycles if _parting(system) else None


def _response_cost(options: Any, system: GearSystem) -> float:
    """Measured: 0.2 ms for 100 samples of three coordinates and two meshes; smooth waves ten times as much."""
    if _parting(system):
        # Measured: 0.7 ms a cycle of a gear pair, and more the more modes are faster than the mesh frequency.
        cycles = max(options.cycles or CYCLES, 2 * system.common_period()[1][0])
        return 4000 * system.size * cycles * (1 if system.piecewise_constant else 5)
    size = (2 * system.size + 5) / 11
    samples = options.samples_per_cycle * max(1, system.common_period()[1][0]) / 100
    return 1000 * size**2 * samples * (1 if system.piecewise_constant else 10)


def _response_check(options: Any, system: GearSystem) -> None:
    if not system.forced:
        remedy = "remove it, or give a load (a gearbox: torques of input or outputs), forces or transmission errors"
        raise OptionError(("response",), "nothing drives the system", remedy)
    if not _parting(system):
        for name in ("continuation", "cycles", "discard"):
            if getattr(options, name) is not None:
                raise OptionError(("response", name), "no mesh has backlash", "remove it, or give a mesh backlash")
    elif options.discard is not None and options.discard >= (options.cycles or CYCLES):
        message = f"leaves nothing of {options.cycles or CYCLES:g} cycles"
        raise OptionError(("response", "discard"), message, "discard less, or give more cycles")
    if not system.commensurate:
        message = "mesh frequencies of irrational ratio have no periodic steady state"
        raise OptionError(("response",), message, "remove it, or give exact ratios")


METHOD = Method(
    name="response", frequency=POINTS, variables=_response_variables, constants=_mesh_names, run=_response,
    cost=_response_cost, check=_response_check, singly=_singly,
)  # fmt: skip
