"""The search for the best design, or for those of which none is better than another in all of several objectives.

What takes one of a few values is enumerated. Continuous variables are searched by differential evolution (Storn & Price
1997, as in SciPy): first on the widths of first-order theory, which cost next to nothing, then, from the best places
found, on exact boundaries; a simplex search (Nelder & Mead 1965) goes to the bottom. None of them needs derivatives:
widths are sums of moduli, and the best designs lie on the kinks where one of them is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from math import prod

import numpy as np

from gearstab.config import ConfigError
from gearstab.design.judge import VIOLATED, Goal, Judge
from gearstab.design.problem import DesignProblem
from gearstab.design.quantities import screened
from gearstab.system import Array

MOST_COMBINATIONS = 20_000
"""Most combinations of choices."""
SEED = 1
FEWEST, MOST = 24, 80
"""Designs of a generation; twelve a variable between these."""
CHEAP_GENERATIONS, GENERATIONS = 80, 40
SAMPLES = 32
"""Designs at which a combination of choices is looked at first."""
LOOKED_AT, SEARCHED = 12, 4
"""Combinations that first-order theory, and the exact search, go through."""
APART = 0.05
"""Least distance, as part of the bounds, of designs from which a search begins."""
STEPS = (0.03, 0.003)
"""First steps of the simplex searches, of the bounds."""
EQUAL = 1e-7
"""Relative difference of two scores below which two designs are equally good: edges are right to 1e-9."""
AT_A_BOUND = 1e-3
"""Part of the bounds: a design nearer than this is tried on the bound itself."""
EVALUATIONS = 120
"""Evaluations of a simplex search per variable."""
DEAR = {"samples": 4, "searched": 2, "size": 8, "generations": 6, "evaluations": 15}
"""The same numbers, much smaller, where judging a design takes long (:attr:`DesignProblem.dear`)."""

Say = Callable[[str], None]


def first(objectives: Array) -> Array:
    """The goal with one objective."""
    return objectives[:, 0]


def combinations(problem: DesignProblem) -> Array:
    """``(C, variables)``, every combination of choices; 0 for continuous variables. Raises ConfigError for too many."""
    sizes = [1 if v.continuous else v.axis.size for v in problem.variables]
    if prod(sizes) > MOST_COMBINATIONS:
        message = f"have {prod(sizes):,} combinations of choices, more than {MOST_COMBINATIONS:,}"
        raise ConfigError([problem.config.problem(("design", "variables"), "too_large", message, "give fewer choices")])
    return np.array(list(product(*(range(size) for size in sizes))), dtype=float).reshape(-1, len(sizes))


def best(problem: DesignProblem, judge: Judge, goal: Goal = first, say: Say = lambda text: None) -> Array:
    """Return the best design found ``(variables,)``."""
    choices = combinations(problem)
    if not problem.continuous.any():
        say(f"{len(choices):,} combinations of choices")
        return np.asarray(choices[ranking(problem, choices, judge.worth(choices).score(goal))[0]])
    cheap = not problem.whirling and all(screened(tuple(weights)) for weights in problem.design.objectives)
    starts = list(_starts(problem, judge, choices, cheap, say))
    found = [searched(problem, judge, goal, start, say) for start in starts]
    own = _as_given(problem)
    found += [own] if own is not None else []
    designs = np.array(found)
    return np.asarray(designs[int(np.argmin(judge.worth(designs).score(goal)))])


def ranking(problem: DesignProblem, designs: Array, scores: Array, others: Array | None = None) -> Array:
    """Order designs by their scores; of equally good ones the one comes first that changes the given design least.

    others: ``(rows, K)``, scores that decide between equals before that.
    """
    later = np.empty((len(scores), 0)) if others is None else others
    return np.lexsort((changed(problem, designs), *later.T[::-1], tied(scores)))


def tied(scores: Array) -> Array:
    """Number groups of scores from the best one on, those that differ by no more than errors of edges in one."""
    order = np.argsort(scores, kind="stable")
    ascending = scores[order]
    group = np.empty(len(scores), dtype=int)
    group[order] = np.cumsum(np.diff(ascending, prepend=ascending[:1]) > EQUAL * np.abs(ascending))
    return group


def changed(problem: DesignProblem, designs: Array) -> Array:
    """``(rows,)``, how far choices are from those of the given design.

    The sum over variables of the distance of numbers as part of their extent; 1 for another row of a table or word.
    """
    total = np.zeros(len(designs))
    for variable, given, places in zip(problem.variables, problem.given_places, designs.T, strict=True):
        if variable.continuous:
            continue
        values = np.array([problem.number(variable, float(place)) for place in range(variable.axis.size)])
        own = problem.number(variable, np.nan)
        if variable.form == "choices" or np.isnan(own) or np.isnan(values).any():
            total += places != given
        else:
            total += np.abs(values[places.astype(int)] - own) / (np.ptp(values) or 1.0)
    return total


def _as_given(problem: DesignProblem) -> Array | None:
    """The given design by the values of its variables; None where it is not within bounds and choices."""
    places = problem.given_places
    low, high = problem.bounds
    return places if np.all((places >= low) & (places <= high)) else None


def _starts(problem: DesignProblem, judge: Judge, choices: Array, cheap: bool, say: Say) -> Iterator[Array]:
    """Designs ``(K, variables)`` of one combination of choices each, from which exact searches begin."""
    score = judge.screen if cheap else lambda designs: judge.worth(designs).score(first)
    count = DEAR["samples"] if problem.dear and not cheap else SAMPLES
    samples = [_filled(problem, row, _sampled(problem, count)) for row in choices]
    if len(choices) > 1:
        say(f"{len(choices):,} combinations of choices at {count} places each")
        least = [float(np.min(score(part))) for part in samples]
        order = np.argsort(least, kind="stable")[:LOOKED_AT]
        samples = [samples[k] for k in order]
        choices = choices[order]
    if not cheap:
        yield from samples[: DEAR["searched"] if problem.dear else SEARCHED]
        return
    ranked = []
    for row in choices:
        say("first-order theory")
        places, scores = _evolved(problem, row, judge.screen, CHEAP_GENERATIONS, None)
        chosen = _spread(problem, places, scores)
        ranked.append((float(scores.min()), chosen))
    for _, chosen in sorted(ranked, key=lambda item: item[0])[:SEARCHED]:
        yield chosen


def _size(problem: DesignProblem) -> int:
    return DEAR["size"] if problem.dear else int(np.clip(12 * problem.continuous.sum(), FEWEST, MOST))


def _sampled(problem: DesignProblem, count: int) -> Array:
    """Points of the unit cube, ``(count, continuous variables)``; scrambled, with a fixed seed."""
    from scipy.stats import qmc

    sampler = qmc.LatinHypercube(int(problem.continuous.sum()), seed=SEED)
    return np.asarray(sampler.random(count))


def _filled(problem: DesignProblem, row: Array, unit: Array) -> Array:
    """Designs of a combination of choices, with continuous variables at points of the unit cube."""
    low, high = problem.bounds[:, problem.continuous]
    designs = np.tile(row, (len(unit), 1))
    designs[:, problem.continuous] = low + (high - low) * np.clip(unit, 0.0, 1.0)
    return designs


def _unit(problem: DesignProblem, designs: Array) -> Array:
    """The reverse."""
    low, high = problem.bounds[:, problem.continuous]
    return np.asarray((designs[:, problem.continuous] - low) / (high - low))


def _evolved(
    problem: DesignProblem, row: Array, score: Callable[[Array], Array], generations: int, begin: Array | None
) -> tuple[Array, Array]:
    """Everything that a differential evolution looks at, and its scores. begin: designs of the first generation."""
    from scipy.optimize import differential_evolution

    size, places, scores = _size(problem), [], []

    def function(x: Array) -> Array:
        designs = _filled(problem, row, x.reshape(len(x), -1).T)
        places.append(designs)
        scores.append(score(designs))
        return scores[-1] if x.ndim > 1 else scores[-1][0]

    population = _sampled(problem, size)
    if begin is not None:
        own = _unit(problem, begin)[: size // 2]
        population[: len(own)] = own
    differential_evolution(
        function, [(0.0, 1.0)] * population.shape[1], init=population, maxiter=generations, tol=1e-6, seed=SEED,
        polish=False, updating="deferred", vectorized=True,
    )  # fmt: skip
    return np.concatenate(places), np.concatenate(scores)


def _spread(problem: DesignProblem, designs: Array, scores: Array) -> Array:
    """The best of many designs that are apart from each other."""
    unit = _unit(problem, designs)
    chosen: list[int] = []
    for k in np.argsort(scores, kind="stable"):
        if all(np.abs(unit[k] - unit[j]).max() > APART for j in chosen):
            chosen.append(int(k))
        if len(chosen) >= _size(problem) // 2 or scores[k] >= VIOLATED:
            break
    return designs[chosen]


def searched(problem: DesignProblem, judge: Judge, goal: Goal, start: Array, say: Say) -> Array:
    """Return the best design of one combination of choices by exact judgement, from designs to begin with."""
    say("exact judgement")
    row, generations = start[0], DEAR["generations"] if problem.dear else GENERATIONS
    places, scores = _evolved(problem, row, lambda x: judge.worth(x).score(goal), generations, start)
    return polished(problem, judge, goal, places[int(np.argmin(scores))])


def improved(problem: DesignProblem, judge: Judge, goal: Goal, start: Array, generations: int) -> None:
    """Have designs of one combination of choices evolve for some generations; the judge remembers what is found."""
    _evolved(problem, start[0], lambda x: judge.worth(x).score(goal), generations, start)


def polished(problem: DesignProblem, judge: Judge, goal: Goal, design: Array) -> Array:
    """The bottom of the valley in which a design lies."""
    from scipy.optimize import minimize

    def score(places: Array) -> Array:
        return judge.worth(_filled(problem, design, places)).score(goal)

    def bottom(x: Array, free: Array, step: float) -> Array:
        """The best place found with some coordinates as they are."""

        def function(part: Array) -> float:
            return float(score(_put(x, free, part)[None])[0])

        simplex = np.concatenate([x[None, free], x[free] + np.diag(np.where(x[free] > 0.5, -step, step))])
        most = (DEAR["evaluations"] if problem.dear else EVALUATIONS) * int(free.sum())
        options = {"initial_simplex": simplex, "xatol": 1e-7, "fatol": 1e-12, "maxfev": most}
        bounds = [(0.0, 1.0)] * int(free.sum())
        found = minimize(function, x[free], method="Nelder-Mead", bounds=bounds, options=options)
        return _put(x, free, np.clip(found.x, 0.0, 1.0))

    x = _unit(problem, design[None])[0]
    for step in STEPS:
        x = bottom(x, np.ones(len(x), dtype=bool), step)
    # A simplex comes close to a bound and does not lie on it; with a coordinate held there it goes on in the others.
    snapped = np.where(x < AT_A_BOUND, 0.0, np.where(x > 1 - AT_A_BOUND, 1.0, x))
    free = snapped == x
    if not free.all() and free.any():
        for step in STEPS:
            snapped = bottom(snapped, free, step)
    both = np.stack([snapped, x])
    return np.asarray(_filled(problem, design, both)[int(np.argmin(score(both)))])


def _put(x: Array, where: Array, values: Array) -> Array:
    """A copy with some entries replaced."""
    copy = x.copy()
    copy[where] = values
    return copy


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
        best(problem, judge, lambda objectives, k=k: objectives[:, k], say)  # type: ignore[misc]
    if problem.continuous.any():
        for weights in _directions(count):
            designs, objectives = feasible(judge)
            goal = chebyshev(weights, *_corners(objectives[nondominated(objectives)]))
            order = np.argsort(goal(objectives), kind="stable")[:BEGIN]
            same = _of_one_choice(problem, designs[order])
            say(f"compromise {', '.join(f'{weight:.2g}' for weight in weights)}")
            improved(problem, judge, goal, same, GENERATIONS)
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
