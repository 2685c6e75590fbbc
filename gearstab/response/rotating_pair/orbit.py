"""Periodic orbits of gear pairs by shooting on the section theta = 0, many at once.

In units of 1/w0 and k0 the unknowns are x = (phi, phi', theta', t1, eta): the state just after the crossing of
theta = 0, how long one pair of teeth is in contact, and the drive eta that holds the mean speed against the damping
(4 pi eta is the loss of a cycle over k0; without damping it comes out 0). The equations are that theta reaches both
boundaries in time and that the state comes back after T = 2 pi/Omega. Newton's method with exact derivatives follows
the orbit from the uniform rotation at phi_s = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tau

import numpy as np

from gearstab.response.rotating_pair.integrate import field, flow, jump_derivative
from gearstab.response.rotating_pair.motion import free_basis
from gearstab.system import Array

PHI, RATE, SPEED, TIME, DRIVE = range(5)

CLOSE = 1e-8
"""Relative Newton step below which one more step reaches rounding accuracy."""
STEPS = 12
"""Newton steps for one load."""
SMALLEST = 2.0**-16
"""Least part of the whole load by which an orbit must still be able to go on."""
NEAR = 0.2
"""How far a corrector may go from the predicted orbit, relative to the step: farther leads to another orbit."""
FINE = 1e-9
"""A correction so small, relative to the orbit, is always near."""


@dataclass(frozen=True)
class PeriodicProblem:
    """N periodic problems, ``(N,)`` each: m, zeta, kappa with one and two pairs, the angle of single contact, the load
    phi_s and the mesh frequency over w0. impulsive: whether changes of stiffness take kinetic energy.
    """

    m: Array
    zeta: Array
    kappa: tuple[Array, Array]
    single: Array
    load: Array
    omega: Array
    impulsive: bool

    def at(self, index: Array) -> PeriodicProblem:
        """Some of them."""
        own = {name: getattr(self, name)[index] for name in ("m", "zeta", "single", "load", "omega")}
        return replace(self, kappa=(self.kappa[0][index], self.kappa[1][index]), **own)

    def loaded(self, part: Array) -> PeriodicProblem:
        """Return the pair with a part of the load."""
        return replace(self, load=part * self.load)


@dataclass(frozen=True)
class Leg:
    """The motion of N pairs with one stiffness, and what it depends on.

    end: ``(N, 4)``, the state (phi, phi', advance of theta, theta') when it ends. state, drive: ``(N, 4, 4)`` and
    ``(N, 4)``, the derivatives of the end by the state at the beginning and by eta. before: ``(N, 4)``, the vector
    field at the end.
    """

    end: Array
    state: Array
    drive: Array
    before: Array


def leg(p: PeriodicProblem, region: int, start: Array, duration: Array, eta: Array) -> Leg:
    """Motion from ``start (N, 4)`` for a duration; theta counts from the start."""
    m, kappa, t = p.m, p.kappa[region], duration
    s, c, u = basis = free_basis(t, kappa, p.zeta)
    phi, rate, speed = start[:, 0], start[:, 1], start[:, 3]
    rest = p.load + m * eta - kappa * phi
    free = 1 - m**2
    step, change = rate * s + rest * u, rate * (c - 1) + rest * s
    end = np.stack(
        [phi + step, rate + change, m * (step - rate * t) + speed * t + 0.5 * free * eta * t**2,
         speed + m * change + free * eta * t], axis=-1
    )  # fmt: skip
    drive = np.stack([m * u, m * s, m**2 * u + 0.5 * free * t**2, m**2 * s + free * t], axis=-1)
    return Leg(end, flow(m, kappa, t, basis), drive, field_of(p, region, end, eta))


def field_of(p: PeriodicProblem, region: int, state: Array, eta: Array) -> Array:
    """The vector field in a region, ``(N, 4)``."""
    return field(p.m, p.zeta, p.load, p.kappa[region], state, eta)


def jump(p: PeriodicProblem, region: int, before: Array) -> tuple[Array, Array]:
    """The state after leaving a region forwards, theta counted anew, and its derivative DR ``(N, 4, 4)``.

    NaN where the gears would be reflected.
    """
    after = before.copy()
    after[:, 2] = 0.0
    if not p.impulsive:
        return after, np.broadcast_to(np.eye(4), (len(before), 4, 4))
    change = p.kappa[1 - region] - p.kappa[region]
    phi, speed = before[:, 0], before[:, 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        new = np.sqrt(speed**2 - change * phi**2)
        # Without the cancellation of two nearly equal speeds.
        step = -change * phi**2 / (new + speed)
    after[:, 1] += p.m * step
    after[:, 3] = speed + step
    return after, jump_derivative(p.m, change, before, new)


@dataclass(frozen=True)
class Cycle:
    """One mesh cycle from the section on: both legs, the states after both jumps and their derivatives."""

    legs: tuple[Leg, Leg]
    after: tuple[Array, Array]
    jumps: tuple[Array, Array]


def cycle(p: PeriodicProblem, x: Array) -> Cycle:
    """The motion of unknowns ``(N, 5)`` through one mesh cycle."""
    start = np.stack([x[:, PHI], x[:, RATE], np.zeros(len(x)), x[:, SPEED]], axis=-1)
    first = leg(p, 0, start, x[:, TIME], x[:, DRIVE])
    middle, jump1 = jump(p, 0, first.end)
    second = leg(p, 1, middle, tau / p.omega - x[:, TIME], x[:, DRIVE])
    last, jump2 = jump(p, 1, second.end)
    return Cycle((first, second), (middle, last), (jump1, jump2))


def equations(p: PeriodicProblem, x: Array) -> tuple[Array, Array, Cycle]:
    """Residuals ``(N, 5)``, their derivatives ``(N, 5, 5)`` and the motion."""
    found = cycle(p, x)
    (first, second), (_, last), (jump1, jump2) = found.legs, found.after, found.jumps
    # The start depends on x[0:3] as (phi, phi', theta').
    begin = np.zeros((len(x), 4, 5))
    begin[:, 0, PHI] = begin[:, 1, RATE] = begin[:, 3, SPEED] = 1.0
    end1 = first.state @ begin
    end1[:, :, TIME] += first.before
    end1[:, :, DRIVE] += first.drive
    middle = jump1 @ end1
    middle[:, 2] = 0.0
    end2 = second.state @ middle
    end2[:, :, TIME] -= second.before
    end2[:, :, DRIVE] += second.drive
    final = jump2 @ end2
    residual = np.stack(
        [last[:, 0] - x[:, PHI], last[:, 1] - x[:, RATE], last[:, 3] - x[:, SPEED],
         first.end[:, 2] - p.single, second.end[:, 2] - (tau - p.single)], axis=-1
    )  # fmt: skip
    rows = [final[:, 0] - begin[:, 0], final[:, 1] - begin[:, 1], final[:, 3] - begin[:, 3], end1[:, 2], end2[:, 2]]
    return residual, np.stack(rows, axis=-2), found


def uniform(p: PeriodicProblem) -> Array:
    """The orbit without load: phi = 0 and theta' = Omega."""
    zero = np.zeros_like(p.omega)
    return np.stack([zero, zero, p.omega, p.single / p.omega, zero], axis=-1)


