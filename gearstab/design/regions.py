"""Instability regions of designs: of many over an operating range, exact and to first order, and how edges move.

The latter is of two designs, near the range: where their regions lie, and how the edges go with each variable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from gearstab.config.model.fields import Section
from gearstab.design.problem import Batch, DesignProblem, Span
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS, union
from gearstab.grouping import numbered
from gearstab.modal import mean_modes
from gearstab.perturbation import Tongue, first_order
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step
from gearstab.system import Array, GearSystem
from gearstab.systems.base import System

TOLERANCE, FLOOR = 1e-9, 1e-6
"""Tolerance of edges and floor of a region's width, relative to the mesh frequency."""
REACH = 0.5
"""How far beyond a range regions are looked for, in lengths of the range; not below half of its lower end."""
AT_LEAST = 0.25
"""The same in its upper end, for narrow ranges."""
MOST_HARMONICS = 8


@dataclass(frozen=True)
class DisjointRegions:
    """Disjoint regions ``(rows, K)`` by ascending mesh frequency, NaN where a row has fewer."""

    lower: Array
    upper: Array

    def width(self, low: float, high: float) -> Array:
        """``(rows,)``, how much of low .. high is unstable."""
        inside = np.minimum(self.upper, high) - np.maximum(self.lower, low)
        return np.asarray(np.nansum(np.maximum(inside, 0.0), axis=1))

    def distance(self, low: float, high: float) -> Array:
        """``(rows,)``, from low .. high to the nearest region, 0 where one reaches into it; infinite without any."""
        away = np.maximum(np.maximum(self.lower - high, low - self.upper), 0.0)
        return np.asarray(np.min(np.where(np.isnan(away), np.inf, away), axis=1, initial=np.inf))


def exact(
    system: GearSystem, low: float, high: float, tolerance: float = TOLERANCE, floor: float = FLOOR
) -> DisjointRegions:
    """Find all regions of all rows between two mesh frequencies by root finding on the Floquet problem."""
    found = boundaries(system, low, high, tolerance, floor)
    return _by_row(found.row, found.lower, found.upper, found.rows)


def _by_row(row: Array, lower: Array, upper: Array, rows: int) -> DisjointRegions:
    count = np.bincount(row, minlength=rows)
    _, place = numbered(count)
    edges = np.full((2, rows, max(1, int(count.max(initial=0)))), np.nan)
    order = np.lexsort((lower, row))
    edges[:, row[order], place] = lower[order], upper[order]
    return DisjointRegions(edges[0], edges[1])


def reach(low: float, high: float) -> tuple[float, float]:
    """The range within which regions outside of an operating range are looked for."""
    away = max(REACH * (high - low), AT_LEAST * high)
    return max(low - away, 0.5 * low), high + away


def harmonics(system: GearSystem, low: float) -> int:
    """Up to which harmonic of the meshes the sum of two natural frequencies can be met above ``low``."""
    fastest = float(np.nanmax(mean_modes(system).natural_frequency))
    slowest = min(float(ratio) for ratio in system.frequency_ratios)
    return int(np.clip(ceil(2 * fastest / (low * slowest)), 1, MOST_HARMONICS))


def predicted(system: GearSystem, low: float, high: float) -> DisjointRegions:
    """Predict the regions of all rows by first-order theory; united where they overlap."""
    near = reach(low, high)
    found = first_order(system, harmonics(system, near[0]))
    rows = system.rows
    edges = np.asarray(found.boundary_frequency).reshape(len(found.index), 2, rows)
    lower, upper = edges[:, 0].T, edges[:, 1].T
    open_ = (upper - lower > FLOOR * upper) & (upper > near[0]) & (lower < near[1])
    keep = open_.any(axis=0)
    return united(np.where(open_, lower, np.nan)[:, keep], np.where(open_, upper, np.nan)[:, keep])


def united(lower: Array, upper: Array) -> DisjointRegions:
    """Unite intervals ``(rows, K)`` that overlap; NaN for none."""
    order = np.argsort(lower, axis=1)
    lower, upper = np.take_along_axis(lower, order, 1), np.take_along_axis(upper, order, 1)
    furthest = np.fmax.accumulate(upper, axis=1)
    before = np.concatenate([np.full((len(lower), 1), -np.inf), furthest[:, :-1]], axis=1)
    # What an earlier interval covers is taken off; one that lies in it wholly is none.
    start = np.maximum(lower, np.minimum(before, upper))
    empty = ~(upper > start)
    return DisjointRegions(np.where(empty, np.nan, start), np.where(empty, np.nan, upper))


TIGHT = 1e-12
"""Tolerance of edges that are differentiated."""
STEP = 1e-4
"""Step of differences, relative to the bounds of a variable: (8 [f(h) - f(-h)] - [f(2h) - f(-2h)])/12h is right to h^4
f'''''/30."""
WEIGHTS = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}

