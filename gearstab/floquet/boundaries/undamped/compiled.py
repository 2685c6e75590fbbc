"""The search of :mod:`~gearstab.floquet.boundaries.undamped.search` in the compiled kernel: the same intervals in a
fraction of the time.

The same counts of collisions decide, from the same points of view; what differs is how they are come by. Krein signs
and speeds of multipliers are told by a second monodromy matrix a tiny step in the period later instead of by
eigenvectors, and brackets are empty, or hold one edge, by counts at each angle of the circle (brackets.c).
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.boundaries.counting.krein import opened
from gearstab.floquet.boundaries.counting.pairs import COMBINATION, SELF
from gearstab.floquet.boundaries.counting.points import exact
from gearstab.floquet.boundaries.intervals import Intervals
from gearstab.floquet.boundaries.undamped.search import Search
from gearstab.floquet.kernel import c_boundaries
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

DENSITY = 0.25
"""Points of the scan per collision of multipliers; up to 1 small systems take the same time, and 59 coordinates a fifth
more with 0.5."""

BLURRED = 1.05
"""Bracket of an edge over the tolerance, beyond which it is that of rounding errors."""
SHARP = 0.2
"""The bracket of an edge from inside, over the tolerance."""
NARROW = 3e-3
"""Width over the mean distance of collisions up to which the edges of a tongue follow from inside."""
INSIDE = np.array([-0.9, -0.3, 0.3, 0.9])
"""Places inside a tongue where its pair of multipliers is looked at, from edge -1 to edge 1."""
STEPS = 4
"""Steps of Newton's method from where the edges seem to be."""
TRUSTED = 0.25
"""Half-widths by which rounding may have moved an edge, at most."""
FARTHEST = 4
"""The same over its bracket: products of hundreds of steps round more than the estimate of it says."""


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, 1/Omega in the pattern's
    units, as of :func:`gearstab.floquet.boundaries.undamped.search.search`.
    """
    if len(pattern.states) == 1 and np.all(pattern.squared_frequency > 0):
        # Constant stiffness: multipliers only pass through each other.
        return Search(Intervals.of([]), *np.zeros((2, len(first)), dtype=np.int64))
    edges, reach = c_boundaries.edges(exact(pattern), pattern, first, last, tolerance, floor, DENSITY)
    ends = _ends(edges, reach, first, last)
    begin = np.flatnonzero((ends["enters"][:-1] == 1) & (ends["enters"][1:] == 0) & (np.diff(ends["row"]) == 0))
    begin = begin[ends["cycle"][begin + 1] - ends["cycle"][begin] > floor * ends["cycle"][begin]]
    start, stop = ends[begin], ends[begin + 1]
    # Counts at an end of the range where growth is strong are not known: none are reported there.
    meetings = np.maximum(stop["passed"] - start["passed"], 0)
    extra = _sharpen(pattern, start, stop, meetings, tolerance)
    contacts = reach["passed"][:, 1] - reach["passed"][:, 0]
    np.subtract.at(contacts, start["row"], meetings)
    error, cut = (np.stack([start[name], stop[name]], axis=1) for name in ("error", "cut"))
    intervals = Intervals(start["row"], start["cycle"], stop["cycle"], start["passed"], meetings, error, cut == 1)
    # A collision beside +-1 is one of the complex conjugates too.
    return Search(intervals, np.maximum(contacts, 0) @ [1, 1, 2], reach["evaluations"] + extra)


def _sharpen(pattern: Pattern, start: Array, stop: Array, meetings: Array, tolerance: float) -> Array:
    """Replace edges that rounding blurs, of narrow tongues at +-1, and return the evaluations of each row.

    Inside such a tongue delta^2 - 4 |b|^2 of its pair (:mod:`~gearstab.floquet.boundaries.counting.pairs`) comes
    without cancellation. It is analytic across the edges, where it vanishes, and so nearly a parabola that a cubic
    through four points is exact.
    """
    blurred = [(end["cut"] == 0) & (end["error"] > BLURRED * tolerance * end["cycle"]) for end in (start, stop)]
    width = stop["cycle"] - start["cycle"]
    distance = start["cycle"] / (1 + start["passed"].sum(axis=1))
    single = (meetings.sum(axis=1) == 1) & (width < NARROW * distance)
    chosen = np.flatnonzero((blurred[0] | blurred[1]) & single)
    row, count = start["row"][chosen], len(INSIDE)
    if len(chosen) == 0:
        return np.zeros(len(pattern.rows), dtype=np.int64)
    middle, half = 0.5 * (start["cycle"] + stop["cycle"])[chosen], 0.5 * width[chosen]
    parts = opened(pattern, np.tile(row, count), (middle + half * INSIDE[:, None]).ravel())
    kind, each = np.where(meetings[chosen, 2] == 1, COMBINATION, SELF), np.arange(len(chosen))
    delta, b = (values.reshape(2, count, -1)[kind, :, each] for values in parts)
    cubic = np.linalg.solve(np.vander(INSIDE), ((delta - 2 * b) * (delta + 2 * b)).T)
    for end, which, side in ((start, blurred[0][chosen], -1.0), (stop, blurred[1][chosen], 1.0)):
        u = np.full(len(chosen), side)
        for _ in range(STEPS):
            value, slope = np.zeros(len(u)), np.zeros(len(u))
            for c in cubic:
                value, slope = value * u + c, slope * u + value
            u = u - value / slope
        # Not where a point is stable and u is NaN, nor where a third multiplier bends the parabola.
        moved = half * np.abs(u - side)
        good = which & (moved < TRUSTED * half) & (moved <= FARTHEST * end["error"][chosen])
        end["cycle"][chosen[good]] = (middle + half * u)[good]
        end["error"][chosen[good]] = SHARP * tolerance * (middle + half * u)[good]
    return count * np.bincount(row, minlength=len(pattern.rows))


def _ends(edges: Array, reach: Array, first: Array, last: Array) -> Array:
    """The edges and, where a range begins or ends in a region, its ends, by row and place."""
    fields = [*c_boundaries.EDGE.descr, ("cut", "i8")]
    ends = np.zeros(len(edges), dtype=fields)
    for name in c_boundaries.EDGE.names or ():
        ends[name] = edges[name]
    row, side = np.nonzero(reach["stable"] == 0)
    cut = np.zeros(len(row), dtype=fields)
    cut["row"], cut["cycle"] = row, np.where(side == 0, first[row], last[row])
    cut["enters"], cut["passed"], cut["cut"] = 1 - side, reach["passed"][row, side], 1
    return np.insert(ends, np.searchsorted(ends["row"], row + side), cut)
