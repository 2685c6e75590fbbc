"""Event-driven integration of a gear pair: exact motion between changes of the stiffness, and growth of its errors."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, isfinite, pi, tau
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearstab.response.rotating_pair.motion import Arc, Law, State, first_exit, free_basis
from gearstab.system import Array

STATUS = {
    "stalled": 1,
    "reflected": 2,
    "reversed": 4,
    "chatter": 8,
    "event_limit": 16,
    "overflow": 32,
    "time_limit": 64,
    "unpredictable": 128,
}
"""Bits of the status of a run: the gears are trapped with one pair in contact; were reflected; turned back across a
boundary; changed region without end, which stopped the run; reached the largest number of events; the motion outgrew
double precision; the run was stopped before it reached its goal, since that takes too long; rounding errors have grown
until what follows is one of many histories (:func:`growth`). 0: nothing of all that."""

MOST_EVENTS = 1_000_000
CHATTER = 1000
"""So many events within one period 2 pi/w0 are chatter."""


@dataclass(frozen=True)
class Goal:
    """When a run ends: at a time, after an angle of theta, or (neither) when the gears have stalled.

    time: in units of 1/w0. cycles, rest: theta - theta_0, as whole cycles and the rest in radians. patience: the time
    after which a run towards anything but a time is given up.
    A run that cannot reach its angle, since the gears have stalled, ends then.
    """

    time: float = inf
    patience: float = inf
    cycles: int | None = None
    rest: float = 0.0


class TimedArc(NamedTuple):
    """An arc of a run: when it begins, how long it lasts, in which region and cycle; theta is local to the cycle."""

    begin: float
    duration: float
    arc: Arc
    region: int
    cycle: int


class Crossing(NamedTuple):
    """A boundary that was met at a time: the state before and after, and whether the gears passed."""

    time: float
    direction: int
    passed: bool
    region: int
    cycle: int
    before: State
    after: State

    @property
    def new_cycle(self) -> int:
        """The cycle after the event."""
        at_end = self.before[2] in (0.0, tau)
        return self.cycle + self.direction if self.passed and at_end else self.cycle


@dataclass
class Run:
    """State of a run so far: its status bits, the time, and when the gears stalled."""

    status: int = 0
    time: float = 0.0
    stalled: float = inf


def region_at(law: Law, state: State) -> int:
    """The region of an angle local to a cycle; on a boundary the one that the gears move into."""
    _, single, end = law.edges
    theta, forward = state[2], state[3] >= 0
    if theta == single:
        return 1 if forward else 0
    if theta in (0.0, end):
        return 0 if forward == (theta == 0.0) else 1
    return 0 if theta < single else 1


def integrate(law: Law, start: State, goal: Goal, run: Run) -> Iterator[TimedArc | Crossing]:
    """All pieces and events of a run, in order; ``run`` tells how it went.

    start: theta is local to cycle 0, from 0 to 2 pi; backwards from 0 is written as 2 pi of cycle -1 by the caller.
    """
    region, cycle, state = region_at(law, start), 0, start
    last_cycle, last_angle = _target(start[2], goal)
    recent: deque[float] = deque(maxlen=CHATTER)
    limit = min(goal.time, goal.patience)
    for _ in range(MOST_EVENTS):
        arc = law.arc(region, state)
        lower, upper = law.edges[region] - state[2], law.edges[region + 1] - state[2]
        ends = cycle == last_cycle and state[2] < last_angle <= law.edges[region + 1]
        upper = last_angle - state[2] if ends else upper
        found = first_exit(arc, lower, upper, limit - run.time)
        duration = limit - run.time if found is None else found.time
        stall = _stall(law, region, arc, duration) if run.status & STATUS["stalled"] == 0 else None
        if stall is not None:
            run.status |= STATUS["stalled"]
            run.stalled = run.time + stall
            if goal.time == inf:
                yield TimedArc(run.time, stall, arc, region, cycle)
                run.time += stall
                return
        if duration == inf:
            run.status |= STATUS["stalled"]
            run.stalled = run.time
            yield TimedArc(run.time, 0.0, arc, region, cycle)
            return
        yield TimedArc(run.time, duration, arc, region, cycle)
        run.time += duration
        if found is None:
            run.status |= STATUS["time_limit"] if goal.time > limit else 0
            return
        if ends and found.direction > 0:
            return
        phi, rate, _, speed = arc.at(duration)
        edge = law.edges[region + (found.direction > 0)]
        before = (phi, rate, edge, speed)
        rate, speed, passed = law.cross(region, before, found.direction)
        event = Crossing(run.time, found.direction, passed, region, cycle, before, (phi, rate, edge, speed))
        yield event
        run.status |= 0 if passed else STATUS["reflected"]
        run.status |= STATUS["reversed"] if passed and found.direction < 0 else 0
        if not all(map(isfinite, event.after)):
            run.status |= STATUS["overflow"]
            return
        if len(recent) == CHATTER and run.time - recent[0] < 2 * pi:
            run.status |= STATUS["chatter"]
            return
        recent.append(run.time)
        state, cycle = event.after, event.new_cycle
        if passed:
            region = 1 - region
            if edge in (0.0, tau):
                state = (phi, rate, tau - edge, speed)
                if cycle == last_cycle and last_angle == 0.0 and found.direction > 0:
                    yield TimedArc(run.time, 0.0, law.arc(region, state), region, cycle)
                    return
    run.status |= STATUS["event_limit"]


def _target(start: float, goal: Goal) -> tuple[int | None, float]:
    """Cycle and local angle at which a run ends."""
    if goal.cycles is None:
        return None, 0.0
    angle = start + goal.rest
    return (goal.cycles + 1, angle - tau) if angle >= tau else (goal.cycles, angle)


def _stall(law: Law, region: int, arc: Arc, duration: float) -> float | None:
    """When, within an arc, the energy falls below what it takes to get out of the softer region; None if not."""
    if not law.impulsive or law.drive != 0 or region != law.soft:
        return None

    def spare(t: float) -> float:
        return law.energy(region, arc.at(t)) - law.pass_energy

    if spare(0.0) < 0:
        return 0.0
    if law.zeta == 0:
        return None
    end = duration
    if duration == inf:
        end = 1.0
        while spare(end) > 0 and end < 1e12:  # in 1/w0: what is not spent by then never is
            end *= 2
    if spare(end) >= 0:
        return None
    # To the last digit; the tolerance is relative only.
    return float(brentq(spare, 0.0, end, xtol=1e-300, rtol=8.9e-16))


ROUNDING = 0.5 * float(np.finfo(float).eps)
LOST = 0.01
"""Error of phi, as a part of its largest magnitude so far, from which on a history is one of many."""
LARGEST = 1e100
"""Beyond this amplification there is nothing left to tell."""
WIDEST = 40
"""Columns that a factor of the covariance may grow to, four an event, before it is made square again."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class ErrorGrowth:
    """Errors just after each event ``(events,)``.

    amplification: the factor by which a small error of the initial state has grown, with time in units of 1/w0: the
        Frobenius norm of the derivative, at most LARGEST.
    error: what rounding errors have made of phi, as a part of its largest magnitude so far, at most 1.
    """

    amplification: Array
    error: Array

    @property
    def first_lost(self) -> int | None:
        """The event, from 0, from which on the history is one of many; None if it is certain to the end."""
        lost = self.error > LOST
        return int(np.argmax(lost)) if lost.any() else None