Key = tuple[Tongue, int]


@dataclass(frozen=True)
class DesignTongues:
    """Regions of ``(states,)`` designs, each region once.

    index: (tongue, occurrence). edges ``(tongue, 2, states)``, rad per unit time, NaN where a tongue is closed.
    distance ``(tongue, states)``: from the nearest range, 0 where it reaches into one; NaN where it is closed.
    sensitivity, first_order ``(tongue, 2, states, variables)``: d(edge)/d(variable), exact and by first-order theory.
    uncovered: of each state what is neither proved nor counted stable; None where nothing is.
    """

    index: tuple[Key, ...]
    edges: Array
    distance: Array
    sensitivity: Array
    first_order: Array
    uncovered: tuple[str | None, ...] = ()

    def limiting(self, state: int) -> int | None:
        """The widest region inside a range, else the nearest one outside; None where there is none in reach."""
        open_ = np.flatnonzero(np.isfinite(self.distance[:, state]))
        if len(open_) == 0:
            return None
        width = self.edges[:, 1, state] - self.edges[:, 0, state]
        return int(min(open_, key=lambda k: (self.distance[k, state], -width[k])))


def tongues(problem: DesignProblem, designs: Sequence[Array]) -> DesignTongues:
    """Find the regions of designs within reach of the operating ranges, and the sensitivities of their edges."""
    found = [_of(problem, design) for design in designs]
    index = union([own.index for own in found])
    place = {key: k for k, key in enumerate(index)}
    where = np.full((len(index), 2, len(designs)), np.nan)
    away = np.full((len(index), len(designs)), np.nan)
    tables = np.full((2, len(index), 2, len(designs), len(problem.variables)), np.nan)
    for state, own in enumerate(found):
        rows = [place[key] for key in own.index]
        where[rows, :, state] = own.edges
        away[rows, state] = distance(own.edges, own.spans)
        tables[0, rows, :, state], tables[1, rows, :, state] = own.sensitivity, own.first_order
    return DesignTongues(index, where, away, tables[0], tables[1], tuple(own.uncovered for own in found))


@dataclass(frozen=True)
class _Own:
    """Regions of one design: edges ``(tongue, 2)``, both sensitivities ``(tongue, 2, variables)``."""

    index: tuple[Key, ...]
    spans: tuple[Span, ...]
    edges: Array
    sensitivity: Array
    first_order: Array
    uncovered: str | None


def distance(edges: Array, spans: Sequence[Span]) -> Array:
    """``(tongue,)``, from edges ``(tongue, 2)`` to the nearest of the ranges."""
    away = [np.maximum(np.maximum(edges[:, 0] - span.high, span.low - edges[:, 1]), 0.0) for span in spans]
    return np.asarray(np.min(away, axis=0))


def _of(problem: DesignProblem, design: Array) -> _Own:
    rows, steps = _moved(problem, design)
    batches = list(problem.batches(rows))
    if len(batches) != 1 or len(batches[0].members) != len(rows):
        # A step leads to what cannot be built: the edges alone.
        batches, steps = list(problem.batches(rows[:1])), {}
    (batch,) = batches
    low, high = whole(batch.spans)
    found = boundaries(batch.system, low, high, TIGHT, FLOOR)
    edges = found.arranged()
    derivative = _differences(problem, edges.boundary_frequency, steps)
    own = np.flatnonzero((edges.flags[:, 0] & BOUNDARY_FLAGS["open"]) > 0)
    predicted = _predicted(problem, batch, steps, [edges.index[k] for k in own], low)
    cut = [(k, s) for k in own for s, name in enumerate(("cut_below", "cut_above"))
           if edges.flags[k, 0] & BOUNDARY_FLAGS[name]]  # fmt: skip
    for k, s in cut:
        derivative[k, s] = np.nan
    index = tuple(edges.index[k] for k in own)
    return _Own(index, batch.spans, edges.boundary_frequency[own, :, 0], derivative[own], predicted, found.uncovered())


def whole(spans: Sequence[Span]) -> tuple[float, float]:
    """Return the lowest and highest mesh frequency at which regions are of interest, over all ranges."""
    ends = [reach(span.low, span.high) for span in spans]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _moved(problem: DesignProblem, design: Array) -> tuple[Array, dict[tuple[int, int], int]]:
    """The design and its neighbours along each continuous variable, and the row of (variable, steps)."""
    places = np.where(np.isnan(design), problem.given_places, design)
    rows = [design]
    steps = {}
    for v in np.flatnonzero(problem.continuous & np.isfinite(places)):
        for k in WEIGHTS:
            moved = design.copy()
            moved[v] = places[v] + k * step(problem, int(v))
            steps[int(v), k] = len(rows)
            rows.append(moved)
    if np.isnan(design).any():
        # Rows are of one structure where the same variables are given.
        rows = [np.where(problem.continuous & np.isfinite(places) & np.isnan(row), places, row) for row in rows]
    return np.array(rows), steps


