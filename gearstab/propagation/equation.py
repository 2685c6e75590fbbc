"""The equation x' = A x + B z of rows of a system, between the edges of its schedule.

Its right side is the excitation: the external force f(t) and the transmission errors of the meshes. With tau the part
of the common period that has passed, t = tau T, and

    z(tau) = (1, cos 2 pi h_1 tau, sin 2 pi h_1 tau, cos 2 pi h_2 tau, ...)

for the harmonics h of the common period that occur, the generalised force on the system without its meshes' own is

    F(tau) z(tau),    F = F_0 + Omega F_1,

F_0 with the load, the Fourier series of forces, k_i e_i g_i of the transmission errors, and forces of other shapes at
their momentary value; F_1 with c_i (de_i/dt) g_i of meshes with damping. While the mesh stiffness is constant so is F.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearstab.propagation.first_order import FirstOrder
from gearstab.propagation.schedule import Functions, Schedule, Source, distinct, divided, sources
from gearstab.propagation.segment import States
from gearstab.system import Array, GearSystem, shared_period
from gearstab.waveforms import Fourier

ON_A_JUMP = 1e-12
"""A moment closer to a jump than this part of the common period is taken as lying on it."""
INSIDE = 1e-9
"""How near to its edges an interval is looked at, as a part of its width: functions may jump there."""


@dataclass(frozen=True)
class Equation:
    """x' = A x + (B_0 + Omega B_1) z(tau): the first-order form of rows, and what drives these rows."""

    form: FirstOrder
    drive: Excitation

    @property
    def edges(self) -> Array:
        """``(r, Q + 1)``, between which everything is smooth, in parts of the common period."""
        return self.drive.schedule.edges

    @cached_property
    def occupied(self) -> Array:
        """Numbers of the intervals that some row has."""
        return np.flatnonzero(np.any(np.diff(self.edges, axis=1) > 0, axis=0))

    def values(self, tau: Array) -> Array:
        """``(X, r, J)``, the varying functions at the times ``(X, r)``."""
        return np.swapaxes(self.drive.varying(tau.T), 0, 1)

    @cached_property
    def middles(self) -> Array:
        """``(Q, r, J)``, the varying functions in the middle of every interval."""
        return self.values(0.5 * (self.edges[:, 1:] + self.edges[:, :-1]).T)

    @cached_property
    def states(self) -> States:
        """The states of A in intervals in which nothing varies."""
        inner = self.drive.split(self.middles[self.occupied])[1]
        which, first = distinct(np.swapaxes(inner, 0, 1))
        of = np.zeros(self.edges.shape[1] - 1, dtype=int)
        of[self.occupied] = which
        return States(of, self.form.generator(inner[first]))

    def inputs(self, values: Array) -> tuple[Array, Array, Array]:
        """A ``(X, r, m, m)``, B_0 ``(X, r, m, L)`` and B_1 ``(r, m, L)`` for values ``(X, r, J)``."""
        return self.form.generator(values), *self.forces(values)

    def forces(self, values: Array) -> tuple[Array, Array]:
        """B_0 ``(X, r, m, L)`` and B_1 ``(r, m, L)`` for values ``(X, r, J)``."""
        return self.form.inlet @ self.drive.force(values), self.form.inlet @ self.drive.force_of_rates

    @cached_property
    def borders(self) -> Array:
        """Edges of the intervals that the first row has, from 0 to 1."""
        edges = self.edges[0]
        return np.append(edges[:-1][np.diff(edges) > 0], 1.0)

    def momentary(self, part: Array, slack: float = ON_A_JUMP) -> tuple[Array, Array]:
        """``(X, meshes)``: mesh stiffnesses and transmission errors of the first row at parts of the common period.

        Forces that the teeth of a mesh exert, over its stiffness, are transmission errors too.

        Just after the jump for a part that is on one, or before it by no more than the slack.
        """
        inside = part - np.floor(part)
        k = np.clip(np.searchsorted(self.borders, inside + slack, side="right") - 1, 0, len(self.borders) - 2)
        begin, end = self.borders[k], self.borders[k + 1]
        # Just inside, where a function that jumps at an edge still has the value of the interval.
        inner = np.clip(inside, begin + INSIDE * (end - begin), end - INSIDE * (end - begin))
        at = 0.5 * (begin + end) if self.drive.exact else inner
        varying = self.drive.varying(np.broadcast_to(at, (len(self.edges), len(at))))[0]
        stiffness, _, others = self.drive.split(varying)
        exerted = others @ self.drive.exerted.T
        # A mesh without stiffness at a moment, or a weak tooth that does not carry, exerts nothing.
        errors = exerted / np.where(exerted == 0, 1.0, stiffness)
        return stiffness, self.drive.z(part) @ self.drive.errors[0].T + errors

    def at_speeds(self, at: Array, speed: Array) -> Equation:
        """Return a row for each of the speeds ``(K,)`` that rows ``at`` (K,) have."""
        return Equation(self.form.at_speeds(at, speed), self.drive.subset(at))


