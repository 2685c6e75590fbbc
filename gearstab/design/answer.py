"""A design result in about ten lines."""

from __future__ import annotations

import numpy as np

from gearstab.config.model.units import scale
from gearstab.config.sections.design import objective_name, objective_unit
from gearstab.design.solution import Solution
from gearstab.results.display import in_brackets, unit_of

LONGEST = 5
"""Variables in the answer; further ones are counted."""


def answer(solution: Solution, reasons: int = 2) -> list[str]:
    """Return what changes, what that brings, what limits it, how firm it is and, in so many lines, why it works."""
    problem = solution.problem
    lines = []
    for k, weights in enumerate(problem.design.objectives):
        before, after = solution.objective_initial[k], solution.objective_optimum[k]
        gain = f", {100 * (1 - after / before):.3g} % less" if before > 0 and after <= before else ""
        shown = in_brackets(solution.initial_system, objective_unit(weights))
        lines.append(f"{objective_name(weights)}{shown}: {before:.6g} -> {after:.6g}{gain}")
    for v, variable in enumerate(problem.variables[:LONGEST]):
        old, new = (problem.text(variable, place) for place in (np.nan, solution.optimum[v]))
        down, up = solution.margins[:, v]
        firm = f" (margins {_signed('-', down)}, {_signed('+', up)})" if np.isfinite([down, up]).all() else ""
        lines.append(f"{variable.name}: {old} -> {new}{firm}")
    if len(problem.variables) > LONGEST:
        lines.append(f"... and {len(problem.variables) - LONGEST} more variables")
    if solution.equals > 1:
        lines.append(f"{solution.equals} combinations are equally good; this one changes the given design least")
    lines += _regions(solution)
    if solution.front is not None:
        lines.append(f"Pareto front: {len(solution.front[0])} designs; the optimum shown is a compromise between them")
    lines += [f"why: {text}" for text in solution.explanation[:reasons]]
    points, wrong = solution.verified
    lines.append(f"verified by Floquet analysis at {points:,} speeds: {wrong or 'none'} contradict{'s' * (wrong == 1)}")
    return lines


def _signed(sign: str, length: float) -> str:
    return f"{sign}{length:.3g}" if length > 0 else "0"


def _regions(solution: Solution) -> list[str]:
    tongues = solution.tongues
    if tongues is None:
        return []
    place = tongues.limiting(1)
    if place is None:
        return ["no instability region within reach of the operating range"]
    lower, upper = tongues.edges[place, :, 1]
    name, one, unit = _speed(solution)
    where = f"{name} {lower / one:.6g} to {upper / one:.6g}{unit}"
    away = tongues.distance[place, 1]
    label = tongues.index[place][0].label
    inside = int(np.count_nonzero(tongues.distance[:, 1] == 0))
    if away > 0:
        return [f"no instability in the operating range; nearest region {label}, {where}, {away / one:.4g}{unit} away"]
    return [f"{inside} region{'s' * (inside != 1)} left in the operating range; the widest is {label}, {where}"]


def _speed(solution: Solution) -> tuple[str, float, str]:
    """The speed that the operating range is given in: its name, the mesh frequency that one of it is, and its unit."""
    given = solution.problem.design.ranges[0]
    unit = given.shown_units or unit_of(solution.initial_system, "rad/s")
    one = solution.optimum_spans[0].factor * (scale(given.shown_units, "rad/s") if given.shown_units else 1.0)
    return given.of.replace("_", " "), one, "" if unit == "1" else f" {unit}"
