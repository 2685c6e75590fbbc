"""Multipliers where everything is constant between jumps: products of exponentials, all mesh frequencies at once.

Where nothing goes with the mesh frequency the states have modes, which serve all of it. Where speeds of rotation follow
it, every segment has an exponential of its own at each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel import c_points, decision
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.kernel.factors import SPREAD
from gearstab.floquet.segments.pattern import SHORTEST, Succession, merged
from gearstab.propagation.elastic import ElasticRows, elastic_rows
from gearstab.propagation.schedule import Schedule, distinct, schedule
from gearstab.system import Array, GearSystem

ROUNDING = 3e-16
"""Relative error of a step, and of its exponential for each unit of the norm of its exponent."""
SOFT = 1e-12
"""Squared frequencies, in units of the rate, below which a coordinate is not weighted."""
SYMMETRIC = 1e-14
"""Part of the largest entry by which matrices may depart from what symmetry makes them."""


@dataclass(frozen=True)
class PeriodGrowth:
    """Growth of points over a common period.

    log: ``(r, P)``, ln max |lambda|, of Hamiltonian systems positive only where that is no rounding. error: of the
    multipliers. canonical, doubtful: which points are of Hamiltonian systems, which of these Krein signs decided.
    table: ln lambda ``(r, P, m)``, or None.
    """

    log: Array
    error: Array
    canonical: Array
    doubtful: Array
    table: Array | None


@dataclass(frozen=True)
class ExactRows:
    """Rows with their segments and the generators of their states, in units of the rows' rates."""

    own: ElasticRows
    segments: Succession
    generator: Generators

    @property
    def rate(self) -> Array:
        """``(r, 1)``, 1/time."""
        return self.own.form.rate[:, None]

    def subset(self, index: Array) -> ExactRows:
        """Some of the rows, by position; of all of them what is known already."""
        if len(index) == len(self.own.form.rows):
            return self
        return ExactRows(self.own.subset(index), self.segments.subset(index), self.generator.subset(index))

    def solved(self, mesh_frequency: Array, exponents: bool) -> PeriodGrowth:
        """Solve at mesh frequencies ``(r, P)``."""
        omega = mesh_frequency / self.rate
        if self.own.form.size == 0:
            table = np.empty((*omega.shape, 0), dtype=complex) if exponents else None
            none = np.zeros(omega.shape, dtype=bool)
            return PeriodGrowth(np.full(omega.shape, -np.inf), np.zeros(omega.shape), none, none, table)
        growth = kernel.scan_damped(self.segments, self.generator, omega)[0]
        log, canonical, doubtful = self.by_krein(mesh_frequency, growth)
        canonical = np.broadcast_to(canonical[:, None], log.shape)
        return PeriodGrowth(
            log, self._rounding(omega), canonical, doubtful, self.all_logs(mesh_frequency) if exponents else None
        )

    def multipliers(self, mesh_frequency: Array) -> tuple[Array, Array]:
        """(all multipliers over exp(scale) ``(r, P, m)``, scale ``(r, P)``)."""
        _, scale, values = kernel.multipliers_damped(self.segments, self.generator, mesh_frequency / self.rate)
        return values, scale

    def by_krein(self, mesh_frequency: Array, log: Array) -> tuple[Array, Array, Array]:
        """Decide the doubtful points of Hamiltonian rows by Krein signs.

        Returns: (ln max |lambda| ``(r, P)``, of Hamiltonian rows positive only where that is no rounding; which rows
        these are ``(r,)``; which points were doubtful).
        """
        periods = CanonicalPeriods(
            self.segments.cycles, self.segments.fractions, self.segments.states, self.generator, len(self.own.elastic)
        )
        if self.own.damped.all():
            return log, np.zeros(len(log), dtype=bool), np.zeros(log.shape, dtype=bool)
        omega = mesh_frequency / self.rate
        canonical = ~self.own.damped & periods.hamiltonian(_ends(omega))
        found = np.where(canonical[:, None] & (log <= decision.ON_CIRCLE), 0.0, log)
        asked = canonical[:, None] & (found > 0) & (found <= decision.OFF_CIRCLE)
        row, point = np.nonzero(asked)
        if len(row):
            found[row, point] = decision.conservative(periods.monodromy(row, 1 / omega[row, point]))[1]
        return found, canonical, asked

    def all_logs(self, mesh_frequency: Array) -> Array:
        """ln lambda ``(r, P, m)``, however far multipliers are apart."""
        omega = mesh_frequency / self.rate
        if self.generator.by_speed is None:
            return kernel.log_multipliers_damped(self.segments, self.generator, omega)
        _, scale, values = kernel.multipliers_damped(self.segments, self.generator, omega)
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(values) + scale[..., None]
        # Small multipliers of a product are noise: there every point is a row of its own, whose speeds are held.
        row, point = np.nonzero(~(np.ptp(logs.real, axis=-1) <= SPREAD))
        if len(row):
            at = omega[row, point][:, None]
            matrix = self.generator.subset(row).at(at)[:, 0]
            logs[row, point] = kernel.log_multipliers_damped(self.segments.subset(row), Generators(matrix), at)[:, 0]
        return logs

    def _rounding(self, omega: Array) -> Array:
        """``(r, P)``: of all steps, and of the exponentials, whose exponents' norms add up."""
        size = np.abs(self.generator.at(_ends(omega))).sum(axis=-2).max(axis=-1)[..., self.segments.states].max(axis=1)
        norm = 2 * np.pi * self.segments.cycles * np.sum(np.abs(self.segments.fractions) * size, axis=1)
        error = np.divide(ROUNDING * norm[:, None], omega)
        error += ROUNDING * len(self.segments.states)
        return error


