"""The method ``required_damping`` of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.frequencies import choice, groups, per_mesh
from gearstab.floquet.report import reduction
from gearstab.results.variables import REQUIRED_DAMPING, Variable, flagged
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods.base import POINTS, Method, Outcome, nothing
from gearstab.system import Array, GearSystem

LADDER = 60.0
"""Cost of scanning the levels of damping, in undamped points."""
ROOTS = 400.0
"""Cost of the root finding, shared by all points: eigenproblems of their own for those that need damping."""


def way(options: Any, system: GearSystem) -> str:
    """``common_period`` or ``per_mesh``. Raises ValueError where the way asked for does not exist."""
    taken = choice.chosen(system, options.frequencies)
    # Zeros of an estimate with an interval would have none.
    return choice.PER_MESH if taken == choice.LYAPUNOV else taken


def variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    """The required damping and its status."""
    from gearstab.floquet.required_damping import FLAGS

    return flagged(REQUIRED_DAMPING, FLAGS)


def values(system: GearSystem, mesh_frequency: Array, options: Any) -> dict[str, Array]:
    """``required_damping`` and ``status`` of a batch of systems."""
    from gearstab.floquet.required_damping import required_damping

    settings = (options.of, options.largest, options.tolerance)
    if way(options, system) == choice.COMMON_PERIOD:
        found = [required_damping(system, mesh_frequency, *settings)]
    else:
        whole = system.over(system.batch)
        found = [
            required_damping(per_mesh.alone(whole, group), float(group.ratio) * mesh_frequency, *settings)
            for group in groups(system)
        ]
    status = np.bitwise_or.reduce([one.status for one in found])
    return {"required_damping": np.max([one.value for one in found], axis=0), "status": status}


def cost(options: Any, system: GearSystem) -> float:
    """Of a point, in the units of a sweep's costs."""
    if way(options, system) == choice.PER_MESH:
        return sum(_cost(per_mesh.alone(system, group)) for group in groups(system))
    return _cost(system)


def _cost(system: GearSystem) -> float:
    return LADDER * max(1.0, sum(p.segments * p.size**3 for p in reduction(system).parts) / 108) + ROOTS


def report(options: Any, system: GearSystem) -> Mapping[str, Any]:
    """Which way was taken through several mesh frequencies."""
    if len(set(system.frequency_ratios)) < 2:
        return {}
    return {"frequencies_chosen": way(options, system)}


def outlook(options: Any, system: GearSystem) -> str | None:
    """What --dry-run says of the way through several mesh frequencies."""
    if len(set(system.frequency_ratios)) < 2:
        return None
    return choice.reason(system, way(options, system))


def check(options: Any, system: GearSystem) -> None:
    """Raises OptionError where the options do not fit the system."""
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        message = f"takes periodic mesh stiffness only, and this system has {names} as well"
        raise OptionError(("required_damping",), message, "sweep the damping with floquet instead")
    try:
        way(options, system)
    except NotPossible:
        message = "mesh frequencies of irrational ratio have no common period"
        raise OptionError(("required_damping", "frequencies"), message, "choose per_mesh or auto") from None
    if options.of == "factor" and system.damping is None:
        message = "there is no damping to multiply"
        remedy = "give the system damping, or choose of: damping_ratio"
        raise OptionError(("required_damping", "of"), message, remedy)


def _run(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return Outcome(values(system, mesh_frequency, options))


METHOD = Method(
    name="required_damping", frequency=POINTS, variables=variables, constants=nothing, run=_run, cost=cost,
    report=report, check=check, outlook=outlook,
)  # fmt: skip
