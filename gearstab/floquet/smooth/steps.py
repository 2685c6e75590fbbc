"""Common periods cut into Magnus steps: from a gear system to patterns of any resolution.

A common period is cut at all jumps and kinks of all meshes. The *pieces* between them are either constant, and then one
exact segment, or cut into steps of equal length, the more the faster the stiffness varies; every exponential of a step
is a segment with a stiffness of its own. None of this depends on the mesh frequency, so that the eigenproblems of the
many stiffness matrices serve the whole frequency axis.

With a commutator-free Magnus scheme a step of x' = A(t) x over [t, t + h] is a product of exponentials, the earliest
first,

    x(t + h) = exp(h sum_j a_mj A_j) ... exp(h sum_j a_1j A_j) x(t),    A_j = A(t + c_j h),

with the Gauss-Legendre nodes c_j. For an oscillator, A = [[0, I], [-K, -C]] with constant C, each exponential is
itself an oscillator of constant stiffness: with the duration d_i h and the stiffness K_i,

    d_i = sum_j a_ij,    K_i = sum_j a_ij K(t + c_j h) / d_i,

so that a step is symplectic where C = 0. The published coefficients f_in belong to the moments of A over the step,
sum_n f_in (2n - 1) int_0^1 P_{n-1}(2x - 1) A(t + x h) dx; the nodes integrate these exactly where A is a polynomial of
degree 3 at most.

Schemes of sixth order have an exponential of negative duration.

Source: Alvermann & Fehske 2011, J. Comput. Phys. 230, 5930-5956, optimized propagators CFET 4:2 and 6:5; the first
is that of Blanes & Moan 2006, Appl. Numer. Math. 56, 1519-1537. f_23 and f_33 of CFET 6:5 were computed from the other
coefficients and the order conditions sum_i f_i3 = 0, sum_(i<k) (f_i2 f_k3 - f_k2 f_i3) = -1/15.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.segments.pattern import CONSTANT, PROBES, SHORTEST, Pattern
from gearstab.floquet.segments.reduction import Elastic, reduce
from gearstab.grouping import equal_rows, numbered
from gearstab.propagation.schedule import Functions, sources
from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class Scheme:
    """order: of convergence. nodes ``(k,)``: c_j, in parts of the step. weights ``(m, k)``: a_ij."""

    name: str
    order: int
    nodes: Array
    weights: Array

    @property
    def exponentials(self) -> int:
        """m, their number per step."""
        return len(self.weights)

    @property
    def durations(self) -> Array:
        """``(m,)``: d_i, in parts of the step; they add up to 1."""
        return np.asarray(self.weights.sum(axis=1))

    @property
    def mixture(self) -> Array:
        """``(m, k)``: a_ij/d_i, with which the stiffnesses at the nodes make up those of the exponentials."""
        return np.asarray(self.weights / self.durations[:, None])


def _from_moments(name: str, order: int, moments: list[tuple[float, float, float]]) -> Scheme:
    """The scheme of the coefficients f_in of its first half, latest exponential first, the middle one included.

    Symmetric in time: f_in of the other half has the sign (-1)^(n - 1).
    """
    middle = moments[-1:] if moments[-1][1] == 0 else []
    first = moments[: len(moments) - len(middle)]
    latest_first = first + middle + [(f1, -f2, f3) for f1, f2, f3 in first[::-1]]
    x, w = np.polynomial.legendre.leggauss(3)
    legendre = np.stack([np.ones(3), x, 0.5 * (3 * x * x - 1)])
    weights = np.array(latest_first[::-1]) @ (np.array([[1.0], [3.0], [5.0]]) * legendre * (0.5 * w))
    return Scheme(name, order, 0.5 * (x + 1), weights)


CF4_2 = _from_moments("CF4:2", 4, [(1 / 2, 1 / 3, 0.0)])
CF6_5 = _from_moments(
    "CF6:5",
    6,
    [
        (0.1714, 0.15409059414309687213, 0.11947178242929061641),
        (0.37496374319946236513, 0.13813675394387646682, -0.13090674649282935741),
        (-0.09272748639892473025, 0.0, 0.02286992812707748200),
    ],
)


BASE = 4
"""Steps a common period of the coarsest resolution, unless there are more pieces or steps fail to resolve K(t)."""
FOLLOWED = 0.008
"""A stiffness counts as resolved where the parabola through its values at the nodes is right within this part of its
variation: below that errors do not yet fall as they should, and estimates may be far too low."""
MOST = 4096
"""Steps of the coarsest resolution."""
HALFWAY = np.sqrt(2.0)
"""Resolutions lie a factor sqrt(2) apart, so that every second one halves the steps."""
EVENNESS = 1 / 7
"""Steps are denser by this power of the slope: where errors of seventh order a step are to be equally large."""


ENTRIES_AT_ONCE, TYPICAL = 2**20, 512
"""Size of the stiffness matrices of the rows that are treated together, at so many segments."""

NODES = CF6_5.nodes
CHECKS = np.array([0.02, 0.3, 0.7, 0.98])
PARABOLA = np.linalg.solve(np.vander(NODES, 3).T, np.vander(CHECKS, 3).T).T
"""``(4, 3)``: from the values of a parabola at the nodes to those at the checks."""

LEFT_OUT, VARYING, STILL, JOINED = range(4)
"""Kinds of pieces: of no length; to be cut into steps; constant; constant and equal to the one before."""


def edges_of(functions: Functions) -> Array:
    """``(rows, Q)``: jumps and kinks in parts of a common period, the unit of time, ascending from [0, 1) on.

    Rows with fewer of them than others have the end of the period for the rest; without any, 0 is one.
    """
    # A mesh whose stiffness does not vary has no jumps; another one's edge stands for its.
    found = [np.where(functions.varies(k)[:, None], functions.jumps(k), np.nan) for k in range(len(functions.found))]
    every = np.concatenate([*found, np.full((functions.rows, 1), np.nan)], axis=1)
    every = every - np.floor(every)
    every = np.sort(np.where(every >= 1.0, 0.0, every), axis=1)
    every[:, 0] = np.where(np.isnan(every[:, 0]), 0.0, every[:, 0])
    return np.where(np.isnan(every), every[:, :1] + 1.0, every)


@dataclass(frozen=True)
class Division:
    """Rows whose common periods are cut into the same sequence of pieces.

    rows ``(r,)``: positions in the flattened batch, as those of ``elastic``. start, length ``(r, Q)``: of the pieces,
    in parts of the common period. constant ``(Q,)`` bool. density ``(Q,)``: shares of the steps, 0 where constant.
    base: about the steps of the coarsest resolution.
    """

    functions: Functions
    elastic: Elastic
    cycles: float
    start: Array
    length: Array
    constant: Array
    density: Array
    base: int = BASE

    @property
    def rows(self) -> Array:
        """``(r,)``, positions in the flattened batch."""
        return self.elastic.rows

    def subset(self, index: Array) -> Division:
        """Some of the rows, by position."""
        return replace(self, elastic=self.elastic.subset(index), start=self.start[index], length=self.length[index])

    def counts(self, resolution: int) -> Array:
        """``(Q,)``: steps of each piece. Two resolutions further on there are twice as many."""
        steps = self.base * (HALFWAY if resolution % 2 else 1.0) * self.density
        steps = np.maximum(1, np.rint(steps).astype(int)) * 2 ** (resolution // 2)
        return np.where(self.constant, 1, steps)

    def missed(self) -> float:
        """Return how badly the coarsest steps resolve the stiffness, over FOLLOWED: 1 or less is good enough."""
        start, length, piece = in_steps(self.start, self.length, self.counts(0))
        moving = ~self.constant[piece]
        if not moving.any():
            return 0.0
        place = start[:, moving, None] + length[:, moving, None] * np.append(NODES, CHECKS)
        known = self.functions(self.rows, place.reshape(len(place), -1)).reshape(*place.shape, -1)
        span = np.maximum(np.ptp(known, axis=(1, 2)), np.finfo(float).tiny)[:, None, None]
        missed = np.abs(known[:, :, len(NODES) :] - PARABOLA @ known[:, :, : len(NODES)])
        # Of a mesh that varies little or not at all there is only rounding to see.
        noise = CONSTANT * np.abs(known).max(axis=(1, 2))[:, None, None]
        return float(np.max(np.maximum(missed - noise, 0.0) / span)) / FOLLOWED

    def pattern(self, scheme: Scheme, resolution: int) -> Pattern:
        """The rows as a pattern: a segment a constant piece and an exponential elsewhere, all with their own state."""
        start, length, piece = in_steps(self.start, self.length, self.counts(resolution))
        fractions, levels = exponentials(self.functions, self.rows, start, length, self.constant[piece], scheme)
        states, stiffness = np.arange(fractions.shape[1]), self.elastic.stiffness_of(levels)
        return Pattern(self.rows, self.cycles, fractions, self.start[:, 0], states, levels, self.elastic, stiffness)


def in_steps(start: Array, length: Array, counts: Array) -> tuple[Array, Array, Array]:
    """(start, length ``(r, S)``, piece ``(S,)``) of the equal steps that pieces ``(r, Q)`` are cut into."""
    piece, number = numbered(counts)
    length = length[:, piece] / counts[piece]
    return start[:, piece] + number * length, length, piece


def exponentials(
    functions: Functions, rows: Array, start: Array, length: Array, still: Array, scheme: Scheme
) -> tuple[Array, Array]:
    """(durations ``(r, X)``, mesh stiffnesses ``(r, X, meshes)``) of the exponentials of steps.

    start, length: ``(r, S)``; still: ``(S,)``, which steps are over constant pieces and take a single exponential.
    """
    place = start[:, :, None] + length[:, :, None] * scheme.nodes
    known = functions(rows, place.reshape(len(rows), -1)).reshape(*place.shape, -1)
    levels = scheme.mixture @ known
    levels[:, still] = known[:, still, len(scheme.nodes) // 2, None]
    durations = length[:, :, None] * np.where(still[:, None], 1.0, scheme.durations)
    kept = ~still[:, None] | (np.arange(scheme.exponentials) == 0)
    return np.ascontiguousarray(durations[:, kept]), levels[:, kept]


def divisions(system: GearSystem) -> Iterator[Division]:
    """All rows, grouped; every row occurs exactly once."""
    common, turns = system.common_period()
    functions, cycles = Functions(sources(system, turns), system.batch), float(common)
    edges = edges_of(functions)
    length = np.diff(edges, axis=1, append=edges[:, :1] + 1)
    span, code = _kinds(functions, edges, length)
    for elastic in reduce(system):
        for index, key in equal_rows(code[elastic.rows]):
            members = elastic.rows[index]
            own = (key == VARYING) | (key == STILL)
            owner, kept = np.cumsum(own) - 1, np.flatnonzero(own)
            start, parts = edges[members][:, kept], np.zeros((len(members), len(kept)))
            np.add.at(parts.T, owner[key > 0], length[members].T[key > 0])
            constant = key[kept] == STILL
            slope = span[members][:, kept] / parts
            wanted = np.mean(parts * slope**EVENNESS, axis=0) * ~constant
            density = wanted / max(float(wanted.sum()), np.finfo(float).tiny)
            found = Division(functions, elastic.subset(index), cycles, start, parts, constant, density)
            while found.base < MOST and (missed := found.missed()) > 1.0:
                # What a parabola misses falls as the cube of the step, so that some choices need not be tried.
                hopeless, base = min(found.base * np.cbrt(missed) / HALFWAY, MOST), found.base
                while base == found.base or base < hopeless:
                    base = int(np.ceil(HALFWAY * base))
                found = replace(found, base=base)
            yield found


def portions(system: GearSystem, most: int | None = None) -> Iterator[Division]:
    """All rows, ``most`` at once, by default as many as fit in memory at TYPICAL segments per common period."""
    for division in divisions(system):
        size = max(1, division.elastic.static.shape[-1])
        step = most or max(1, ENTRIES_AT_ONCE // (TYPICAL * size**2))
        for begin in range(0, len(division.rows), step):
            yield division.subset(np.arange(begin, min(begin + step, len(division.rows))))


def _kinds(functions: Functions, edges: Array, length: Array) -> tuple[Array, Array]:
    """By how much the stiffness varies (relative) on each piece ``(rows, Q)``, and the kind of the piece."""
    place = edges[:, :, None] + length[:, :, None] * PROBES
    known = functions(np.arange(functions.rows), place.reshape(len(place), -1)).reshape(*place.shape, -1)
    size = np.maximum(np.abs(known).max(axis=(1, 2)), np.finfo(float).tiny)
    span = ((known.max(axis=2) - known.min(axis=2)) / size[:, None]).max(axis=2, initial=0.0)
    kind = np.where(length > SHORTEST, np.where(span > CONSTANT, VARYING, STILL), LEFT_OUT)
    each = np.arange(len(edges))
    before = np.full(len(edges), -1)
    for q in range(edges.shape[1]):
        step = np.abs(known[:, q, 0] - known[each, np.maximum(before, 0), 0]) / size
        same = (before >= 0) & (step <= CONSTANT).all(axis=-1)
        same &= (kind[:, q] == STILL) & (kind[each, np.maximum(before, 0)] >= STILL)
        before = np.where(kind[:, q] != LEFT_OUT, q, before)
        kind[same, q] = JOINED
    return span, kind
