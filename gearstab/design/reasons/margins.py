"""How far each variable may move by itself before the objective degrades, and how the objective changes with it."""

from __future__ import annotations

import numpy as np

from gearstab.design.judging.judge import Goal, Judge
from gearstab.design.problem import DesignProblem
from gearstab.design.reasons.tongues import WEIGHTS, step
from gearstab.system import Array

DEGRADED = 0.1
"""Part of the optimum by which the objective may grow; of the given design's objective where the optimum is 0."""
LOOKED_AT = 24
"""Designs between the optimum and a bound, of which the first that is degraded counts."""
HALVINGS = 40
DEAR_LOOKED_AT, DEAR_HALVINGS = 6, 10
"""The same where judging a design takes long."""


def allowed(optimum: float, initial: float) -> float:
    """The largest objective that counts as not degraded.

    1.1 J of an optimum J > 0 (J + 0.1 |J| of a negative one); where J = 0, a tenth of the given design's objective, and
    0 where that is 0 as well: the margin then ends where the first instability begins.
    """
    if optimum != 0:
        return optimum + DEGRADED * abs(optimum)
    return DEGRADED * max(initial, 0.0)


def margins(problem: DesignProblem, judge: Judge, goal: Goal, design: Array, most: float) -> Array:
    """``(2, variables)``, how far each variable may go down and up until the goal exceeds ``most``.

    At most as far as its bounds, of a phasing that may take every value a whole turn; whole choices of integers; NaN of
    other choices.
    """
    found = np.full((2, len(problem.variables)), np.nan)
    for v, variable in enumerate(problem.variables):
        if variable.form == "integers":
            found[:, v] = _steps(problem, judge, goal, design, most, v)
    sides = [(k, int(v)) for v in np.flatnonzero(problem.continuous) for k in (0, 1)]
    if not sides:
        return found
    start = np.array([design[v] for _, v in sides])
    turning = np.array([problem.variables[v].periodic for _, v in sides])
    ends = np.where(turning, start + [2 * k - 1 for k, _ in sides], [problem.bounds[k, v] for k, v in sides])
    looked, halvings = (DEAR_LOOKED_AT, DEAR_HALVINGS) if problem.dear else (LOOKED_AT, HALVINGS)
    part = np.linspace(0.0, 1.0, looked + 1)[1:]
    places = start[:, None] + (ends - start)[:, None] * part
    bad = _values(problem, judge, goal, design, sides, places) > most
    first = np.where(bad.any(axis=1), np.argmax(bad, axis=1), looked)
    outside = np.where(first < looked, (first + 1) / looked, np.nan)
    inside = first / looked
    for _ in range(halvings):
        middle = 0.5 * (inside + np.where(np.isnan(outside), inside, outside))
        places = (start + (ends - start) * middle)[:, None]
        wrong = _values(problem, judge, goal, design, sides, places)[:, 0] > most
        outside = np.where(np.isnan(outside) | ~wrong, outside, middle)
        inside = np.where(wrong | np.isnan(outside), inside, middle)
        if np.nanmax(np.append(outside - inside, 0.0)) < 1e-9:
            break
    for (k, v), length in zip(sides, np.abs(ends - start) * inside, strict=True):
        found[k, v] = length
    return found


def _values(
    problem: DesignProblem, judge: Judge, goal: Goal, design: Array, sides: list[tuple[int, int]], places: Array
) -> Array:
    """The goal ``(sides, K)`` with one variable at a time at places ``(sides, K)``; infinite where none is possible."""
    designs = np.repeat(design[None], places.size, axis=0)
    turning = np.array([problem.variables[v].periodic for _, v in sides])[:, None]
    low = np.array([problem.bounds[0, v] for _, v in sides])[:, None]
    within = np.where(turning, low + np.mod(places - low, 1.0), places)
    designs[np.arange(places.size), np.repeat([v for _, v in sides], places.shape[1])] = within.ravel()
    objectives = judge.worth(designs).objectives
    value = np.where(np.isnan(objectives).any(axis=1), np.inf, goal(np.nan_to_num(objectives)))
    return np.asarray(value).reshape(places.shape)


def _steps(problem: DesignProblem, judge: Judge, goal: Goal, design: Array, most: float, v: int) -> list[float]:
    """Choices that an integer may go down and up."""
    size = problem.variables[v].axis.size
    places = np.arange(size, dtype=float)
    good = _values(problem, judge, goal, design, [(0, v)], places[None])[0] <= most
    here = int(design[v])
    runs = (good[:here][::-1], good[here + 1 :])
    return [float(np.argmin(run)) if not run.all() else float(len(run)) for run in runs]


def sensitivities(problem: DesignProblem, judge: Judge, design: Array) -> Array:
    """``(objectives, variables)``, d(objective)/d(variable) by differences of the exact objective; NaN of choices.

    On a kink, where a region just closes, it is the mean of the slopes on both sides.
    """
    found = np.full((len(problem.design.objectives), len(problem.variables)), np.nan)
    moving = [int(v) for v in np.flatnonzero(problem.continuous)]
    if not moving:
        return found
    rows = [(v, k) for v in moving for k in WEIGHTS]
    designs = np.repeat(design[None], len(rows), axis=0)
    for row, (v, k) in enumerate(rows):
        designs[row, v] += k * step(problem, v)
    values = judge.worth(designs).objectives
    for row, (v, k) in enumerate(rows):
        found[:, v] = np.nan_to_num(found[:, v]) + WEIGHTS[k] * values[row] / step(problem, v)
    return found
