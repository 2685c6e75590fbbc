"""All unstable intervals of a conservative pattern along the period: brackets that the compiled kernel refines.

A bracket lies between two neighbouring points of a row. Counts of collisions
(:mod:`~gearstab.floquet.boundaries.counting.krein`) decide what it holds: nothing, one edge, a narrow tongue or
contact, or more. Krein signs and speeds of multipliers come from a second monodromy matrix a tiny step in the period
later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.krein import about_to_meet, opened, stable_at
from gearstab.floquet.boundaries.counting.pairs import COMBINATION, SELF
from gearstab.floquet.boundaries.counting.points import exact
from gearstab.floquet.boundaries.parts import Intervals
from gearstab.floquet.kernel import c_boundaries
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

DENSITY = 0.25
"""Points of the scan per collision of multipliers; up to 1 small systems take the same time, and 59 coordinates a fifth
more with 0.5."""

BLURRED = 1.05
"""Bracket of an edge over the tolerance, beyond which it is that of rounding errors."""
ROUNDED = 2.0**-46
"""Relative error of where a verdict changes, 64 eps: phases of some ten turns are right to a few eps each."""
SHARP = 0.2
"""The bracket of an edge from inside, over the tolerance."""
NARROW = 3e-3
"""Width over the mean distance of collisions up to which the edges of a tongue follow from inside."""
BENT = 0.25
"""By how much the cubic may miss an edge, in half-widths times (width over distance)^2: 0.07 was seen of Mathieu's."""
INSIDE = np.array([-0.9, -0.3, 0.3, 0.9])
"""Places inside a tongue where its pair of multipliers is looked at, from edge -1 to edge 1."""
STEPS = 4
"""Steps of Newton's method from where the edges seem to be."""
TRUSTED = 0.25
"""Half-widths by which rounding may have moved an edge, at most."""
FARTHEST = 4
"""The same over its bracket: products of hundreds of steps round more than the estimate of it says."""


FINEST = 5e-12
"""Tolerances below ask for more than the kernel may leave of an edge."""
NARROWEST = 2.0**-20
"""Regions that the kernel searches itself: signs are told by a second matrix, a sixteenth of the floor and at most
2^-24 of the period later (window.h). Shorter steps lose to rounding what they shall tell."""
NEARER = 2.0**-28
"""How near to a collision that opens hardly any region the second look at it is, relative."""
NODES = np.array([-3.0, -2.0, 2.0, 3.0])
"""Where a collision that opens a narrower one is looked at, in units of NARROWEST, and then of its width or NEARER."""


