"""Floquet analysis of smooth and mixed mesh stiffness: Magnus steps on the kernel of the exact method."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gearstab.floquet.kernel.damped import generators
from gearstab.floquet.kernel.decision import DOUBTFUL, STABLE
from gearstab.floquet.segments.blocks import Block, split, whole
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.floquet.smooth.compare import rounding
from gearstab.floquet.smooth.control import PILOTS, Estimates, Ladder, estimates, first, rectangles
from gearstab.floquet.smooth.steps import CF4_2, CF6_5, Division, Scheme, portions
from gearstab.floquet.stability import (
    DAMPED_ON_CIRCLE,
    STATUS_FLAGS,
    FloquetStability,
    OperatingPoints,
    conservative_exponents,
    damped_exponents,
    decide_doubtful,
    decided,
    pieces,
    solved,
)
from gearstab.system import Array, GearSystem

WASTED = -1.0
"""A resolution of sixth order below which half of the points would do: the least one, 2, then leaves an error at most a
thousandth of what is asked for, and fourth order may take less."""
SMALL = 3
"""Coordinates of a system whose points take so little that finding out would take more."""
COARSE = 4
"""Resolution at which blocks are told apart: of CF4:2, in general position."""
SAMPLES = Scheme("samples", 0, CF6_5.nodes, np.diag(CF6_5.weights.sum(axis=0)))
"""Not a scheme: the stiffness at the nodes themselves."""


def periods(system: GearSystem, most: int | None = None) -> Iterator[tuple[Pattern, Division | None]]:
    """All rows over a common period: patterns that tell their blocks apart, and the period still to be cut into steps;
    None where it is exact as it is, the stiffness being constant or jumping only.

    most: rows at once, see :func:`~gearstab.floquet.smooth.steps.portions`.
    """
    if system.piecewise_constant:
        yield from ((pattern, None) for pattern in prepare(system))
        return
    for division in portions(system, most):
        yield split_pattern(division), None if division.constant.all() else division


def solutions(
    system: GearSystem, omega: Array, exponents: bool, reduction: bool, tolerance: float
) -> Iterator[tuple[Block, FloquetStability]]:
    """All blocks of all rows at mesh frequencies ``(rows, P)``, rad per unit time."""
    for division in portions(system):
        negative = _negative(division)
        coarse = split_pattern(division)
        for block in split(coarse) if reduction else [whole(coarse)]:
            part = OperatingPoints(block.pattern, omega[block.pattern.rows])
            own = part.omega
            if block.constant or division.constant.all():
                exact = solved(part, block, exponents)
                yield block, replace(exact, error_estimate=rounding(block.pattern, own))
                continue
            found = _varying(within(division, block.pattern), own, exponents, tolerance)
            rows = negative[np.searchsorted(division.rows, block.pattern.rows)]
            found.status[rows] |= STATUS_FLAGS["negative_stiffness"]
            yield block, found


def split_pattern(division: Division) -> Pattern:
    """The rows at a low resolution, with the mean stiffness exactly as it is: for the separation into blocks.

    A mean that is wrong by a quadrature error would not be diagonal in the modes of the mean system.
    """
    pattern = division.pattern(CF4_2, COARSE)
    if division.constant.all():
        return pattern
    wrong = np.einsum("rs,rsm->rm", pattern.fractions, pattern.levels) - division.functions.offsets(division.rows)
    levels = pattern.levels - wrong[:, None]
    return replace(pattern, levels=levels, stiffness=pattern.elastic.stiffness_of(levels))


def within(division: Division, block: Pattern) -> Division:
    """The division of a block's rows, in the block's coordinates."""
    part = division.subset(np.searchsorted(division.rows, block.rows))
    return replace(part, elastic=block.elastic)


def _negative(division: Division) -> Array:
    """``(r,)``: whether K(t) has a negative eigenvalue at some time."""
    lowest = division.elastic.stiffness_of(division.functions.lowest(division.rows)[:, None])
    shift = division.elastic.shift[:, None] ** 2
    below = np.any(np.linalg.eigvalsh(lowest[:, 0]) + shift < 0, axis=1)
    rows = np.flatnonzero(below)
    if len(rows):
        below[rows] = np.any(division.subset(rows).pattern(SAMPLES, COARSE).stiffness_below_zero, axis=(1, 2))
    return below


def ladder(division: Division, omega: Array, decay: Array, tolerance: float) -> tuple[Ladder, Array]:
    """The scheme that takes least, and the resolution ``(r, P)`` that each point is likely to need.

    Sixth order nearly always; where it does not get by with fewer than two steps between kinks, or for a low accuracy,
    fourth order may do with less, which counts for large systems at many points.
    """
    best = Ladder(division, CF6_5)
    wanted, enough = first(best, omega, decay, tolerance)
    if enough < WASTED and division.elastic.static.shape[-1] > SMALL and omega.shape[1] > PILOTS:
        other = Ladder(division, CF4_2)
        others, _ = first(other, omega, decay, tolerance)
        if _work(other, others) < _work(best, wanted):
            return other, others
    return best, wanted


def _work(choice: Ladder, resolution: Array) -> float:
    """Segments of all points."""
    found, count = np.unique(resolution, return_counts=True)
    return float(sum(choice.segments(int(k)) * n for k, n in zip(found, count, strict=True)))


def _varying(division: Division, omega: Array, exponents: bool, tolerance: float) -> FloquetStability:
    """A block whose stiffness varies, at ``omega`` in its own units."""
    elastic = division.elastic
    period = 2 * np.pi * division.cycles / omega
    decay = elastic.shift[:, None] * period
    chosen, wanted = ladder(division, omega, decay, tolerance)
    found = estimates(chosen, omega, decay, tolerance, wanted)
    status = np.zeros(omega.shape, dtype=np.int16)
    table = np.full((*omega.shape, elastic.state_size), np.nan, dtype=complex) if exponents else None
    if elastic.conservative:
        for rows, points, pattern in _at_resolutions(chosen, found, found.verdict == DOUBTFUL):
            _settled(found, status, pattern, rows, points, omega)
    if table is not None:
        for rows, points, pattern in _at_resolutions(chosen, found, np.ones(omega.shape, dtype=bool)):
            own = omega[rows[:, None], points]
            if elastic.conservative:
                stable = found.verdict[rows[:, None], points] == STABLE
                table[rows[:, None], points] = conservative_exponents(pattern, own, stable)
            else:
                table[rows[:, None], points] = damped_exponents(pattern, generators(pattern), own)
    growth = found.growth - decay
    value, stable = decided(growth, period, DAMPED_ON_CIRCLE)
    if elastic.conservative:
        value, stable = growth / period, np.where(decay == 0, found.verdict == STABLE, growth <= 0).astype(np.int8)
        near = np.where(
            decay == 0, found.changed | ((stable == 0) & (growth <= found.error)), np.abs(growth) <= found.error
        )
    else:
        near = np.abs(growth) <= found.error
    status[near] |= STATUS_FLAGS["near_boundary"]
    status[~(found.error <= tolerance)] |= STATUS_FLAGS["not_converged"]
    rate = elastic.rate[:, None]
    return FloquetStability(
        value * rate,
        stable,
        status,
        None if table is None else table * rate[..., None],
        found.error,
    )


def _at_resolutions(chosen: Ladder, found: Estimates, asked: Array) -> Iterator[tuple[Array, Array, Pattern]]:
    """(rows, points ``(q, c)``, pattern of these rows) that together are the points ``asked`` (r, P) for."""
    for resolution in np.unique(found.resolution[asked]):
        for rows, points, _ in rectangles(asked & (found.resolution == resolution)):
            yield rows, points, chosen.pattern(int(resolution), rows)


def _settled(found: Estimates, status: Array, pattern: Pattern, rows: Array, points: Array, omega: Array) -> None:
    """Decide the points in doubt among those of a pattern."""
    some, places = np.nonzero(found.verdict[rows[:, None], points] == DOUBTFUL)
    for row, column in pieces(some, places, pattern.size):
        target = rows[row], points[row, column]
        verdict, growth, bits = decide_doubtful(pattern, row, omega[target])
        found.verdict[target], found.growth[target] = verdict, growth
        status[target] |= bits
