"""Multipliers where everything is constant between jumps: products of exponentials, all mesh frequencies at once.

Where nothing goes with the mesh frequency the states have modes, which serve all of it. Where speeds of rotation follow
it, every segment has an exponential of its own at each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.general.canonical import CanonicalPeriods
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel import decision
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
