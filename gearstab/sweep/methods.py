"""The methods that a sweep can run: what each needs, declares and computes. One entry a method."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearstab.floquet import STATUS_FLAGS, kernel, solve
from gearstab.perturbation import Tongue, Tongues, first_order, uncoupled
from gearstab.results.variables import EXACT, EXPONENTS, FIRST_ORDER, FLOQUET, OCCURRENCE, SIDE, TONGUE, Variable
from gearstab.system import Array, GearSystem

POINTS, RANGE = "points", "range"
"""What of the mesh frequency a method needs: every point of the grid or the ends of its axis; None for neither."""


Key = tuple[Tongue, int]
"""What tells the regions along the dimension ``tongue`` apart: where a region is rooted and, as there can be several of
one root, which one of them it is."""


@dataclass(frozen=True)
class Outcome:
    """What a method gives for a batch of systems, one a row.

    values: by variable, with GRID as ``(rows, P)`` and ROWS as ``(rows,)`` (one row may stand for all).
    tongues: what the dimension ``tongue`` consists of, for methods that have it.
    """

    values: Mapping[str, Array]
    tongues: tuple[Key, ...] = ()


def _never() -> bool:
    return False


def _in_order(indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
    """Each once, in order of first appearance."""
    return tuple(dict.fromkeys(key for index in indices for key in index))


@dataclass(frozen=True)
class Method:
    """One method.

    name: its key in ``methods`` of a configuration, and its group in the result.
    frequency: what it needs of the mesh frequency; its results stand over all axes if that is POINTS, else over all but
        the mesh frequency. A method with RANGE gets it as an array of the two ends.
    variables: what it computes, coordinates included, for its options and a system.
    constants: values of those coordinates that are the same everywhere.
    run: (system, mesh frequency, options) -> Outcome.
    cost: about how many points of an undamped system of three coordinates and four segments a point of its own takes.
    unite: the list of all regions, from those of the blocks.
    parallel: whether threads of one process can run it side by side: where it spends its time outside of Python.
    """

    name: str
    frequency: str | None
    variables: Callable[[Any, GearSystem], tuple[Variable, ...]]
    run: Callable[[GearSystem, Array, Any], Outcome]
    cost: Callable[[Any, GearSystem], float]
    constants: Callable[[Any, GearSystem], Mapping[str, Any]]
    unite: Callable[[Iterable[Sequence[Key]]], tuple[Key, ...]] = _in_order
    parallel: Callable[[], bool] = _never

    @property
    def over_tongues(self) -> bool:
        """Whether its results stand over instability regions, a list that differs from system to system."""
        return self.frequency != POINTS

    def attributes(self, options: Any) -> dict[str, Any]:
        """What the group in the result says of the options."""
        plain = options.model_dump(exclude_none=True)
        return {name: int(value) if isinstance(value, bool) else value for name, value in plain.items()}


def _floquet_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    flags = {"flag_masks": list(STATUS_FLAGS.values()), "flag_meanings": " ".join(STATUS_FLAGS)}
    table = [replace(v, attributes=flags) if v.name == "status" else v for v in FLOQUET]
    return (*table, *(EXPONENTS if options.exponents else ()))


def _floquet(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    found = solve(system, mesh_frequency, exponents=options.exponents)
    values = {"growth_rate": found.growth_rate, "stable": found.stable, "status": found.status}
    if found.exponents is not None:
        values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
    return Outcome(values)


def _floquet_cost(options: Any, system: GearSystem) -> float:
    segments = 2 * sum(system.common_period()[1])
    work = max(1.0, segments * system.size**3 / 108)
    return work * (5 if options.exponents or system.damping is not None else 1)


def _exponent_numbers(options: Any, system: GearSystem) -> dict[str, Any]:
    return {"exponent": np.arange(1, 2 * system.size + 1)} if options.exponents else {}


def _compiled_kernel() -> bool:
    return kernel.name() == "c"


def _tongue_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    return (*TONGUE, *FIRST_ORDER)


def _sides(options: Any, system: GearSystem) -> dict[str, Any]:
    return {SIDE.name: ["lower", "upper"]}


def _from_tongues(found: Tongues) -> Outcome:
    names = ("boundary_frequency", "center_frequency", "half_width", "threshold")
    return Outcome({name: getattr(found, name) for name in names}, tuple((tongue, 0) for tongue in found.index))


def _modes_and_harmonics(options: Any, system: GearSystem) -> float:
    return 4.0 * system.size**2 * options.harmonics


def _perturbation(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return _from_tongues(first_order(system, options.harmonics))


def _uncoupled(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return _from_tongues(uncoupled(system, options.harmonics))


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


def _boundaries_cost(options: Any, system: GearSystem) -> float:
    return 4000 * max(1.0, 2 * sum(system.common_period()[1]) * system.size**3 / 108)


METHODS: dict[str, Method] = {
    "perturbation": Method(
        name="perturbation", frequency=None, variables=_tongue_variables, constants=_sides, cost=_modes_and_harmonics,
        run=_perturbation,
    ),
    "uncoupled": Method(
        name="uncoupled", frequency=None, variables=_tongue_variables, constants=_sides, cost=_modes_and_harmonics,
        run=_uncoupled,
    ),
    "floquet": Method(
        name="floquet", frequency=POINTS, variables=_floquet_variables, constants=_exponent_numbers, run=_floquet,
        cost=_floquet_cost, parallel=_compiled_kernel,
    ),
    "boundaries": Method(
        name="boundaries", frequency=RANGE, variables=_boundary_variables, constants=_sides, run=_boundaries,
        cost=_boundaries_cost, unite=_united_regions,
    ),
}  # fmt: skip
"""By name, in the order in which they run: the cheap ones first."""


def chosen(methods: Any) -> list[tuple[Method, Any]]:
    """The methods that a configuration asks for, with their options."""
    asked = [(method, getattr(methods, name, None)) for name, method in METHODS.items()]
    return [(method, options) for method, options in asked if options is not None]


def tongue_coordinates(index: Sequence[Key]) -> dict[str, list[Any]]:
    """The coordinates of the dimension ``tongue``."""
    found = {variable.name: [getattr(tongue, variable.name) for tongue, _ in index] for variable in TONGUE}
    return found | {OCCURRENCE.name: [occurrence for _, occurrence in index]}
