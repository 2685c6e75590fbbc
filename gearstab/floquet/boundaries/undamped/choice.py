"""The search for the unstable intervals of conservative patterns by the kernel in use."""

from __future__ import annotations

from gearstab.ckernel import in_use
from gearstab.floquet.boundaries.undamped import compiled
from gearstab.floquet.boundaries.undamped import search as reference
from gearstab.floquet.boundaries.undamped.search import Search
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

FINEST = 5e-12
"""Tolerances below are the reference's: eigenvectors tell a pair on the circle from one off it in the last digits."""

NARROWEST = 2.0**-20
"""Floors below are the reference's: the compiled search tells signs by a second matrix, a sixteenth of the floor and at
most 2^-24 of the period later (window.h). Shorter steps lose to rounding what they shall tell: floors of 1e-9 missed
regions of 3e-7, or made them three times too wide."""
EDGES = 8.0
"""Floor over the tolerance of an edge, at least, where the reference looks for regions so narrow."""


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, see
    :func:`gearstab.floquet.boundaries.undamped.search.search`.
    """
    if floor < NARROWEST:
        return reference.search(pattern, first, last, min(tolerance, floor / EDGES), floor)
    if not in_use() or tolerance < FINEST:
        return reference.search(pattern, first, last, tolerance, floor)
    kernel.record("c")
    return compiled.search(pattern, first, last, tolerance, floor)
