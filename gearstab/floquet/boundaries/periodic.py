"""Boundaries of systems with periodic terms besides the mesh stiffness: friction, mesh damping that follows the
stiffness, gyroscopic terms. Edges are zeros of the growth rate.

Nothing is symplectic here, but the search of damped systems asks for no more than a chain of constant generators, x' =
A_d x, symmetric or not: so the same proof, the same scan with a step set by damping and the same pursuit of meeting
multipliers apply (:mod:`~gearstab.floquet.boundaries.damped.search`), the damping rates being those of the mean system,
means of the terms included. To first order a tongue's bump in the growth rate is at least mu_p + mu_q wide whatever its
coupling, symmetric or not, of sums or of differences of frequencies. Where a mode of the mean system is not damped
nothing is proved, and nothing counts as counted.

Where something varies smoothly A(t) is replaced by commutator-free Magnus steps, whose exponentials are constant
generators again (A is affine in the functions that vary). The number of steps is chosen at a few mesh frequencies and
confirmed at the edges themselves, as in :mod:`~gearstab.floquet.boundaries.smooth`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.sparse.csgraph import connected_components

from gearstab.floquet.boundaries import gyroscopic, smooth
from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.damped.search import NO_GROWTH, Limits, SearchResult, fastest
from gearstab.floquet.boundaries.parts import Part
from gearstab.floquet.general import cut, varying
from gearstab.floquet.general.exact import CanonicalPeriods
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import ROUNDING, Chain, linked
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.segments.reduction import Elastic
from gearstab.floquet.smooth.control import SAFETY
from gearstab.floquet.smooth.steps import CF4_2, CF6_5, Scheme
from gearstab.grouping import equal_rows
from gearstab.propagation.elastic import free_rotations, single_rows
from gearstab.propagation.first_order import FirstOrder
from gearstab.propagation.magnus import StepControl, remainder
from gearstab.propagation.schedule import Schedule, distinct, schedule
from gearstab.system import Array, GearSystem

Verdict = Callable[[Array, Array], Array]
"""Which points (row, cycle) are stable."""

UNCOUPLED = 1e-13
"""Part of the largest entry of a matrix below which one is rounding."""
COARSEST, FINEST = 2, 12
"""Doublings of the first number of steps, one in each smooth interval, that are tried."""


@dataclass(frozen=True)
class PeriodicPart:
    """Rows of a system that have equally many coordinates of each sort.

    part: their places and units; of its pattern only rows, rate, size and rigid-body modes mean anything.
    form: the first-order systems. plan: when what changes, of all rows of the system. varies: whether anything varies
    within an interval. speeds: mesh frequencies over the range.
    """

    part: Part
    form: FirstOrder
    plan: Schedule
    varies: Array
    speeds: Array

    def subset(self, index: Array) -> PeriodicPart:
        """Some of the rows, by position."""
        return replace(self, part=self.part.subset(index), form=self.form.subset(index))

    @property
    def hamiltonian(self) -> Array:
        """``(r,)``: which rows are Hamiltonian at all mesh frequencies."""
        return self.canonical(CF6_5, 0).hamiltonian(self.speeds / self.part.pattern.elastic.rate[:, None])

    def components(self) -> list[PeriodicPart]:
        """The same in parts that nothing couples, without coordinates that nothing couples with what varies, and that
        do not grow: on these exponents of a constant system depend no edge, no step of a scan and no proof.
        """
        form, n = self.form, self.form.elastic
        varying = form.parts if form.by_speed is None else np.concatenate([form.parts, form.by_speed], axis=1)
        touched = _entries(varying)
        number = connected_components(touched | _entries(form.constant[:, None]), directed=False)[1]
        driven = np.unique(number[touched.any(axis=0) | touched.any(axis=1)])
        left = ~np.isin(number, driven)
        exponents = np.linalg.eigvals(form.constant[:, left][:, :, left]).real
        if len(driven) == 0 or exponents.max(initial=-np.inf) > NO_GROWTH or (len(driven) == 1 and not left.any()):
            return [self]
        return [self._only(number == one, n) for one in driven]

    def _only(self, kept: Array, n: int) -> PeriodicPart:
        """The same with some of the states ``(m,)``, the displacements of n coordinates first."""
        own = self.part.pattern
        part = _part(own.rows, own.cycles, int(kept[:n].sum()), own.elastic.rate, own.elastic.rigid_exponents)
        return replace(self, part=part, form=self.form.only(kept))

    def canonical(self, scheme: Scheme, doublings: int) -> CanonicalPeriods:
        """Their common periods, of 2^doublings steps in each interval that is not constant."""
        fractions, values = self.steps(scheme, doublings)
        generator, states = self.generators(values)
        return CanonicalPeriods(self.part.pattern.cycles, fractions, states, generator, self.form.elastic)

    def flow(self, scheme: Scheme, doublings: int, rounding: float = ROUNDING) -> Chain:
        """The chain of a common period, of 2^doublings steps in each interval that is not constant."""
        return self._linked(*self.steps(scheme, doublings), rounding)

    def steps(self, scheme: Scheme, doublings: int) -> tuple[Array, Array]:
        """How long each segment lasts ``(r, S)``, and all functions in it ``(r, S, J)``."""
        counts = np.where(self.varies, 2**doublings, 1)
        return cut(self.plan.subset(self.part.pattern.rows), self.varies, counts, scheme)

    def generators(self, values: Array) -> tuple[Generators, Array]:
        """Generators of distinct states in units of the rates, and the state of each segment; values: ``(r, S, J)``."""
        states, first = distinct(values)
        return Generators.of(self.form, values[:, first]), states

    def _linked(self, fractions: Array, values: Array, rounding: float) -> Chain:
        """values: ``(r, S, J)``, of all functions in each segment."""
        (generator, states), n = self.generators(values), self.part.pattern.size
        # At one mesh frequency of many where generators go with it.
        matrix = generator.at(self.speeds / self.part.pattern.elastic.rate[:, None])
        mean, middle = np.einsum("rd,rpdij->rpij", weights(fractions, states), matrix), len(self.speeds) // 2
        with np.errstate(invalid="ignore"):
            frequencies = np.sqrt(-np.einsum("rii->ri", mean[:, middle, n : 2 * n, :n]))
        rates = -0.5 * np.einsum("rii->ri", mean[:, middle, n:, n:])
        where = self.part.pattern.cycles, fractions, states
        flow = replace(linked(*where, Generators(matrix[:, middle]), frequencies, rates), rounding=rounding)
        if generator.by_speed is None:
            return flow
        exponents = np.linalg.eigvals(mean)
        size = np.maximum(np.abs(exponents), np.finfo(float).tiny)
        lightest = (np.abs(exponents.real) / size).min(axis=2)
        return replace(flow, following=generator, lightest=lightest, sound=np.ones(len(fractions), dtype=bool))

    def growing(self, flow: Chain) -> Array:
        """``(r,)``: which coordinate the mean system lets grow by itself, -1 where none does."""
        mean = np.einsum("rs,rsij->rij", flow.fractions, flow.generator.matrix[:, flow.states])
        return fastest(Generators(mean[:, None]), self.part.pattern.size)


def _entries(matrices: Array) -> Array:
    """``(m, m)``: which entries are more than rounding in any of the matrices ``(r, J, m, m)``."""
    size = np.abs(matrices)
    return np.asarray((size > UNCOUPLED * size.max(axis=(2, 3), keepdims=True, initial=0.0)).any(axis=(0, 1)))


def _part(rows: Array, cycles: float, n: int, rate: Array, rigid_exponents: Array) -> Part:
    """Rows of n elastic coordinates, of whose pattern only sizes and units mean anything."""
    r = len(rows)
    none, whole = np.zeros(r), np.zeros((r, n, n))
    elastic = Elastic(rows, rate, whole, np.zeros((r, 0, n)), None, none, rigid_exponents, whole[:, :0])
    unit, levels = np.ones((r, 1)), np.zeros((r, 1, 0))
    pattern = Pattern(rows, cycles, unit, none, np.zeros(1, dtype=int), levels, elastic, whole[:, None])
    return Part(pattern, n, np.tile(np.arange(n), (r, 1)), 1)


def weights(fractions: Array, states: Array) -> Array:
    """``(r, D)``: how long each state is there."""
    result = np.zeros((len(fractions), int(states.max(initial=0)) + 1))
    for s, state in enumerate(states):
        result[:, state] += fractions[:, s]
    return result


def parts(system: GearSystem, limits: Limits) -> Iterator[PeriodicPart]:
    """All rows of a system, each once."""
    plan, rows, cycles = schedule(system), single_rows(system), float(system.common_period()[0])
    still = free_rotations(system).sum(axis=1)
    sizes = np.stack([still, [row.form.size for row in rows]], axis=1)
    varies, speeds = varying(plan), np.geomspace(limits.start, limits.stop, smooth.PILOTS)
    for members, (rigid, _) in equal_rows(sizes):
        own = [rows[k] for k in members]
        form = FirstOrder.joined([row.form for row in own])
        exponents = np.concatenate([row.rigid_exponents for row in own])
        part = _part(members, cycles, system.size - int(rigid), form.rate, exponents)
        yield PeriodicPart(part, form, plan, varies, speeds)


def searched(system: GearSystem, limits: Limits) -> Iterator[tuple[PeriodicPart, Chain, Chain, SearchResult]]:
    """All rows, once for each part that nothing couples with others: chains of the whole and of the part, from which
    its regions may be named, and what is found out about it.
    """
    for every in parts(system, limits):
        for part in every.components():
            canonical = part.hamiltonian
            for flag in (True, False):
                if len(k := np.flatnonzero(canonical == flag)):
                    own, driven = every.subset(k), part.subset(k)
                    if own.varies.any():
                        doublings, found = _controlled(driven, limits, flag)
                        # Names need few digits, and segments that follow each other.
                        given = CF4_2, doublings
                    else:
                        given, found = (CF6_5, 0), _search(driven, 0, limits, flag, ROUNDING)[0]
                    yield own, own.flow(*given), driven.flow(*given), found


def _search(
    own: PeriodicPart, doublings: int, limits: Limits, canonical: bool, rounding: float
) -> tuple[SearchResult, Verdict]:
    """Search with this many steps; return the result and which points are stable with half of them."""
    pattern = own.part.pattern
    if canonical:
        found = gyroscopic.search(
            own.canonical(CF6_5, doublings), *limits.cycles(pattern), limits.tolerance, limits.floor
        )
        periods = own.canonical(CF6_5, max(doublings - 1, 0))
        return found, lambda row, cycle: np.asarray(~spectrum(periods.monodromy(row, cycle)).off.any(axis=1))
    half = own.flow(CF6_5, max(doublings - 1, 0))
    found = limits.damped(own.flow(CF6_5, doublings, rounding), pattern)
    return found, lambda row, cycle: np.asarray(c_points.moduli(half, row, cycle)[:, 0] <= 0)


def _controlled(own: PeriodicPart, limits: Limits, canonical: bool) -> tuple[int, SearchResult]:
    """The same where the number of steps has to be found; the edges' brackets contain the error of the steps.

    Returns: (doublings of the steps that names need, the result).
    """
    first = np.array([resolution(own, limits, CF6_5, np.pi * limits.tolerance, canonical)])
    control = StepControl(first, first + smooth.ATTEMPTS, limits.tolerance, CF6_5.order)
    for doublings, _ in control:
        # A proof allows for what the steps may be wrong by.
        found, stable = _search(own, doublings, limits, canonical, max(ROUNDING, limits.tolerance))
        error = smooth.edge_errors(found.intervals, stable, limits.tolerance)
        control.judge(error.max(initial=0.0))
    return resolution(own, limits, CF4_2, smooth.ROUGH, canonical), replace(
        found, intervals=smooth.widened(found.intervals, error)
    )


def resolution(own: PeriodicPart, limits: Limits, scheme: Scheme, tolerance: float, canonical: bool) -> int:
    """Doublings of the steps with which the largest moduli are likely to be right to ``tolerance``, relatively; without
    dissipation, when these tell nothing, the monodromy matrices.
    """
    low, high = limits.cycles(own.part.pattern)
    cycle = np.geomspace(low, high, smooth.PILOTS, axis=1).ravel()
    row = np.repeat(np.arange(len(low)), smooth.PILOTS)

    @cache
    def computed(doublings: int) -> Array:
        if canonical:
            return own.canonical(scheme, doublings).monodromy(row, cycle)
        return c_points.moduli(own.flow(scheme, doublings), row, cycle)[:, 0]

    control = StepControl(np.array([COARSEST]), FINEST, tolerance, scheme.order)
    for doublings, _ in control:
        difference = np.abs(computed(doublings) - computed(doublings - 1)).max()
        control.judge(SAFETY * remainder(scheme.order) * difference)
    return doublings