def step(problem: DesignProblem, variable: int) -> float:
    """h of the differences along a continuous variable."""
    low, high = problem.bounds[:, variable]
    return STEP * float(high - low)


def _differences(problem: DesignProblem, values: Array, steps: dict[tuple[int, int], int]) -> Array:
    """d/d(variable) ``(..., variables)`` of values ``(..., rows)``, NaN of variables that were not moved."""
    found = np.full((*values.shape[:-1], len(problem.variables)), np.nan)
    for v in {v for v, _ in steps}:
        total = sum(weight * values[..., steps[v, k]] for k, weight in WEIGHTS.items())
        found[..., v] = np.asarray(total) / step(problem, v)
    return found


def _predicted(
    problem: DesignProblem, batch: Batch, steps: dict[tuple[int, int], int], keys: Sequence[Key], low: float
) -> Array:
    """The same of the edges of first-order theory, of the tongues that it knows."""
    found = first_order(batch.system, harmonics(batch.system, low))
    edges = np.asarray(found.boundary_frequency).reshape(len(found.index), 2, batch.system.rows)
    derivative = _differences(problem, edges, steps)
    place = {(t.mode_p, t.mode_q, t.frequency_ratio): k for k, t in enumerate(found.index)}
    table = np.full((len(keys), 2, len(problem.variables)), np.nan)
    for row, (tongue, occurrence) in enumerate(keys):
        k = place.get((tongue.mode_p, tongue.mode_q, tongue.frequency_ratio))
        if k is not None and occurrence == 0:
            table[row] = derivative[k]
    return table


def single(problem: DesignProblem, design: Array) -> tuple[GearSystem, tuple[Span, ...], System]:
    """Build one design by itself: the system, its operating ranges and its section, of plain numbers."""
    p = _scalars(problem.systems(design[None]))
    return p.build(), problem.spans(p), p


def _scalars(value: Any) -> Any:
    """Parameters of one design as plain numbers."""
    if isinstance(value, Section):
        return value.model_copy(update={key: _scalars(item) for key, item in value})
    if isinstance(value, list | tuple):
        return [_scalars(item) for item in value]
    if isinstance(value, np.ndarray) and value.shape == (1,):
        return float(value[0])
    return value


MOST = 400
"""Choices that are gone through, the best ones."""


def phasing(problem: DesignProblem, designs: Array) -> dict[str, Any]:
    """Return of each choice z_s mod N, the regions within reach that its phases forbid, and those found in the ranges.

    What the existence rule forbids to first order is compared with the regions that root finding leaves: a forbidden
    region that is found all the same, by second order, is not listed as suppressed. Nothing for other systems.

    Source: Parker 2009, conclusion 2.
    """
    varied = {item.path for v in problem.variables for item in v.axis.assignments}
    if problem.config.kind != "planetary" or not any(path[0] in ("teeth", "planets", "phases") for path in varied):
        return {}
    steps, suppressed, driven = np.full(len(designs), -1), [""] * len(designs), [""] * len(designs)
    for k, design in enumerate(designs[:MOST]):
        system, spans, _ = single(problem, design)
        step = phase_step(system)
        low, high = whole(spans)
        found = boundaries(system, low, high, TOLERANCE, FLOOR)
        open_ = {t.label for members in found.members for t in members}
        inside = [
            members
            for members, lower, upper in zip(found.members, found.lower, found.upper, strict=True)
            if any(lower < span.high and upper > span.low for span in spans)
        ]
        driven[k] = ", ".join(dict.fromkeys(t.label for members in inside for t in members))
        if step is not None:
            steps[k] = step
            suppressed[k] = ", ".join(label for label in forbidden(system, step, low, high) if label not in open_)
    return {"phase_step": steps, "suppressed": suppressed, "driven": driven}


def forbidden(system: Any, step: int, low: float, high: float) -> list[str]:
    """Labels of the regions rooted between two mesh frequencies that the existence rule forbids, by frequency."""
    modes, order = natural_modes(system), system.symmetries[0].order
    types = deflection_types(system, modes)
    known = first_order(system, harmonics(system, low))
    found = []
    for tongue, center in zip(known.index, np.ravel(known.center_frequency), strict=True):
        pair = int(types[tongue.mode_p - 1]), int(types[tongue.mode_q - 1])
        if not low <= center <= high or min(pair) < 0:
            continue
        if not can_couple(order, step, tongue.harmonic, *pair):
            found.append((float(center), tongue.label))
    return [label for _, label in sorted(found)]
