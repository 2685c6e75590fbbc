"""Edges of all instability regions by root finding: ``methods.boundaries``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from gearstab.results.variables import EXACT, OCCURRENCE, TONGUE, Variable
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods.base import RANGE, Effort, Key, Method, Outcome, sides
from gearstab.system import Array, GearSystem


def _boundary_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    from gearstab.floquet.boundaries import BOUNDARY_FLAGS

    flags = {"flag_masks": list(BOUNDARY_FLAGS.values()), "flag_meanings": " ".join(BOUNDARY_FLAGS)}
    table = [replace(v, attributes=flags) if v.name == "status" else v for v in EXACT]
    return (*TONGUE, OCCURRENCE, *table)


def _boundaries(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    from gearstab.floquet.boundaries import boundaries

    start, stop = (float(end) for end in mesh_frequency)
    found = boundaries(system, start, stop, options.tolerance, options.width_floor)
    edges = found.arranged()
    values = {
        "boundary_frequency": edges.boundary_frequency, "tolerance": edges.tolerance, "status": edges.flags,
        "holder": edges.holder, "contacts": found.contacts, "evaluations": found.evaluations,
    }  # fmt: skip
    return Outcome(values, edges.index)


def _united_regions(indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
    from gearstab.floquet.boundaries import union

    return union(indices)


def _boundaries_check(options: Any, system: GearSystem) -> None:
    if not system.commensurate:
        message = "mesh frequencies of irrational ratio have no common period"
        raise OptionError(("boundaries",), message, "remove it, or give exact ratios")
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        message = f"takes periodic mesh stiffness only, and this system has {names} as well"
        raise OptionError(("boundaries",), message, "use floquet, which takes these too")


def _boundaries_effort(options: Any, system: GearSystem, mesh_frequency: Array) -> Effort:
    from gearstab.sweep.effort import effort

    start, stop = (float(end) for end in mesh_frequency)
    return effort(system, start, stop)


def _boundaries_cost(options: Any, system: GearSystem) -> float:
    return 4000 * max(1.0, 2 * sum(system.common_period()[1]) * system.size**3 / 108)


METHOD = Method(
    name="boundaries", frequency=RANGE, variables=_boundary_variables, constants=sides, run=_boundaries,
    cost=_boundaries_cost, unite=_united_regions, check=_boundaries_check, effort=_boundaries_effort,
    relief="narrow the range of mesh_frequency, take ratios of smaller numbers, or remove it: floquet on a fine grid "
    "shows the regions that damping leaves",
)  # fmt: skip
