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


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Search:
    """Unstable intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``, see
    :func:`gearstab.floquet.boundaries.undamped.search.search`.
    """
    if not in_use() or tolerance < FINEST:
        return reference.search(pattern, first, last, tolerance, floor)
    kernel.record("c")
    return compiled.search(pattern, first, last, tolerance, floor)