def growth(law: Law, pieces: Sequence[TimedArc], events: Sequence[Crossing]) -> ErrorGrowth:
    """Errors along the pieces of a run, each but the last of which ends with the event of the same number.

    Small differences d of the state y = (phi, phi', theta, theta') follow the flow's derivative between two changes of
    the stiffness, and at each of them the saltation matrix

        S = DR + (F+ - DR F-) e_theta^T/theta'-,

    of the map R of the state there and the vector fields F-, F+ before and after it (Leine & Nijmeijer 2004, ch. 7).
    Where the gears are reflected it is the same with the field of one region on both sides. A slow meeting, theta'-
    near zero, amplifies much: histories with reflections are chaotic.

    The error of a computed state is carried along as a covariance matrix, P <- S (Phi P Phi^T + Q) S^T, with the
    rounding errors Q of each piece. That is of first order: once errors are as large as the motion it says no more than
    that. What is kept is a factor of P = L L^T (square-root form: Bierman 1977), since P itself loses its small
    variances to rounding where directions differ by more than eight digits, and may turn negative.
    """
    if not events:
        return ErrorGrowth(np.empty(0), np.empty(0))
    steps, noise, size = _steps(law, pieces, events)
    amplification, error = np.full(len(events), LARGEST), np.ones(len(events))
    total, root = np.eye(4), np.diag(ROUNDING * np.array([size[0], size[0], 1.0, 1.0]))
    for k, (step, own) in enumerate(zip(steps, noise, strict=True)):
        with np.errstate(invalid="ignore", over="ignore"):
            total, both = step @ total, np.hstack([step @ root, own])
            factor, deviation = np.sqrt(np.vdot(total, total)), np.sqrt(np.vdot(both[0], both[0]))
        if not (factor < LARGEST and np.all(np.isfinite(both)) and np.isfinite(deviation)):
            break
        root = both if both.shape[1] < WIDEST else np.linalg.qr(both.T)[1].T
        amplification[k], error[k] = factor, min(deviation / size[k], 1.0)
        if deviation > size[k]:
            # Of no more use, and large numbers overflow.
            root = root * (size[k] / deviation)
    return ErrorGrowth(amplification, np.maximum.accumulate(error))


