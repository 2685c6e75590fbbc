"""From event to event: jumps of the mesh stiffness as they come, teeth that part and meet as the motion makes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.response.backlash.contact import APART, LOWER, UPPER
from gearstab.response.backlash.crossing import bernstein, first_below
from gearstab.response.backlash.dynamics import Dynamics, PolynomialPiece
from gearstab.system import Array

PENETRATION = 1e-12
"""A flank may be passed by this part of the backlash unnoticed (and by rounding errors of large deflections)."""
ROUNDING = 1e-14
GRAZING = 1e-6
"""A touch is grazing if it is closer to a mere one than this part of the backlash."""
AT_ONCE, MOST_AT_ONCE = 1e-12, 50
"""So many events in a row, each within this part of the common period, are chatter."""
BUSY = 1000
"""More events than this a common period, and 10 for every vibration of the fastest mode in it, are chatter too."""
FINE = 64
"""Parts of a piece in which the least distance is looked for."""
LARGEST = 1e150
"""States beyond have outgrown double precision: squares of larger ones overflow."""


@dataclass(frozen=True)
class Event:
    """A mesh whose contact changes. time; mesh and kind: positions; speed: of g_i^T q - e_i."""

    time: float
    mesh: int
    kind: int
    speed: float


@dataclass(frozen=True)
class Stretch:
    """A piece of the motion between events.

    period: number of the common period, from 0; begin: time in it.
    contact: ``(meshes,)``; values: ``(J,)``, the varying functions, None where they vary smoothly.
    event: what ends it; grazing: whether a flank is hardly touched, or hardly missed.
    """

    piece: PolynomialPiece
    period: int
    begin: float
    contact: Array
    values: Array | None
    event: Event | None
    grazing: bool


class Chatter(Exception):
    """Events come closer and closer, or too many of them."""


def follow(dynamics: Dynamics, x: Array, tolerance: float) -> Iterator[Stretch]:
    """The motion from the state x at t = 0 on, without end.

    Raises Chatter, OverflowError where the motion outgrows double precision, and ValueError where smooth functions are
    too rough for the tolerance.
    """
    motion = dynamics.motion
    edges, period = motion.points.edges[0], motion.period
    # Every period asks for the same.
    middles = dynamics.values(0.5 * (edges[:-1] + edges[1:])) if motion.drive.exact else None
    intervals = motion.points.equation.occupied
    contact = dynamics.teeth.contact(dynamics.gauge @ dynamics.whole(x, 0.0))
    most, soon = busiest(dynamics), 0
    switched: int | None = None
    number = 0
    while True:
        events = 0
        for q in intervals:
            begin, end = float(edges[q] * period), float(edges[q + 1] * period)
            y = dynamics.whole(x, edges[q])
            values = None if middles is None else middles[q]
            while end - begin > 1e-15 * period:  # else only rounding is left
                longest = end - begin
                if values is not None:
                    piece = dynamics.constant(values, contact, y, longest)
                else:
                    piece = dynamics.varying(begin, contact, y, longest, tolerance)
                last = piece.length >= longest
                found, grazing = _next(dynamics, piece, contact, switched)
                event, before = None, contact
                if found is not None:
                    u, mesh, following = found
                    piece, last = piece.until(u), last and u == 1.0
                    contact = contact.copy()
                    contact[mesh] = following
                    speed = float(dynamics.gauge[mesh] @ _rate(piece, dynamics, values, begin, before))
                    time = number * period + begin + piece.length
                    event = Event(float(time), mesh, dynamics.teeth.kind(mesh, following), speed)
                    grazing |= abs(speed) < GRAZING * float(motion.basis.rate[0]) * dynamics.teeth.width[mesh]
                    events, soon = events + 1, soon + 1 if piece.length < AT_ONCE * period else 0
                yield Stretch(piece, number, begin, before, values, event, bool(grazing))
                if events > most or soon > MOST_AT_ONCE:
                    raise Chatter
                y = piece.end
                if not np.abs(y).max() < LARGEST:
                    raise OverflowError
                switched = None if event is None else event.mesh
                begin = end if last else begin + piece.length
            x = y[: dynamics.size]
        number += 1


def busiest(dynamics: Dynamics) -> float:
    """How many events a common period may have: by the vibrations of the fastest mode in it."""
    motion = dynamics.motion
    middle = dynamics.values(np.array([0.5 * float(motion.points.edges[0][:2].sum())]))
    closed = dynamics.generator(middle, np.full(len(dynamics.teeth.has), UPPER))[0]
    m = dynamics.size
    return BUSY + 10 * float(np.abs(np.linalg.eigvals(closed[:m, :m])).max() * motion.period / (2 * np.pi))


def _rate(piece: PolynomialPiece, dynamics: Dynamics, values: Array | None, begin: float, contact: Array) -> Array:
    """dy/dt at the end of a piece."""
    if piece.length > 0:
        return np.asarray(np.arange(len(piece.powers)) @ piece.powers / piece.length)
    if values is None:
        values = dynamics.values(np.array([begin / dynamics.motion.period]))[0]
    return np.asarray(dynamics.generator(values[None], contact)[0] @ piece.end)


def _next(
    dynamics: Dynamics, piece: PolynomialPiece, contact: Array, switched: int | None
) -> tuple[tuple[float, int, int] | None, bool]:
    """The first change of contact in a piece, (u, mesh, contact afterwards), and whether a touch is grazing.

    switched: the mesh whose contact changed at the beginning of the piece, where its deflection is at the limit.
    """
    teeth = dynamics.teeth
    first: tuple[float, int, int] | None = None
    grazing = False
    for mesh in map(int, np.flatnonzero(teeth.has)):
        deflection = piece.powers @ dynamics.gauge[mesh]
        tolerance = PENETRATION * teeth.width[mesh] + ROUNDING * np.abs(deflection).sum()
        for sign, limit, following in _limits(dynamics, mesh, int(contact[mesh])):
            distance = sign * deflection
            distance[0] -= sign * limit
            # A mesh that has just come to this limit is on it; one that came to the other limit is a width away.
            if mesh == switched and abs(distance[0]) <= 0.25 * teeth.width[mesh]:
                distance[0] = 0.0
            if (bernstein(len(distance) - 1) @ distance).min() >= GRAZING * teeth.width[mesh]:
                continue
            u = first_below(distance, tolerance)
            if u is not None and (first is None or u < first[0]):
                first = u, mesh, following
            grazing |= u is None and _nearly(distance, GRAZING * teeth.width[mesh])
    return first, grazing


def _limits(dynamics: Dynamics, mesh: int, contact: int) -> list[tuple[int, float, int]]:
    """What a mesh may meet: (sign s, limit, contact beyond it); s (x - limit) is positive before."""
    low, high = float(dynamics.teeth.low[mesh]), float(dynamics.teeth.high[mesh])
    if contact == UPPER:
        return [(1, high, APART)]
    if contact == LOWER:
        return [(-1, low, APART)]
    return [(-1, high, UPPER), (1, low, LOWER)]


def _nearly(distance: Array, margin: float) -> bool:
    """Whether a distance has a minimum below the margin in a piece, or where it begins or ends.

    By the parabola at the least of a number of values.
    """
    powers = np.vander(np.linspace(0.0, 1.0, FINE + 1), len(distance), increasing=True)
    values = powers @ distance
    least = int(np.argmin(values))
    slope, bend = (powers[least, : len(d)] @ d for d in _derivatives(distance))
    return bool(bend > 0 and abs(slope) <= 2 * bend / FINE and values[least] - 0.5 * slope**2 / bend < margin)


def _derivatives(powers: Array) -> tuple[Array, Array]:
    """Coefficients of the first and the second derivative."""
    first = powers[1:] * np.arange(1, len(powers))
    return first, first[1:] * np.arange(1, len(first))
