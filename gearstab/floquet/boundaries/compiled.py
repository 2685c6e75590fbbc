"""The search of :mod:`~gearstab.floquet.boundaries.search` in the compiled kernel: the same intervals, many times faster.

The same counts of collisions decide, from the same points of view; what differs is how they are come by. Krein signs
and speeds of multipliers are told by a second monodromy matrix a tiny step in the period later instead of by
eigenvectors, and brackets are empty, or hold one edge, by counts at each angle of the circle (brackets.c).
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.boundaries.points import exact
from gearstab.floquet.boundaries.search import Interval, Search
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

DENSITY = 1.0
"""Points of the scan a collision of multipliers."""


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, 1/Omega in the pattern's
    units, as of :func:`gearstab.floquet.boundaries.search.search`.
    """
    if len(pattern.states) == 1 and np.all(pattern.squared_frequency > 0):
        # Constant stiffness: multipliers only pass through each other.
        return Search([], *np.zeros((2, len(first)), dtype=np.int64))
    edges, reach = c_kernel.edges(exact(pattern), pattern, first, last, tolerance, floor, DENSITY)
    intervals: list[Interval] = []
    begins = np.searchsorted(edges["row"], np.arange(len(first) + 1))
    contacts = reach["passed"][:, 1] - reach["passed"][:, 0]
    for row in range(len(first)):
        own = _intervals(edges[begins[row] : begins[row + 1]], reach[row], row, float(first[row]), float(last[row]))
        kept = [i for i in own if i.stop - i.start > floor * i.start]
        intervals += kept
        contacts[row] -= np.sum([i.meetings for i in kept], axis=0, dtype=np.int64)
    # A collision beside +-1 is one of the complex conjugates too.
    return Search(intervals, np.maximum(contacts, 0) @ [1, 1, 2], reach["evaluations"].copy())


def _intervals(edges: Array, reach: Array, row: int, first: float, last: float) -> list[Interval]:
    """Pair entrances with exits; a region that reaches an end of the range is cut there."""
    cycle, error, enters = edges["cycle"].tolist(), edges["error"].tolist(), edges["enters"].tolist()
    passed, ends = edges["passed"].tolist(), reach["passed"].tolist()
    result: list[Interval] = []
    start = None if reach["stable"][0] else (first, 0.0, ends[0], True)
    for k in range(len(edges)):
        here = cycle[k], error[k], passed[k], False
        if enters[k]:
            start = here
        elif start is not None:
            result.append(_interval(row, start, here))
            start = None
    if start is not None:
        result.append(_interval(row, start, (last, 0.0, ends[1], True)))
    return result


End = tuple[float, float, list[int], bool]


def _interval(row: int, start: End, stop: End) -> Interval:
    """From (cycle, error, collisions passed, whether the range ends there) of both ends."""
    # Counts at an end of the range where growth is strong are not known: none are reported there.
    meetings = [max(0, b - a) for a, b in zip(start[2], stop[2], strict=True)]
    passed = (start[2][0], start[2][1], start[2][2])
    return Interval(
        row,
        start[0],
        stop[0],
        passed,
        (meetings[0], meetings[1], meetings[2]),
        (start[1], stop[1]),
        (start[3], stop[3]),
    )
