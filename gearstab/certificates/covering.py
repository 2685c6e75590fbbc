"""Certificates of all rows of a system over a range of mesh frequencies, whose edges are known."""

from __future__ import annotations

from math import ceil, floor

import numpy as np
from flint import arb
from scipy.optimize import brentq

from gearstab.certificates.counting import Counter
from gearstab.certificates.equations import flow
from gearstab.certificates.lyapunov import decays
from gearstab.certificates.making import Maker
from gearstab.certificates.proof import counter
from gearstab.certificates.segments import segments
from gearstab.certificates.shares import gaps
from gearstab.certificates.verifier import CARRIED, COUNTED, Array, Certificate, Flow, proves
from gearstab.system import GearSystem

LEFT = 4e-4
"""Part of the range, in logarithms, that may be left around all edges together."""
LEAST = 1e-9
"""The least width, relative to Omega, that is given up at an edge."""
MOST = 1e-4
"""The largest, also where no edges share LEFT: shorter pieces are tried before a part is left."""
NARROW = 0.05
"""Part of an interval that is given up at each of its ends, at most."""
PHASE = 1500
"""States times segments beyond which Theorem 4 is cheaper than Theorem 1."""
SHORTEST = 0.1
"""A piece of Theorem 4 is not halved further, as part of the width that is given up at an edge."""
BESIDE = 0.1
"""Width given up beside multipliers that cross the circle in an unstable interval, as part of that at an edge."""
SAMPLES = 32
"""Samples a cell in which such crossings are looked for."""


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
    share = LEFT * widths.sum() / (2 * len(widths))
    counting = counter(known)
    found: list[Certificate] = []
    for k, width in enumerate(widths):
        least = max(LEAST, min(share, MOST, NARROW * width))
        edges = k > 0, k < len(widths) - 1
        low, high = ends[k] * (1 + edges[0] * least), ends[k + 1] * (1 - edges[1] * least)
        counted = [] if counting is None else _without_coordinates(counting, low, high, least)
        left = gaps(np.array([(piece.low, piece.high) for piece in counted]).reshape(-1, 2), low, high)
        left = left[left[:, 1] > left[:, 0] * (1 + least)]
        if len(left) and known.form is None and known.generators[0].nrows() * len(known.states) > PHASE:
            counted += _decaying(known, left, least)
            left = gaps(np.array([(piece.low, piece.high) for piece in counted]).reshape(-1, 2), low, high)
            left = left[left[:, 1] > left[:, 0] * (1 + least)]
        if len(left):
            maker = Maker(known, least)
            for start, stop in left.tolist():
                counted += maker.cover(start, stop, (edges[0] and start == low, edges[1] and stop == high))
        found += sorted(counted, key=lambda piece: piece.low)
    return found


def _decaying(known: Flow, left: Array, least: float) -> list[Certificate]:
    """Pieces of stable intervals by Theorem 4: the whole, or halves where these are not proved."""
    maker, parts, found = Maker(known, least), [], []
    for low, high in left.tolist():
        if (claim := maker.proposal(low, high)) is not None and claim.outside == 0:
            parts.append((low, high))
    while parts:
        low, high = parts.pop()
        if decays(known, low, high):
            found.append(Certificate(low, high, 0, CARRIED, np.zeros((0, 0))))
        elif high > low * (1 + SHORTEST * least):
            middle = float(np.sqrt(low * high))
            parts += [(low, middle), (middle, high)]
    return found


def _without_coordinates(counting: Counter, low: float, high: float, least: float) -> list[Certificate]:
    """Pieces of an interval by Theorem 3: the whole, or what lies between places where multipliers cross the circle
    while others are outside.
    """
    if (whole := _counted(counting, low, high)) is not None:
        return [whole]
    beside, zeros = BESIDE * least, _zeros(counting, low, high)
    starts, ends = [low, *(at * (1 + beside) for at in zeros)], [*(at * (1 - beside) for at in zeros), high]
    parts, found = [*zip(starts, ends, strict=True)], []
    while parts:
        start, end = parts.pop()
        if (piece := _counted(counting, start, end) if start < end else None) is not None:
            found.append(piece)
        elif counting.place(start) - counting.place(end) > 1:  # more than a cell: a half of it may do
            middle = float(np.sqrt(start * end))
            parts += [(start, middle), (middle, end)]
    return found


def _counted(counting: Counter, low: float, high: float) -> Certificate | None:
    outside = counting.outside(low, high)
    return None if outside is None else Certificate(low, high, int(outside > 0), COUNTED, np.zeros((0, 0)))


def _zeros(counting: Counter, low: float, high: float) -> list[float]:
    """Where p(1) p(-1) D changes its sign, ascending, as far as samples show it."""

    def value(omega: float) -> float:
        place = float(counting.place(omega))
        cell = counting.cell(floor(place))
        return np.nan if cell is None else float(cell[1](arb(2 * (place - floor(place)) - 1)))

    count = max(2, ceil(SAMPLES * float(counting.place(low) - counting.place(high))))
    at = np.geomspace(low, high, count + 1)
    values = np.array([value(omega) for omega in at.tolist()])
    changes = np.flatnonzero(values[1:] * values[:-1] < 0)
    return [brentq(value, at[k], at[k + 1], xtol=1e-12 * at[k], rtol=1e-12) for k in changes]
