"""The methods that a sweep can run: what each needs, declares and computes. One entry a method."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearstab.floquet import STATUS_FLAGS, Floquet, kernel, solve
from gearstab.floquet.report import reduction
from gearstab.floquet.truncation import modes_basis, neglected, restricted, torn, type_basis
from gearstab.perturbation import PERTURBATION_FLAGS, Tongue, Tongues, first_order, second_order, uncoupled
from gearstab.results.variables import (
    ERROR_ESTIMATE,
    EXACT,
    EXPONENTS,
    FIRST_ORDER,
    FLOQUET,
    OCCURRENCE,
    SECOND_ORDER,
    SIDE,
    SPEED_RESPONSE,
    TONGUE,
    Variable,
    flagged,
)
from gearstab.sweep import frequencies, required_damping
from gearstab.sweep.pairs import knowing_pairs
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Rectangular

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


def _never(options: Any, system: GearSystem) -> bool:
    return False


def _nothing(options: Any, system: GearSystem) -> Mapping[str, Any]:
    return {}


def _any(options: Any, system: GearSystem) -> None:
    return None


def _silent(options: Any, system: GearSystem) -> str | None:
    return None


FEWEST = 4
"""Points of a block, however costly."""


def _few(options: Any) -> int:
    return FEWEST


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
    report: attributes that say what it makes of the base system.
    check: raises ValueError where the options do not fit the base system.
    together: the least number of points of its own in a block, however costly, because they share work.
    note: what the user should know before it runs, None for nothing.
    outlook: what there is to say of its cost besides the estimated time, None for nothing.
    """

    name: str
    frequency: str | None
    variables: Callable[[Any, GearSystem], tuple[Variable, ...]]
    run: Callable[[GearSystem, Array, Any], Outcome]
    cost: Callable[[Any, GearSystem], float]
    constants: Callable[[Any, GearSystem], Mapping[str, Any]]
    unite: Callable[[Iterable[Sequence[Key]]], tuple[Key, ...]] = _in_order
    parallel: Callable[[Any, GearSystem], bool] = _never
    report: Callable[[Any, GearSystem], Mapping[str, Any]] = _nothing
    check: Callable[[Any, GearSystem], None] = _any
    together: Callable[[Any], int] = _few
    note: Callable[[Any, GearSystem], str | None] = _silent
    outlook: Callable[[Any, GearSystem], str | None] = _silent

    @property
    def over_tongues(self) -> bool:
        """Whether its results stand over instability regions, a list that differs from system to system."""
        return self.frequency != POINTS

    def attributes(self, options: Any, system: GearSystem) -> dict[str, Any]:
        """What the group in the result says of the options and of the base system."""
        plain = options.model_dump(exclude_none=True)
        return flat(plain) | dict(self.report(options, system))