@dataclass(frozen=True)
class Excitation:
    """Everything that depends on time, for rows of a system.

    cycles: N; the common period of all that varies and drives is N 2 pi/Omega. counts: cycles of each mesh in it.
    schedule: the mesh stiffnesses k_i(tau), the terms' profiles, then the forces that are no Fourier series.
    exact: whether all of these are constant between their jumps.
    harmonics: ``(H,)``, of the common period.
    fixed: ``(rows, n, L)``, L = 1 + 2 H, the part of F_0 that does not change.
    errors, slopes: ``(rows, meshes, L)``: e_i = errors z, de_i/dt = Omega slopes z.
    directions: ``(rows, meshes, n)``, g_i;  dampings: ``(rows, meshes)``, c_i.
    others: ``(rows, n, F)``, directions of the forces that are no Fourier series.
    wholes: ``(meshes, meshes)``, of the system, for :func:`gearstab.system.of_wholes`.
    exerted: ``(meshes, F)``, 1 where the teeth of a mesh exert such a force, else 0.
    """

    cycles: float
    counts: tuple[int, ...]
    schedule: Schedule
    exact: bool
    harmonics: Array
    fixed: Array
    errors: Array
    slopes: Array
    directions: Array
    dampings: Array
    others: Array
    wholes: Array | None
    exerted: Array

    def subset(self, index: Array) -> Excitation:
        """Some of the rows, by position."""
        names = ("fixed", "errors", "slopes", "directions", "dampings", "others")
        own = {name: getattr(self, name)[index] for name in names}
        return replace(self, schedule=self.schedule.subset(index), **own)

    @property
    def acts(self) -> bool:
        """Whether there is any force."""
        return bool(self.others.shape[-1] or np.any(self.fixed) or np.any(self.errors))

    @property
    def width(self) -> int:
        """L."""
        return 1 + 2 * len(self.harmonics)

    def z(self, tau: Array) -> Array:
        """``(..., L)`` at any times."""
        angle = 2 * np.pi * np.asarray(tau)[..., None] * self.harmonics
        parts = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(*angle.shape[:-1], -1)
        return np.concatenate([np.ones((*angle.shape[:-1], 1)), parts], axis=-1)

    def varying(self, tau: Array) -> Array:
        """``(rows, X, J)``: k_i, the terms' functions and the other forces at the times ``(rows, X)``."""
        return self.schedule.values(tau)

    def split(self, values: Array) -> tuple[Array, Array, Array]:
        """Values ``(..., J)`` as (mesh stiffnesses, what acts in A, other forces)."""
        inner = values.shape[-1] - self.others.shape[-1]
        return values[..., : len(self.counts)], values[..., :inner], values[..., inner:]

    def force(self, values: Array) -> Array:
        """F_0 ``(..., rows, n, L)`` for values ``(..., rows, J)`` of the varying functions."""
        stiffness, _, others = self.split(values)
        result = self.fixed + np.einsum("...ri,rin,ril->...rnl", stiffness, self.directions, self.errors)
        result[..., 0] += np.einsum("...rf,rnf->...rn", others, self.others)
        return np.asarray(result)

    @cached_property
    def force_of_rates(self) -> Array:
        """F_1 ``(rows, n, L)``."""
        return np.einsum("ri,rin,ril->rnl", self.dampings, self.directions, self.slopes)


