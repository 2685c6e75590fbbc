"""Outcome of a search, as a result: everything that figures and reports show of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from gearstab.config.sections.design import QUANTITIES, objective_name, objective_unit
from gearstab.design import quantities, regions
from gearstab.design.judge import AT_ONCE, Judge, limited
from gearstab.design.problem import Batch, DesignProblem
from gearstab.design.solution import Solution, answer
from gearstab.floquet import solve
from gearstab.results import Group, Variable, fields_of
from gearstab.results.display import in_units_of, unit_of
from gearstab.results.variables.design import (
    DESIGN,
    DESIGN_CHOICES,
    DESIGN_FRONT,
    DESIGN_PHASING,
    DESIGN_QUANTITIES,
    DESIGN_REGIONS,
    DESIGN_SCANS,
    SEVERAL,
)
from gearstab.system import Array

STATES = ("initial", "optimum")
SPEEDS = 801
"""Mesh frequencies at which the growth rate is stored."""
ACROSS = 25
"""Places along a variable, and along each side of a map of two."""
STEP = 0.05
"""Step of a variable, as part of its bounds, whose effect is reported."""
MOST_SCANS = 6
"""Maps of two variables, the first ones."""
ALWAYS = ("instability_width", "growth_rate", "required_damping", "tongue_distance")
"""Quantities of every design whose regions can be found."""

OVER_SPEED = {"load_factor": quantities.load_factor_over, "required_damping": quantities.damping_over}
"""Objectives that are stored over the speed as well."""


def group(solution: Solution) -> Group:
    """Return the group ``/design``."""
    problem = solution.problem
    several = len(problem.design.objectives) > 1
    found: dict[str, Any] = {}
    for part in (_main, _quantities, _regions, _scans, _front, _choices):
        found |= part(solution)
    tables = (*DESIGN, *DESIGN_QUANTITIES, *DESIGN_REGIONS, *DESIGN_SCANS, *DESIGN_FRONT, *DESIGN_CHOICES,
              *DESIGN_PHASING)  # fmt: skip
    unique = {item.name: item for item in tables}
    named = [replace(v, dims=SEVERAL[v.name]) if several and v.name in SEVERAL else v for v in unique.values()]
    table = [_united(solution, variable) for variable in in_units_of(solution.initial_system, named)]
    return Group(fields_of(table, found), attributes(solution))


def attributes(solution: Solution) -> dict[str, Any]:
    """Return what a reader wants first, as texts."""
    return {
        "answer": "\n".join(answer(solution)),
        "explanation": "\n".join(solution.explanation),
        "settings": "\n".join(solution.problem.settings(solution.optimum)),
        "limiting": solution.limiting,
        "evaluations": len(solution.judge.archive()[0]),
        "verification_points": solution.verified[0],
        "verification_mismatches": solution.verified[1],
        "margin_objective": solution.most,
        "width_floor": regions.FLOOR,
        "comment": "margins: how far a variable may move by itself, within its bounds, until the (first) objective "
        "exceeds margin_objective: 1.1 times the optimum, or a tenth of the initial objective where the optimum is 0; "
        "of integers in whole steps",
    }


def _united(solution: Solution, variable: Variable) -> Variable:
    """A variable in the unit of the objectives or, where values of several units stand in it, with a word on that."""
    units = map(objective_unit, solution.problem.design.objectives)
    own = [unit_of(solution.initial_system, unit) for unit in units]
    one = own[0] if len(set(own)) == 1 else "1"
    if variable.name in ("objective_initial", "objective_optimum", "design_objective", "choice_objective"):
        return replace(variable, units=one)
    if variable.name in ("scan_objective", "line_objective", "step_objective"):
        return replace(variable, units=own[0])
    if variable.name.startswith(("edge_sensitivity", "sensitivity")):
        numerator = "of the objective" if variable.name == "sensitivity" else "of the mesh frequency"
        return replace(variable, attributes={"comment": f"unit: that {numerator} over variable_units"})
    if variable.dims in (("variable",), ("design", "variable"), ("choice", "variable")) and variable.dtype == "f8":
        comment = "unit: variable_units; of choices the number of the row, from 1"
        return replace(variable, attributes={"comment": comment})
    return variable


def _main(solution: Solution) -> dict[str, Any]:
    problem = solution.problem
    rows = {"initial": problem.given[0], "optimum": solution.optimum}
    found: dict[str, Any] = {
        "variable": [v.name for v in problem.variables],
        "variable_units": [unit_of(solution.initial_system, v.axis.units) for v in problem.variables],
        "variable_form": [v.form for v in problem.variables],
        "objective": list(map(objective_name, problem.design.objectives)),
        "state": list(STATES),
        "lower_bound": np.array([_bound(problem, k, 0) for k in range(len(problem.variables))]),
        "upper_bound": np.array([_bound(problem, k, 1) for k in range(len(problem.variables))]),
        "margin_lower": solution.margins[0],
        "margin_upper": solution.margins[1],
    }
    for name, row in rows.items():
        pairs = list(zip(problem.variables, row, strict=True))
        found[name] = np.array([problem.number(v, place) for v, place in pairs])
        found[f"{name}_text"] = [problem.text(v, place) for v, place in pairs]
    several = len(problem.design.objectives) > 1
    for name, objectives in (("initial", solution.objective_initial), ("optimum", solution.objective_optimum)):
        found[f"objective_{name}"] = objectives if several else np.asarray(objectives[0])
    return found | {"sensitivity": solution.sensitivity if several else solution.sensitivity[0]}


def _bound(problem: DesignProblem, k: int, side: int) -> float:
    variable = problem.variables[k]
    if variable.continuous:
        return variable.bounds[side]
    numbers = [problem.number(variable, float(place)) for place in range(variable.axis.size)]
    return (min, max)[side](numbers)


def _quantities(solution: Solution) -> dict[str, Any]:
    """Quantities and constraints of both designs."""
    problem = solution.problem
    wanted = dict.fromkeys(name for weights in problem.design.objectives for name in weights)
    wanted |= dict.fromkeys(limit.name for limit in problem.design.limits if not limit.paths)
    wanted |= dict.fromkeys(ALWAYS if solution.tongues is not None else ())
    table = np.full((len(wanted), 2), np.nan)
    held = np.full((len(problem.design.limits), 2), np.nan)
    for state, design in enumerate((problem.given[0], solution.optimum)):
        for batch in problem.batches(design[None]):
            known = {name: quantities.EXACT[name](batch) for name in wanted}
            table[:, state] = [value[0] for value in known.values()]
            held[:, state] = [_worst(batch, limit, known) for limit in problem.design.limits]
    units = [unit_of(solution.initial_system, QUANTITIES[name].units) for name in wanted]
    found: dict[str, Any] = {"quantity": list(wanted), "quantity_units": units, "quantity_value": table}
    if problem.design.limits:
        found |= {
            "constraint": [limit.name for limit in problem.design.limits], "constraint_value": held,
            "constraint_minimum": np.array([limit.low for limit in problem.design.limits]),
            "constraint_maximum": np.array([limit.high for limit in problem.design.limits]),
        }  # fmt: skip
    return found


def _worst(batch: Batch, limit: Any, known: dict[str, Array]) -> float:
    """Return the number that is nearest to its limit or farthest beyond, of all that the limit is on."""
    numbers = limited(batch, limit, dict(known))[:, 0]
    room = np.fmin(limit.high - numbers, numbers - limit.low)
    return float(numbers[int(np.argmin(room))])


def _regions(solution: Solution) -> dict[str, Any]:
    spans = [solution.initial_spans, solution.optimum_spans]
    ranges = np.array([[[s.low, s.high] for s in own] for own in spans])
    found: dict[str, Any] = {
        "side": ["lower", "upper"],
        "range_frequency": np.moveaxis(ranges, 0, -1),
        "range_weight": np.array([s.weight for s in spans[0]]),
    }
    found |= _growth(solution, float(ranges.min()), float(ranges.max()))
    tongues = solution.tongues
    if tongues is None:
        return found
    for name in ("mode_p", "mode_q", "harmonic", "mesh", "kind", "label", "frequency_ratio"):
        found[name] = [getattr(tongue, name) for tongue, _ in tongues.index]
    return found | {
        "occurrence": [occurrence for _, occurrence in tongues.index], "region_frequency": tongues.edges,
        "region_distance": tongues.distance, "edge_sensitivity": tongues.sensitivity,
        "edge_sensitivity_first_order": tongues.first_order,
    }  # fmt: skip


def _growth(solution: Solution, low: float, high: float) -> dict[str, Any]:
    away = 0.15 * (high - low)
    speed = np.linspace(max(low - away, 0.5 * low), high + away, SPEEDS)
    if not solution.initial_system.commensurate:
        return {}
    systems = (solution.initial_system, solution.optimum_system)
    found = {"speed_growth_rate": [solve(system, speed).growth_rate[0] for system in systems]}
    wanted = {name for weights in solution.problem.design.objectives for name in weights}
    for name, over in OVER_SPEED.items():
        if name in wanted:
            found[f"speed_{name}"] = [over(system, speed)[0] for system in systems]
    return {"speed": speed} | {name: np.stack(curves, axis=1) for name, curves in found.items()}


def _scans(solution: Solution) -> dict[str, Any]:
    problem, judge = solution.problem, solution.judge
    moving = [int(v) for v in np.flatnonzero(problem.continuous)]
    if not moving or problem.dear:
        return {}
    across = np.linspace(0.0, 1.0, ACROSS)
    lines, steps = np.full((len(problem.variables), ACROSS), np.nan), np.full((len(problem.variables), 2), np.nan)
    for v in moving:
        low, high = problem.bounds[:, v]
        beside = (solution.optimum[v] - low) / (high - low) + np.array([-STEP, STEP])
        line = _objective(judge, _moved(problem, solution.optimum, {v: np.append(across, np.clip(beside, 0.0, 1.0))}))
        lines[v], steps[v] = line[:-2], line[-2:]
    found: dict[str, Any] = {"place": across, "line_objective": lines, "step_objective": steps}
    pairs = list(combinations(moving, 2))[:MOST_SCANS] if solution.cheap or len(moving) == 2 else []
    if pairs:
        one, other = (part.ravel() for part in np.meshgrid(across, across))
        maps = [_objective(judge, _moved(problem, solution.optimum, {a: one, b: other})) for a, b in pairs]
        names_of = [v.name for v in problem.variables]
        found |= {
            "other_place": across, "scanned": [names_of[a] for a, _ in pairs],
            "other_scanned": [names_of[b] for _, b in pairs],
            "scan_objective": np.reshape(maps, (len(pairs), ACROSS, ACROSS)),
        }  # fmt: skip
    return found


def _moved(problem: DesignProblem, design: Array, places: dict[int, Array]) -> Array:
    """The design with variables at places between their bounds."""
    designs = np.repeat(design[None], len(next(iter(places.values()))), axis=0)
    for v, part in places.items():
        low, high = problem.bounds[:, v]
        designs[:, v] = low + (high - low) * part
    return designs


def _objective(judge: Judge, designs: Array) -> Array:
    worth = [judge.worth(designs[k : k + AT_ONCE]) for k in range(0, len(designs), AT_ONCE)]
    return np.concatenate([np.where(w.violation > 0, np.nan, w.objectives[:, 0]) for w in worth])


def _front(solution: Solution) -> dict[str, Any]:
    if solution.front is None:
        return {}
    designs, objectives = solution.front
    return {
        "design": np.arange(1, len(designs) + 1), "design_value": numbers(solution.problem, designs),
        "design_objective": objectives, "design_text": [words(solution.problem, row) for row in designs],
    }  # fmt: skip


def _choices(solution: Solution) -> dict[str, Any]:
    if solution.choices is None:
        return {}
    designs, objectives = solution.choices
    found = {
        "choice": np.arange(1, len(designs) + 1), "choice_value": numbers(solution.problem, designs),
        "choice_objective": objectives, "choice_text": [words(solution.problem, row) for row in designs],
    }  # fmt: skip
    return found | solution.phasing


def numbers(problem: DesignProblem, designs: Array) -> Array:
    """``(designs, variables)``, values as numbers."""
    return np.array(
        [[problem.number(v, place) for v, place in zip(problem.variables, row, strict=True)] for row in designs]
    )


def words(problem: DesignProblem, design: Array) -> str:
    """``meshes.first.contact_ratio = 1.1, stage = row 2``."""
    pairs = zip(problem.variables, design, strict=True)
    return ", ".join(f"{variable.name} = {problem.text(variable, place)}" for variable, place in pairs)