def _ends(omega: Array) -> Array:
    """``(r, 2)``: the least and the greatest of ``(r, P)``."""
    return np.stack([omega.min(axis=1), omega.max(axis=1)], axis=1)


def exact_rows(system: GearSystem) -> Iterator[ExactRows]:
    """All rows of a system that is piecewise constant, each once."""
    plan, cycles = schedule(system), float(system.common_period()[0])
    values = plan.values(0.5 * (plan.edges[:, 1:] + plan.edges[:, :-1]))
    for own, hamiltonian in alike_rows(system):
        rows = own.form.rows
        yield joined(own, hamiltonian, *_segments(plan.subset(rows), values[rows], cycles))


def alike_rows(system: GearSystem) -> Iterator[tuple[ElasticRows, bool]]:
    """All rows, each once, and whether they are symplectic but for what acts with a speed on positions."""
    for every in elastic_rows(system):
        symplectic = _hamiltonian(every)
        for hamiltonian in np.unique(symplectic):
            yield every.subset(np.flatnonzero(symplectic == hamiltonian)), bool(hamiltonian)


def joined(own: ElasticRows, hamiltonian: bool, segments: Succession, levels: Array) -> ExactRows:
    """Rows with segments and the functions ``(r, D, J)`` in each of their states."""
    return ExactRows(own, segments, _weighted(Generators.of(own.form, levels, hamiltonian), len(own.elastic)))


def _weighted(generator: Generators, elastic: int) -> Generators:
    """The same for the state (w u, u', b), whose matrices keep the size of motions: small ones have polynomials."""
    squared = -np.diagonal(generator.matrix[..., elastic : 2 * elastic, :elastic], axis1=-2, axis2=-1).mean(axis=1)
    weight = np.sqrt(np.where(squared > SOFT, squared, 1.0))
    unit = np.concatenate([weight, np.ones((len(weight), generator.matrix.shape[-1] - elastic))], axis=1)
    factor = (unit[:, :, None] / unit[:, None, :])[:, None]
    by_speed = None if generator.by_speed is None else generator.by_speed * factor
    return replace(generator, matrix=generator.matrix * factor, by_speed=by_speed)


def _hamiltonian(own: ElasticRows) -> Array:
    """``(r,)``: whether all that acts on positions is symmetric, and all that acts on velocities skew."""
    form, n = own.form, len(own.elastic)
    if form.size != 2 * n:
        return np.zeros(len(form.rows), dtype=bool)
    matrices = np.concatenate(
        [form.constant[:, None], form.parts, *([] if form.by_speed is None else [form.by_speed])], 1
    )
    velocity, above = matrices[..., n:, n:], matrices[..., :n, :].copy()
    above[:, 0, :, n:] -= np.eye(n)
    left = [above, matrices[..., n:, :n] - np.swapaxes(matrices[..., n:, :n], -1, -2)]
    left.append(velocity + np.swapaxes(velocity, -1, -2))
    size = np.abs(matrices).max(axis=(1, 2, 3))
    return np.asarray(np.max([np.abs(part).max(axis=(1, 2, 3)) for part in left], axis=0) <= SYMMETRIC * size)


def _segments(plan: Schedule, values: Array, cycles: float) -> tuple[Succession, Array]:
    """Intervals without neighbours in the same state, and the functions ``(r, D, J)`` in each state.

    values: ``(r, S, J)``.
    """
    lengths = plan.lengths
    states, first = distinct(values)
    key = np.where(lengths.max(axis=0) > SHORTEST, states, -1)
    kept, fractions, start = merged(key, lengths, plan.edges[:, :-1])
    used, states = np.unique(kept, return_inverse=True)
    return Succession(plan.rows, cycles, fractions, start, np.ravel(states)), values[:, first[used]]


CANONICAL = 1e-11
"""Part of the largest entry by which J A may depart from symmetry: rounding in the modes of the mean system."""
MOST_STATES = 64
"""Most states that are looked at for that: more than functions that vary."""
STEP = 1e-5
"""Relative step of the derivative, which is right to about its square."""