def _steps(law: Law, pieces: Sequence[TimedArc], events: Sequence[Crossing]) -> tuple[Array, Array, Array]:
    """Derivatives from one event to the next ``(E, 4, 4)``, factors of the covariances of the rounding errors that
    each step adds ``(E, 4, 4)``, and the largest |phi| so far ``(E,)``.
    """
    start = np.array([piece.arc.start for piece in pieces[: len(events)]])
    time = np.array([piece.duration for piece in pieces[: len(events)]])
    region = np.array([event.region for event in events])
    passed = np.array([event.passed for event in events])
    before, after = np.array([event.before for event in events]), np.array([event.after for event in events])
    kappa, beyond = np.array(law.kappa)[region], np.array(law.kappa)[np.where(passed, 1 - region, region)]
    derivative = np.broadcast_to(np.eye(4), (len(events), 4, 4)).copy()
    if law.impulsive:
        derivative = jump_derivative(law.m, beyond - kappa, before, after[:, 3], passed)
    m, zeta = law.follows, law.zeta
    arriving = field(m, zeta, law.load, kappa, before, law.drive)
    leaving = field(m, zeta, law.load, beyond, after, law.drive)
    rates = leaving - np.einsum("eij,ej->ei", derivative, arriving)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        derivative[:, :, 2] += rates / before[:, 3, None]
    rest = np.abs(law.load / kappa)
    size = np.maximum(np.abs(start[:, 0] - law.load / kappa) + rest, np.abs(start[:, 1]) / np.sqrt(kappa))
    turns = 1 + np.sqrt(kappa) * time
    angle = np.pi + (np.abs(start[:, 3]) + np.abs(law.follows * start[:, 1])) * time
    noise = ROUNDING * np.stack([size * turns, size * turns, angle, np.abs(before[:, 3]) + size * turns], axis=-1)
    own = derivative * noise[:, None, :]
    with np.errstate(invalid="ignore"):  # a meeting at rest: infinite derivatives
        steps = derivative @ flow(m, kappa, time, free_basis(time, kappa, np.asarray(zeta)))
    return steps, own, np.maximum.accumulate(np.maximum(size, TINY))


def flow(m: Array | float, kappa: Array, time: Array, basis: tuple[Array, Array, Array]) -> Array:
    """The derivative of the state at the end of an arc by that at its beginning, ``(N, 4, 4)``.

    basis: S, C and U of :func:`.motion.free_basis`.
    """
    s, c, u = basis
    zero, one = np.zeros_like(time), np.ones_like(time)
    rows = [
        [1 - kappa * u, s, zero, zero],
        [-kappa * s, c, zero, zero],
        [-m * kappa * u, m * (s - time), one, time],
        [-m * kappa * s, m * (c - 1), zero, one],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def field(
    m: Array | float, zeta: Array | float, force: Array | float, kappa: Array, state: Array, drive: Array | float
) -> Array:
    """The vector field F = (phi', phi'', theta', theta'') at states ``(N, 4)``; force: phi_s; drive: eta."""
    acting = force - kappa * state[:, 0] - 2 * zeta * state[:, 1]
    return np.stack([state[:, 1], acting + m * drive, state[:, 3], m * acting + drive], axis=-1)


def jump_derivative(m: Array | float, change: Array, before: Array, speed: Array, passed: Array | bool = True) -> Array:
    """DR of :meth:`.motion.Law.cross`, ``(N, 4, 4)``. change: of the stiffness; speed: theta' after the jump."""
    found = np.broadcast_to(np.eye(4), (len(before), 4, 4)).copy()
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        by_phi = np.where(passed, -change * before[:, 0] / speed, 0.0)
        by_speed = np.where(passed, before[:, 3] / speed, -1.0)
    found[:, 1, 0], found[:, 1, 3] = m * by_phi, m * (by_speed - 1)
    found[:, 3, 0], found[:, 3, 3] = by_phi, by_speed
    return found
