"""From event to event: jumps of the mesh stiffness as they come, teeth that part and meet as the motion makes them.

The compiled kernel follows many pieces a call. It is given what a generator G is made of for every contact that
occurs, and varying functions as polynomials on cells of the common period: constants between edges, or parts of
Chebyshev series so short that they end. On either a piece of the motion is its Taylor series, of which smooth functions
make a recurrence: with G = sum_i u^i G_i, (k + 1) y_(k+1) = length sum_i G_i y_(k-i). The distance from a flank is a
polynomial then, and its first root is isolated by Bernstein coefficients (Farouki 2012, sections 3.3 and 5): in [0, 1]
a polynomial is nowhere below the least of them, and has at most as many roots as these change their sign; halving makes
both sharp.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab import ckernel
from gearstab.grouping import Columns
from gearstab.response.backlash import dynamics as d
from gearstab.response.backlash.dynamics import APART, UPPER
from gearstab.system import Array

FULL, UNKNOWN, CHATTERS, OUTGROWN, ROUGH = range(5)
"""Why a call ends, see ckernel/kernel.h and ckernel/backlash/follow.h."""

FIRST, MOST, ENTRIES = 32, 1024, 2**20
"""Pieces of the first call, and of a later one at most; numbers in their polynomials at most."""
SERIES, ROUNDED = 1e-15, 1e-12
"""Last coefficients of a series, relative to the largest value of its function; the latter where they are rounding."""
MOST_CELLS = 2**17
"""Cells of a common period."""
MOST_KEPT = 2**24
"""Numbers in the matrices of contacts that are kept for further use."""
MOST_LIKELY = 27
"""Contacts that are prepared at once: all of three meshes."""
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
SMALLEST = 2.0**-48
"""Parts of a piece that are not divided further in the search of a root."""


@dataclass(frozen=True)
class Event:
    """A mesh whose contact changes. time; mesh and kind: positions; speed: of g_i^T q - e_i."""

    time: float
    mesh: int
    kind: int
    speed: float


@dataclass(frozen=True)
class Track(Columns):
    """S pieces of the motion between events, one after the other.

    powers: ``(S, degree + 1, D)``, y(begin + u length) = sum_k u^k powers_k for u in [0, 1];  length, begin: ``(S,)``,
        times in the common period;  period: ``(S,)``, its number, from 0.
    contact: ``(S, meshes)``;  values: ``(S, order, J)``, the varying functions as powers of u.
    mesh, kind, speed: ``(S,)``, of the event at the end; where there is none mesh is -1.  grazing: ``(S,)`` bool,
        whether a flank is hardly touched, or hardly missed.
    """

    powers: Array
    length: Array
    begin: Array
    period: Array
    contact: Array
    values: Array
    mesh: Array
    kind: Array
    speed: Array
    grazing: Array

    def __getitem__(self, which: slice | Array) -> Track:
        """Some of them."""
        return self.chosen(which)


class Chatter(Exception):
    """Events come closer and closer, or too many of them."""


@dataclass(frozen=True)
class Timetable:
    """Cells of the varying coefficients: C cells of the common period, the same at any mesh frequency.

    span: ``(C, 2)``, begin and end, in parts of the period.
    shapes: ``(C, order, J)``, the varying functions as powers of the part of the cell that has passed.
    start: ``(C, L)``, S z at the beginning.
    """

    span: Array
    shapes: Array
    start: Array

    @property
    def order(self) -> int:
        """1 where all functions are constant."""
        return self.shapes.shape[1]


def timetable(dynamics: d.Dynamics) -> Timetable:
    """Divide the common period. Raises NotPossible where that takes too many series."""
    motion = dynamics.motion
    edges = motion.points.edges[0]
    spans = np.stack([edges[:-1], edges[1:]], axis=1)[motion.points.equation.occupied]
    if motion.drive.exact:
        shapes = dynamics.values(spans.mean(axis=1))[:, None]
    else:
        spans, waves = _series(dynamics, spans)
        shapes = d.POWERS @ waves
    return Timetable(spans, shapes, dynamics.scale * motion.drive.z(spans[:, 0]))


def _series(dynamics: d.Dynamics, spans: Array) -> tuple[Array, Array]:
    """Halve spans of tau until all their Chebyshev series end; in order of time."""
    known: list[tuple[Array, Array]] = []
    before = np.full((len(spans), dynamics.parts.shape[0]), np.inf)
    while len(spans):
        at = spans[:, :1] + d.POINTS * np.diff(spans)
        values = dynamics.values(at.ravel()).reshape(*at.shape, -1)
        waves = d.WAVES @ values
        rest = np.abs(waves[:, -2:]).max(axis=1) / np.maximum(np.abs(values).max(axis=1), np.finfo(float).tiny)
        # What halving does not make smaller is the rounding of the functions themselves.
        done = ((rest <= SERIES) | ((rest <= ROUNDED) & (rest > 0.1 * before))).all(axis=1)
        known.append((spans[done], waves[done]))
        low, high = spans[~done].T
        if 2 * len(low) + sum(len(part) for part, _ in known) > MOST_CELLS:
            raise d.too_rough()
        middle, before = 0.5 * (low + high), np.concatenate([rest[~done]] * 2)
        spans = np.concatenate([np.stack([low, middle], axis=1), np.stack([middle, high], axis=1)])
    found, series = (np.concatenate(parts) for parts in zip(*known, strict=True))
    order = np.argsort(found[:, 0], kind="stable")
    return found[order], series[order]


class Contacts:
    """Parts of the generators for the contacts ``(count, meshes)`` that have occurred.

    others: at another mesh frequency, the latest of which are likely to occur again.
    """

    def __init__(self, dynamics: d.Dynamics, others: Contacts | None = None) -> None:
        self.dynamics = dynamics
        nothing = np.empty((0, len(dynamics.gauge)), dtype=np.int64)
        likely = nothing if others is None else others.known[0][-MOST_LIKELY:].copy()
        self.count = len(likely)
        self.contacts = likely if self.count else np.empty((1, len(dynamics.gauge)), dtype=np.int64)
        self.matrices = np.empty((len(self.contacts), 1 + len(dynamics.parts), *dynamics.fixed.shape))
        if self.count:
            constant, parts = dynamics.generators(likely)
            self.matrices[:, 0], self.matrices[:, 1:] = np.swapaxes(constant, 1, 2), np.swapaxes(parts, 2, 3)

    @property
    def known(self) -> tuple[Array, Array]:
        """The contacts, and what is always there and what comes with the functions, ``(1 + J, D, D)`` by columns."""
        return self.contacts[: self.count], self.matrices[: self.count]

    def learn(self, contact: Array) -> None:
        """Add a contact ``(meshes,)``; where they have become too many, all others are forgotten."""
        if self.count == len(self.contacts):
            if 2 * self.matrices.size > MOST_KEPT:
                self.count = 0
            else:
                self.contacts, self.matrices = (
                    np.concatenate([a, np.empty_like(a)]) for a in (self.contacts, self.matrices)
                )
        constant, parts = self.dynamics.generators(contact)
        self.contacts[self.count] = contact
        self.matrices[self.count, 0], self.matrices[self.count, 1:] = constant.T, np.swapaxes(parts, 1, 2)
        self.count += 1


@dataclass(frozen=True)
class ContactCourse:
    """Everything that it takes to follow motions of a single system at one mesh frequency.

    dynamics: the equations;  table: what varies in them;  contacts: that have occurred.
    fastest: vibrations of the fastest mode per unit of time, all teeth in contact.
    """

    dynamics: d.Dynamics
    table: Timetable
    contacts: Contacts
    fastest: float

    @classmethod
    def of(cls, dynamics: d.Dynamics) -> ContactCourse:
        """Prepare. Raises NotPossible where that takes too many series."""
        table, m = timetable(dynamics), dynamics.size
        closed = dynamics.generator(table.shapes[:1, 0], np.full(len(dynamics.teeth.has), UPPER))[0]
        fastest = np.abs(np.linalg.eigvals(closed[:m, :m])).max() / (2 * np.pi)
        return cls(dynamics, table, Contacts(dynamics), float(fastest))

    def at(self, omega: float, contacts: Contacts) -> ContactCourse:
        """Return the same at another mesh frequency, on which the modes may not depend; contacts: at one nearby."""
        model = self.dynamics.at(omega)
        return replace(self, dynamics=model, contacts=Contacts(model, contacts))


def follow(course: ContactCourse, x: Array) -> Iterator[Track]:
    """The motion from the state x at t = 0 on, without end.

    Raises Chatter, OverflowError where the motion outgrows double precision, and NotPossible where smooth functions are
    too rough.
    """
    dynamics, table, contacts = course.dynamics, course.table, course.contacts
    motion, teeth, span = dynamics.motion, dynamics.teeth, table.span * dynamics.motion.period
    functions, meshes, size = table.shapes.shape[2], len(teeth.has), len(dynamics.fixed)
    y = np.concatenate([x, table.start[0]])
    marks = np.concatenate([[0, 0, -1, 0, 0], teeth.contact(dynamics.gauge @ y)]).astype(np.int64)
    state = np.concatenate([span[:1, 0], y])
    limits = np.where(teeth.has, [teeth.low, teeth.high], 0.0).T.copy()
    most_events = int(min(BUSY + 10 * course.fastest * motion.period, 2.0**62))
    settings = (
        motion.period, float(motion.basis.rate[0]), d.TOLERANCE, d.REACH, PENETRATION, ROUNDING, GRAZING,
        AT_ONCE, LARGEST, SMALLEST,
    )  # fmt: skip
    given = [np.ascontiguousarray(part) for part in (span, table.shapes, table.start, dynamics.gauge, limits)]
    most = max(min(MOST, ENTRIES // ((d.DEGREE + 1) * size)), 1)
    room, why = min(FIRST, most), FULL
    while True:
        numbers = (
            size, size - dynamics.size, meshes, functions, len(span), table.order, d.DEGREE, contacts.count,
            most_events, MOST_AT_ONCE, FINE, d.MOST_HALVINGS,
        )  # fmt: skip
        powers, number = np.empty((room, d.DEGREE + 1, size)), np.empty((room, 3))
        values = np.empty((room, table.order, functions))
        label, contact = np.empty((room, 5), dtype=np.int64), np.empty((room, meshes), dtype=np.int64)
        why, count = ckernel.library.follow(
            numbers, settings, *given, *contacts.known, room, marks, state, powers, values, number, label, contact,
        )  # fmt: skip
        if count:
            period, _, mesh, following, grazing = label[:count].T
            begin, length, speed = number[:count].T
            kind = np.where(following == APART, 0, np.where(following == teeth.drive[mesh], 1, 2))
            yield Track(
                powers[:count], length, begin, period, contact[:count], values[:count], mesh, kind, speed, grazing > 0
            )
        if why == UNKNOWN:
            contacts.learn(marks[5:])
        elif why == CHATTERS:
            raise Chatter
        elif why == OUTGROWN:
            raise OverflowError
        elif why == ROUGH:
            raise d.too_rough()
        elif room < most:
            room = min(2 * room, most)
