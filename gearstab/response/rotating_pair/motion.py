"""The motion of a gear pair between two changes of its mesh stiffness, written down.

In units of 1/w0 for time and of k0 for stiffness, with F = phi_s - kappa phi - 2 zeta phi':

    phi'' = F + m eta,        theta'' = m F + eta

Damping acts in both equations, so that it takes energy and never gives any (Oh, Grosh & Barber 2005 print it in the
first one only). eta is an unbalanced torque on the mean rotation, over k0; 0 for the balanced torques of the paper.
phi is a damped sinusoid, and theta = theta_0 + m (phi - phi_0) + (theta_0' - m phi_0') t + (1 - m^2) eta t^2/2.

The motion ends where the rotation first leaves the region of its stiffness. theta is monotone between zeros of theta',
theta' between zeros of theta'', and so on down to a derivative whose zeros can be written down: no crossing can be
missed, however short the gear stays beyond the boundary.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, takewhile
from math import atan2, atanh, copysign, cos, cosh, exp, expm1, floor, inf, pi, sin, sinh, sqrt, tau
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearstab.rotating_pair import CLASSICAL, ENERGY_CONSERVING, RotatingPair
from gearstab.system import Array

State = tuple[float, float, float, float]
"""phi, phi', theta, theta'."""


def free_basis(t: Array, kappa: Array, zeta: Array) -> tuple[Array, Array, Array]:
    """S, C = S', U = int S dt with S'' + 2 zeta S' + kappa S = 0, S(0) = 0, S'(0) = 1, of arrays that broadcast."""
    w = np.sqrt(np.abs(kappa - zeta**2))
    oscillates = kappa > zeta**2
    decay = np.exp(-zeta * t)
    # Beyond the critical damping both exponentials together, neither of which grows.
    slow, fast = np.exp(np.minimum(w - zeta, 0.0) * t), np.exp(-(w + zeta) * t)
    s = np.where(oscillates, decay * t * np.sinc(w * t / np.pi), 0.0)
    c = np.where(oscillates, decay * np.cos(w * t), 0.5 * (slow + fast))
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(oscillates, s, np.where(w > 0, 0.5 * (slow - fast) / w, t * decay))
    below = np.where(oscillates, -np.expm1(-zeta * t) + 2 * decay * np.sin(0.5 * w * t) ** 2, 1 - c)
    return s, c - zeta * s, (below - zeta * s) / kappa


