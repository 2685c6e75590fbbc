"""Which two motions of the mean system, at the speed of a region, the mesh makes unstable together.

Where speeds of rotation act the modes are complex, change with the mesh frequency, and carry energies of either sign.
The growing Floquet solution is taken apart into the motions exp(i w_p t) and exp(-i w_p t) of the mean system at that
mesh frequency, by left and right vectors, and each amplitude, which varies with the common period, into harmonics. Its
two leading parts are a motion of positive and one of negative *action* (the Krein form of a motion times its squared
amplitude; without dissipation all actions add up to zero). If they are p at +w_p and q at -w_q the region is a sum, w_p
+ w_q = nu; if both frequencies have one sign it is a difference, which needs motions of opposite signatures, or a
system without symmetry, where both may have one. nu = M Omega/N with M the distance of the two harmonics.

Motions are numbered by ascending frequency *at that speed*.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.boundaries.names import BAND, Root, nearest_sum
from gearstab.floquet.boundaries.parts import Intervals
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import Chain
from gearstab.grouping import Columns, numbered
from gearstab.system import Array

PLACES = 0.5, 0.1, 0.9
"""Where in a wide interval its motions are looked for, the leading one first; in others, in the middle."""
WIDE = 0.02
"""Relative width from which on an interval may hold several tongues."""
LEADING = 6
"""Parts of the solution that are looked at."""
CLEAR = 0.5
"""The share from which on a pair is named besides the leading one."""
ALIKE = 1e-3
"""Shares that differ by less are equal: the lower harmonic is the name."""
EQUAL = 1e-9
"""Natural frequencies that differ by less than this part are equal."""
NO_GROWTH = 1e-11
"""Growth of the mean system, over the largest exponent, that is rounding."""
ENTRIES_AT_ONCE = 2**21
"""Entries of the tables of harmonics that are made at once: 32 MB."""


@dataclass(frozen=True)
class WhirlPairs(Columns):
    """The leading pair of motions at each of P places, as of a root, and its share ``(P,)``."""

    p: Array
    q: Array
    cycles: Array
    difference: Array
    share: Array

    def root(self, k: int) -> Root:
        """Return that of a place."""
        return Root(int(self.p[k]), int(self.q[k]), int(self.cycles[k]), bool(self.difference[k]))


def named(chain: Chain, whole: Chain, intervals: Intervals, size: int) -> list[tuple[Root, ...]]:
    """The roots of each interval, the leading one first.

    chain: of the motions that come into question; whole: of all. size: n, rigid-body modes included.
    """
    count = np.where(intervals.stop - intervals.start > WIDE * intervals.start, len(PLACES), 1)
    owner, number = numbered(count)
    if len(owner) == 0:
        return []
    cycle = intervals.start[owner] + np.array(PLACES)[number] * (intervals.stop - intervals.start)[owner]
    found = _pairs(chain, intervals.row[owner], cycle, size)
    if whole.size > chain.size:
        few, every = (_frequencies(one, intervals.row[owner], cycle, size) for one in (chain, whole))
        place = _places(few, every)
        found = replace(found, **{name: place[np.arange(len(cycle)), getattr(found, name)] for name in ("p", "q")})
    result: list[tuple[Root, ...]] = [()] * len(count)
    for k, i in enumerate(owner.tolist()):
        if not result[i] or found.share[k] > CLEAR:
            result[i] = tuple(dict.fromkeys([*result[i], found.root(k)]))
    return result


def _mean(chain: Chain, row: Array) -> Array:
    """The mean generators ``(P, m, m)`` of rows."""
    return np.einsum("ps,psij->pij", chain.fractions[row], chain.generator.matrix[row][:, chain.states])


def _frequencies(chain: Chain, row: Array, cycle: Array, size: int) -> Array:
    """Natural frequencies ``(P, size)`` at points, ascending, 0 of motions that do not oscillate."""
    own = np.sort(np.maximum(np.linalg.eigvals(_mean(*chain.at(row, cycle))).imag, 0.0), axis=1)
    return np.pad(own, ((0, 0), (size, 0)))[:, -size:]


def _places(few: Array, every: Array) -> Array:
    """Which of all natural frequencies ``(P, n)`` each of some ``(P, n)`` is, both ascending; zeros stand before."""
    place, above = np.empty(few.shape, dtype=int), np.full(len(few), few.shape[1])
    for k in range(few.shape[1])[::-1]:
        gap = np.abs(every - few[:, [k]])
        near = gap <= gap.min(axis=1, keepdims=True) + EQUAL * few[:, [k]]
        # Of equal ones the last that is free.
        place[:, k] = above = np.minimum(few.shape[1] - 1 - near[:, ::-1].argmax(axis=1), above - 1)
    return place


def _pairs(chain: Chain, row: Array, cycle: Array, size: int) -> WhirlPairs:
    """The leading pairs at points (row, cycle) ``(P,)``."""
    fast = float(np.abs(chain.values.imag).max()) * float(chain.period(cycle).max()) / (2 * np.pi)
    # Gyroscopic terms may make motions faster than the states in the middle of the range.
    most = int(np.ceil(2 * BAND * fast)) + 1
    step = max(1, ENTRIES_AT_ONCE // ((2 * most + 1) * chain.size))
    parts = range(0, len(row), step)
    return WhirlPairs.joined([_pairs_of(chain, row[k : k + step], cycle[k : k + step], size, most) for k in parts])


def _pairs_of(chain: Chain, row: Array, cycle: Array, size: int, most: int) -> WhirlPairs:
    own, each = chain.at(row, cycle)
    motions = _SignedMotions.of(own, each, size)
    harmonic = np.arange(-most, most + 1)
    with np.errstate(all="ignore"):
        weight = _weights(own, each, cycle, motions.left, harmonic) * motions.sign[:, :, None]
    found = _leading(weight, harmonic, motions)
    for k in np.flatnonzero(found.share <= 0):
        upper = motions.exponents[k].imag > 0
        p, q, found.cycles[k] = nearest_sum(motions.exponents[k].imag[upper] * chain.cycles * cycle[k])
        found.p[k], found.q[k] = motions.number[k][upper][[p, q]]
        found.difference[k] = False
    by_itself = motions.driven >= 0
    found.p[by_itself] = found.q[by_itself] = motions.driven[by_itself]
    found.cycles[by_itself], found.difference[by_itself], found.share[by_itself] = 0, False, 1.0
    return found


@dataclass(frozen=True)
class _SignedMotions:
    """Motions exp(mu t) of mean systems at P points, by ascending frequency, each before its complex conjugate.

    exponents, number ``(P, m)``: mu, and the mode from 0. left ``(P, m, m)``: left vectors of motions of action 1 or
    -1; 0 of those that do not oscillate, whose action is 0. sign ``(P, m)``: of the action. driven ``(P,)``: the mode
    that grows by itself, -1 where none does.
    """

    exponents: Array
    number: Array
    left: Array
    sign: Array
    driven: Array

    @classmethod
    def of(cls, chain: Chain, row: Array, size: int) -> _SignedMotions:
        mean = _mean(chain, row)
        values, right = np.linalg.eig(mean)
        values, right = values.astype(complex), right.astype(complex)
        order = np.lexsort((values.imag < 0, np.abs(values.imag)))
        values, right = np.take_along_axis(values, order, 1), np.take_along_axis(right, order[:, None, :], 2)
        upper = values.imag > 0
        # Motions that do not oscillate come first.
        number = np.maximum(size - upper.sum(axis=1)[:, None] + np.cumsum(upper, axis=1) - 1, 0)
        n = chain.frequencies.shape[1]
        weight, damping = np.einsum("pii->pi", mean[:, :n, n : 2 * n]), -mean[:, n : 2 * n, n : 2 * n]
        u = right[:, :n] / weight[:, :, None]
        momentum = right[:, n : 2 * n] + 0.25 * (damping - np.swapaxes(damping, 1, 2)) @ u
        action = 2 * np.sum(u.conj() * momentum, axis=1).imag
        try:
            left = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            left = np.linalg.pinv(right)
        fastest = values.real.argmax(axis=1)
        each = np.arange(len(values))
        grows = values.real[each, fastest] > NO_GROWTH * np.abs(values).max(axis=1)
        driven = np.where(grows, number[each, fastest], -1)
        return cls(values, number, left * np.sqrt(np.abs(action))[:, :, None], np.sign(action), driven)


def _weights(chain: Chain, row: Array, cycle: Array, left: Array, harmonic: Array) -> Array:
    """``(P, m, K)``: the squared amplitude of each harmonic of each motion in the fastest growing solution."""
    period = chain.period(cycle)
    product, scale = c_points.products(chain, row, cycle)
    multipliers, vectors = np.linalg.eig(product)
    each = np.arange(len(row))
    best = np.abs(multipliers).argmax(axis=1)
    logs = np.log(multipliers[each, best].astype(complex)) + scale
    state = np.einsum("pij,pj->pi", chain.basis[row, chain.states[0]], vectors[each, :, best])
    values, modes, inverse = chain.generator.eigen
    turns = logs[:, None] + 2j * np.pi * harmonic
    result, begin = 0.0, np.zeros(len(row))
    for s, d in enumerate(chain.states):
        part, exponents = chain.fractions[row, s], values[row, d] * period[:, None]
        amplitude = np.einsum("pij,pj->pi", inverse[row, d], state)
        rate = exponents[:, :, None] - turns[:, None, :]
        length = part[:, None, None]
        mean = np.where(np.abs(rate * length) < 1e-6, length, np.expm1(rate * length) / rate)
        own = (left @ modes[row, d]) * amplitude[:, None, :]
        result = result + np.exp(-turns * begin[:, None])[:, None, :] * (own @ mean)
        state = np.einsum("pij,pj->pi", modes[row, d], amplitude * np.exp(exponents * part[:, None]))
        begin = begin + part
    return np.nan_to_num(np.abs(result) ** 2)


def _leading(weight: Array, harmonic: Array, motions: _SignedMotions) -> WhirlPairs:
    """The best pairs of the leading parts; weight ``(P, m, K)``: signed actions. The share is 0 where there is none."""
    flat = weight.reshape(len(weight), -1)
    count = min(LEADING, flat.shape[1])
    order = np.argsort(-np.abs(flat), axis=1, kind="stable")[:, :count]
    first, second = np.triu_indices(count, 1)
    one, other = order[:, first], order[:, second]
    (a, k), (b, j) = np.divmod(one, len(harmonic)), np.divmod(other, len(harmonic))
    cycles = harmonic[k] - harmonic[j]
    size, signed = np.abs(flat), [np.take_along_axis(flat, part, 1) for part in (one, other)]
    p, q, up, down = (
        np.take_along_axis(table, part, 1)
        for table, part in (
            (motions.number, a), (motions.number, b), (motions.exponents.imag, a), (motions.exponents.imag, b),
        )
    )  # fmt: skip
    difference = up * down > 0
    allowed = (a != b) & (cycles != 0) & ((signed[0] * signed[1] < 0) | difference) & ~(difference & (p == q))
    share = 2 * np.minimum(*map(np.abs, signed)) / np.maximum(size.sum(axis=1), np.finfo(float).tiny)[:, None]
    # Of equal shares the lower harmonic.
    value = np.where(allowed, np.round(share / ALIKE) - 1e-6 * np.abs(cycles), -np.inf)
    best = value.argmax(axis=1)[:, None]
    found = [np.take_along_axis(part, best, 1)[:, 0] for part in (p, q, np.abs(cycles), difference, share, value)]
    low, high = np.minimum(found[0], found[1]), np.maximum(found[0], found[1])
    return WhirlPairs(low, high, found[2], found[3], np.where(np.isfinite(found[5]), found[4], 0.0))