def excitation(system: GearSystem) -> Excitation:
    """The excitation of all rows. Raises ValueError without a common period."""
    cycles, counts = shared_period(system.all_ratios)
    meshes, own = counts[: len(system.meshes)], counts[: len(system.frequency_ratios)]
    driven = list(zip(system.forces, counts[len(own) :], strict=False))
    shaped = [(force, count) for force, count in driven if not isinstance(force.profile, Fourier)]
    varying = sources(system, own) + tuple(
        Source(force.profile, count, np.asarray(force.lag, dtype=float), np.zeros(()), np.ones(()))
        for force, count in shaped
    )
    exact = system.piecewise_constant and all(force.profile.piecewise_constant for force, _ in shaped)
    waves = [(force.profile, count, force.lag) for force, count in driven if isinstance(force.profile, Fourier)]
    errors = [
        (i, mesh.transmission_error, count, mesh.lag)
        for i, (mesh, count) in enumerate(zip(system.meshes, meshes, strict=True))
        if mesh.transmission_error is not None
    ]
    revolutions = [(i, error) for i, mesh in enumerate(system.meshes) for error in mesh.revolution_errors]
    last = counts[len(own) + len(driven) :]
    errors += [(i, one.profile, count, one.lag) for (i, one), count in zip(revolutions, last, strict=True)]
    harmonics = np.unique([
        count * s for profile, count, _ in (*waves, *(error[1:] for error in errors))
        for s in range(1, np.shape(profile.sin)[-1] + 1)
    ]).astype(int)  # fmt: skip
    rows, width = system.rows, 1 + 2 * len(harmonics)
    fixed = np.zeros((rows, system.size, width))
    if system.load is not None:
        fixed[:, :, 0] += system.flat(system.load, 1)
    for force, count in driven:
        if isinstance(force.profile, Fourier):
            series = _series(system, force.profile, count, force.lag, harmonics)
            fixed += system.flat(force.direction, 1)[:, :, None] * series[:, None]
    table = np.zeros((rows, len(meshes), width))
    for i, profile, count, lag in errors:
        table[:, i] += _series(system, profile, count, lag, harmonics)
    names = [mesh.name for mesh in system.meshes]
    for i, mesh in enumerate(system.meshes):
        if mesh.part_of:  # it is stretched as the whole mesh is
            table[:, i] = table[:, names.index(mesh.part_of)]
    return Excitation(
        cycles=float(cycles), counts=meshes, schedule=divided(Functions(varying, system.batch)), exact=exact,
        harmonics=harmonics,
        fixed=fixed, errors=table, slopes=_derivative(table, harmonics, float(cycles)),
        directions=np.stack([system.flat(mesh.direction, 1) for mesh in system.meshes], axis=1),
        dampings=np.stack([system.flat(mesh.damping, 0) for mesh in system.meshes], axis=1),
        others=np.stack([system.flat(force.direction, 1) for force, _ in shaped], axis=-1)
        if shaped else np.zeros((rows, system.size, 0)),
        wholes=system.wholes,
        exerted=np.array([[float(force.mesh == mesh.name) for force, _ in shaped] for mesh in system.meshes]),
    )  # fmt: skip


def _series(system: GearSystem, profile: Fourier, count: int, lag: Array | float, harmonics: Array) -> Array:
    """``(rows, L)`` with profile(count tau - lag) = series z(tau)."""
    sin, cos = (system.flat(part, 1) for part in (profile.sin, profile.cos))
    angle = 2 * np.pi * system.flat(lag, 0)
    result = np.zeros((len(sin), 1 + 2 * len(harmonics)))
    for s in range(1, sin.shape[-1] + 1):
        at = 1 + 2 * int(np.searchsorted(harmonics, count * s))
        a, b, cosine, sine = sin[:, s - 1], cos[:, s - 1], np.cos(s * angle), np.sin(s * angle)
        result[:, at] += b * cosine - a * sine
        result[:, at + 1] += a * cosine + b * sine
    return result


def _derivative(series: Array, harmonics: Array, cycles: float) -> Array:
    """Derivative of series z with respect to Omega t; 2 pi tau = Omega t/N."""
    result = np.zeros_like(series)
    result[..., 1::2] = series[..., 2::2] * harmonics / cycles
    result[..., 2::2] = -series[..., 1::2] * harmonics / cycles
    return result
