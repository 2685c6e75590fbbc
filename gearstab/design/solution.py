"""A design problem solved: the best design, how good it is, why, and how firmly, and all that in about ten lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gearstab.config import ConfigError
from gearstab.config.model.units import scale
from gearstab.config.sections.design import objective_name, objective_unit
from gearstab.design import search
from gearstab.design.judge import Goal, Judge
from gearstab.design.problem import DesignProblem, Span
from gearstab.design.quantities import REGIONS
from gearstab.design.reasons import allowed, explanation, margins, sensitivities
from gearstab.design.regions import DesignTongues, phasing, single, tongues
from gearstab.floquet import solve
from gearstab.results.display import in_brackets, unit_of
from gearstab.system import Array, GearSystem, unsupported

VERIFIED = 2001
"""Mesh frequencies of a range at which the optimum is verified."""
NEAR = 1e-6
"""Part of the mesh frequency around an edge: a point there is neither inside nor outside."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Solution:
    """Outcome of a search.

    optimum: the design. margins ``(2, variables)``; most: the objective at which they end. tongues: of the given design
    and of the optimum, None where regions cannot be found. verified: points of Floquet analysis in the ranges, and how
    many of them contradict the edges. front, choices: designs and their objectives; equals: how many of the choices are
    as good as the first one. phasing: further variables of choices of planetary gears.
    """

    problem: DesignProblem
    judge: Judge
    optimum: Array
    objective_initial: Array
    objective_optimum: Array
    margins: Array
    most: float
    sensitivity: Array
    tongues: DesignTongues | None
    verified: tuple[int, int]
    initial_system: GearSystem
    optimum_system: GearSystem
    initial_spans: tuple[Span, ...]
    optimum_spans: tuple[Span, ...]
    explanation: list[str]
    front: tuple[Array, Array] | None = None
    choices: tuple[Array, Array] | None = None
    equals: int = 1
    phasing: dict[str, Any] = field(default_factory=dict)

    @property
    def cheap(self) -> bool:
        """Whether a thousand designs are judged in seconds."""
        return not self.optimum_system.damped and self.problem.config.kind != "gearbox"

    @property
    def limiting(self) -> str:
        """The region that limits the optimum: the widest in the range, else the nearest one; "" for none in reach."""
        place = None if self.tongues is None else self.tongues.limiting(1)
        return "" if place is None or self.tongues is None else self.tongues.index[place][0].label


def solved(problem: DesignProblem, say: Say = lambda text: None) -> Solution:
    """Solve a design problem that was checked. Raises ConfigError where no design meets the constraints."""
    judge = Judge(problem)
    initial = judge.worth(problem.given)
    front = None
    goal: Goal = search.first
    if len(problem.design.objectives) > 1:
        designs = search.front(problem, judge, say)
        if len(designs) == 0:
            raise _infeasible(problem)
        objectives = judge.worth(designs).objectives
        front = designs, objectives
        optimum = designs[search.compromise(objectives)]
    else:
        optimum = search.best(problem, judge, goal, say)
    final = judge.worth(optimum[None])
    if final.violation[0] > 0:
        raise _infeasible(problem)
    say("sensitivities and margins")
    most = allowed(float(final.objectives[0, 0]), float(np.nan_to_num(initial.objectives[0, 0])))
    before, after = single(problem, problem.given[0]), single(problem, optimum)
    found = tongues(problem, [problem.given[0], optimum]) if not unsupported(after[0], REGIONS) else None
    if found is not None and (rest := found.uncovered[1]):
        say(rest)
    reasons = [] if found is None else explanation(after[0], [tongue for tongue, _ in found.index])
    choices, equals = (None, 1) if problem.continuous.any() else _choices(problem, judge)
    return Solution(
        problem, judge, optimum, initial.objectives[0], final.objectives[0],
        margins(problem, judge, goal, optimum, most), most, sensitivities(problem, judge, optimum), found,
        verified(after[0], after[1], found), before[0], after[0], before[1], after[1], reasons, front, choices, equals,
        {} if choices is None or found is None else phasing(problem, choices[0]),
    )  # fmt: skip


def _infeasible(problem: DesignProblem) -> ConfigError:
    """Message where no design that was looked at is allowed."""
    path = ("design", "constraints") if problem.design.limits else ("design", "variables")
    message, hint = "no design within the bounds meets the constraints", "relax constraints, or widen bounds"
    return ConfigError([problem.config.problem(path, "impossible", message, hint)])


def _choices(problem: DesignProblem, judge: Judge) -> tuple[tuple[Array, Array], int]:
    """All combinations of choices that are possible, the best ones first, and how many are as good as the first."""
    designs, worth = judge.archive()
    good = np.flatnonzero((worth.violation == 0) & ~np.isnan(designs).any(axis=1))
    _, first = np.unique(designs[good], axis=0, return_index=True)
    kept = good[first]
    scores, objectives = worth.score(search.first)[kept], worth.objectives[kept]
    order = search.ranking(problem, designs[kept], scores, objectives[:, 1:])
    equals = int(np.count_nonzero(search.tied(scores) == 0)) if objectives.shape[1] == 1 else 1
    return (designs[kept][order], objectives[order]), equals


def verified(system: GearSystem, spans: tuple[Span, ...], found: DesignTongues | None) -> tuple[int, int]:
    """Count points of Floquet analysis over the ranges, and those that contradict the edges.

    A point whose multipliers fail, or which lies at an edge, contradicts nothing.
    """
    if not system.commensurate:
        return 0, 0
    points, wrong = 0, 0
    for span in spans:
        omega = np.linspace(span.low, span.high, VERIFIED)
        stable = solve(system, omega).stable[0]
        points += int(np.count_nonzero(stable >= 0))
        if found is None:
            continue
        edges = found.edges[np.isfinite(found.edges[:, 0, 1]), :, 1]
        inside = np.any((omega > edges[:, :1]) & (omega < edges[:, 1:]), axis=0)
        near = np.any(np.abs(omega - edges.reshape(-1, 1)) < NEAR * omega, axis=0)
        wrong += int(np.count_nonzero(~near & (stable >= 0) & (inside == (stable == 1))))
    return points, wrong


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
