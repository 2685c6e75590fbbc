"""Certificates of all rows of a system over a range of mesh frequencies, whose edges are known.

Claims are those that multipliers suggest, in floating point. Coordinates are Floquet vectors, those that grow most
first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from gearstab import ckernel
from gearstab.certificates.choices import REAL, balanced
from gearstab.certificates.counting import Counter
from gearstab.certificates.equations import Flow, flow
from gearstab.certificates.lyapunov import decays
from gearstab.certificates.proof import counter
from gearstab.certificates.segments import segments
from gearstab.certificates.shares import gaps
from gearstab.certificates.verifier import CARRIED, COUNTED, Certificate, proves
from gearstab.system import Array, GearSystem

WIDE = 1e6
"""Ratio of multipliers above which the modes of the mean system serve as coordinates."""
CIRCLE = 1e-9
"""Growth over a period that is rounding."""
WITHIN = 0.25
"""Where between the growth of two directions, as logarithms, the rate that tells them apart lies."""
LEFT = 4e-4
"""Part of the range, in logarithms, that may be left around all edges together."""
LEAST = 1e-9
"""The least width, relative to Omega, that is given up at an edge."""
MOST = 1e-4
"""The largest, also where no edges share LEFT: shorter pieces are tried before a part is left."""
NARROW = 0.05
"""Part of an interval that is given up at each of its ends, at most."""
NUMBERS = 1e6
"""Numbers in the matrices of all segments beyond which Theorem 4 is cheaper than Theorem 1."""
FIRST, SHORTER, LONGER, SHORTEST = 0.01, 0.5, 2.0, 0.4
"""The longest piece that is tried first with coordinates; factors on the length of the next one, where one was not
proved, and where it was; the shortest, as a part of the width that is given up at an edge.
"""
UNTOLD, ASIDE = 64, 1e-12
"""Stretches in which nothing is told without coordinates, after which it is given up; by how much a piece ends before
one, relative to Omega.
"""
NONE = np.zeros((0, 0))
"""Coordinates of pieces that need none."""
Claim = Callable[[float, float], Certificate | None]


def claimed(flow: Flow, low: float, high: float) -> Certificate | None:
    """Return what the multipliers in the middle suggest; None where rounding has the last word."""
    omega = float(np.sqrt(low * high))
    own, share = flow.enclosed(omega), np.bincount(flow.states, flow.fractions)
    generators = 2 * np.pi * flow.cycles * np.einsum("i,dijk->djk", flow.powers(omega), own.terms)
    states, fractions, sorts = flow.sorts
    steps, monodromy = ckernel.exponentials(generators[states] * fractions[:, None, None]), np.eye(len(own.modes))
    for sort in sorts:
        monodromy = steps[sort] @ monodromy
    if not np.isfinite(monodromy).all():
        return None
    values, vectors = np.linalg.eig(monodromy)
    least, most = np.abs(values).min(), np.abs(values).max()
    # The condition is 1 at least, and takes longest to find.
    if most < 1 and least * WIDE <= most and np.linalg.cond(vectors) * least * WIDE <= most:
        values, vectors = np.linalg.eig(np.tensordot(share, generators, 1))
        # Of rates what orders and pairs them: multipliers themselves may be below all doubles.
        values = np.exp(values.real / np.abs(values.real).max() - 2 + 1j * np.sign(values.imag))
    order = np.argsort(-np.abs(values), kind="stable")
    values, vectors = values[order], vectors[:, order]
    pairs = values.imag > REAL * np.abs(values)
    kept = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
    values, vectors, pairs = values[kept], vectors[:, kept], pairs[kept]
    if len(values) + pairs.sum() != len(monodromy) or not values.all():
        return None
    coordinates = (own.modes @ balanced(vectors, pairs, generators, share)).astype(np.float32).astype(float)
    growth = np.log(np.abs(np.repeat(values, 1 + pairs)))
    gap = growth - np.maximum(np.append(growth[1:], -np.inf), 0.0)
    outside = int(np.argmax(gap)) + 1
    if gap[outside - 1] > CIRCLE:
        next_growth = growth[outside] if outside < len(growth) else growth[-1]
        log_rate = 2 * max(0.0, next_growth + WITHIN * (growth[outside - 1] - next_growth))
        return Certificate(low, high, outside, _single(np.exp(log_rate)), coordinates)
    if flow.form is None:
        return Certificate(low, high, 0, 1.0, coordinates)
    return Certificate(low, high, 0, 0.0, coordinates, _separators(own.forms[0], values, vectors))


def _separators(form: Array, values: Array, vectors: Array) -> tuple[float, ...]:
    """Numbers between the 2 cos(theta) of neighbours of unequal Krein signature."""
    signature = np.sign(np.einsum("ij,ik,kj->j", vectors.conj(), form, vectors).imag)
    turns = 2 * np.cos(np.angle(values))
    order = np.argsort(turns)
    middle, change = 0.5 * (turns[order][1:] + turns[order][:-1]), np.diff(signature[order]) != 0
    return tuple(_single(value) for value in middle[change])


def _single(value: float) -> float:
    return float(np.float32(value))


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
        for k, at in enumerate(omega[row].tolist()):
            if (piece := by_a_form(known, at, at)) is not None:
                found[row, k] = piece.outside == 0
    return found


def covered(low: float, high: float, least: float, claim: Claim, first: float = np.inf) -> Iterator[Certificate]:
    """Pieces of an interval, ascending, each as long as what is proved; where nothing is, a width of ``least`` is left
    out. Widths and ``first``, the longest that is tried first, are relative to Omega.
    """
    at, step, sure = low, first, True
    while at < high:
        left = float(np.log(high / at))
        step, end = (step, at * float(np.exp(step))) if 1.01 * step < left else (left, high)
        if (piece := claim(at, end)) is not None:
            yield piece
            at, step, sure = piece.high, step * LONGER if sure else step, True
        elif step > SHORTEST * least:
            step, sure = step * SHORTER, False
        else:
            at, step = at * (1 + least), least


def by_a_form(known: Flow, low: float, high: float) -> Certificate | None:
    """A piece by Theorem 1 or 2."""
    piece = claimed(known, low, high)
    return piece if piece is not None and proves(known, piece) else None


def _by_one_carried_along(known: Flow, low: float, high: float) -> Certificate | None:
    """A piece by Theorem 4."""
    return Certificate(low, high, 0, CARRIED, NONE) if decays(known, low, high) else None


def _of_row(known: Flow, ends: Array) -> list[Certificate]:
    widths = np.diff(np.log(ends))
    share = LEFT * widths.sum() / (2 * len(widths))
    counting = counter(known)
    found: list[Certificate] = []
    for k, width in enumerate(widths):
        least = max(LEAST, min(share, MOST, NARROW * width))
        edges = k > 0, k < len(widths) - 1
        low, high = ends[k] * (1 + edges[0] * least), ends[k + 1] * (1 - edges[1] * least)
        counted = [] if counting is None else _without_coordinates(counting, low, high)
        left = gaps(np.array([(piece.low, piece.high) for piece in counted]).reshape(-1, 2), low, high)
        long = known.form is None and known.generators[0].nrows() ** 2 * len(known.states) > NUMBERS
        for start, stop in left[left[:, 1] > left[:, 0] * (1 + least)].tolist():
            suggested = claimed(known, start, stop) if long else None
            if suggested is not None and suggested.outside == 0:
                counted += covered(start, stop, least, partial(_by_one_carried_along, known))
            else:
                counted += covered(start, stop, least, partial(by_a_form, known), FIRST)
        found += sorted(counted, key=lambda piece: piece.low)
    return found


def _without_coordinates(counting: Counter, low: float, high: float) -> list[Certificate]:
    """Pieces of an interval by Theorem 3 or 5: the whole, or what lies between places where nothing is told."""
    parts: list[tuple[float, float]] = []
    before: int | None = None
    untold = 0
    for start, end, outside in counting.stretches(low, high):
        untold += outside is None
        if untold > UNTOLD:
            break
        if outside is not None:
            ends = (max(low, counting.omega(end) * (1 + ASIDE)), min(high, counting.omega(start) * (1 - ASIDE)))
            if outside == before:
                parts[-1] = ends[0], parts[-1][1]
            else:
                parts.append(ends)
        before = outside
    if len(parts) == 1 and before is not None and not untold:
        return [Certificate(low, high, int(before > 0), COUNTED, NONE)]
    pieces = (_counted(counting, *part) for part in parts if part[0] < part[1])
    return [piece for piece in pieces if piece is not None]


def _counted(counting: Counter, low: float, high: float) -> Certificate | None:
    outside = counting.outside(low, high)
    return None if outside is None else Certificate(low, high, int(outside > 0), COUNTED, NONE)
