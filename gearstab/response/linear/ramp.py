"""The motion of a driven system while its speed changes: a run-up or a coast-down.

With theta(t) the phase of the first mesh, Omega = theta', and tau = theta/(2 pi N) in common periods,

    x' = A(tau) x + B(t),    B = inlet [F_0(tau) + Omega(t) F_1] z(tau)

(:mod:`gearstab.linear.first_order`, :mod:`gearstab.response.linear.excitation`). Between the jumps of the mesh
stiffness A is constant: by its eigenvectors A = X L X^-1 a step h takes y = X^-1 x to

    exp(L h) y + int_0^h exp(L (h - s)) X^-1 B(t + s) ds,

exactly where B is constant, and by Gauss-Legendre quadrature of three nodes where it varies, with steps so short that
the quadrature's error is some 1e-9 of what it adds. Smooth waves, and generators with nearly parallel eigenvectors,
take sixth-order Magnus steps of [[A, B], [0, 0]].

The speed is given: the torque that accelerates the train is no part of the motion, nor are rigid-body motions that
nothing holds back. Teeth stay in contact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, tau

import numpy as np

from gearstab.errors import NotPossible
from gearstab.linear import magnus
from gearstab.linear.eigen import Eigen, diagonalised, divided_exponential
from gearstab.linear.first_order import Basis, bases
from gearstab.linear.path import Path
from gearstab.response.linear.equilibrium import static_equilibrium, static_mesh_force
from gearstab.response.linear.excitation import Excitation, excitation
from gearstab.response.linear.history import RESPONSE_FLAGS, separated
from gearstab.system import Array, GearSystem

REACH, MAGNUS_REACH = 0.5, 0.25
"""Longest step of the quadrature, and of Magnus, in units of the fastest rate: the error goes as its seventh power."""
NODES, WEIGHTS = magnus.NODES, np.array([5.0, 8.0, 5.0]) / 18
AT_ONCE = 1 << 14
"""Steps that are prepared together."""
MOST_STEPS = 20_000_000


@dataclass(frozen=True)
class RampResponse:
    """The history of a run-up or coast-down.

    time: ``(samples,)``, from 0 in equal steps. mesh_frequency: ``(samples,)``, Omega(t).
    displacement, velocity: ``(samples, n)``, without rigid-body motion.
    mesh_deflection, mesh_force: ``(samples, meshes)``, g_i^T q and k_i (g_i^T q - e_i).
    flags: bits of :data:`~gearstab.response.linear.history.RESPONSE_FLAGS`.
    """

    time: Array
    mesh_frequency: Array
    displacement: Array
    velocity: Array
    mesh_deflection: Array
    mesh_force: Array
    flags: int

    @property
    def overflowed(self) -> bool:
        """Whether the history ends because it outgrew double precision."""
        return bool(self.flags & RESPONSE_FLAGS["overflow"])

    @property
    def separated(self) -> bool:
        """Whether the force of a loaded mesh changes its sign, where teeth would part."""
        return bool(self.flags & RESPONSE_FLAGS["separation"])


@dataclass(frozen=True)
class Moving:
    """A single system along a path. period: N, turns of the first mesh in a common period."""

    drive: Excitation
    basis: Basis
    path: Path

    @property
    def period(self) -> float:
        """Radians of the first mesh in a common period."""
        return tau * self.drive.cycles

    def functions(self, part: Array) -> Array:
        """``(X, J)``, what varies at parts of the common period."""
        return self.drive.varying(part[None])[0]

    def push(self, values: Array, time: Array) -> Array:
        """B ``(X, m)`` in units of the basis, for what varies ``(X, J)``, at times ``(X,)``."""
        phase, speed = self.path.phase_at(time), self.path.speed_at(time)
        force = self.drive.force(values[:, None])[:, 0] + speed[:, None, None] * self.drive.force_of_rates[0]
        return np.asarray(np.einsum("mn,xnl,xl->xm", self.basis.inlet[0], force, self.drive.z(phase / self.period)))

    @property
    def pushed_evenly(self) -> bool:
        """Whether B is constant while what varies is."""
        return self.drive.exact and self.drive.width == 1

    def state(self, displacement: Array, velocity: Array, mass: Array) -> Array:
        """x ``(m,)`` from q and dq/dt ``(n,)``: by the mass matrix, as the modes are orthogonal by it."""
        rate = float(self.basis.rate[0])
        modes = self.basis.inlet[0] * rate**2
        n = int(np.count_nonzero(np.abs(self.basis.outlet[0]).max(axis=0)))
        weight = np.diagonal(self.basis.constant[0, :n, n : 2 * n])
        x = modes @ mass @ velocity / rate
        x[:n] = weight * (modes[n : 2 * n] @ mass @ displacement)
        return np.asarray(x)


@dataclass(frozen=True)
class Steps:
    """Steps that follow one another: begin, duration, middle ``(S,)``, times, and in which part of the period.

    kept: ``(S,)``, whether a sample lies at the end of the step.
    """

    begin: Array
    duration: Array
    part: Array
    kept: Array

    def nodes(self) -> Array:
        """``(S, 3)``, the times of the nodes."""
        return self.begin[:, None] + self.duration[:, None] * NODES


def ramp_response(
    system: GearSystem, path: Path, samples_per_cycle: int = 200, start: tuple[Array, Array] | None = None
) -> RampResponse:
    """Compute the response to load, forces and transmission errors while the mesh frequency follows a path.

    Parameters
    ----------
    system: a single system without backlash that has a common period.
    path: the mesh frequency over time.
    samples_per_cycle: equal steps in the shortest period of the first mesh.
    start: q and dq/dt ``(n,)`` at t = 0; static equilibrium at rest without.

    Raises
    ------
    ValueError: a batch of systems.
    NotPossible: no common period, or a path of more than 20 million steps.
    """
    if system.batch != ():
        raise ValueError(f"a time response needs a single system, not a batch of shape {system.batch}")
    moving = Moving(excitation(system), next(bases(system)), path)
    ratio = float(system.meshes[0].frequency_ratio)
    step = tau / (path.range[1] * ratio * samples_per_cycle)
    steps = path.time[-1] * (1 / step + 1 / longest_step(moving))
    if steps > MOST_STEPS:
        remedy = "raise the rate, or narrow the range of speeds"
        raise NotPossible(f"the ramp takes {steps:.2g} steps of integration, more than {MOST_STEPS:.2g}", remedy)
    time = np.arange(int(np.floor(path.time[-1] / step * (1 + 1e-12))) + 1) * step
    q0, v0 = (static_equilibrium(system), np.zeros(system.size)) if start is None else start
    with np.errstate(over="ignore", invalid="ignore"):
        x = _followed(moving, time, moving.state(q0, v0, np.asarray(system.mass)))
        q, v = x @ moving.basis.outlet[0].T, x @ moving.basis.speed[0].T
        deflection = np.stack([q @ np.asarray(mesh.direction) for mesh in system.meshes], axis=-1)
        stiffness, errors = _momentary(moving, time)
        force = stiffness * (deflection - errors)
    finite = np.isfinite(force).all(axis=1) & np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
    kept = len(time) if finite.all() else int(np.argmin(finite))
    flags = RESPONSE_FLAGS["overflow"] * (kept < len(time))
    flags |= RESPONSE_FLAGS["separation"] * bool(np.any(separated(force[:kept], static_mesh_force(system))))
    speed = path.speed_at(time)
    return RampResponse(time[:kept], speed[:kept], q[:kept], v[:kept], deflection[:kept], force[:kept], flags)


def _momentary(moving: Moving, time: Array) -> tuple[Array, Array]:
    """``(samples, meshes)``, the mesh stiffnesses, just after a jump on one, and the transmission errors."""
    part = moving.path.phase_at(time) / moving.period
    edges = moving.drive.schedule.edges[0]
    inside = part - np.floor(part)
    if moving.drive.exact:
        k = np.clip(np.searchsorted(edges, inside + 1e-12, side="right") - 1, 0, len(edges) - 2)
        inside = 0.5 * (edges[k] + edges[k + 1])
    stiffness = moving.drive.split(moving.functions(inside))[0]
    return stiffness, moving.drive.z(part) @ moving.drive.errors[0].T


def _followed(moving: Moving, time: Array, start: Array) -> Array:
    """x ``(samples, m)`` at all samples."""
    found = np.empty((len(time), len(start)))
    found[0], x, done = start, start, 1
    advance = _Spectral(moving) if moving.drive.exact else None
    for steps in _steps(moving, time):
        known = None if advance is None else advance.through(steps, x)
        states = _by_magnus(moving, steps, x) if known is None else known
        x = states[-1]
        kept = states[steps.kept]
        found[done : done + len(kept)] = kept
        done += len(kept)
    return found


def _steps(moving: Moving, time: Array) -> Iterator[Steps]:
    """Yield steps from sample to sample and from jump to jump, none longer than the reach."""
    path, edges = moving.path, moving.drive.schedule.edges[0]
    edges = np.append(edges[:-1][np.diff(edges) > 0], 1.0)
    each = len(edges) - 1
    longest = longest_step(moving)
    ends = path.phase_at(time) / moving.period
    # So many samples at once that there are about AT_ONCE steps.
    jumps = each * (ends[-1] - ends[0]) / max(1, len(time) - 1)
    finer = ceil((time[1] - time[0]) / longest) if len(time) > 1 else 1
    some = max(1, int(AT_ONCE / (finer + jumps + 1)))
    for first in range(0, len(time) - 1, some):
        own = time[first : first + some + 1]
        low, high = ends[first], ends[first + len(own) - 1]
        turn = np.arange(np.floor(low), np.ceil(high) + 1)
        jump = (turn[:, None] + edges[:-1]).ravel()
        jump = jump[(jump > low) & (jump < high)]
        moments = path.moment(jump * moving.period)
        knots = np.concatenate([own, np.clip(moments, own[0], own[-1])])
        order = np.argsort(knots, kind="stable")
        knots, sample = knots[order], order < len(own)
        pieces = np.maximum(1, np.ceil(np.diff(knots) / longest)).astype(int)
        begin = np.repeat(knots[:-1], pieces)
        duration = np.repeat(np.diff(knots) / pieces, pieces)
        number = np.arange(len(begin)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        begin = begin + number * duration
        last = number == np.repeat(pieces, pieces) - 1
        kept = last & np.repeat(sample[1:], pieces)
        # The middle of a step tells its interval; that of one without length does not matter.
        middle = path.phase_at(begin + 0.5 * duration) / moving.period
        yield Steps(begin, duration, middle - np.floor(middle), kept)


def longest_step(moving: Moving) -> float:
    """Return the longest step, in time; infinite where none is too long."""
    if moving.pushed_evenly:
        return np.inf
    rate = float(moving.basis.rate[0])
    tau_ = np.linspace(0.0, 1.0, 65)[:-1] + 1 / 128
    generators = moving.basis.generator(moving.drive.split(moving.functions(tau_))[1][:, None])[:, 0]
    own = rate * np.abs(np.linalg.eigvals(generators)).max(initial=0.0)
    turns = max([*moving.drive.harmonics, 0.0], default=0.0)
    waves = 0 if moving.drive.exact else 4 * max(source.cycles for source in moving.drive.schedule.found)
    forced = max(turns, waves) * moving.path.range[1] / moving.drive.cycles
    return (REACH if moving.drive.exact else MAGNUS_REACH) / (own + forced)


class _Spectral:
    """Steps by the eigenvectors of every generator that occurs."""

    def __init__(self, moving: Moving) -> None:
        self.moving = moving
        edges = moving.drive.schedule.edges[0]
        self.edges = np.append(edges[:-1][np.diff(edges) > 0], 1.0)
        values = moving.functions(0.5 * (self.edges[1:] + self.edges[:-1]))
        self.values, self.state = np.unique(values, axis=0, return_inverse=True)
        self.state = self.state.ravel()
        inner = moving.drive.split(self.values)[1]
        self.eigen: Eigen | None = diagonalised(moving.basis.generator(inner[:, None])[:, 0])

    def through(self, steps: Steps, x: Array) -> Array | None:
        """Return x at the end of every step, ``(S, m)``; None where eigenvectors are nearly parallel."""
        if self.eigen is None:
            return None
        place = np.clip(np.searchsorted(self.edges, steps.part, side="right") - 1, 0, len(self.edges) - 2)
        state = self.state[place]
        growth = self.eigen.values[state] * (steps.duration * float(self.moving.basis.rate[0]))[:, None]
        push = self._push(steps, state, growth)
        factor = np.exp(growth)
        result = np.empty((len(state), len(x)))
        runs = np.flatnonzero(np.diff(state, prepend=-1))
        for first, last in zip(runs, [*runs[1:], len(state)], strict=True):
            own = state[first]
            y, many = self.eigen.inverse[own] @ x, np.empty((last - first, len(x)), dtype=complex)
            for j in range(first, last):
                y = factor[j] * y + push[j]
                many[j - first] = y
            result[first:last] = (many @ self.eigen.vectors[own].T).real
            x = result[last - 1]
        return result

    def _push(self, steps: Steps, state: Array, growth: Array) -> Array:
        """What the excitation adds to y in every step, ``(S, m)``."""
        duration = steps.duration * float(self.moving.basis.rate[0])
        if self.moving.pushed_evenly:
            even = self.moving.push(self.values[state], steps.begin)
            whole = self._modal(state, even) * duration[:, None]
            return np.asarray(whole * divided_exponential(growth, np.zeros_like(growth)))
        result = np.zeros(growth.shape, dtype=complex)
        for node, weight, at in zip(NODES, WEIGHTS, steps.nodes().T, strict=True):
            force = self._modal(state, self.moving.push(self.values[state], at))
            result += weight * duration[:, None] * np.exp((1 - node) * growth) * force
        return result

    def _modal(self, state: Array, push: Array) -> Array:
        """A push ``(S, m)`` on x as one on y, state by state: the matrices of all steps would take a gigabyte."""
        assert self.eigen is not None
        found = np.empty(push.shape, dtype=complex)
        order = np.argsort(state, kind="stable")
        for own in np.split(order, np.flatnonzero(np.diff(state[order])) + 1):
            found[own] = push[own] @ self.eigen.inverse[state[own[0]]].T
        return found


def _by_magnus(moving: Moving, steps: Steps, x: Array) -> Array:
    """The same by Magnus steps of the state and a 1, which drives it."""
    m, rate = len(x), float(moving.basis.rate[0])
    at = steps.nodes()
    turns = moving.path.phase_at(at) / moving.period
    whole = np.floor(moving.path.phase_at(steps.begin + 0.5 * steps.duration) / moving.period)
    part = np.clip(turns - whole[:, None], 0.0, 1.0)
    if moving.drive.exact:
        part = np.repeat(steps.part[:, None], 3, axis=1)
    values = moving.functions(part.ravel())
    inner = moving.drive.split(values)[1]
    a = np.zeros((len(values), m + 1, m + 1))
    a[:, :m, :m] = moving.basis.generator(inner[:, None])[:, 0]
    push = moving.push(values, at.ravel())
    size = np.abs(push).max(initial=1e-300)
    a[:, :m, m] = push / size
    powers = (steps.duration * rate)[:, None] ** np.arange(1, 6)
    coefficients = magnus.polynomial(a.reshape(-1, 3, m + 1, m + 1))
    propagators = magnus.expm(np.einsum("sp,spij->sij", powers, coefficients))
    result, state = np.empty((len(steps.part), m)), np.append(x / size, 1.0)
    for k, propagator in enumerate(propagators):
        state = propagator @ state
        result[k] = state[:m]
    return result * size
