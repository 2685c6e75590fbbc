"""When the rotation leaves the region of its stiffness: the first exit, bracketed through nested zeros of derivatives.

theta is monotone between zeros of theta', theta' between zeros of theta'', and so on down to a derivative whose
zeros can be written down. So no crossing can be missed, however short the gear stays beyond the boundary.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain, takewhile
from math import inf, pi, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

from gearstab.response.rotating_pair.motion import Arc

LONGEST = 1e15
"""Times (in 1/w0) after which phases have no digits left; a gear that takes so long to leave never does."""
SLACK = 1 + 1e-9
"""Room for rounding in times by which theta has left for certain."""

PERIOD = 1.01
"""Period of the swing, and a little more: what happens in a period has then happened, however it is rounded."""


class Exit(NamedTuple):
    """Where theta leaves its region: the time since the beginning of the arc and the direction, 1 or -1."""

    time: float
    direction: int


def first_exit(arc: Arc, lower: float, upper: float, until: float = inf) -> Exit | None:
    """The first time at which theta - theta_0 reaches ``upper`` or ``lower``; None if it does not before ``until``.

    lower <= 0 <= upper, relative to theta_0. On a boundary (0) the gear must be moving inwards.
    """
    for begin, end in _windows(arc, lower, upper):
        if begin > until:
            break
        found = _search(arc, lower, upper, begin, min(end, until))
        if found is not None:
            return found
    return None


def _windows(arc: Arc, lower: float, upper: float) -> Iterator[tuple[float, float]]:
    """The times in which theta can reach a boundary, in order.

    About its drift theta swings by m (phi - equilibrium), which never grows. So the boundary behind can be reached
    within the first period only, and the one ahead from when the swing first extends so far.
    """
    end = _certain(arc, lower, upper)
    if arc.drive != 0:
        yield 0.0, end
        return
    period = 2 * pi / sqrt(arc.discriminant) if arc.discriminant > 0 else inf
    if arc.drift == 0:
        yield 0.0, min(PERIOD * period, LONGEST)
        return
    if abs(arc.drift) > abs(arc.m) * arc.bounds(0.0)[1]:
        # theta' keeps its sign.
        yield 0.0, end
        return
    first = min(PERIOD * period, end)
    yield 0.0, first
    begin = first
    # The swing shrinks meanwhile, so that each bound gives a later one; any number of them is right.
    for _ in range(60):
        later = _ahead(arc, lower, upper, begin)
        if later <= begin * SLACK:
            break
        begin = later
    if begin < end:
        yield begin, end


def _ahead(arc: Arc, lower: float, upper: float, since: float) -> float:
    """A time before which theta cannot reach the boundary ahead, by the swing from ``since`` on."""
    swing = abs(arc.m) * arc.bounds(since)[0]
    middle = arc.m * (arc.load / arc.kappa - arc.start[0])
    room = upper - middle - swing if arc.drift > 0 else middle - swing - lower
    return max(since, room / abs(arc.drift))


def _certain(arc: Arc, lower: float, upper: float) -> float:
    """A time at which theta has left for certain; ``LONGEST`` if it may stay so long."""
    spread = 2 * abs(arc.m) * arc.bounds(0.0)[0] * SLACK
    goal, drift, pull = upper + spread, arc.drift, arc.pull
    if pull < 0 or (pull == 0 and drift < 0):
        goal, drift, pull = spread - lower, -drift, -pull
    if pull == 0:
        return min(goal / drift * SLACK, LONGEST) if drift > 0 else LONGEST
    root = sqrt(drift**2 + 2 * pull * goal)
    return min((2 * goal / (drift + root) if drift > 0 else (root - drift) / pull) * SLACK, LONGEST)


def _search(arc: Arc, lower: float, upper: float, begin: float, end: float) -> Exit | None:
    """The first exit between two times, piece by piece."""
    start, value = begin, arc.turned(begin)
    for stop in chain(_turns(arc, begin, end), [end]):
        there = arc.turned(stop)
        if there >= upper or there <= lower:
            boundary, direction = (upper, 1) if there >= upper else (lower, -1)
            return Exit(_root(_less(arc.turned, boundary), start, stop, value - boundary, there - boundary), direction)
        start, value = stop, there
    return None


def _turns(arc: Arc, begin: float, end: float) -> Iterator[float]:
    """Zeros of theta' between two times."""
    swing = abs(arc.m) * arc.bounds(begin)[1]
    slowest = min(arc.drift + arc.pull * begin, arc.drift + arc.pull * end, key=abs)
    if abs(slowest) > swing and arc.drift * (arc.drift + arc.pull * end) > 0:
        return iter(())
    return _zeros(arc.speed, _bends(arc, begin, end), begin, end)


def _bends(arc: Arc, begin: float, end: float) -> Iterator[float]:
    """Zeros of theta'' between two times."""
    if arc.drive == 0:
        return takewhile(lambda t: t < end, arc.bends(2, begin))
    return _zeros(arc.acceleration, takewhile(lambda t: t < end, arc.bends(3, begin)), begin, end)


def _zeros(f: Callable[[float], float], inner: Iterator[float], begin: float, end: float) -> Iterator[float]:
    """Ascending zeros of f between two times; f is monotone between the times ``inner``."""
    start, value = begin, f(begin)
    for stop in chain(inner, [end]):
        there = f(stop)
        if value * there < 0:
            yield _root(f, start, stop, value, there)
        elif there == 0 and stop < end:
            yield stop
        start, value = stop, there


def _less(f: Callable[[float], float], level: float) -> Callable[[float], float]:
    return lambda t: f(t) - level


def _root(f: Callable[[float], float], a: float, b: float, fa: float, fb: float) -> float:
    """The zero of a monotone f between a and b, to the last digits of t."""
    if fb == 0:
        return b
    if fa * fb >= 0:
        # On the boundary, at rest or as far as rounding can tell, and on its way out.
        return a
    # To the last digit, however early the event: the tolerance is relative only.
    return float(brentq(f, a, b, xtol=1e-300, rtol=8.9e-16, maxiter=500))
