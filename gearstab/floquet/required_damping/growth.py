"""Growth a period over the damping z C1, of rows of a system at their mesh frequencies.

In modes of the mean system, block by block, where theory in modes applies. Otherwise of the first-order form as a
whole: A(z) is affine in z, A(z) = A(1) + (z - 1) [A(2) - A(1)], so that what a common period consists of is found once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from gearstab.floquet.dispatch import in_modes
from gearstab.floquet.general import SteppedRows, analyse, stepped_rows
from gearstab.floquet.general.exact import ExactRows, exact_rows
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel import damped
from gearstab.floquet.segments.blocks import Block, split
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.smooth import periods, within
from gearstab.floquet.smooth.steps import CF6_5, Division
from gearstab.floquet.stability import DAMPED_ON_CIRCLE, OperatingPoints, solved
from gearstab.mesh import PeriodicTerm, Rotation
from gearstab.modal import modal_damping_matrix
from gearstab.propagation.magnus import StepControl, remainder
from gearstab.system import Array, Feature, GearSystem

DAMPING_RATIO, FACTOR = "damping_ratio", "factor"
RESOLVED = 1e-8
"""Error of the growth per period, where it is propagated in Magnus steps."""
MOST_DOUBLINGS = 6
"""Most doublings of the number of Magnus steps."""
ROWS_AT_ONCE = 32
"""Rows that Magnus steps are made of side by side."""
POINTS_AT_ONCE, ENTRIES_AT_ONCE = 4096, 2**24
"""Points of the root finding treated side by side, and entries of their generators."""
PARALLEL = 1e-12
"""Part of the size of a term u v^T by which u and v may differ in direction through rounding."""


@dataclass(frozen=True)
class BlockGrowth:
    """Growth a period of a block of rows in modes of the mean system, over the factor z on a damping C1; positive where
    unstable.

    block: with the damping C1. mesh_frequency: in 1/time.
    """

    block: Block
    mesh_frequency: Array

    at_once = POINTS_AT_ONCE
    """Number of single points that are treated together."""

    @property
    def rows(self) -> Array:
        """``(r,)``, positions in the flattened batch."""
        return self.block.pattern.rows

    @cached_property
    def omega(self) -> Array:
        """``(r, P)``, mesh frequencies in units of the rates."""
        return np.asarray(self.mesh_frequency / self.block.pattern.elastic.rate[:, None])

    def at_level(self, level: float) -> Array:
        """Return the growth ``(r, P)`` of all points at one factor, which may be 0."""
        pattern = self.block.pattern
        still = level == 0
        own = pattern.without_damping() if still else scaled(pattern, np.full(len(pattern.rows), level))
        if not still and not self.block.constant:
            growth = growth_of(own, self.omega)
        else:
            part = OperatingPoints(own, self.mesh_frequency)
            found = solved(part, replace(self.block, pattern=own), False)
            growth = found.growth_rate * part.period / pattern.elastic.rate[:, None]
        return growth if still else np.maximum(growth, level * pattern.elastic.rigid_growth[:, None])

    def at_points(self, row: Array, omega: Array, factor: Array) -> Array:
        """Return the growth ``(N,)`` of single points, each with its own factor above 0."""
        return growth_of(scaled(self.block.pattern.subset(row), factor), omega[:, None])[:, 0]


@dataclass(frozen=True)
class WholeGrowth:
    """The same of rows as a whole.

    one: at the factor 1. slope: of the matrices of its states by the factor. undamped: the growth at 0.
    """

    one: ExactRows
    slope: Array
    mesh_frequency: Array
    undamped: Array

    @property
    def rows(self) -> Array:
        return self.one.own.form.rows

    @property
    def omega(self) -> Array:
        return np.asarray(self.mesh_frequency / self.one.rate)

    @property
    def at_once(self) -> int:
        return max(1, min(POINTS_AT_ONCE, ENTRIES_AT_ONCE // max(1, self.slope[0].size)))

    def at_level(self, level: float) -> Array:
        if level == 0:
            return self.undamped
        every = np.arange(len(self.rows))
        return self._growth(every, self.omega, np.full(len(every), level))

    def at_points(self, row: Array, omega: Array, factor: Array) -> Array:
        return self._growth(row, omega[:, None], factor)[:, 0]

    def _growth(self, row: Array, omega: Array, factor: Array) -> Array:
        """``(K, P)`` of rows ``(K,)`` at mesh frequencies ``(K, P)`` in their units."""
        own = self.one.generator.subset(row)
        own = replace(own, matrix=own.matrix + (factor - 1)[:, None, None, None] * self.slope[row])
        growth: Array = kernel.scan_damped(self.one.segments.subset(row), own, omega)[0]
        known = self.one.own.rigid_exponents[row].max(axis=1, initial=-np.inf)
        by_itself = np.where(known > 0, known, -np.inf) / self.one.own.form.rate[row]
        period = 2 * np.pi * self.one.segments.cycles / omega
        return np.maximum(growth, by_itself[:, None] * period) - DAMPED_ON_CIRCLE


GrowthByDamping = BlockGrowth | WholeGrowth
Growth = TypeVar("Growth", BlockGrowth, WholeGrowth)


def growths(system: GearSystem, of: str, omega: Array, level: float) -> Iterator[GrowthByDamping]:
    """All parts of all rows at mesh frequencies ``(rows, P)``.

    of: DAMPING_RATIO or FACTOR. level: the smallest factor, at which Magnus steps are to be right.

    Raises ValueError for a factor on no damping.
    """
    if of == FACTOR and not scalable(system):
        raise ValueError("a factor on the damping needs a system with damping")
    if not in_modes(system):
        yield from _wholes(system, of, omega, level)
        return
    one = system if of == FACTOR else replace(system, damping=unit_damping(system))
    for pattern, division in periods(one, ROWS_AT_ONCE):
        for block in split(pattern):
            own = omega[block.pattern.rows]
            if block.pattern.size == 0:
                continue
            if division is None or block.constant:
                yield BlockGrowth(block, own)
            else:
                yield _resolved(partial(_in_steps, block, within(division, block.pattern), own), level, 0, doubling=2)


def _in_steps(block: Block, division: Division, mesh_frequency: Array, resolution: int) -> BlockGrowth:
    return BlockGrowth(replace(block, pattern=division.pattern(CF6_5, resolution)), mesh_frequency)


def _resolved(made: Callable[[int], Growth], factor: float, coarsest: int, doubling: int) -> Growth:
    """The growth in as many Magnus steps that it is right to RESOLVED at a factor.

    made: at a level of resolution; ``doubling`` levels double the steps.
    """
    before = made(coarsest).at_level(factor)
    first, last = np.array([coarsest + doubling]), coarsest + MOST_DOUBLINGS * doubling
    control = StepControl(first, last, RESOLVED, CF6_5.order, doubling, leap=1)
    for level, _ in control:
        found = made(level)
        growth = found.at_level(factor)
        control.judge(remainder(CF6_5.order) * np.abs(growth - before).max())
        before = growth
    return found


def scalable(system: GearSystem) -> bool:
    """Return whether a system has any damping that a factor may multiply."""
    return system.damped or any(map(_dissipative, system.terms))


def unit_damping(system: GearSystem) -> Array:
    """C1 of a modal damping ratio of one, in the modes of the mean system without what acts with a speed."""
    return modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), np.ones((*system.batch, 1)))


def scaled(pattern: Pattern, factor: Array) -> Pattern:
    """The pattern with its damping times ``(r,)``, uniform damping as a matrix like any other."""
    pattern, times = pattern.unshifted(), factor[:, None, None]
    elastic = pattern.elastic
    drag = {"damping": times * elastic.damping_matrix, "rigid_damping": times * elastic.rigid_damping}
    return replace(pattern, elastic=replace(elastic, **drag))


def growth_of(pattern: Pattern, omega: Array) -> Array:
    """Growth a period ``(r, P)``, positive where unstable."""
    generator = damped.generators(pattern)
    growth: Array = kernel.scan_damped(pattern, generator, omega)[0]
    return growth - DAMPED_ON_CIRCLE


def _wholes(system: GearSystem, of: str, omega: Array, level: float) -> Iterator[WholeGrowth]:
    """All rows; what is varied is a matrix that acts with a speed, as coordinates do not depend on that."""
    given, back = system.damping_matrix, np.swapaxes(system.damping_matrix, -1, -2)
    matrix = unit_damping(system) if of == DAMPING_RATIO else 0.5 * (given + back)
    others = tuple(term for term in map(_without_dissipation, system.terms) if term.profiles)
    # What is skew in a damping matrix does no work: it is gyroscopic.
    skew = 0.5 * (given - back) if Feature.UNSYMMETRIC_DAMPING in system.features else None
    still = replace(system, damping=skew, terms=others)
    kept = tuple(filter(_dissipative, system.terms)) if of == FACTOR else ()

    def at(factor: float) -> GearSystem:
        drag = Rotation(None, factor, gyroscopic=matrix)
        scaled_terms = [replace(term, left=factor * term.left, stiffness=None) for term in kept]
        return replace(still, terms=(*others, *scaled_terms), rotations=(*system.rotations, drag))

    found = analyse(still, omega)
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    undamped = np.where(found.stable == 0, found.growth_rate, np.minimum(found.growth_rate, 0.0)) * period

    def whole(one: ExactRows, two: ExactRows) -> WholeGrowth:
        rows = one.own.form.rows
        return WholeGrowth(one, two.generator.matrix - one.generator.matrix, omega[rows], undamped[rows])

    def in_steps(one: SteppedRows, two: SteppedRows, level: int) -> WholeGrowth:
        return whole(one.cut(level), two.cut(level))

    one, two = at(1.0), at(2.0)
    if one.piecewise_constant:
        yield from map(whole, exact_rows(one), exact_rows(two))
        return
    for rows in zip(stepped_rows(one), stepped_rows(two), strict=True):
        coarsest = int(rows[0].first_levels(omega[rows[0].own.form.rows]).max())
        yield _resolved(partial(in_steps, *rows), level, coarsest, doubling=1)


def _dissipative(term: PeriodicTerm) -> bool:
    """Whether a term has a damping along one direction, as that of a mesh."""
    u, v = np.broadcast_arrays(term.left, term.right)
    across = u[..., :, None] * v[..., None, :] - v[..., :, None] * u[..., None, :]
    size = np.linalg.norm(u, axis=-1) * np.linalg.norm(v, axis=-1)
    return term.damping is not None and bool(np.all(np.abs(across).max(axis=(-2, -1)) <= PARALLEL * size))


def _without_dissipation(term: PeriodicTerm) -> PeriodicTerm:
    return replace(term, damping=None) if _dissipative(term) else term
