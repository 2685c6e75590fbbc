"""The search of :mod:`~gearstab.floquet.boundaries.search` in the compiled kernel: the same intervals in a fraction of
the time.

The same counts of collisions decide, from the same points of view; what differs is how they are come by. Krein signs
and speeds of multipliers are told by a second monodromy matrix a tiny step in the period later instead of by
eigenvectors, and brackets are empty, or hold one edge, by counts at each angle of the circle (brackets.c).
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.boundaries.points import exact
from gearstab.floquet.boundaries.search import Interval, Search
from gearstab.floquet.kernel import c_kernel
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
    ends = _ends(edges, reach, first, last)
    begin = np.flatnonzero((ends["enters"][:-1] == 1) & (ends["enters"][1:] == 0) & (np.diff(ends["row"]) == 0))
    begin = begin[ends["cycle"][begin + 1] - ends["cycle"][begin] > floor * ends["cycle"][begin]]
    start, stop = ends[begin], ends[begin + 1]
    # Counts at an end of the range where growth is strong are not known: none are reported there.
    meetings = np.maximum(stop["passed"] - start["passed"], 0)
    contacts = reach["passed"][:, 1] - reach["passed"][:, 0]
    np.subtract.at(contacts, start["row"], meetings)
    columns = (
        start["row"].tolist(),
        start["cycle"].tolist(),
        stop["cycle"].tolist(),
        map(tuple, start["passed"].tolist()),
        map(tuple, meetings.tolist()),
        zip(start["error"].tolist(), stop["error"].tolist(), strict=True),
        zip((start["cut"] == 1).tolist(), (stop["cut"] == 1).tolist(), strict=True),
    )
    intervals = list(map(Interval, *columns))
    # A collision beside +-1 is one of the complex conjugates too.
    return Search(intervals, np.maximum(contacts, 0) @ [1, 1, 2], reach["evaluations"].copy())


def _ends(edges: Array, reach: Array, first: Array, last: Array) -> Array:
    """The edges and, where a range begins or ends in a region, its ends, by row and place."""
    fields = [*c_kernel.EDGE.descr, ("cut", "i8")]
    parts = [np.zeros(len(edges), dtype=fields)]
    for name in c_kernel.EDGE.names or ():
        parts[0][name] = edges[name]
    for side, cycle in enumerate((first, last)):
        rows = np.flatnonzero(reach["stable"][:, side] == 0)
        cut = np.zeros(len(rows), dtype=fields)
        cut["row"], cut["cycle"], cut["passed"] = rows, cycle[rows], reach["passed"][rows, side]
        cut["enters"], cut["cut"] = 1 - side, 1
        parts.append(cut)
    ends = np.concatenate(parts)
    return ends[np.lexsort((ends["cycle"], ends["row"]))]
