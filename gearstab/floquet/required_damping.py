"""How much damping makes a system stable: the damping at which the growth rate falls to zero, point by point.

With C = z C1, C1 either the damping of equal modal damping ratios of one, in the modes of the mean system at rest, or
the damping that was given,

    growth(z) = max Re (characteristic exponents) = 0

is solved for z, in each part of the system that the meshes do not couple by itself; the largest of all parts is
required. The growth rate need not fall with z: where two modes of different decay are coupled, damping may widen a
combination tongue (see :mod:`gearstab.perturbation.damped`). Therefore z is scanned at levels z_max/2^k
first; what is returned is the *largest* zero, beyond which all levels up to z_max are stable, and points where a lower
level was stable too are marked. In a primary tongue of first order, Omega = 2 w_p + d of half-width s in Omega,

    z = sqrt(s^2 - d^2)/(2 w_p).

Growth a period is found in modes of the mean system, block by block, where theory in modes applies. Otherwise of the
first-order form as a whole: A(z) is affine in z, A(z) = A(1) + (z - 1) [A(2) - A(1)], so that what a common period
consists of is found once.
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
from gearstab.floquet.segments.reduction import reduce
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
FLAGS = {"not_monotone": 1, "beyond": 2, "failed": 4, "rigid_body": 8}
"""Bits of ``status``: a smaller damping was stable too, the largest zero is given; more than the largest one is
required; no finite growth rate; the damping that the system has makes a rigid-body mode grow, which no damping ratio of
the elastic modes can prevent."""

LARGEST = {DAMPING_RATIO: 0.5, FACTOR: 100.0}
"""Where the search ends by default."""
LEVELS = 11
"""Damping levels that are tried besides zero: the lowest is a thousandth of the largest."""
ROUNDS = 100
"""Steps of the root finding at most; every third one halves the bracket."""


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
    others = (replace(term, damping=None) if _dissipative(term) else term for term in system.terms)
    # What is skew in a damping matrix does no work: it is gyroscopic.
    skew = 0.5 * (given - back) if Feature.UNSYMMETRIC_DAMPING in system.features else None
    still = replace(system, damping=skew, terms=tuple(term for term in others if term.profiles))
    kept = tuple(filter(_dissipative, system.terms)) if of == FACTOR else ()

    def at(factor: float) -> GearSystem:
        drag = Rotation(None, factor, gyroscopic=matrix)
        scaled_terms = [replace(term, left=factor * term.left, stiffness=None) for term in kept]
        return replace(still, terms=(*still.terms, *scaled_terms), rotations=(*system.rotations, drag))

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


@dataclass(frozen=True)
class RequiredDamping:
    """value: ``(rows, P)``, the modal damping ratio (or factor on the given damping) from which on the system is
    stable; 0 where it is stable without, NaN where the search found none. status: ``(rows, P)`` int16, bits of FLAGS.
    """

    value: Array
    status: Array


def required_damping(
    system: GearSystem,
    mesh_frequency: Array,
    of: str = DAMPING_RATIO,
    largest: float | None = None,
    tolerance: float = 1e-6,
) -> RequiredDamping:
    """The damping that stabilises every row of a system at every mesh frequency of the first mesh.

    Parameters
    ----------
    system: any batch shape, with a common period.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``.
    of: ``damping_ratio``: one ratio for all modes of the mean system, in place of the damping that it has; ``factor``:
        on that damping, the symmetric part of C and of terms along one direction. What is skew, friction, and what acts
        with a speed of rotation, rotating damping included, stay as they are.
    largest: damping at which the search ends.
    tolerance: of the value, relative. It is rounded up, so that the growth there is no larger than its rounding error.

    Raises ValueError for a factor on no damping, NotPossible where there is no common period.
    """
    omega = system.operating_points(mesh_frequency)
    value, status = np.zeros(omega.shape), np.zeros(omega.shape, dtype=np.int16)
    levels = np.append(0.0, (largest or LARGEST[of]) * 0.5 ** np.arange(LEVELS - 1, -1, -1))
    for by_damping in growths(system, of, omega, levels[1]):
        index = by_damping.rows
        found, flags = _zeros(by_damping, levels, tolerance)
        # NaN, nothing found, prevails.
        value[index] = np.maximum(value[index], found)
        status[index] |= flags
    if not in_modes(system):
        return RequiredDamping(value, status)
    driven = _driven(system)
    status[driven] |= FLAGS["rigid_body"]
    if of == DAMPING_RATIO:
        value[driven] = np.nan
    return RequiredDamping(value, status)


def _driven(system: GearSystem) -> Array:
    """``(rows,)`` bool: where the damping of the system feeds a rigid-body mode."""
    result = np.zeros(system.rows, dtype=bool)
    for elastic in reduce(system):
        result[elastic.rows] = elastic.rigid_driven
    return result


def _zeros(by_damping: GrowthByDamping, levels: Array, tolerance: float) -> tuple[Array, Array]:
    """(largest zero, status) ``(r, P)`` from ascending levels of which the first is zero."""
    growth = np.stack([by_damping.at_level(level) for level in levels])
    unstable = growth > 0
    count = len(levels)
    last = count - 1 - np.argmax(unstable[::-1], axis=0)
    last = np.where(unstable.any(axis=0), last, -1)
    status = np.where(unstable.sum(axis=0) < last + 1, FLAGS["not_monotone"], 0).astype(np.int16)
    beyond, failed = last == count - 1, ~np.isfinite(growth).all(axis=0)
    status[beyond] |= FLAGS["beyond"]
    status[failed] |= FLAGS["failed"]
    value = np.where(beyond | failed, np.nan, 0.0)
    rows, points = np.nonzero((last >= 0) & ~beyond & ~failed)
    step = by_damping.at_once
    for i in range(0, len(rows), step):
        row, point = rows[i : i + step], points[i : i + step]
        low = last[row, point]
        ends = np.stack([levels[low], levels[low + 1]])
        values = np.stack([growth[low, row, point], growth[low + 1, row, point]])
        # The kernel rounds the growth at a zero either way: half of the tolerance is kept for that.
        found = _refined(by_damping, row, by_damping.omega[row, point], ends, values, 0.5 * tolerance)
        value[row, point] = np.minimum(found * (1 + 0.5 * tolerance), levels[low + 1])
    return value, status


def _refined(
    by_damping: GrowthByDamping, row: Array, omega: Array, ends: Array, values: Array, tolerance: float
) -> Array:
    """Return the zeros ``(N,)`` of points in brackets ``(2, N)`` of values > 0 and <= 0: their last stable ends.

    Source: Illinois method, with halving in between. A growth below DAMPED_ON_CIRCLE is none only where the stable
    end decays no more than that, as a mode without damping does; elsewhere the zero is that of the growth itself.
    """
    floor = np.where(values[1] < -2 * DAMPED_ON_CIRCLE, DAMPED_ON_CIRCLE, 0.0)
    (low, high), (f_low, f_high) = ends.copy(), values + floor
    side = np.zeros(len(row))
    for step in range(ROUNDS):
        active = np.flatnonzero(high - low > tolerance * high)
        if len(active) == 0:
            break
        a, b, f_a, f_b = low[active], high[active], f_low[active], f_high[active]
        x = 0.5 * (a + b) if step % 3 == 2 else b - f_b * (b - a) / (f_b - f_a)
        # A zero at an end of the bracket is approached from inside, by half of what is left to gain.
        margin = 0.5 * tolerance * b
        x = np.clip(x, a + margin, b - margin)
        f = by_damping.at_points(row[active], omega[active], x) + floor[active]
        above = f > 0
        # An end that stays twice running counts half, so that the secant crosses over to it.
        stays = side[active] == np.where(above, 1, -1)
        f_high[active] = np.where(above, np.where(stays, 0.5 * f_b, f_b), f)
        f_low[active] = np.where(above, f, np.where(stays, 0.5 * f_a, f_a))
        low[active], high[active] = np.where(above, x, a), np.where(above, b, x)
        side[active] = np.where(above, 1, -1)
    return high
