"""Multipliers of x' = A(t) x for a batch of rows and mesh frequencies, to a requested tolerance.

Piecewise constant A: exact products of exponentials (:mod:`~gearstab.floquet.general.exact`). Otherwise sixth-order
Magnus steps that begin and end at all jumps and kinks (:mod:`~gearstab.floquet.general.stepped`).

Eigenvalues of the product tell the small multipliers of a strongly damped period to eps times the largest one; where
all exponents are wanted they are found from factors of the product (:mod:`gearstab.floquet.kernel.factors`). A
multiplier on the unit circle is there within rounding only, but for those of Hamiltonian systems, which Krein signs
decide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gearstab.floquet.general.exact import PeriodGrowth, exact_rows
from gearstab.floquet.general.stepped import stepped_rows
from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability, decided, empty, settled
from gearstab.propagation.elastic import ElasticRows
from gearstab.system import Array, GearSystem

ON_CIRCLE = 1e-7
"""Growth a period below which a system without damping counts as stable: a double multiplier on the unit circle is
known to the square root of the rounding error. Of a Hamiltonian one Krein signs decide."""
DAMPED_ON_CIRCLE = 1e-10
"""The same for a damped system, whose multipliers lie inside."""
POINTS_AT_ONCE = 2**14
"""Points that are decided together: what is known of so many stays in the processor's cache."""


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
