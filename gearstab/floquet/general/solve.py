"""Multipliers of x' = A(t) x for a batch of rows and mesh frequencies, to a requested tolerance.

Piecewise constant A: exact products of exponentials. Otherwise sixth-order Magnus steps that begin and end at all jumps
and kinks; every point is computed with some number of steps and with twice as many, and the difference is its error
estimate; points whose estimate exceeds the tolerance are computed again with more.

Nothing here is symplectic: a multiplier on the unit circle is there within rounding only. Eigenvalues of the product
tell the small multipliers of a strongly damped period to eps times the largest one; where all exponents are wanted they
are found from factors of the product (:mod:`gearstab.floquet.kernel.graded`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gearstab.floquet.general.exact import exact_rows
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.segments.pattern import CONSTANT, PROBES
from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability, decided, empty, settled
from gearstab.interrupts import heed
from gearstab.propagation.control import StepControl, remainder
from gearstab.propagation.elastic import ElasticForm, elastic_forms
from gearstab.propagation.magnus import NODES, ORDER, MagnusSteps, eigenvalues, polynomial, propagated
from gearstab.propagation.schedule import Schedule, schedule
from gearstab.system import Array, GearSystem

FINEST = 14
"""Doublings of the first number of steps (about one per radian of the fastest mode) that are tried at most: 2^14."""
SAFETY = 4.0
"""The estimate is this times |difference| / (2^6 - 1), the remainder of a method of order six that has converged."""
ROUNDING = 3e-16
"""Relative error of a step, by which the estimate is never smaller than that of all steps."""
ON_CIRCLE = 1e-7
"""Growth a period below which a system without damping counts as stable: a double multiplier on the unit circle is
known to the square root of the rounding error. Where a Hamiltonian one is constant between jumps Krein signs decide."""
DAMPED_ON_CIRCLE = 1e-10
"""The same for a damped system, whose multipliers lie inside."""
SPREAD = np.log(100.0)
"""Spread of ln |lambda| up to which the eigenvalues of the product tell all exponents."""
WIDTH = 3.0
"""By how much growth and decay may differ in a factor: its small part loses a factor of exp(3) = 20."""
SLIVER = 1e-13
"""Part of the common period below which an interval is a rounding error: nothing varies in it."""
ENTRIES_AT_ONCE = 2**21
"""Entries of the matrices of the points that are treated together: 16 MB."""


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
    if system.piecewise_constant:
        return _exact(system, omega, exponents, tolerance)
    plan, rows = schedule(system), elastic_forms(system)
    cycles = float(system.common_period()[0])
    shape = omega.shape
    if rows[0].form.by_speed is not None:
        # At a constant speed that is constant too: points are rows of their own.
        each, omega = np.repeat(np.arange(shape[0]), shape[1]), omega.reshape(-1, 1)
        plan, rows = plan.subset(each), [rows[r].at_speed(speed) for r, speed in zip(each, omega[:, 0], strict=True)]
    found, error = _log_multipliers(plan, rows, cycles, omega, tolerance, exponents)
    growth = np.full(error.shape, np.nan)
    table = np.full((*error.shape, 2 * system.size), np.nan, dtype=complex) if exponents else None
    stable = np.full(error.shape, -1, dtype=np.int8)
    for r, row in enumerate(rows):
        period, logs = 2 * np.pi * cycles / omega[r], found[r]
        largest = np.maximum(logs.real.max(axis=-1, initial=-np.inf), row.rigid_growth * period)
        known = np.isfinite(error[r])
        threshold = np.maximum(DAMPED_ON_CIRCLE if row.damped else ON_CIRCLE, error[r])
        growth[r, known], stable[r, known] = (part[known] for part in decided(largest, period, threshold))
        if table is not None:
            rigid = np.broadcast_to(row.rigid_exponents.astype(complex), (len(logs), len(row.rigid_exponents)))
            table[r] = settled(np.concatenate([logs / period[:, None], rigid], axis=1), stable[r])
    status = np.where(error <= tolerance, 0, STATUS_FLAGS["not_converged"]).astype(np.int16)
    status[stable < 0] |= STATUS_FLAGS["failed"]
    table = None if table is None else table.reshape(*shape, -1)
    return FloquetStability(
        growth.reshape(shape), stable.reshape(shape), status.reshape(shape), table, error.reshape(shape)
    )


def _exact(system: GearSystem, omega: Array, exponents: bool, tolerance: float) -> FloquetStability:
    """:func:`analyse` where everything is constant between jumps."""
    result, error = empty(*omega.shape), np.empty(omega.shape)
    table = np.empty((*omega.shape, 2 * system.size), dtype=complex) if exponents else None
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    for part in exact_rows(system):
        own, rows = part.own, part.own.form.rows
        log, error[rows], logs = part.logs(omega[rows], exponents)
        log, canonical, doubtful = part.by_krein(omega[rows], log)
        by_itself = own.rigid_exponents.max(axis=1, initial=-np.inf)[:, None]
        log = np.maximum(log, np.where(by_itself > 0, by_itself, -np.inf) * period[rows])
        least = np.maximum(np.where(own.damped, DAMPED_ON_CIRCLE, ON_CIRCLE)[:, None], error[rows])
        growth, stable = decided(log, period[rows], np.where(canonical[:, None], 0.0, least))
        lost = np.isnan(log)
        result.growth_rate[rows], result.stable[rows] = growth, np.where(lost, -1, stable)
        flags = np.where(lost, STATUS_FLAGS["failed"], 0) | np.where(doubtful, STATUS_FLAGS["krein"], 0)
        result.status[rows] = flags | np.where(error[rows] <= tolerance, 0, STATUS_FLAGS["not_converged"])
        if table is not None and logs is not None:
            rigid = np.broadcast_to(own.rigid_exponents[:, None], (*log.shape, own.rigid_exponents.shape[1]))
            whole = np.concatenate([logs / period[rows][..., None], rigid], axis=-1)
            table[rows] = settled(whole, result.stable[rows])
    return replace(result, exponents=table, error_estimate=error)


@dataclass(frozen=True)
class _Division:
    """The common period cut into steps.

    steps: ``(S,)``, of each smooth interval.  values: for each interval ``(rows, steps, 3, J)``, all functions at the
    nodes of its steps.
    """

    plan: Schedule
    steps: Array
    values: list[Array]

    @classmethod
    def of(cls, plan: Schedule, steps: Array) -> _Division:
        parts = [((np.arange(count)[:, None] + NODES) / count).ravel() for count in steps]
        interval = np.repeat(np.arange(len(steps)), [len(part) for part in parts])
        f = plan.values(plan.edges[:, interval] + plan.lengths[:, interval] * np.concatenate(parts))
        every = f.reshape(len(f), -1, len(NODES), f.shape[-1])
        return cls(plan, steps, np.split(every, np.cumsum(steps)[:-1], axis=1))

    def pieces(self, row: ElasticForm, index: int) -> Iterator[MagnusSteps]:
        """The steps of one row, as many together as memory is given."""
        size = row.size
        at_once = max(1, ENTRIES_AT_ONCE // max(1, 5 * size * size))
        for run in self._runs(at_once):
            heed()
            values = np.concatenate([self.values[s][index, part] for s, part in run])
            length = [np.full(part.stop - part.start, self.plan.lengths[index, s] / self.steps[s]) for s, part in run]
            matrices = row.generators(values)
            yield MagnusSteps(polynomial(matrices), np.concatenate(length))

    def cut(self, row: ElasticForm, index: int, longest: float) -> _Division:
        """The same with intervals in which nothing varies, exact in any steps, in steps no wider than WIDTH."""
        constant = np.flatnonzero(self.steps == 1)
        if not len(constant):
            return self
        values = np.stack([self.values[s][index, 0, 0] for s in constant])
        rates = row.generators(values)
        width, steps = _widths(rates, self.plan.lengths[index, constant] * longest), self.steps.copy()
        steps[constant] = np.maximum(1, np.ceil(width / WIDTH))
        return _Division.of(self.plan, steps)

    def _runs(self, at_once: int) -> Iterator[list[tuple[int, slice]]]:
        """Consecutive steps in groups of up to so many: intervals, and which steps of each."""
        run: list[tuple[int, slice]] = []
        left = at_once
        for s, count in enumerate(self.steps.tolist()):
            begin = 0
            while begin < count:
                part = slice(begin, min(count, begin + left))
                run.append((s, part))
                left -= part.stop - part.start
                begin = part.stop
                if not left:
                    yield run
                    run, left = [], at_once
        if run:
            yield run


def _log_multipliers(
    plan: Schedule, rows: list[ElasticForm], cycles: float, omega: Array, tolerance: float, exponents: bool
) -> tuple[list[Array], Array]:
    """ln lambda of each row ``(P, m)`` and the error estimates ``(rows, P)``; exponents: whether all are wanted."""
    varies = varying(plan)
    points = omega.shape[1]
    logs = [np.full((points, row.size), np.nan, dtype=complex) for row in rows]
    error = np.full(omega.shape, np.nan)
    level = _first_levels(rows, plan, cycles, omega) if varies.any() else np.zeros(omega.shape, dtype=int)
    period = 2 * np.pi * cycles / omega
    control = StepControl(level, level + (FINEST if varies.any() else 0), tolerance, ORDER)
    for current, chosen in control:
        coarse = _steps(plan, varies, 2**current)
        first = _Division.of(plan, coarse)
        both = first, _Division.of(plan, np.where(varies, 2 * coarse, 1)) if varies.any() else first
        for r in np.flatnonzero(chosen.any(axis=1)):
            members = np.flatnonzero(chosen[r])
            values, scale, error[r, members] = _compared(rows[r], int(r), both, period[r, members])
            with np.errstate(divide="ignore"):
                logs[r][members] = np.log(values) + scale[:, None]
        control.judge(error[chosen], 2 * ROUNDING * both[1].steps.sum())
        for r in np.flatnonzero((chosen & ~control.pending).any(axis=1)) if exponents else ():
            members = np.flatnonzero(chosen[r] & ~control.pending[r])
            apart = np.ptp(logs[r].real[members], axis=1) if logs[r].shape[1] else np.zeros(len(members))
            wide = members[np.isfinite(error[r, members]) & (apart > SPREAD)]
            if len(wide):
                logs[r][wide] = _graded(both[1], rows[r], int(r), period[r, wide])
    return logs, error


def _first_levels(rows: list[ElasticForm], plan: Schedule, cycles: float, omega: Array) -> Array:
    """``(rows, P)``: log2 of the steps per common period that make about one per radian of the fastest mode."""
    typical = plan.values(0.5 * (plan.edges[:, 1:] + plan.edges[:, :-1]))
    fastest = np.empty(len(rows))
    for r, row in enumerate(rows):
        a = row.generators(typical[r])
        fastest[r] = row.rate * np.sqrt(np.abs(np.linalg.eigvals(a @ a)).max(initial=0.0))
    radians = 2 * np.pi * cycles * fastest[:, None] / omega
    return np.asarray(np.ceil(np.log2(np.maximum(radians, 1.0))).astype(int))


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


def _steps(plan: Schedule, varies: Array, count: int) -> Array:
    """``(S,)``: how many steps each interval takes when a common period has about ``count``."""
    wanted = np.maximum(1, np.ceil(count * plan.lengths.max(axis=0, initial=0.0))).astype(int)
    return np.where(varies, wanted, 1)


def _compared(
    row: ElasticForm, index: int, divisions: tuple[_Division, _Division], period: Array
) -> tuple[Array, Array, Array]:
    """Multipliers over exp(scale) with the finer division ``(P, m)``, scale ``(P,)``, error estimate ``(P,)``."""
    coarse, fine = divisions
    values, scale = _eigenvalues(fine, row, index, period)
    error = np.full(len(period), ROUNDING * fine.steps.sum())
    if fine.steps.sum() > coarse.steps.sum():
        before, other = _eigenvalues(coarse, row, index, period)
        with np.errstate(over="ignore", invalid="ignore"):
            gap = _distance(before * np.exp(other - scale)[:, None], values)
            size = np.maximum(np.abs(values).max(axis=1, initial=0.0), np.exp(-scale))
            error = error + SAFETY * remainder(ORDER) * gap / size
    return values, scale, np.where(np.isfinite(values).all(axis=1), error, np.nan)


def _distance(first: Array, second: Array) -> Array:
    """``(P,)``: the largest distance from a member of ``second`` (P, m) to the nearest member of ``first``."""
    if second.shape[1] == 0:
        return np.zeros(len(second))
    return np.asarray(np.abs(second[:, :, None] - first[:, None, :]).min(axis=2).max(axis=1))


def _eigenvalues(division: _Division, row: ElasticForm, index: int, period: Array) -> tuple[Array, Array]:
    """Multipliers over exp(scale), ``(P, m)`` and ``(P,)``."""
    m = row.size
    values, scale = np.empty((len(period), m), dtype=complex), np.zeros(len(period))
    at_once = max(1, ENTRIES_AT_ONCE // max(1, m * m))
    for begin in range(0, len(period), at_once):
        part = slice(begin, begin + at_once)
        product, scale[part] = _product(division, row, index, period[part] * row.rate)
        values[part] = eigenvalues(product)
    return values, scale


def _product(division: _Division, row: ElasticForm, index: int, period: Array) -> tuple[Array, Array]:
    """Monodromy matrices over exp(scale) ``(P, m, m)``, scale ``(P,)``; ``period`` in units of 1/rate."""
    m = row.size
    product, scale = np.broadcast_to(np.eye(m), (len(period), m, m)), np.zeros(len(period))
    for steps in division.pieces(row, index):
        product, scale = propagated(steps, period, product, scale)
    return product, scale


def _graded(division: _Division, row: ElasticForm, index: int, period: Array) -> Array:
    """ln lambda ``(P, m)``, the small ones as right as the large, from factors no wider than WIDTH."""
    time, size = period * row.rate, row.size
    division = division.cut(row, index, float(time.max()))
    at_once = max(1, ENTRIES_AT_ONCE // (int(division.steps.sum()) * size * size))
    logs = np.empty((len(time), size), dtype=complex)
    for begin in range(0, len(time), at_once):
        part, count, more = slice(begin, begin + at_once), 0, SPREAD
        while True:
            factors, scale = _factors(division.pieces(row, index), time[part], more)
            logs[part] = kernel.graded(factors) + scale[:, None]
            widest = float(np.ptp(logs[part].real, axis=1).max())
            # Multipliers may be further apart than the states tell, as those of instabilities are.
            if len(factors) == count or not widest > 1.5 * WIDTH * len(factors):
                break
            count, more = len(factors), 2 * widest
    return logs


def _factors(pieces: Iterator[MagnusSteps], time: Array, more: float) -> tuple[list[Array], Array]:
    """Factors ``(P, m, m)`` each, and the logarithm ``(P,)`` of what was taken out of all.

    more: what is added to the width of the steps over the whole period, in parts as long as they are.
    """
    factors, scale = [], np.zeros(len(time))
    for piece in pieces:
        size = piece.coefficients.shape[-1]
        width = _widths(piece.coefficients[:, 0], piece.length * float(time.max())) + more * piece.length
        starts = np.flatnonzero(np.diff(np.floor(np.cumsum(width) / WIDTH))) + 1
        for begin, end in pairwise([0, *starts, len(width)]):
            steps = MagnusSteps(piece.coefficients[begin:end], piece.length[begin:end])
            unit = np.broadcast_to(np.eye(size), (len(time), size, size))
            factor, scale = propagated(steps, time, unit, scale)
            factors.append(factor)
    return factors, scale


def _widths(rates: Array, time: Array) -> Array:
    """By how much growth and decay of x' = A x differ after some times, ``(S,)`` of ``(S, m, m)`` and ``(S,)``."""
    return np.asarray(np.ptp(np.linalg.eigvals(rates).real, axis=-1) * time)
