"""Stability of the periodic orbits of gear pairs: monodromy matrices with saltation, multipliers, growth rates.

Order of the coordinates: y = (phi, phi', theta, w = theta'). Where theta crosses a change of stiffness a perturbation
is carried over by the saltation matrix

    S = DR + (F+ - DR F-) e_theta^T/w-

with the derivative DR of the jump and the vector fields F before and after it. On the section theta = 0 three
multipliers remain. Without damping they are 1, mu and 1/mu: the orbits of neighbouring speeds, and the parametric pair,
which is Hill's at no load. With damping and the drive that holds the speed the first one becomes a multiplier of the
mean speed; it is told apart by its share of the energy and of the orbit's change with the speed, which is exactly 1 and
0 for the others without damping.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from gearstab.errors import NotPossible
from gearstab.response.rotating_pair import orbit
from gearstab.response.rotating_pair.history import InitialState
from gearstab.response.rotating_pair.motion import Law, first_exit
from gearstab.response.rotating_pair.orbit import Cycle, PeriodicProblem
from gearstab.rotating_pair import CLASSICAL, ENERGY_CONSERVING, RotatingPair
from gearstab.system import Array

FLAGS = {"no_periodic_orbit": 1024, "speed_unstable": 2048, "speed_coupled": 4096}
"""Bits of ``status``, beside those of Floquet analysis: no orbit with one crossing of each boundary a cycle was found;
the mean speed runs away from it; the multiplier of the mean speed has formed a pair with a parametric one, and the
growth rate is that of all three."""

ON_CIRCLE = 1e-9
"""|trace| - 2 of the parametric pair without damping, relative to the matrix, that rounding may leave."""
SECTION = [0, 1, 3]
"""phi, phi' and theta'."""
AT_ONCE = 20_000
"""Orbits that are computed together."""


@dataclass(frozen=True)
class PairStability:
    """All ``(rows, P)``.

    growth_rate: the largest real part of the two parametric exponents, 1/time. stable: 1, 0, or -1 where there is no
    orbit. status: bits of FLAGS. exponents ``(rows, P, 2)``: the parametric ones, imaginary parts in (-pi/T, pi/T], by
    descending real part. speed_exponent: that of the mean speed; 0 without damping. drive: eta, the unbalanced torque
    over k0 that holds the speed.
    """

    growth_rate: Array
    stable: Array
    status: Array
    exponents: Array
    speed_exponent: Array
    drive: Array


def stability(pair: RotatingPair, mesh_frequency: Array) -> PairStability:
    """Stability of the orbit of mean mesh frequency Omega for every row of a pair.

    pair: of any batch shape, one row for each entry of the flattened batch; rigid kinematic or energy conserving.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``, rad/s: theta turns by 2 pi in 2 pi/Omega.

    Raises ValueError for the classical formulation, whose stability is that of Hill's equation.
    """
    if pair.formulation == CLASSICAL:
        raise ValueError("the classical formulation is a linear system: use Floquet analysis")
    omega = pair.operating_points(mesh_frequency)
    problem = problem_of(pair, omega)
    parts = [np.arange(i, min(i + AT_ONCE, omega.size)) for i in range(0, omega.size, AT_ONCE)]
    found = [_stability(problem.at(index)) for index in parts]
    growth, stable, status, exponents, speed, drive = (np.concatenate(item) for item in zip(*found, strict=True))
    rate = np.broadcast_to(pair.flat(pair.numbers.w0)[:, None], omega.shape)
    return PairStability(
        growth.reshape(omega.shape) * rate,
        stable.reshape(omega.shape),
        status.reshape(omega.shape),
        exponents.reshape(*omega.shape, 2) * rate[..., None],
        speed.reshape(omega.shape) * rate,
        drive.reshape(omega.shape),
    )


def problem_of(pair: RotatingPair, omega: Array) -> PeriodicProblem:
    """The periodic problems of all rows at mesh frequencies ``(rows, P)``, flattened."""
    numbers = pair.numbers

    def flat(values: Array) -> Array:
        return np.ravel(np.broadcast_to(pair.flat(values)[:, None], omega.shape))

    return PeriodicProblem(
        m=flat(numbers.m),
        zeta=flat(numbers.zeta),
        kappa=(flat(numbers.kappa[0]), flat(numbers.kappa[1])),
        single=flat(numbers.single),
        load=flat(numbers.load),
        omega=np.ravel(omega) / flat(numbers.w0),
        impulsive=pair.formulation == ENERGY_CONSERVING,
    )


def saltation(p: PeriodicProblem, region: int, motion: Cycle, eta: Array) -> Array:
    """S of the jump at the end of a region, ``(N, 4, 4)``."""
    derivative, before = motion.jumps[region], motion.legs[region].before
    after = orbit.field_of(p, 1 - region, motion.after[region], eta)
    matrix = derivative.copy()
    matrix[:, :, 2] += (after - np.einsum("nij,nj->ni", derivative, before)) / motion.legs[region].end[:, 3, None]
    return matrix


def monodromy(p: PeriodicProblem, x: Array) -> Array:
    """The monodromy matrix from just after theta = 0 to just after theta = 2 pi, ``(N, 4, 4)``."""
    motion = orbit.cycle(p, x)
    eta = x[:, orbit.DRIVE]
    total = np.broadcast_to(np.eye(4), (len(x), 4, 4))
    for region in (0, 1):
        total = saltation(p, region, motion, eta) @ motion.legs[region].state @ total
    return total


def section_map(p: PeriodicProblem, x: Array) -> Array:
    """The derivative of the return map of the section, in (phi, phi', theta'), ``(N, 3, 3)``."""
    total = monodromy(p, x)
    start = np.stack([x[:, orbit.PHI], x[:, orbit.RATE], np.zeros(len(x)), x[:, orbit.SPEED]], axis=-1)
    flow = orbit.field_of(p, 0, start, x[:, orbit.DRIVE])
    # Back to the section along the flow.
    total = total - flow[:, :, None] * total[:, 2:3, :] / flow[:, 2, None, None]
    return total[:, SECTION][:, :, SECTION]


def _stability(p: PeriodicProblem) -> tuple[Array, ...]:
    x, found = orbit.solve(p)
    found &= monotone(p, x)
    count = len(x)
    growth, exponents = np.full(count, np.nan), np.full((count, 2), np.nan, dtype=complex)
    speed, drive = np.full(count, np.nan), np.full(count, np.nan)
    status = np.where(found, 0, FLAGS["no_periodic_orbit"]).astype(np.int16)
    index = np.flatnonzero(found)
    if index.size:
        q, y = p.at(index), x[index]
        matrix, period = section_map(q, y), tau / q.omega
        logs, own, coupled = multipliers(q, y, matrix)
        exponents[index] = logs / period[:, None]
        growth[index] = exponents[index].real.max(axis=-1)
        speed[index] = np.where(coupled, np.nan, own / period)
        growth[index] = np.where(coupled, np.maximum(growth[index], own / period), growth[index])
        drive[index] = y[:, orbit.DRIVE]
        status[index] |= np.where(coupled, FLAGS["speed_coupled"], 0).astype(np.int16)
        # ln of the multiplier of the speed; without damping 0 but for rounding.
        status[index] |= np.where(own > 1e-9, FLAGS["speed_unstable"], 0).astype(np.int16)
    # Without damping the growth is 0 but for rounding.
    stable = np.where(found, growth <= 1e-10 * p.omega, -1).astype(np.int8)
    return growth, stable, status, exponents, speed, drive


def multipliers(p: PeriodicProblem, x: Array, matrix: Array) -> tuple[Array, Array, Array]:
    """(ln of the parametric pair ``(N, 2)``, ln |multiplier of the speed|, whether that is one of a complex pair)."""
    conservative = p.zeta == 0
    logs = np.empty((len(x), 2), dtype=complex)
    own, coupled = np.zeros(len(x)), np.zeros(len(x), dtype=bool)
    neutral = conservative | (not p.impulsive)
    if neutral.any():
        logs[neutral] = _reciprocal(matrix[neutral], conservative[neutral], p.zeta[neutral] * tau / p.omega[neutral])
    rest = np.flatnonzero(~neutral)
    if rest.size:
        values, vectors = np.linalg.eig(matrix[rest])
        shares = speed_shares(p.at(rest), x[rest], vectors)
        which = np.argmax(np.abs(shares), axis=-1)
        rows = np.arange(rest.size)
        chosen = values[rows, which]
        # An eigenvalue of a real matrix is real or clearly not, but where two are about to meet.
        coupled[rest] = np.abs(chosen.imag) > 1e-12 * np.abs(chosen)
        own[rest] = np.log(np.abs(chosen))
        others = np.stack([values[rows, (which + 1) % 3], values[rows, (which + 2) % 3]], axis=-1).astype(complex)
        with np.errstate(divide="ignore"):
            logs[rest] = np.log(others)
    order = np.argsort(-logs.real, axis=-1, kind="stable")
    return np.take_along_axis(logs, order, axis=-1), own, coupled


def _reciprocal(matrix: Array, conservative: Array, decay: Array) -> Array:
    """ln of the two multipliers beside an exact 1, whose product is exp(-2 zeta T)."""
    half = 0.5 * (np.trace(matrix, axis1=1, axis2=2) - 1) * np.exp(decay)
    size = 1 + np.abs(matrix).max(axis=(1, 2))
    # Conservative: rounding must not open a tongue.
    limit = 1 + np.where(conservative, ON_CIRCLE * size, 0.0)
    inside = np.abs(half) <= limit
    angle = np.arccos(np.clip(half, -1.0, 1.0))
    growth = np.arccosh(np.maximum(np.abs(half), 1.0))
    turn = np.where(half < 0, np.pi, 0.0)
    first = np.where(inside, 1j * angle, growth + 1j * turn)
    second = np.where(inside, -1j * angle, -growth + 1j * turn)
    return np.stack([first, second], axis=-1) - decay[:, None]


def speed_shares(p: PeriodicProblem, x: Array, vectors: Array) -> Array:
    """Return how much of the speed each eigenvector carries: shares that add up to 1, ``(N, 3)``.

    Eigenvector r_i with its left counterpart l_i: (g r_i)(l_i y)/(g y), with the gradient g of the energy on the
    section and the change y of the orbit with the speed. Without damping g and y are themselves the eigenvectors of
    the multiplier 1.
    """
    phi, rate, speed = x[:, orbit.PHI], x[:, orbit.RATE], x[:, orbit.SPEED]
    across = (rate - p.m * speed) / (1 - p.m**2)
    gradient = np.stack([p.kappa[0] * phi - p.load, across, speed - p.m * across], axis=-1)
    _, derivative, motion = orbit.equations(p, x)
    end2 = motion.legs[1].before
    final = np.einsum("nij,nj->ni", motion.jumps[1], end2)
    zero = np.zeros(len(x))
    by_period = np.stack([final[:, 0], final[:, 1], final[:, 3], zero, end2[:, 2]], axis=-1)
    change = np.linalg.solve(derivative, by_period[..., None])[:, :3, 0]
    left = np.linalg.inv(vectors)
    shares = np.einsum("ni,nij->nj", gradient, vectors) * np.einsum("nji,ni->nj", left, change)
    return shares / np.einsum("ni,ni->n", gradient, change)[:, None]


def monotone(p: PeriodicProblem, x: Array) -> Array:
    """Whether theta really crosses each boundary once per cycle and not earlier, ``(N,)``."""
    motion = orbit.cycle(p, x)
    good = np.isfinite(x).all(axis=1) & (x[:, orbit.TIME] > 0) & (x[:, orbit.TIME] < tau / p.omega)
    starts = (np.stack([x[:, 0], x[:, 1], np.zeros(len(x)), x[:, 2]], axis=-1), motion.after[0])
    durations = (x[:, orbit.TIME], tau / p.omega - x[:, orbit.TIME])
    for region in (0, 1):
        start, eta = starts[region], x[:, orbit.DRIVE]
        distance = start[:, 0] - (p.load + p.m * eta) / p.kappa[region]
        swing = np.abs(p.m) * np.sqrt(start[:, 1] ** 2 + p.kappa[region] * distance**2)
        drift = start[:, 3] - p.m * start[:, 1]
        later = drift + (1 - p.m**2) * eta * durations[region]
        # Where theta' cannot vanish nothing needs to be looked at.
        for i in np.flatnonzero(good & (np.minimum(drift, later) <= swing)):
            good[i] = _crosses(p, int(i), region, start[i], durations[region][i], float(eta[i]))
    return good


def _crosses(p: PeriodicProblem, i: int, region: int, start: Array, duration: float, eta: float) -> bool:
    """Whether the first exit from a region is the one that the orbit has."""
    m = float(p.m[i])
    kappa = (float(p.kappa[0][i]), float(p.kappa[1][i]))
    edges = (0.0, float(p.single[i]), tau)
    law = Law(m, float(p.zeta[i]), float(p.load[i]), kappa, edges, m, p.impulsive, eta)
    arc = law.arc(region, (float(start[0]), float(start[1]), 0.0, float(start[3])))
    # The orbit's own exit is at its end: looked for a little beyond, and recognised to Newton's accuracy.
    found = first_exit(arc, 0.0, edges[region + 1] - edges[region], 1.01 * duration)
    return found is not None and found.direction > 0 and abs(found.time - duration) <= 1e-8 * duration


def held(pair: RotatingPair, mesh_frequency: float) -> tuple[InitialState, float]:
    """The state of a single pair on its periodic orbit of mean mesh frequency, just after theta = 0, and the torque.

    The torque (N m) is unbalanced and acts on theta as the ``drive`` of
    :func:`~gearstab.response.rotating_pair.respond`; 0 without damping and in the rigid kinematic formulation.

    Raises NotPossible where no orbit with one crossing of each change of stiffness a cycle was found.
    """
    problem = problem_of(pair, np.array([[float(mesh_frequency)]]))
    x, found = orbit.solve(problem)
    if not (found & monotone(problem, x)).all():
        raise NotPossible("no periodic orbit of this mean speed was found")
    rate = float(pair.numbers.w0)
    phi, phi_dot, theta_dot, _, drive = (float(value) for value in x[0])
    return InitialState(theta_dot * rate, phi, phi_dot * rate), drive * float(pair.numbers.k0)
