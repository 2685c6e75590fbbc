"""The worth of designs: objectives, violated constraints, and one number that an optimiser can compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearstab.config.document import value_at
from gearstab.config.sections.design import Limit
from gearstab.design.problem import Batch, DesignProblem
from gearstab.design.quantities import EXACT, first_order_width, tongue_distance
from gearstab.grouping import Columns
from gearstab.system import Array

AT_ONCE = 256
"""Designs built together."""
IMPOSSIBLE, VIOLATED = 1e30, 1e15
"""Scores, finite and far beyond any value, of designs that cannot be built and of those that violate a constraint."""

Goal = Callable[[Array], Array]
"""From objectives ``(rows, objectives)`` to what is minimised ``(rows,)``."""


@dataclass(frozen=True)
class Worth(Columns):
    """Values of designs ``(rows,)``.

    objectives: ``(rows, objectives)``, NaN where a design cannot be built. violation: sum of the relative excesses over
    the limits, infinite where it cannot be built. distance: from the ranges to the nearest region where the first
    objective is 0, else 0.
    """

    objectives: Array
    violation: Array
    distance: Array

    def score(self, goal: Goal) -> Array:
        """Return the number that an optimiser minimises: feasible designs by their goal, ties at zero by their
        distance.
        """
        value = goal(np.where(np.isnan(self.objectives), 0.0, self.objectives)) - self.distance
        return np.where(self.violation > 0, penalty(self.violation), value)


def penalty(violation: Array) -> Array:
    """Return the scores of designs that violate a constraint by so much, or cannot be built where it is infinite."""
    return np.where(np.isinf(violation), IMPOSSIBLE, VIOLATED * (1 + np.minimum(violation, 1e6)))


class Judge:
    """Judges designs exactly, and remembers every one of them."""

    def __init__(self, problem: DesignProblem) -> None:
        self.problem = problem
        self.designs: list[Array] = []
        self.worths: list[Worth] = []

    def worth(self, designs: Array) -> Worth:
        """Judge designs ``(rows, variables)``."""
        found = Worth.joined([self._part(designs[k : k + AT_ONCE]) for k in range(0, len(designs), AT_ONCE)])
        self.designs.append(np.array(designs))
        self.worths.append(found)
        return found

    def archive(self) -> tuple[Array, Worth]:
        """Everything judged so far."""
        return np.concatenate(self.designs), Worth.joined(self.worths)

    def _part(self, designs: Array) -> Worth:
        rows, wanted = len(designs), self.problem.design.objectives
        objectives = np.full((rows, len(wanted)), np.nan)
        violation, distance = np.full(rows, np.inf), np.zeros(rows)
        for batch in self.problem.batches(designs):
            known: dict[str, Array] = {}
            values = np.stack([weighted(batch, weights, known) for weights in wanted], axis=1)
            objectives[batch.members] = values
            fault = excess(self.problem, batch, known)
            violation[batch.members] = np.where(np.isfinite(values).all(axis=1), fault, np.inf)
        still = np.flatnonzero((violation == 0) & (objectives[:, 0] == 0))
        for batch in self.problem.batches(designs[still]):
            distance[still[batch.members]] = tongue_distance(batch)
        return Worth(np.where(np.isfinite(objectives), objectives, np.nan), violation, distance)

    def screen(self, designs: Array) -> Array:
        """First-order scores of designs ``(rows,)``; constraints on quantities are left to the exact judgement."""
        found = np.full(len(designs), IMPOSSIBLE)
        for start in range(0, len(designs), AT_ONCE):
            for batch in self.problem.batches(designs[start : start + AT_ONCE]):
                fault = excess(self.problem, batch, None)
                found[start + batch.members] = np.where(fault > 0, penalty(fault), first_order_width(batch))
        return found


def weighted(batch: Batch, weights: Mapping[str, float], known: dict[str, Array]) -> Array:
    """The weighted sum of an objective; quantities computed once are found in ``known`` again."""
    total = np.zeros(batch.system.rows)
    for name, weight in weights.items():
        if name not in known:
            known[name] = EXACT[name](batch)
        total = total + weight * known[name]
    return total


def excess(problem: DesignProblem, batch: Batch, known: dict[str, Array] | None) -> Array:
    """Return how far designs exceed their limits: the sum of the relative excesses, infinite for what cannot exist.

    known: quantities by name, completed; None to leave out the limits on quantities.
    """
    total = _impossible(problem, batch)
    for limit in problem.design.limits:
        if not limit.paths and known is None:
            continue
        values = limited(batch, limit, {} if known is None else known)
        scale = np.where(np.abs(values) > 0, np.abs(values), 1.0)
        over = np.fmax(values - limit.high, limit.low - values) / scale
        total = total + np.where(np.isnan(values), np.inf, np.maximum(over, 0.0)).max(axis=0)
    return total


def limited(batch: Batch, limit: Limit, known: dict[str, Array]) -> Array:
    """``(numbers, rows)``, what a limit is on."""
    if not limit.paths:
        if limit.name not in known:
            known[limit.name] = EXACT[limit.name](batch)
        return known[limit.name][None]
    return np.stack([_number(batch, path) for path in limit.paths])


def _number(batch: Batch, path: tuple[str | int, ...]) -> Array:
    """A number of the system; what a mesh is not given comes from its teeth."""
    value: Any = value_at(batch.p, path)
    rows = batch.system.rows
    if value is None and path[0] == "meshes" and isinstance(path[1], int):
        mesh = batch.system.meshes[path[1]]
        value = getattr(mesh.waveform, "contact_ratio", None) if path[2] == "contact_ratio" else None
        value = getattr(mesh, str(path[2]), None) if path[2] in ("mean_stiffness", "epsilon") else value
    if value is None:
        return np.full(rows, np.nan)
    return np.broadcast_to(np.asarray(value, dtype=float), (rows,))


def _impossible(problem: DesignProblem, batch: Batch) -> Array:
    """Infinite for meshes that are soft to nothing and for teeth with faults that the given design has not."""
    fault = np.zeros(batch.system.rows)
    if not batch.p.allow_negative_stiffness:
        for mesh in batch.system.meshes:
            soft = np.broadcast_to(np.asarray(mesh.lowest_stiffness) <= 0, fault.shape)
            fault = np.where(soft, np.inf, fault)
    if batch.p["kind"] == "gearbox":
        from gearstab.systems.gearbox.feasibility import notice_flags

        flags = notice_flags(batch.p).reshape(-1, len(batch.system.whole_meshes))
        allowed = notice_flags(problem.config.system).reshape(len(batch.system.whole_meshes))
        fault = np.where(np.any(np.broadcast_to(flags & ~allowed, (len(fault), len(allowed))), axis=1), np.inf, fault)
    return fault
