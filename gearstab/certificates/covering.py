"""Certificates of all rows of a system over a range of mesh frequencies, whose edges are known."""

from __future__ import annotations

import numpy as np

from gearstab.certificates.equations import flow
from gearstab.certificates.making import Maker
from gearstab.certificates.segments import segments
from gearstab.certificates.verifier import Array, Certificate, Flow, proves
from gearstab.system import GearSystem

LEFT = 4e-4
"""Part of the range, in logarithms, that may be left around all edges together."""
LEAST = 1e-9
"""The least width, relative to Omega, that is given up at an edge."""
MOST = 1e-4
"""The largest, also where no edges share LEFT: shorter pieces are tried before a part is left."""
NARROW = 0.05
"""Part of an interval that is given up at each of its ends, at most."""


def states(system: GearSystem) -> int:
    """Return m, how many states the first row has."""
    return flow(segments(system)[0]).generators[0].nrows()


def certificates(system: GearSystem, start: float, stop: float, edges: list[Array]) -> list[list[Certificate]]:
    """Return the pieces of every row, ascending; ``edges``: of each row, ascending and within (start, stop)."""
    return [_of_row(flow(own), np.array([start, *at, stop])) for own, at in zip(segments(system), edges, strict=True)]


def verdicts(system: GearSystem, omega: Array) -> Array:
    """Return what is proved of points ``(rows, P)``: 1 stable, 0 unstable, -1 neither."""
    found = np.full(omega.shape, -1, dtype=np.int8)
    for row, own in enumerate(segments(system)):
        known = flow(own)
        maker = Maker(known, 0.0)
        for k, at in enumerate(omega[row].tolist()):
            piece = maker.proposal(at, at)
            if piece is not None and proves(known, piece):
                found[row, k] = piece.outside == 0
    return found


def _of_row(known: Flow, ends: Array) -> list[Certificate]:
    widths = np.diff(np.log(ends))
    floor = LEFT * widths.sum() / (2 * len(widths))
    found: list[Certificate] = []
    for k, width in enumerate(widths):
        maker = Maker(known, max(LEAST, min(floor, MOST, NARROW * width)))
        found += maker.cover(ends[k], ends[k + 1], (k > 0, k < len(widths) - 1))
    return found