@dataclass(frozen=True)
class Arc:
    """A piece of motion with constant stiffness.

    start: the state at t = 0. kappa: k/k0. zeta: damping ratio. load: phi_s. m: M1/M2, by which theta follows phi; 0
    lets theta advance uniformly, as the classical formulation has it. drive: eta.
    """

    start: State
    kappa: float
    zeta: float
    load: float
    m: float
    drive: float = 0.0

    @property
    def discriminant(self) -> float:
        """kappa - zeta^2: positive for an oscillation."""
        return self.kappa - self.zeta**2

    @property
    def drift(self) -> float:
        """theta' - m phi' at the beginning: the speed at which theta advances on average."""
        return self.start[3] - self.m * self.start[1]

    @property
    def rest(self) -> float:
        """phi_s + m eta - kappa phi_0, the acceleration at the beginning but for damping."""
        return self.load + self.m * self.drive - self.kappa * self.start[0]

    @property
    def pull(self) -> float:
        """(1 - m^2) eta, the constant part of theta''."""
        return (1 - self.m**2) * self.drive

    def basis(self, t: float) -> tuple[float, float, float]:
        """S, C = S', U = int S dt with S'' + 2 zeta S' + kappa S = 0, S(0) = 0, S'(0) = 1."""
        z, d = self.zeta, self.discriminant
        if d > 0:
            w, decay = sqrt(d), exp(-z * t)
            s, c = decay * sin(w * t) / w, decay * cos(w * t)
            below = -expm1(-z * t) + 2 * decay * sin(0.5 * w * t) ** 2
        elif d < 0:
            w = sqrt(-d)
            if w * t < 1:
                decay = exp(-z * t)
                s, c = decay * sinh(w * t) / w, decay * cosh(w * t)
                below = -expm1(-z * t) - 2 * decay * sinh(0.5 * w * t) ** 2
            else:
                slow, fast = exp((w - z) * t), exp(-(w + z) * t)
                s, c = 0.5 * (slow - fast) / w, 0.5 * (slow + fast)
                below = 1 - c
        else:
            c = exp(-z * t)
            s, below = t * c, -expm1(-z * t)
        return s, c - z * s, (below - z * s) / self.kappa

    def at(self, t: float) -> State:
        """The state at a time."""
        phi, rate, theta, speed = self.start
        s, c, u = self.basis(t)
        step, new_rate = rate * s + self.rest * u, rate * c + self.rest * s
        advance = self.m * (step - rate * t) + speed * t + 0.5 * self.pull * t * t
        return phi + step, new_rate, theta + advance, speed + self.m * (new_rate - rate) + self.pull * t

    def turned(self, t: float) -> float:
        """theta - theta_0, which keeps its digits however long the gears have rotated."""
        rate = self.start[1]
        s, _, u = self.basis(t)
        return self.m * (rate * (s - t) + self.rest * u) + self.start[3] * t + 0.5 * self.pull * t * t

    def speed(self, t: float) -> float:
        """theta'."""
        s, c, _ = self.basis(t)
        rate = self.start[1]
        return self.start[3] + self.m * (rate * (c - 1) + self.rest * s) + self.pull * t

    def acceleration(self, t: float) -> float:
        """theta''."""
        s, c, _ = self.basis(t)
        return self.m * (self.bend * c - self.kappa * self.start[1] * s) + self.pull

    @property
    def bend(self) -> float:
        """phi'' at the beginning."""
        return self.rest - 2 * self.zeta * self.start[1]

    def samples(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """The states at many times."""
        phi, rate, theta, speed = self.start
        s, c, u = free_basis(times, np.asarray(self.kappa), np.asarray(self.zeta))
        step, change = rate * s + self.rest * u, rate * (c - 1) + self.rest * s
        advance = self.m * (step - rate * times) + speed * times + 0.5 * self.pull * times**2
        return phi + step, rate + change, theta + advance, speed + self.m * change + self.pull * times

    def bounds(self, t: float) -> tuple[float, float]:
        """Bounds that |phi - its equilibrium| and |phi'| do not exceed from t on; both infinite without an oscillation.

        The energy phi'^2 + kappa (phi - equilibrium)^2 never grows.
        """
        phi, rate, _, _ = self.at(t)
        distance = phi - (self.load + self.m * self.drive) / self.kappa
        energy = rate**2 + self.kappa * distance**2
        return sqrt(energy / self.kappa), sqrt(energy)

    def bends(self, order: int, after: float = 0.0) -> Iterator[float]:
        """Ascending times t > ``after`` at which the derivative of phi of this order, 2 or 3, vanishes.

        The derivatives obey the equation of a free oscillation, so x(t) = x_0 C + (x_0' + 2 zeta x_0) S.
        """
        if order == 2:
            value, slope = self.bend, -self.kappa * self.start[1]
        else:
            value, slope = -2 * self.zeta * self.bend - self.kappa * self.start[1], -self.kappa * self.bend
        if value == 0 and slope == 0:
            return
        # x = exp(-zeta t) (value cos w t + sine sin(w t)/w), or the same with cosh and sinh.
        sine, d = slope - self.zeta * value, self.discriminant
        w = sqrt(abs(d))
        if d > 0:
            first = atan2(-value * w, sine) % pi
            count = max(floor((after * w - first) / pi), 0)
            for number in itertools.count(count):
                if (time := (first + number * pi) / w) > after:
                    yield time
            return
        ratio = -value / sine if sine else 0.0
        if d == 0 or abs(ratio * w) < 1:
            time = ratio if d == 0 else atanh(ratio * w) / w
            if time > after:
                yield time


@dataclass(frozen=True)
class Law:
    """The equations of one pair in units of 1/w0 and k0: see :class:`~gearstab.response.rotating_pair.motion.Arc`.

    kappa: k/k0 with one and with two pairs in contact. edges: where in a mesh cycle each of them begins, and 2 pi.
    follows: by how much theta follows phi, m but for the classical formulation. impulsive: whether a change of
    stiffness takes or gives kinetic energy.
    """

    m: float
    zeta: float
    load: float
    kappa: tuple[float, float]
    edges: tuple[float, float, float]
    follows: float
    impulsive: bool
    drive: float = 0.0

    def arc(self, region: int, start: State) -> Arc:
        """The motion from a state on, with one (region 0) or two pairs (1) in contact."""
        return Arc(start, self.kappa[region], self.zeta, self.load, self.follows, self.drive)

    def energy(self, region: int, state: State) -> float:
        """M2 U/w0^2 = (phi' - m theta')^2/(1 - m^2) + theta'^2 + kappa phi^2 - 2 phi_s phi."""
        phi, rate, _, speed = state
        kinetic = (rate - self.m * speed) ** 2 / (1 - self.m**2) + speed**2
        return kinetic + self.kappa[region] * phi**2 - 2 * self.load * phi

    @property
    def soft(self) -> int:
        """The region of the lower stiffness."""
        return 0 if self.kappa[0] <= self.kappa[1] else 1

    @property
    def pass_energy(self) -> float:
        """The least energy with which the gears can get from the softer into the stiffer region.

        At the boundary theta'^2 must exceed dkappa phi^2, so that the energy exceeds kappa phi^2 - 2 phi_s phi with the
        greater kappa, which is nowhere below -phi_s^2/kappa.
        """
        return -(self.load**2) / max(self.kappa)

    def cross(self, region: int, state: State, direction: int) -> tuple[float, float, bool]:
        """(phi', theta', whether it passes) after theta has met the boundary of a region in a direction.

        With dk = k_after - k_before at fixed theta and phi: theta'^2 falls by M2 dk phi^2, phi' changes by m times as
        much as theta', and the kinetic energy by exactly -dk phi^2 (Oh, Grosh & Barber 2005, (9) and (11)). Where
        theta'^2 is too small for that the gears are reflected: theta' -> -theta', phi' -> phi' - 2 m theta'.
        """
        phi, rate, _, speed = state
        if not self.impulsive:
            return rate, speed, True
        change = self.kappa[1 - region] - self.kappa[region]
        squared = speed**2 - change * phi**2
        if squared <= 0 and change * phi**2 > 0:
            return rate - 2 * self.m * speed, -speed, False
        after = copysign(sqrt(squared), direction)
        # The difference of two nearly equal speeds, without cancellation.
        step = -change * phi**2 / (after + speed) if after * speed > 0 else after - speed
        return rate + self.m * step, after, True


def law_of(pair: RotatingPair, drive: float = 0.0) -> Law:
    """The equations of a single pair (no batch). Raises ValueError for a batch."""
    numbers = pair.numbers
    if numbers.batch != ():
        raise ValueError(f"a time response needs a single system, not a batch of shape {numbers.batch}")
    m = float(numbers.m)
    return Law(
        m=m,
        zeta=float(numbers.zeta),
        load=float(numbers.load),
        kappa=(float(numbers.kappa[0]), float(numbers.kappa[1])),
        edges=(0.0, float(numbers.single), tau),
        follows=0.0 if pair.formulation == CLASSICAL else m,
        impulsive=pair.formulation == ENERGY_CONSERVING,
        drive=drive,
    )


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
            time = _root(arc.turned, start, stop, value - boundary, there - boundary, boundary)
            return Exit(time, direction)
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


def _root(f: Callable[[float], float], a: float, b: float, fa: float, fb: float, level: float = 0.0) -> float:
    """Where a monotone f meets a level between a and b, to the last digits of t; fa, fb: f less the level there."""
    if fb == 0:
        return b
    if fa * fb >= 0:
        # On the boundary, at rest or as far as rounding can tell, and on its way out.
        return a
    # To the last digit, however early the event: the tolerance is relative only.
    return float(brentq(lambda t: f(t) - level, a, b, xtol=1e-300, rtol=8.9e-16, maxiter=500))
