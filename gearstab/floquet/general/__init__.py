"""Multipliers of x' = A(t) x for a batch of rows and mesh frequencies, to a requested tolerance.

Piecewise constant A: exact products of exponentials (:mod:`~gearstab.floquet.general.exact`). Otherwise sixth-order
commutator-free Magnus steps that begin and end at all jumps and kinks: A(t) is affine in the functions that vary, so
that every exponential of a step is that of a constant generator with values of its own
(:mod:`~gearstab.floquet.smooth.steps`), and what goes with the mesh frequency goes with it in each. A common period of
so many steps is a succession of segments like any other; every point is computed with some number of steps and with
twice as many, and the difference is its error estimate, until that is small enough.

Eigenvalues of the product tell the small multipliers of a strongly damped period to eps times the largest one; where
all exponents are wanted they are found from factors of the product (:mod:`gearstab.floquet.kernel.factors`). A
multiplier on the unit circle is there within rounding only, but for those of Hamiltonian systems, which Krein signs
decide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.general.exact import ROUNDING, ExactRows, PeriodGrowth, alike_rows, exact_rows, joined
from gearstab.floquet.segments.pattern import CONSTANT, PROBES, Succession
from gearstab.floquet.smooth.control import rectangles
from gearstab.floquet.smooth.steps import CF6_5, Scheme, exponentials, in_steps
from gearstab.floquet.stability import DAMPED_ON_CIRCLE, STATUS_FLAGS, FloquetStability, decided, empty, settled
from gearstab.interrupts import heed
from gearstab.propagation.elastic import ElasticRows
from gearstab.propagation.magnus import StepControl, remainder
from gearstab.propagation.schedule import Schedule, distinct, schedule
from gearstab.system import Array, GearSystem

ON_CIRCLE = 1e-7
"""Growth a period below which a system without damping counts as stable: a double multiplier on the unit circle is
known to the square root of the rounding error. Of a Hamiltonian one Krein signs decide."""
POINTS_AT_ONCE = 2**14
"""Points that are decided together: what is known of so many stays in the processor's cache."""
FINEST = 14
"""Doublings of the first number of steps (about one per two radians of the fastest motion) that are tried at most."""
FEWEST = 8
"""Steps per cycle of a function at least: below, differences do not yet fall as those of sixth order."""
SAFETY = 4.0
"""The estimate is this times |difference| / (2^6 - 1), the remainder of a method of order six that has converged."""
SLIVER = 1e-13
"""Part of the common period below which an interval is a rounding error: nothing varies in it."""
ENTRIES_AT_ONCE = 2**22
"""Entries of the generators of rows that are treated together, at their coarsest steps: 32 MB."""