def scale(p: PeriodicProblem) -> Array:
    """``(N, 5)``: sizes of the unknowns, to measure changes by."""
    load = np.maximum(np.abs(p.load), 1e-300)  # without load the division by it must not fail
    # A drive of Omega/T changes the speed by itself within a cycle.
    return np.stack([load, load, p.omega, p.single / p.omega, p.omega**2 / tau], axis=-1)


def solve(problem: PeriodicProblem) -> tuple[Array, Array]:
    """Periodic orbits: the unknowns ``(N, 5)`` and whether each was found.

    Every orbit is followed from no load to the whole one in steps of its own, halved where Newton's method does not
    converge near what the step before predicts and doubled where it does.
    """
    x, slope = uniform(problem), None
    done, size = np.zeros(len(x)), np.ones(len(x))
    slope = _slope(problem, x, done)
    active = np.flatnonzero(problem.load != 0)
    done[problem.load == 0] = 1.0
    while active.size:
        p, part = problem.at(active), np.minimum(done[active] + size[active], 1.0)
        predicted = x[active] + slope[active] * (part - done[active])[:, None]
        found, good = newton(p.loaded(part), predicted)
        moved = np.abs((found - predicted) / scale(p)).max(axis=-1)
        step = np.abs((predicted - x[active]) / scale(p)).max(axis=-1)
        good &= moved <= np.maximum(NEAR * step, FINE)
        won, lost = active[good], active[~good]
        x[won], done[won], size[won] = found[good], part[good], 2 * size[won]
        size[lost] /= 2
        going = won[done[won] < 1]
        if going.size:
            slope[going] = _slope(problem.at(going), x[going], done[going])
        active = np.sort(np.concatenate([going, lost[size[lost] >= SMALLEST]]))
    return x, done >= 1


