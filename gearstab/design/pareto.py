"""Designs of which none is better than another in all of several objectives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearstab.design import search
from gearstab.design.judge import Goal, Judge
from gearstab.design.problem import DesignProblem
from gearstab.design.search import Say
from gearstab.system import Array

COMPROMISES = 9
"""Directions between two objectives in which designs are searched."""
BEGIN = 12
"""Number of known designs from which such a search begins."""
GENERATIONS = 12
"""Generations of such a search."""
MOST = 40
"""Designs of a front that are kept."""


def front(problem: DesignProblem, judge: Judge, say: Say) -> Array:
    """Return the designs of the front ``(designs, variables)``, by their first objective.

    The best design by each objective alone, then the best ones by max_k w_k (f_k - u_k)/(n_k - u_k) for weights w in
    several directions, u and n the least and the greatest f_k on the front so far (Bowman 1976, weighted Chebyshev
    norm, with a little of the sum against designs that are better in nothing). Of all designs that were judged on the
    way those are kept that no other one dominates.
    """
    count = len(problem.design.objectives)
    for k in range(count):
        search.best(problem, judge, lambda objectives, k=k: objectives[:, k], say)  # type: ignore[misc]
    if problem.continuous.any():
        for weights in _directions(count):
            designs, objectives = feasible(judge)
            goal = chebyshev(weights, *_corners(objectives[nondominated(objectives)]))
            order = np.argsort(goal(objectives), kind="stable")[:BEGIN]
            same = _of_one_choice(problem, designs[order])
            say(f"compromise {', '.join(f'{weight:.2g}' for weight in weights)}")
            search.improved(problem, judge, goal, same, GENERATIONS)
    designs, objectives = feasible(judge)
    kept = nondominated(objectives)
    return thinned(designs[kept], objectives[kept])


def compromise(objectives: Array) -> int:
    """The design of a front nearest to the best of every objective, each in units of its extent on the front."""
    goal = chebyshev(np.ones(objectives.shape[1]), *_corners(objectives))
    return int(np.argmin(goal(objectives)))


def feasible(judge: Judge) -> tuple[Array, Array]:
    """Designs judged so far that violate nothing, without the given one, and their objectives."""
    designs, worth = judge.archive()
    good = (worth.violation == 0) & ~np.isnan(designs).any(axis=1)
    return designs[good], worth.objectives[good]


def nondominated(objectives: Array) -> Array:
    """Places of rows ``(rows, objectives)`` that no other row equals or betters in everything, first of equals."""
    order = np.lexsort(objectives.T[::-1])
    kept: list[int] = []
    for k in order:
        if not any(np.all(objectives[j] <= objectives[k]) for j in kept):
            kept.append(int(k))
    return np.array(kept, dtype=int)


def thinned(designs: Array, objectives: Array) -> Array:
    """Choose at most MOST designs of a front: the extremes and those farthest apart, by the first objective."""
    low, high = _corners(objectives)
    unit = (objectives - low) / (high - low)
    kept = [int(k) for k in dict.fromkeys(np.argmin(unit, axis=0))]
    away = np.min(np.abs(unit[:, None] - unit[kept]).max(axis=2), axis=1)
    while len(kept) < min(MOST, len(designs)) and away.max() > 1e-3:
        kept.append(int(np.argmax(away)))
        away = np.minimum(away, np.abs(unit - unit[kept[-1]]).max(axis=1))
    chosen = designs[sorted(kept, key=lambda k: tuple(objectives[k]))]
    return np.asarray(chosen)


def chebyshev(weights: Array, low: Array, high: Array) -> Goal:
    """The goal max_k w_k (f_k - low_k)/(high_k - low_k), and a thousandth of the sum."""

    def goal(objectives: Array) -> Array:
        unit = weights * (objectives - low) / (high - low)
        return np.asarray(unit.max(axis=1) + 1e-3 * unit.sum(axis=1))

    return goal


def _corners(objectives: Array) -> tuple[Array, Array]:
    low, high = objectives.min(axis=0), objectives.max(axis=0)
    return low, np.where(high > low, high, low + 1.0)


def _directions(count: int) -> Iterator[Array]:
    """Weights that add up to 1: between two objectives evenly, of more all pairs and the middle."""
    for i in range(count):
        for j in range(i):
            for part in np.linspace(0.0, 1.0, COMPROMISES + 2)[1:-1]:
                weights = np.full(count, 1e-3)
                weights[i], weights[j] = part, 1 - part
                yield weights
    if count > 2:
        yield np.full(count, 1 / count)


def _of_one_choice(problem: DesignProblem, designs: Array) -> Array:
    """Return the designs with the same choices as the first one."""
    fixed = ~problem.continuous
    return np.asarray(designs[np.all(designs[:, fixed] == designs[0, fixed], axis=1)])