def analyse(
    system: GearSystem, mesh_frequency: Array, exponents: bool = False, tolerance: float = 1e-9
) -> FloquetStability:
    """Stability of every row of any commensurate system at every mesh frequency.

    Parameters
    ----------
    system: any batch shape; M symmetric and positive definite.
    mesh_frequency: Omega ``(rows, P)``, rad per unit time, positive.
    exponents: whether all characteristic exponents are wanted.
    tolerance: of the multipliers over the common period, relative to the largest one or 1.

    Raises ValueError where the mesh frequencies have no common period.
    """
    omega = np.asarray(mesh_frequency, dtype=float)
    result, error = empty(*omega.shape), np.empty(omega.shape)
    table = np.empty((*omega.shape, 2 * system.size), dtype=complex) if exponents else None
    turn = 2 * np.pi * float(system.common_period()[0])
    for own, found in _solved(system, omega, exponents, tolerance):
        rows = own.form.rows
        step = max(1, POINTS_AT_ONCE // len(rows))
        for first in range(0, omega.shape[1], step):
            points = slice(first, first + step)
            growth, stable, status = _decided(own, found, points, turn / omega[rows, points], tolerance)
            result.growth_rate[rows, points], result.stable[rows, points] = growth, stable
            result.status[rows, points], error[rows, points] = status, found.error[:, points]
        if table is not None and found.table is not None:
            rigid = np.broadcast_to(own.rigid_exponents[:, None], (*found.log.shape, own.rigid_exponents.shape[1]))
            whole = np.concatenate([found.table * (omega[rows] / turn)[..., None], rigid], axis=-1)
            table[rows] = settled(whole, result.stable[rows])
    return replace(result, exponents=table, error_estimate=error)


def _decided(
    own: ElasticRows, found: PeriodGrowth, points: slice, period: Array, tolerance: float
) -> tuple[Array, Array, Array]:
    """(growth rate, stable, status) of some of the points, whose periods are ``(r, P)``."""
    log, error = found.log[:, points], found.error[:, points]
    canonical, doubtful = found.canonical[:, points], found.doubtful[:, points]
    by_itself = own.rigid_exponents.max(axis=1, initial=-np.inf)[:, None]
    if (by_itself > 0).any():
        log = np.maximum(log, np.where(by_itself > 0, by_itself, -np.inf) * period)
    least = np.maximum(np.where(own.damped, DAMPED_ON_CIRCLE, ON_CIRCLE)[:, None], error)
    least[canonical] = 0.0
    growth, stable = decided(log, period, least)
    lost = np.isnan(log)
    status = np.zeros(log.shape, dtype=np.int16)
    for holds, flag in ((lost, "failed"), (doubtful, "krein"), (~(error <= tolerance), "not_converged")):
        status += holds * np.int16(STATUS_FLAGS[flag])
    stable[lost] = -1
    return growth, stable, status


def _solved(
    system: GearSystem, omega: Array, exponents: bool, tolerance: float
) -> Iterator[tuple[ElasticRows, PeriodGrowth]]:
    """Solve all rows, each once."""
    if system.piecewise_constant:
        for part in exact_rows(system):
            yield part.own, part.solved(omega[part.own.form.rows], exponents)
        return
    for steps in stepped_rows(system):
        yield steps.own, steps.solved(omega[steps.own.form.rows], exponents, tolerance)


@dataclass(frozen=True)
class SteppedRows:
    """Rows with their period, of ``plan``, still to be cut into steps in the intervals in which anything ``varies``."""

    own: ElasticRows
    hamiltonian: bool
    plan: Schedule
    cycles: float
    varies: Array

    def subset(self, index: Array) -> SteppedRows:
        """Some of the rows, by position."""
        return replace(self, own=self.own.subset(index), plan=self.plan.subset(index))

    def cut(self, level: int) -> ExactRows:
        """The rows with about 2^level steps per common period."""
        counts = np.ceil(2**level * self.plan.lengths.max(axis=0, initial=0.0)).astype(int)
        fractions, values = cut(self.plan, self.varies, np.maximum(1, counts))
        states, first = distinct(values)
        none = np.zeros(len(fractions))
        segments = Succession(self.own.form.rows, self.cycles, fractions, none, states)
        return joined(self.own, self.hamiltonian, segments, values[:, first])

    def solved(self, mesh_frequency: Array, exponents: bool, tolerance: float) -> PeriodGrowth:
        """Solve at mesh frequencies ``(r, P)`` to a tolerance of the multipliers, relative to the largest one or 1."""
        omega, m = mesh_frequency, self.own.form.size
        if m == 0:
            return self.cut(0).solved(omega, exponents)
        found = PeriodGrowth(
            np.full(omega.shape, np.nan), np.full(omega.shape, np.nan),
            np.zeros(omega.shape, dtype=bool), np.zeros(omega.shape, dtype=bool),
            np.full((*omega.shape, m), np.nan, dtype=complex) if exponents else None,
        )  # fmt: skip
        before, scales = np.zeros((*omega.shape, m), dtype=complex), np.zeros(omega.shape)
        first = self.first_levels(omega)
        control = StepControl(first.copy(), first + FINEST + 1, tolerance, CF6_5.order, leap=1)
        for level, chosen in control:
            whole = self.cut(level)
            steps = ROUNDING * len(whole.segments.states)
            for rows, points, _ in rectangles(chosen):
                heed()
                at = (rows[:, None], points)
                values, scale = whole.subset(rows).multipliers(omega[at])
                error = np.where(level > first[at], _error(before[at], scales[at], values, scale) + steps, np.inf)
                error[~np.isfinite(values).all(axis=-1)] = np.nan
                before[at], scales[at], found.error[at] = values, scale, error
            control.judge(found.error[chosen], 2 * steps)
            for rows, points, _ in rectangles(chosen & ~control.pending):
                at = (rows[:, None], points)
                with np.errstate(divide="ignore"):
                    found.log[at] = np.log(np.abs(before[at]).max(axis=-1)) + scales[at]
                part = whole.subset(rows)
                found.log[at], canonical, found.doubtful[at] = part.by_krein(omega[at], found.log[at])
                found.canonical[at] = np.broadcast_to(canonical[:, None], points.shape)
                if found.table is not None:
                    found.table[at] = part.all_logs(omega[at])
        return found

    def first_levels(self, omega: Array) -> Array:
        """``(r, P)``: log2 of the steps per common period, one per two radians of the fastest motion or more."""
        edges = self.plan.edges
        typical = self.plan.values(0.5 * (edges[:, 1:] + edges[:, :-1]))
        ends = np.stack([omega.min(axis=1), omega.max(axis=1)])
        form = self.own.form
        matrices = form.generator(np.moveaxis(typical, 1, 0)[:, None], ends)
        fastest = form.rate * np.abs(np.linalg.eigvals(matrices)).max(axis=(0, 1, 3), initial=0.0)
        pairs = np.pi * self.cycles * fastest[:, None] / omega
        fewest = FEWEST * max(source.cycles for source in self.plan.functions.found)
        return np.asarray(np.ceil(np.log2(np.maximum(pairs, fewest))).astype(int))


def stepped_rows(system: GearSystem) -> Iterator[SteppedRows]:
    """All rows of a system, each once, as many together as memory is given."""
    plan, cycles = schedule(system), float(system.common_period()[0])
    varies = varying(plan)
    for own, hamiltonian in alike_rows(system):
        whole = SteppedRows(own, hamiltonian, plan.subset(own.form.rows), cycles, varies)
        step = max(1, ENTRIES_AT_ONCE // max(1, 512 * own.form.size**2))
        for begin in range(0, len(own.form.rows), step):
            yield whole.subset(np.arange(begin, min(begin + step, len(own.form.rows))))


def varying(plan: Schedule) -> Array:
    """``(S,)``: in which intervals anything varies in any row."""
    start, length = plan.edges[:, :-1], plan.lengths
    # Two jumps at one instant may be apart by a rounding error, with the jump itself in between.
    length = np.where(length > SLIVER, length, 0.0)
    start = start + 0.5 * (plan.lengths - length)
    tau = start[:, :, None] + length[:, :, None] * PROBES
    f = plan.values(tau.reshape(len(tau), -1)).reshape(*tau.shape, -1)
    change = np.abs(f - f[:, :, :1]).max(axis=(2, 3), initial=0.0)
    size = np.abs(f).max(axis=(1, 2, 3), initial=0.0)
    return np.asarray(np.any(change > CONSTANT * size[:, None], axis=0))


def cut(plan: Schedule, varies: Array, counts: Array, scheme: Scheme = CF6_5) -> tuple[Array, Array]:
    """How long each exponential lasts ``(r, S)``, in parts of the common period, and all functions in it ``(r, S, J)``.

    counts: steps of each interval in which anything varies; the others take a single exponential.
    """
    # What rounding leaves between jumps that agree is too short for a proof.
    lengths = np.where(plan.lengths > SLIVER, plan.lengths, 0.0)
    kept = np.flatnonzero(lengths.max(axis=0) > 0)
    start, length, piece = in_steps(plan.edges[:, kept], lengths[:, kept], np.where(varies, counts, 1)[kept])
    return exponentials(plan.functions, plan.rows, start, length, ~varies[kept][piece], scheme)


def _error(before: Array, other: Array, values: Array, scale: Array) -> Array:
    """``(r, P)``, the error estimate from multipliers over exp(scale) of twice as few steps and of these."""
    with np.errstate(over="ignore", invalid="ignore"):
        earlier = before * np.exp(other - scale)[..., None]
        gap = np.abs(values[..., :, None] - earlier[..., None, :]).min(axis=-1).max(axis=-1)
        size = np.maximum(np.abs(values).max(axis=-1), np.exp(-scale))
        return np.asarray(SAFETY * remainder(CF6_5.order) * gap / size)