@dataclass(frozen=True)
class CanonicalPeriods:
    """Common periods of r rows in S segments, with canonical monodromy matrices at any mesh frequency.

    With u in the modes of the mean system, u'' + g u' + K(t) u = 0 has the momentum p = u' + g u/2. In the coordinates
    z = (w^(1/2) u, w^(-1/2) p) it is canonical, dz/dt = A z with J A symmetric, if and only if g is skew and K(t)
    symmetric, whatever the speeds are; J then does not depend on them. The monodromy matrix is symplectic, P^T J P = J.

    A rigid-body motion v b that is free at every speed enters by its velocity r' only, and its momentum
    v.(M q' + W G q) is conserved; the other multipliers are those of the system in which it is zero, with the same
    canonical coordinates.

    Source: Yakubovich & Starzhinskii 1975, ch. III; with p as in the Legendre transform of a gyroscopic Lagrangian.

    cycles: N; the common period is N 2 pi/Omega. fractions ``(r, S)``, states ``(S,)``: how long which state lasts.
    generator: of x = (w u, u', ..), ``(r, D, m, m)``. elastic: n, the number of coordinates u.
    """

    cycles: float
    fractions: Array
    states: Array
    generator: Generators
    elastic: int

    def hamiltonian(self, omega: Array) -> Array:
        """``(r,)``: whether J A is symmetric in all states at mesh frequencies ``(r, P)``."""
        # A is affine in what varies: states in general position tell of all.
        some = np.unique(np.linspace(0, self.generator.matrix.shape[1] - 1, MOST_STATES).astype(int))
        generator = replace(self.generator, matrix=self.generator.matrix[:, some])
        n, matrix = self.elastic, generator.at(omega)
        shape = matrix.shape
        matrix = matrix.reshape(-1, *shape[2:])
        turn, back = self._turns(matrix[:, 0])
        whole = matrix @ back[:, None]
        # What is left out has to stay what the rest makes it.
        size = np.abs(matrix).max(axis=(1, 2, 3))
        left = np.abs(whole - back[:, None] @ turn[:, None] @ whole).max(axis=(1, 2, 3), initial=0.0)
        matrix = turn[:, None] @ whole
        form = np.concatenate([matrix[..., n:, :], -matrix[..., :n, :]], axis=-2)
        error = np.abs(form - np.swapaxes(form, -1, -2)).max(axis=(1, 2, 3))
        symmetric = (error <= CANONICAL * np.abs(form).max(axis=(1, 2, 3))) & (left <= CANONICAL * size)
        return np.asarray(symmetric.reshape(shape[:2]).all(axis=1))

    def monodromy(self, row: Array, cycle: Array) -> Array:
        """P ``(P, 2n, 2n)`` at points (row, 1/Omega) ``(P,)``."""
        product = c_points.exponentials(self.cycles, self.fractions, self.states, self.generator, row, cycle)
        matrix = self.generator.subset(row).at(1 / np.asarray(cycle)[:, None])[:, 0, 0]
        turn, back = self._turns(matrix)
        return np.asarray(turn @ product @ back)

    def with_slope(self, row: Array, cycle: Array) -> tuple[Array, Array]:
        """P and dP/d ln(1/Omega)."""
        count, rows = len(row), np.repeat(row, 3)
        every = self.monodromy(rows, np.repeat(cycle, 3) * np.tile(np.exp([-STEP, 0.0, STEP]), count))
        before, here, after = np.moveaxis(every.reshape(count, 3, *every.shape[1:]), 1, 0)
        return here, (after - before) / (2 * STEP)

    def radians(self, omega: Array) -> Array:
        """``(r,)``: of the fastest motion of any state over a period at Omega = 1, from states at Omega ``(r,)``."""
        values = np.linalg.eigvals(self.generator.at(omega[:, None])[:, 0])
        return np.asarray(2 * np.pi * self.cycles * np.abs(values).max(axis=(1, 2)))

    def _turns(self, matrix: Array) -> tuple[Array, Array]:
        """Matrices that take x into z ``(P, 2n, m)``, and back, from generators ``(P, m, m)`` of one state."""
        n, m = self.elastic, matrix.shape[-1]
        weight, gyroscopic = np.einsum("pii->pi", matrix[:, :n, n : 2 * n]), -matrix[:, n : 2 * n, n : 2 * n]
        root, each = np.sqrt(weight), np.arange(n)
        turn, back = np.zeros((len(matrix), 2 * n, m)), np.zeros((len(matrix), m, 2 * n))
        turn[:, each, each] = turn[:, n + each, n + each] = 1 / root
        turn[:, n:, :n] = 0.5 * gyroscopic / root[:, :, None] / weight[:, None, :]
        back[:, each, each] = back[:, n + each, n + each] = root
        back[:, n : 2 * n, :n] = -0.5 * gyroscopic / root[:, None, :]
        if m > 2 * n:
            # The rigid-body velocity at which the momentum d.u' + r' + h.u is zero, with the free motion (d, 1).
            free = -np.swapaxes(matrix[:, :n, 2 * n :], 1, 2) / weight[:, None, :]
            held = (free @ gyroscopic - matrix[:, 2 * n :, n : 2 * n]) / weight[:, None, :]
            back[:, 2 * n :] = -held @ back[:, :n] - free @ back[:, n : 2 * n]
        return turn, back
