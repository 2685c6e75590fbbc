"""Event-driven integration of a gear pair: exact motion from one change of the mesh stiffness to the next."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, isfinite, pi, tau
from typing import NamedTuple

from scipy.optimize import brentq

from gearstab.response.rotating_pair.exits import first_exit
from gearstab.response.rotating_pair.jumps import Law
from gearstab.response.rotating_pair.motion import Arc, State

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
until what follows is one of many histories (:mod:`~gearstab.response.rotating_pair.errors`). 0: nothing of all that."""

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