def flat(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as attributes: without truth values, those of a section after its name."""
    found: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            found |= {f"{name}_{inner}": one for inner, one in flat(value).items()}
        else:
            found[name] = int(value) if isinstance(value, bool) else value
    return found


def _floquet_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    flags = {"flag_masks": list(STATUS_FLAGS.values()), "flag_meanings": " ".join(STATUS_FLAGS)}
    table = [replace(v, attributes=flags) if v.name == "status" else v for v in FLOQUET]
    more = frequencies.variables(options, _chosen_part(options, system))
    estimate = () if _exact(_chosen_part(options, system)) else (ERROR_ESTIMATE,)
    return (*table, *estimate, *(EXPONENTS if options.exponents else ()), *more)


def _exact(system: GearSystem) -> bool:
    """Whether propagation over a period is exact, so that all error is rounding."""
    return system.piecewise_constant and not system.terms


def _basis(options: Any, system: GearSystem) -> Array | None:
    """What the options restrict the system to, None where they do not. Raises ValueError."""
    if options.modes is not None:
        return modes_basis(system, options.modes)
    return None if options.block is None else type_basis(system, options.block)


def _chosen_part(options: Any, system: GearSystem) -> GearSystem:
    """The system that is solved."""
    basis = _basis(options, system)
    return system if basis is None else restricted(system, basis)


def _floquet(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    part = _chosen_part(options, system)

    def exact(one: GearSystem, omega: Array) -> Floquet:
        return solve(one, omega, exponents=options.exponents, tolerance=options.tolerance)

    found = frequencies.solved(options, part, mesh_frequency, exact)
    values = {"growth_rate": found.growth_rate, "stable": found.stable, "status": found.status}
    if found.error_estimate is not None:
        values["error_estimate"] = found.error_estimate
    if isinstance(found, Floquet) and found.exponents is not None:
        values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
    return Outcome(values | frequencies.values(options, part, found))


def _floquet_cost(options: Any, system: GearSystem) -> float:
    def exact(part: GearSystem) -> float:
        work = max(1.0, sum(p.segments * p.size**3 for p in reduction(part).parts) / 108)
        return work * (5 if options.exponents or part.damping is not None else 1)

    return frequencies.cost(options, _chosen_part(options, system), exact)


def _floquet_constants(options: Any, system: GearSystem) -> dict[str, Any]:
    part = _chosen_part(options, system)
    numbers = {"exponent": np.arange(1, 2 * part.size + 1)} if options.exponents else {}
    return numbers | frequencies.constants(options, part)


def _floquet_report(options: Any, system: GearSystem) -> dict[str, Any]:
    """What of the base system was solved, and what that saved."""
    found = reduction(_chosen_part(options, system))
    said: dict[str, Any] = {"reduction": found.text(), **frequencies.report(options, _chosen_part(options, system))}
    if np.isfinite(found.saving) and found.saving > 1:
        said["reduction_saving"] = found.saving
    basis = _basis(options, system)
    if basis is None:
        return said
    what = f"modes {', '.join(map(str, options.modes))}" if options.modes is not None else f"type {options.block}"
    coupling = neglected(system, basis)
    left_out = (
        f"neglects couplings of up to {coupling:.2g} of w_p w_q" if coupling else "which nothing couples to others"
    )
    return said | {"restriction": f"{what} of the base system: {basis.shape[-1]} of {system.size} modes, {left_out}"}


def _floquet_check(options: Any, system: GearSystem) -> None:
    if options.modes is not None and options.block is not None:
        raise ValueError("methods.floquet has both block and modes; give one of them")
    try:
        _basis(options, system)
    except ValueError as error:
        raise ValueError(f"methods.floquet.{'block' if options.modes is None else 'modes'}: {error}") from None
    if options.modes is not None and (group := torn(system, options.modes)):
        listed = ", ".join(map(str, group))
        raise ValueError(f"methods.floquet.modes: modes {listed} have equal frequencies; name all of them or none")
    try:
        taken = frequencies.way(options, _chosen_part(options, system))
    except ValueError as error:
        raise ValueError(f"methods.floquet.frequencies: {error}") from None
    if options.exponents and taken != "common_period":
        raise ValueError(f"methods.floquet.exponents: there are none without a common period ({taken} was chosen)")


def _floquet_note(options: Any, system: GearSystem) -> str | None:
    return frequencies.note(options, _chosen_part(options, system))


def _floquet_outlook(options: Any, system: GearSystem) -> str | None:
    return frequencies.outlook(options, _chosen_part(options, system))


def _compiled_kernel(options: Any, system: GearSystem) -> bool:
    return kernel.name() == "c" and frequencies.way(options, _chosen_part(options, system)) != "lyapunov"


def _tongue_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    return (*TONGUE, *FIRST_ORDER)


def _sides(options: Any, system: GearSystem) -> dict[str, Any]:
    return {SIDE.name: ["lower", "upper"]}


def _from_tongues(found: Tongues) -> Outcome:
    names = ("boundary_frequency", "center_frequency", "half_width", "threshold")
    return Outcome({name: getattr(found, name) for name in names}, tuple((tongue, 0) for tongue in found.index))


def _modes_and_harmonics(options: Any, system: GearSystem) -> float:
    return 4.0 * system.size**2 * options.harmonics


def _perturbation_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    if options.order == 1:
        return _tongue_variables(options, system)
    flags = {"flag_masks": list(PERTURBATION_FLAGS.values()), "flag_meanings": " ".join(PERTURBATION_FLAGS)}
    return (*TONGUE, *(replace(v, attributes=flags) if v.name == "status" else v for v in SECOND_ORDER))


def _perturbation(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    if options.order == 1:
        return _from_tongues(first_order(system, options.harmonics))
    found = second_order(system, options.harmonics)
    outcome = _from_tongues(found)
    further = {
        "first_order_boundary_frequency": found.first_order_boundary, "boundary_error": found.boundary_error,
        "status": found.status,
    }  # fmt: skip
    return replace(outcome, values={**outcome.values, **{name: np.asarray(a) for name, a in further.items()}})


def _perturbation_cost(options: Any, system: GearSystem) -> float:
    work = _modes_and_harmonics(options, system)
    # Sums over all modes and some hundred harmonics for every pair of modes: 2 ms for three modes, 6 s for fifty-nine.
    # Rows that differ by their epsilons alone share them, so that an eighth of it is taken for a row.
    return work if options.order == 1 else work * 10 * system.size


def _perturbation_together(options: Any) -> int:
    return FEWEST if options.order == 1 else 8 * FEWEST


def _perturbation_check(options: Any, system: GearSystem) -> None:
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        raise ValueError(f"methods.perturbation knows periodic mesh stiffness only; this system has {names} as well")


def _uncoupled_check(options: Any, system: GearSystem) -> None:
    other = [mesh.name for mesh in system.meshes if not isinstance(mesh.waveform, Rectangular)]
    if other or system.terms:
        names = ", ".join(other or [term.name for term in system.terms])
        raise ValueError(f"methods.uncoupled averages the contact ratios of rectangular waves: see {names}")


def _uncoupled(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return _from_tongues(uncoupled(system, options.harmonics))


def _required_damping(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return Outcome(required_damping.values(system, mesh_frequency, options))


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
        raise ValueError("methods.boundaries: mesh frequencies of irrational ratio have no common period")
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        raise ValueError(f"methods.boundaries needs symmetric mesh stiffness and nothing else that varies: see {names}")


def _boundaries_cost(options: Any, system: GearSystem) -> float:
    return 4000 * max(1.0, 2 * sum(system.common_period()[1]) * system.size**3 / 108)


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


METHODS: dict[str, Method] = {
    "perturbation": Method(
        name="perturbation", frequency=None, variables=_perturbation_variables, constants=_sides,
        cost=_perturbation_cost, run=_perturbation, check=_perturbation_check, together=_perturbation_together,
    ),
    "uncoupled": Method(
        name="uncoupled", frequency=None, variables=_tongue_variables, constants=_sides, cost=_modes_and_harmonics,
        run=_uncoupled, check=_uncoupled_check,
    ),
    "floquet": knowing_pairs(Method(
        name="floquet", frequency=POINTS, variables=_floquet_variables, constants=_floquet_constants, run=_floquet,
        cost=_floquet_cost, parallel=_compiled_kernel, report=_floquet_report, check=_floquet_check,
        note=_floquet_note, outlook=_floquet_outlook,
    )),
    "required_damping": Method(
        name="required_damping", frequency=POINTS, variables=required_damping.variables, constants=_nothing,
        run=_required_damping, cost=required_damping.cost, report=required_damping.report,
        check=required_damping.check, outlook=required_damping.outlook,
    ),
    "boundaries": Method(
        name="boundaries", frequency=RANGE, variables=_boundary_variables, constants=_sides, run=_boundaries,
        cost=_boundaries_cost, unite=_united_regions, check=_boundaries_check,
    ),
    "response": Method(
        name="response", frequency=POINTS, variables=_response_variables, constants=_mesh_names, run=_response,
        cost=_response_cost, check=_response_check,
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