def newton(p: PeriodicProblem, x: Array) -> tuple[Array, Array]:
    """Newton's method from a guess ``(N, 5)``; where it converged."""
    x = x.copy()
    good, close = np.zeros(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    size = scale(p)
    active = np.arange(len(x))
    for _ in range(STEPS):
        q = p.at(active)
        residual, derivative, _ = equations(q, x[active])
        step, solvable = _solved(derivative, -residual)
        x[active] += step
        change = np.abs(step / size[active]).max(axis=-1) / np.maximum(
            1.0, np.abs(x[active] / size[active]).max(axis=-1)
        )
        timely = (x[active, TIME] > 0) & (x[active, TIME] < tau / q.omega)
        sound = solvable & timely & (change < 1e6)  # a larger step leads nowhere
        good[active[sound & close[active]]] = True
        going = sound & ~close[active]
        close[active] = change <= CLOSE
        active = active[going]
        if not active.size:
            break
    return x, good


def _slope(p: PeriodicProblem, x: Array, part: Array) -> Array:
    """dx/d(part of the load), ``(N, 5)``; 0 where the orbit is at a fold."""
    _, derivative, found = equations(p.loaded(part), x)
    second, (jump1, jump2) = found.legs[1], found.jumps
    # The load acts on phi as the drive acts through m.
    by_load = [_by_load(p, 0, x[:, TIME]), _by_load(p, 1, tau / p.omega - x[:, TIME])]
    end1 = by_load[0]
    middle = np.einsum("nij,nj->ni", jump1, end1)
    middle[:, 2] = 0.0
    end2 = np.einsum("nij,nj->ni", second.state, middle) + by_load[1]
    final = np.einsum("nij,nj->ni", jump2, end2)
    by_part = np.stack([final[:, 0], final[:, 1], final[:, 3], end1[:, 2], end2[:, 2]], axis=-1) * p.load[:, None]
    return _solved(derivative, -by_part)[0]


def _by_load(p: PeriodicProblem, region: int, t: Array) -> Array:
    """The derivative of the end of a leg by phi_s, ``(N, 4)``."""
    s, _, u = free_basis(t, p.kappa[region], p.zeta)
    return np.stack([u, s, p.m * u, p.m * s], axis=-1)


def _solved(matrix: Array, right: Array) -> tuple[Array, Array]:
    """The solutions of small systems, 0 where there is none, and where there is one."""
    # Rows and columns of very different sizes: LAPACK calls nothing singular but exact zeros.
    good = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    safe = np.where(good[:, None, None], matrix, np.eye(matrix.shape[-1]))
    try:
        found = np.linalg.solve(safe, np.where(good[:, None], right, 0.0)[..., None])[..., 0]
    except np.linalg.LinAlgError:
        found = np.stack([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(safe, right, strict=True)])
    good &= np.isfinite(found).all(axis=1)
    return np.where(good[:, None], found, 0.0), good
