"""Choice of the theory that a system is analysed by, and the only place that makes it.

* Segments: mesh stiffness that is constant between jumps. The monodromy matrix over the common period of all meshes is
  the exact product of the segments' propagators, in the modes of the mean system (:mod:`~gearstab.floquet.segments`).
* Steps: mesh stiffness that is smooth somewhere. The same with Magnus steps, as many as a tolerance needs
  (:mod:`~gearstab.floquet.smooth`).
* First order: further terms of K(t) and C(t), damping that is not symmetric, matrices that act with a speed of
  rotation (:mod:`~gearstab.floquet.general`).

Where only the mesh stiffness varies blocks are solved one by one. Their points are decided as
:mod:`~gearstab.floquet.kernel.decision` says.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gearstab.floquet.segments.blocks import Block, split, whole
from gearstab.floquet.segments.pattern import prepare
from gearstab.floquet.stability import (
    DAMPED_ON_CIRCLE,
    FloquetStability,
    OperatingPoints,
    empty,
    mark_failed,
    settled,
    solved,
)
from gearstab.system import ONLY_MESHES, Array, GearSystem, unsupported

if TYPE_CHECKING:
    from gearstab.floquet.report import Reduction

TOLERANCE = 1e-9
"""Tolerance of the multipliers where propagation is not exact."""


def in_modes(system: GearSystem) -> bool:
    """Whether theory in the modes of the mean system applies; else that of the first-order form."""
    return unsupported(system, ONLY_MESHES) is None


def exact(system: GearSystem) -> bool:
    """Whether the monodromy matrix is a product of segments that rounding alone makes wrong."""
    return system.piecewise_constant and in_modes(system)


def solve(
    system: GearSystem,
    mesh_frequency: Array,
    exponents: bool = False,
    reduction: bool = True,
    tolerance: float = TOLERANCE,
) -> FloquetStability:
    """Stability of every row of a system at every mesh frequency of the first mesh.

    Parts of the system that the meshes do not couple are solved one by one (:mod:`~gearstab.floquet.segments.blocks`),
    unless theory of the first-order form is needed.

    Parameters
    ----------
    system: any batch shape; the result has one row for each entry of the flattened batch.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``, rad per unit time, positive.
    exponents: whether to compute all characteristic exponents too (slower).
    reduction: False to treat every system as a whole (slower, for comparison).
    tolerance: of the multipliers over the common period, relative to the largest one or 1, where propagation is not
        exact; points that do not reach it are marked.

    Raises ValueError where the mesh frequencies have no common period.
    """
    omega = system.operating_points(mesh_frequency)
    if in_modes(system):
        return _analyse(system, omega, exponents, reduction, tolerance)
    from gearstab.floquet import general

    return general.analyse(system, omega, exponents, tolerance)


def reduction(system: GearSystem) -> Reduction:
    """Return the reduction of a single system (no batch).

    Without an affordable common period it is that of a window, with the segments of that. A system that theory in
    modes does not apply to is solved as a whole but for its rigid-body modes.
    """
    from gearstab.floquet import report

    return report.reduced(system) if in_modes(system) else report.whole(system)


def _analyse(system: GearSystem, omega: Array, exponents: bool, reduction: bool, tolerance: float) -> FloquetStability:
    """Stability of every row of a system at mesh frequencies ``(rows, P)``; see :func:`gearstab.floquet.solve`."""
    error = None if system.piecewise_constant else np.zeros(omega.shape)
    table = _Exponents(omega.shape, 2 * system.size) if exponents else None
    result = _Result(omega)
    for block, found in _solutions(system, omega, exponents, reduction, tolerance, result):
        result.add(block, found)
        index = block.pattern.rows
        if error is not None and found.error_estimate is not None:
            error[index] = np.maximum(error[index], found.error_estimate)
        if table is not None and found.exponents is not None:
            table.add(block, found.exponents)
    result.mark_failed()
    return replace(
        result.whole,
        exponents=None if table is None else settled(table.values, result.whole.stable),
        error_estimate=error,
    )


def _solutions(
    system: GearSystem, omega: Array, exponents: bool, reduction: bool, tolerance: float, result: _Result
) -> Iterator[tuple[Block, FloquetStability]]:
    """Block by block; to rows that no block reached before, results may be written at once."""
    if not system.piecewise_constant:
        from gearstab.floquet import smooth as magnus

        yield from magnus.solutions(system, omega, exponents, reduction, tolerance)
        return
    for pattern in prepare(system):
        for block in split(pattern) if reduction else [whole(pattern)]:
            rows = block.pattern.rows
            # All rows mostly share their mesh frequencies; dividing them is cheaper than copying them first.
            part = OperatingPoints(block.pattern, omega[0] if omega.strides[0] == 0 else omega[rows])
            yield block, solved(part, block, exponents, None if result.reached[rows].any() else result.whole)


class _Result:
    """The results of all rows, gathered block by block.

    reached, sure: ``(rows,)``, whether a block gave anything for a row, and whether its failures are marked already.
    """

    def __init__(self, omega: Array) -> None:
        self.omega, self.whole = omega, empty(*omega.shape)
        self.reached, self.sure = np.zeros((2, len(omega)), dtype=bool)

    def add(self, block: Block, found: FloquetStability) -> None:
        """Take what was found of a block, unless it is in its place."""
        index, result = block.pattern.rows, self.whole
        growth, stable, status = result.growth_rate, result.stable, result.status
        if found.growth_rate is growth:
            self.sure[index] = True
        elif self.reached[index].any():
            growth[index] = np.maximum(growth[index], found.growth_rate)
            stable[index] &= found.stable
            status[index] |= found.status
            self.sure[index] = False
        else:
            growth[index], stable[index], status[index] = found.growth_rate, found.stable, found.status
        self.reached[index] = True
        # Rigid-body modes are left out of the search, but one that grows by itself decides.
        by_itself = block.pattern.elastic.rigid_growth[:, None]
        if (by_itself > -np.inf).any():
            period = 2 * np.pi * block.pattern.cycles / self.omega[index]
            driven = by_itself * period > DAMPED_ON_CIRCLE
            growth[index] = np.where(driven, np.maximum(growth[index], by_itself), growth[index])
            stable[index] = np.minimum(stable[index], ~driven)

    def mark_failed(self) -> None:
        """Mark the points without a finite growth rate."""
        result, missing = self.whole, ~self.reached
        result.growth_rate[missing], result.stable[missing] = -np.inf, 1
        if not self.sure.all():
            mark_failed(result, ~np.isfinite(result.growth_rate))


class _Exponents:
    """The exponents of all rows, gathered block by block."""

    def __init__(self, shape: tuple[int, ...], count: int) -> None:
        self.values = np.full((*shape, count), np.nan, dtype=complex)
        self.filled = np.zeros(shape[0], dtype=int)

    def add(self, block: Block, elastic: Array) -> None:
        """Add the values of a block ``(r, P, k)``, once for each copy, and the exactly known ones of its rigid-body
        modes.
        """
        rows, known = block.pattern.rows, block.pattern.elastic.rigid_exponents
        known = np.broadcast_to(known[:, None, :], (*elastic.shape[:2], known.shape[-1]))
        every = np.concatenate([np.tile(elastic, block.copies), known.astype(complex)], axis=-1)
        place = self.filled[rows, None] + np.arange(every.shape[-1])
        self.values[rows[:, None], :, place] = np.swapaxes(every, 1, 2)
        self.filled[rows] += every.shape[-1]
