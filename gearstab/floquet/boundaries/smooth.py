"""Boundaries of systems whose mesh stiffness is smooth somewhere: the same search on Magnus steps, block by block.

What the meshes do not couple (:mod:`~gearstab.floquet.boundaries.parts`) is told apart at a few times in a period; each
block is then cut into as many steps as its own coordinates ask for, and searched by itself. A block whose stiffness
does not vary needs none.

The search asks for three things: monodromy matrices, which must be as right as the edges are to be; integers that
count rotations, which any nearby path of matrices gives; and speeds, of which a few digits do. So a pattern of many
segments gives the matrices and one of few the rest (:class:`~gearstab.floquet.boundaries.counting.points.Resolved`).

A collision of multipliers is passed at 2 pi k, k >= 1, in the sum of two phases that grow with the period: an error
of the multipliers moves an edge by at most 1/pi of it, relatively. Whether the number of steps was enough is found out
at the edges themselves: with half of the steps each must be where it was but for so many times the tolerance as the
order of the scheme allows. If not, the steps are doubled: without damping the edges concerned are followed to where
they are then, with damping, whose proofs need the same accuracy, all is done again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from gearstab.floquet.boundaries.counting.krein import stable_at
from gearstab.floquet.boundaries.counting.points import Resolved, exact
from gearstab.floquet.boundaries.damped.search import Limits, SearchResult
from gearstab.floquet.boundaries.parts import Intervals, Part, separated
from gearstab.floquet.boundaries.undamped import Search
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import ROUNDING, Chain, chain
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.smooth import periods, within
from gearstab.floquet.smooth.compare import difference, scan
from gearstab.floquet.smooth.control import SAFETY, Ladder, first
from gearstab.floquet.smooth.steps import CF4_2, CF6_5, Division
from gearstab.propagation.magnus import StepControl, remainder
from gearstab.system import Array, GearSystem

PILOTS = 9
"""Mesh frequencies at which the number of steps is chosen."""
ROUGH = 1e-3
"""Tolerance of the multipliers for integers and speeds."""
ATTEMPTS = 3
"""Doublings of the steps after the first choice."""
WIDENINGS = 12
"""Powers of four of the tolerance up to which an edge is looked for with half of the steps."""
SHARE = SAFETY * remainder(CF6_5.order)
"""Error of an edge over its distance from where half of the steps have it, with some safety."""
SURE = 0.1
"""Part of the width floor: steps that have all edges to that find all regions, and finer ones only follow edges."""

Result = TypeVar("Result")
Verdict = Callable[[Pattern], Callable[[Array, Array], Array]]
"""For a pattern: which points (row, cycle) are stable."""


def parts(system: GearSystem, reduction: bool) -> Iterator[tuple[Part, Division | None]]:
    """The blocks of all rows, each with its period still to be cut into steps; with None where its pattern is exact.

    A block's own pattern is the one by which blocks are told apart: of few steps, and no more than a place for rows,
    units and modes. It is exact where the stiffness does not vary, or only by jumps.
    """
    for pattern, division in periods(system):
        for part in separated(pattern, reduction):
            yield part, None if division is None or part.pattern.constant else within(division, part.pattern)


def searched(part: Part, division: Division, limits: Limits) -> tuple[Part, Search | tuple[Chain, SearchResult]]:
    """Rows of a part, all damped or none, on the steps by which their regions are named, and what is found out about
    them; the edges' brackets contain the error of the steps.
    """
    pattern, found = (_damped if division.elastic.damped.any() else _conservative)(division, limits)
    return replace(part, pattern=pattern), found


@dataclass(frozen=True)
class SteppedPeriod:
    """A division's periods cut into steps: of sixth order for the matrices, of fourth for the rest; each cut and solved
    once.

    pilots: ``(r, PILOTS)``, mesh frequencies in the division's units at which the number of steps is chosen.
    """

    limits: Limits
    pilots: Array
    fine: Ladder
    rough: Ladder

    @classmethod
    def of(cls, division: Division, limits: Limits) -> SteppedPeriod:
        """Nothing cut yet."""
        low, high = limits.cycles(division)
        pilots = 1 / np.geomspace(low, high, PILOTS, axis=1)
        return cls(limits, pilots, Ladder(division, CF6_5), Ladder(division, CF4_2))

    @cached_property
    def resolution(self) -> int:
        """Number of CF6:5 steps at which the error of the multipliers is about pi times the tolerance."""
        return int(first(self.fine, self.pilots, self._decay, np.pi * self.limits.tolerance)[0].max())

    def pattern(self, resolution: int) -> Pattern:
        """Many segments for the matrices, few for the rest."""
        few = self._few
        return Resolved(**{f.name: getattr(few, f.name) for f in fields(few)}, fine=self.fine.pattern(resolution))

    @cached_property
    def _few(self) -> Pattern:
        known = self.fine.pattern(self.resolution)
        right, rough = scan(known, self.pilots), 0
        few = self.rough.pattern(rough)
        while len(few.states) < len(known.states):
            if np.all(difference(right, scan(few, self.pilots), self._decay)[0] < ROUGH):
                break
            rough += 1
            few = self.rough.pattern(rough)
        return few

    @property
    def _decay(self) -> Array:
        """Uniform decay a period."""
        division = self.fine.division
        return np.asarray(division.elastic.shift[:, None] * (2 * np.pi * division.cycles / self.pilots))


def _conservative(division: Division, limits: Limits) -> tuple[Pattern, Search]:
    def stable(half: Pattern) -> Callable[[Array, Array], Array]:
        return partial(stable_at, half)

    steps, tolerance = SteppedPeriod.of(division, limits), limits.tolerance
    enough = max(tolerance, SURE * limits.floor)
    pattern, found, resolution, error = _controlled(steps, enough, limits.undamped, lambda s: s.intervals, stable)
    intervals = found.intervals
    for finer in range(resolution + 2, resolution + 2 * ATTEMPTS + 1, 2):
        if np.all(error <= tolerance):
            break
        intervals, error = followed(intervals, error, stable(steps.fine.pattern(finer)), tolerance)
    return pattern, replace(found, intervals=widened(intervals, error))


def _damped(division: Division, limits: Limits) -> tuple[Pattern, tuple[Chain, SearchResult]]:
    def stable(half: Pattern) -> Callable[[Array, Array], Array]:
        flow = chain(half)
        return lambda row, cycle: c_points.moduli(flow, row, cycle)[:, 0] <= 0

    def run(pattern: Pattern) -> SearchResult:
        # A proof allows for what the steps may be wrong by.
        flow = replace(chain(exact(pattern)), rounding=max(ROUNDING, limits.tolerance))
        return limits.damped(flow, pattern)

    steps = SteppedPeriod.of(division, limits)
    pattern, found, _, error = _controlled(steps, limits.tolerance, run, lambda f: f.intervals, stable)
    return pattern, (chain(pattern), replace(found, intervals=widened(found.intervals, error)))


def _controlled(
    steps: SteppedPeriod,
    enough: float,
    run: Callable[[Pattern], Result],
    intervals: Callable[[Result], Intervals],
    stable: Verdict,
) -> tuple[Pattern, Result, int, Array]:
    """The pattern, what ``run`` finds on it, its resolution, and the error of each interval's edges ``(I, 2)``,
    relative; as many steps as keep that below ``enough``.
    """
    first = np.array([steps.resolution])
    control = StepControl(first, first + 2 * ATTEMPTS, enough, CF6_5.order, doubling=2)
    for resolution, _ in control:
        pattern = steps.pattern(resolution)
        found = run(pattern)
        half = stable(steps.fine.pattern(resolution - 2))
        error = edge_errors(intervals(found), half, steps.limits.tolerance)
        control.judge(error.max(initial=0.0))
    return pattern, found, resolution, error


def edge_errors(intervals: Intervals, stable: Callable[[Array, Array], Array], tolerance: float) -> Array:
    """``(I, 2)``: SAFETY/(2^p - 1) times the distance within which half of the steps have each edge, relative; 0 for
    the ends of the range.
    """
    error = np.zeros((len(intervals), 2))
    error[~intervals.cut] = SHARE * _reach(intervals, ~intervals.cut, stable, tolerance)
    return error


def followed(
    intervals: Intervals, error: Array, stable: Callable[[Array, Array], Array], tolerance: float
) -> tuple[Intervals, Array]:
    """Edges whose error is above the tolerance, where twice the steps have them, and the errors ``(I, 2)`` then.

    An edge that is further off than its error is one where rounding tells stable from unstable: it stays where it was.
    """
    late = error > tolerance
    ends, row = np.stack([intervals.start, intervals.stop], axis=1), intervals.row[np.nonzero(late)[0]]
    edge, reach = ends[late], _reach(intervals, late, stable, tolerance)
    beyond, inside = _beside(intervals, late, np.where(np.isfinite(reach), reach, 0.0))
    for _ in range(2 * WIDENINGS):
        wide = np.flatnonzero(np.abs(beyond - inside) > tolerance * edge)
        if len(wide) == 0:
            break
        middle = 0.5 * (beyond + inside)[wide]
        outer = stable(row[wide], middle)
        beyond[wide[outer]], inside[wide[~outer]] = middle[outer], middle[~outer]
    place, width, error = 0.5 * (beyond + inside), intervals.error.copy(), error.copy()
    moved = np.abs(place / edge - 1)
    good = np.isfinite(reach) & (moved <= error[late])
    ends[late] = np.where(good, place, edge)
    width[late] = np.where(good, np.maximum(width[late], np.abs(beyond - inside)), width[late])
    error[late] = np.where(good, SHARE * (moved + tolerance), error[late])
    return replace(intervals, start=ends[:, 0], stop=ends[:, 1], error=width), error


def _reach(intervals: Intervals, chosen: Array, stable: Callable[[Array, Array], Array], tolerance: float) -> Array:
    """Within what distance ``(E,)``, relative, other steps have the ``chosen`` (I, 2) edges; infinite if not near."""
    row = intervals.row[np.nonzero(chosen)[0]]
    distance = np.full(len(row), np.inf)
    for power in range(WIDENINGS):
        left = np.flatnonzero(np.isinf(distance))
        if len(left) == 0:
            break
        reach = tolerance * 4.0**power
        places = np.concatenate([place[left] for place in _beside(intervals, chosen, reach)])
        both = stable(np.concatenate([row[left]] * 2), places).reshape(2, -1)
        distance[left[both[0] & ~both[1]]] = reach
    return distance


def _beside(intervals: Intervals, chosen: Array, distance: float | Array) -> tuple[Array, Array]:
    """Cycles ``(E,)`` outside of the chosen edges and inside."""
    index, side = np.nonzero(chosen)
    ends = np.stack([intervals.start, intervals.stop], axis=1)
    edge, outwards = ends[index, side], 2.0 * side - 1
    # The window stays on its side of the middle, where the other edge is farther.
    room = 0.4 * np.ptp(ends, axis=1)[index] / edge
    return edge * (1 + outwards * distance), edge * (1 - outwards * np.minimum(distance, room))


def widened(intervals: Intervals, error: Array) -> Intervals:
    """With the errors added to the brackets' halves."""
    ends = np.stack([intervals.start, intervals.stop], axis=1)
    return replace(intervals, error=intervals.error + 2 * error * ends)