@dataclass(frozen=True)
class Search:
    """intervals: by row and ascending cycle. contacts ``(r,)``: collisions that open no interval wider than the
    floor. evaluations ``(r,)``: monodromy matrices computed.
    """

    intervals: Intervals
    contacts: Array
    evaluations: Array


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, 1/Omega in the pattern's
    units.

    tolerance, floor: of an edge and of a region, relative to Omega.
    """
    if len(pattern.states) == 1 and np.all(pattern.squared_frequency > 0):
        # Constant stiffness: multipliers only pass through each other.
        return Search(Intervals.of([]), *np.zeros((2, len(first)), dtype=np.int64))
    widths = max(floor, NARROWEST), floor
    edges, reach = c_boundaries.edges(exact(pattern), pattern, first, last, tolerance, *widths, DENSITY)
    collision = edges["enters"] >= c_boundaries.BEFORE
    ends = _ends(edges[~collision], reach, first, last)
    begin = np.flatnonzero((ends["enters"][:-1] == 1) & (ends["enters"][1:] == 0) & (np.diff(ends["row"]) == 0))
    begin = begin[ends["cycle"][begin + 1] - ends["cycle"][begin] > floor * ends["cycle"][begin]]
    start, stop = ends[begin], ends[begin + 1]
    # Counts at an end of the range where growth is strong are not known: none are reported there.
    meetings = np.maximum(stop["passed"] - start["passed"], 0)
    extra = _sharpen(pattern, start, stop, meetings, tolerance)
    contacts = reach["passed"][:, 1] - reach["passed"][:, 0]
    np.subtract.at(contacts, start["row"], meetings)
    if tolerance < FINEST:
        extra = extra + _halved(pattern, start, tolerance) + _halved(pattern, stop, tolerance)
    error, cut = (np.stack([start[name], stop[name]], axis=1) for name in ("error", "cut"))
    intervals = Intervals(start["row"], start["cycle"], stop["cycle"], start["passed"], meetings, error, cut == 1)
    if collision.any():
        narrow, more = _narrow(pattern, edges[collision], tolerance, floor)
        np.subtract.at(contacts, narrow.row, narrow.meetings)
        intervals, extra = Intervals.joined([intervals, narrow]), extra + more
        intervals = intervals.chosen(np.lexsort((intervals.start, intervals.row)))
    # A collision beside +-1 is one of the complex conjugates too.
    return Search(intervals, np.maximum(contacts, 0) @ [1, 1, 2], reach["evaluations"] + extra)


def _narrow(pattern: Pattern, ends: Array, tolerance: float, floor: float) -> tuple[Intervals, Array]:
    """Regions narrower than NARROWEST but not than the floor, and the evaluations of each row.

    ends: points on both sides of collisions; where several fall together they are left out. Of a single one, delta and
    |b|^2 (:mod:`~gearstab.floquet.boundaries.counting.pairs`) are so smooth that cubics through four points beside it
    are exact, and its edges, delta = -+2 |b|, are well conditioned.
    """
    ends = ends[np.lexsort((ends["enters"], ends["cycle"], ends["row"]))]
    left, right = ends[ends["enters"] == c_boundaries.BEFORE], ends[ends["enters"] == c_boundaries.AFTER]
    single = (right["passed"] - left["passed"]).sum(axis=1) == 1
    left, right = left[single], right[single]
    meetings, row, middle = right["passed"] - left["passed"], left["row"], 0.5 * (left["cycle"] + right["cycle"])
    start, stop, place, reach = middle, middle, meetings.argmax(axis=1), NARROWEST * middle
    for width in (NARROWEST, NEARER):
        center, unit = 0.5 * (start + stop), np.maximum(stop - start, width * middle)
        at = center + unit * NODES[:, None]
        parts = about_to_meet(pattern, np.tile(row, len(NODES)), at.ravel(), np.tile(place, len(NODES)))
        delta, b = (part.reshape(at.shape) for part in parts)
        detuning, squared = np.linalg.solve(np.vander(NODES), np.stack([delta, b**2]))
        start, stop = (center + unit * _edge(detuning, squared, side) for side in (2.0, -2.0))
    # No further from where it was counted than it may be wide.
    kept = (np.abs(start - middle) < reach) & (np.abs(stop - middle) < reach) & (stop - start > floor * start)
    error = (SHARP * tolerance + 2 * ROUNDED) * np.stack([start, stop], axis=1)
    columns = row, start, stop, left["passed"], meetings, error, np.zeros((len(row), 2), dtype=bool)
    evaluations = 2 * len(NODES) * np.bincount(row, minlength=len(pattern.rows))
    return Intervals(*(column[kept] for column in columns)), evaluations


def _edge(detuning: Array, squared: Array, side: float) -> Array:
    """Where delta + side |b| = 0, of cubics ``(4, K)`` delta and |b|^2."""
    u = np.zeros(detuning.shape[1])
    for _ in range(STEPS):
        value = _polynomial(detuning, u) + side * np.sqrt(np.maximum(_polynomial(squared, u), 0.0))
        u = u - value / _derivative(detuning, u)
    return u


def _halved(pattern: Pattern, ends: Array, tolerance: float) -> Array:
    """Replace edges that are not known to the tolerance by halving their brackets, and return the evaluations of each
    row: eigenvectors tell a pair on the circle from one off it in the last digits.
    """
    chosen = np.flatnonzero((ends["cut"] == 0) & (ends["error"] > tolerance * ends["cycle"]))
    row, error = ends["row"][chosen], ends["error"][chosen]
    low, high = ends["cycle"][chosen] - error, ends["cycle"][chosen] + error
    rounds = int(np.ceil(np.log2(np.max((high - low) / (tolerance * low), initial=1.0))))
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        beyond = stable_at(pattern, row, middle) != (ends["enters"][chosen] == 1)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    ends["cycle"][chosen] = 0.5 * (low + high)
    ends["error"][chosen] = high - low + 2 * ROUNDED * high
    return rounds * np.bincount(row, minlength=len(pattern.rows))


def _polynomial(coefficients: Array, u: Array) -> Array:
    """Values at u ``(K,)`` of polynomials ``(degree + 1, K)``, the highest power first."""
    value = np.zeros(len(u))
    for c in coefficients:
        value = value * u + c
    return value


def _derivative(coefficients: Array, u: Array) -> Array:
    """Return the derivatives there."""
    return _polynomial(coefficients[:-1] * np.arange(len(coefficients) - 1, 0, -1)[:, None], u)


def _sharpen(pattern: Pattern, start: Array, stop: Array, meetings: Array, tolerance: float) -> Array:
    """Replace edges that rounding blurs, of narrow tongues at +-1, and return the evaluations of each row.

    Inside such a tongue delta^2 - 4 |b|^2 of its pair (:mod:`~gearstab.floquet.boundaries.counting.pairs`) comes
    without cancellation. It is analytic across the edges, where it vanishes, and so nearly a parabola that a cubic
    through four points is exact but for BENT.
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
    bent = BENT * half * (width / distance)[chosen] ** 2
    kind, each = np.where(meetings[chosen, 2] == 1, COMBINATION, SELF), np.arange(len(chosen))
    delta, b = (values.reshape(2, count, -1)[kind, :, each] for values in parts)
    cubic = np.linalg.solve(np.vander(INSIDE), ((delta - 2 * b) * (delta + 2 * b)).T)
    for end, which, side in ((start, blurred[0][chosen], -1.0), (stop, blurred[1][chosen], 1.0)):
        u = np.full(len(chosen), side)
        for _ in range(STEPS):
            u = u - _polynomial(cubic, u) / _derivative(cubic, u)
        # Not where a point is stable and u is NaN, nor where a third multiplier bends the parabola.
        moved = half * np.abs(u - side)
        error = SHARP * tolerance * (middle + half * u) + bent
        good = which & (moved < TRUSTED * half) & (moved <= FARTHEST * end["error"][chosen])
        good &= error < end["error"][chosen]
        end["cycle"][chosen[good]] = (middle + half * u)[good]
        end["error"][chosen[good]] = error[good]
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
