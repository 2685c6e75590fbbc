"""Which modes and which frequency of excitation make a damped region unstable, at a cost that the period's length
bounds.

The growing Floquet solution is sampled over a common period and its harmonics c_k are found by the fast Fourier
transform; what they say is explained in :mod:`~gearstab.floquet.boundaries.names`. With damping the Krein form
does not vanish, but positive and negative actions still have their leading parts at the two modes of the tongue.
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.boundaries.damped.scan import halves
from gearstab.floquet.boundaries.names import BAND, Root, Shares, leading_roots, nearest_sum
from gearstab.floquet.boundaries.parts import Interval, Intervals, by_row
from gearstab.floquet.kernel.chain import Chain
from gearstab.system import Array

PEAKS = 6
"""Places of an interval at which its tongues are looked for, at most, besides its middle and both ends."""
ASIDE = 0.03
"""How near its ends, as a part of the width."""
PRESENT = 0.4
"""The share that the leading root needs somewhere for a tongue to be named as part of a region."""
CLEAR = 0.5
"""The share of the action that no two roots can have at once."""
REPEATED = 0.75
"""By how much of a share a root may lead another one to be that of a region though it is that of another region,
too."""
SAMPLES = 4
"""A period of the fastest harmonic that counts."""
ENTRIES_AT_ONCE = 2**22
LONGEST = 2**18
"""Samples of a period, at most: what is faster is left out."""


Seen = list[Shares]
"""The shares of the roots at some places in an interval, the middle first."""


def seen(chain: Chain, intervals: Intervals, peaks: list[Array]) -> list[Seen]:
    """Return the harmonics seen in each interval; peaks: cycles inside of each, at which its tongues are strongest."""
    owner, cycle = [], []
    for k, (i, summits) in enumerate(zip(intervals, peaks, strict=True)):
        width = i.stop - i.start
        places = [0.5 * (i.start + i.stop), *summits[:PEAKS], i.start + ASIDE * width, i.stop - ASIDE * width]
        owner += [k] * len(places)
        cycle += places
    row = intervals.row[np.array(owner, dtype=int)]
    order = np.argsort(row, kind="stable")
    found: list[Shares] = [{} for _ in owner]
    for position, there in zip(order, shares(chain, row[order], np.array(cycle)[order]) if owner else [], strict=True):
        found[position] = there
    result: list[Seen] = [[] for _ in intervals]
    for k, there in zip(owner, found, strict=True):
        result[k].append(there)
    return result


def _plain(places: Seen) -> Root | None:
    """The root that leads everywhere, with more than half of the action in the middle; None where there is none."""
    leading = {max(there, key=there.__getitem__, default=None) for there in places}
    root = leading.pop() if len(leading) == 1 else None
    return root if root is not None and places[0][root] > CLEAR else None


def plain(intervals: Intervals, found: list[Seen]) -> list[Root | None]:
    """The roots of the intervals of those rows in which every interval has a plain one, and each another one."""
    roots = [_plain(own) for own in found]
    result: list[Root | None] = [None] * len(intervals)
    for mine in by_row(intervals.row, int(intervals.row.max(initial=-1)) + 1):
        own = [roots[k] for k in mine]
        if None not in own and len(set(own)) == len(own):
            for k in mine:
                result[k] = roots[k]
    return result


def named(chain: Chain, intervals: Intervals, found: list[Seen], allowed: list[set[Root]]) -> list[tuple[Root, ...]]:
    """The roots of each interval, that with the largest share first; the nearest one where a growing solution has no
    harmonics of both signs.

    Roots that lead somewhere in an interval are named. allowed: the roots that come into question; where it is empty,
    all do.
    """
    best: list[Shares] = [{} for _ in intervals]
    present: list[set[Root]] = [set() for _ in intervals]
    for k, own in enumerate(found):
        for there in own:
            chosen = {root: share for root, share in there.items() if not allowed[k] or root in allowed[k]}
            for root, share in chosen.items():
                best[k][root] = max(share, best[k].get(root, 0.0))
            leads = max(chosen.values(), default=0.0)
            present[k] |= {r for r, share in chosen.items() if share > PRESENT and (allowed[k] or share == leads)}
    result: list[tuple[Root, ...]] = [()] * len(intervals)
    for mine in by_row(intervals.row, len(chain.fractions)):
        every = [best[k] or dict.fromkeys(sorted(allowed[k]) or [_nearest(chain, intervals[k])], 0.0) for k in mine]
        # Undamped regions have each root once already.
        free = [not allowed[k] for k in mine]
        leading = _distributed(every) if all(free) else [_ranked(shares)[0] for shares in every]
        for k, root in zip(mine, leading, strict=True):
            elsewhere = () if allowed[k] else leading
            others = [r for r in _ranked(best[k]) if r in present[k] and r != root and r not in elsewhere]
            result[k] = (root, *others)
    return result


def _ranked(shares: Shares) -> list[Root]:
    return sorted(shares, key=lambda root: (-round(shares[root], 3), root))


def _distributed(shares: list[Shares]) -> list[Root]:
    """A root for each region of a row: that of the largest share, but one that leads in several regions is only once
    taken where another root of some share is free: two tongues, and not the same one twice.
    """
    leading = [_ranked(own)[0] for own in shares]
    taken = dict.fromkeys(leading)
    result = list(leading)
    for root in taken:
        regions = [k for k, own in enumerate(leading) if own == root]
        for k in sorted(regions, key=lambda k: -shares[k][root])[1:]:
            free = [r for r in _ranked(shares[k]) if r not in taken and r not in result]
            if free and shares[k][free[0]] > shares[k][root] - REPEATED:
                result[k] = free[0]
    return result


def _nearest(chain: Chain, interval: Interval) -> Root:
    """The root nearest to the middle of an interval, of equally near ones that of the lowest harmonic."""
    turns = np.nan_to_num(chain.frequencies[interval.row]) * chain.cycles * 0.5 * (interval.start + interval.stop)
    return Root(*nearest_sum(turns))


def shares(chain: Chain, row: Array, cycle: Array) -> list[Shares]:
    """The shares of the unstable solutions at each point ``(P,)``, rows ascending; of several solutions, the largest of
    each root.
    """
    result: list[Shares] = [{} for _ in row]
    fastest = np.abs(chain.values.imag).max(axis=(1, 2))[row] * chain.period(cycle) / (2 * np.pi)
    # A power of two, for the Fourier transform.
    count = np.exp2(np.ceil(np.log2(np.maximum(2 * SAMPLES * BAND * fastest, 16)))).astype(int)
    count = np.minimum(count, LONGEST)
    for number in np.unique(count[chain.sound[row]]):
        members = np.flatnonzero((count == number) & chain.sound[row])
        step = max(1, ENTRIES_AT_ONCE // (number * chain.size))
        for begin in range(0, len(members), step):
            part = members[begin : begin + step]
            for k, found in zip(*_solutions(chain, row[part], cycle[part], int(number)), strict=True):
                for root, share in leading_roots(found).items():
                    result[part[k]][root] = max(share, result[part[k]].get(root, 0.0))
    return result


def _solutions(chain: Chain, row: Array, cycle: Array, count: int) -> tuple[Array, Array]:
    """(point, action of its harmonics ``(n, count)``, those of negative numbers first) of all growing solutions, of
    complex conjugates one.
    """
    first, second, scale = halves(chain, row, cycle)
    multipliers, vectors = np.linalg.eig(second @ first)
    with np.errstate(divide="ignore"):
        logs = np.log(multipliers.astype(complex)) + scale[:, None]
    point, place = np.nonzero((logs.real > 0) & (multipliers.imag >= 0))
    if len(point) == 0:
        return point, np.empty((0, 0, count))
    row, period, logs = row[point], chain.period(cycle[point]), logs[point, place]
    state = np.einsum("pij,pj->pi", chain.basis[row, chain.states[0]], vectors[point, :, place])
    harmonics = np.fft.fftshift(
        np.fft.fft(sampled(chain, row, period, state, logs, count, chain.frequencies.shape[1]), axis=-1), axes=-1
    )
    number = np.fft.fftshift(np.fft.fftfreq(count, 1 / count))
    frequency = (logs.imag[:, None] + 2 * np.pi * number) / period[:, None]
    return point, frequency[:, None, :] * np.abs(harmonics) ** 2


def sampled(chain: Chain, row: Array, period: Array, state: Array, logs: Array, count: int, n: int) -> Array:
    """The first n components ``(P, n, count)`` over a common period of the solutions that begin with ``state`` ``(P,
    m)``, over exp(logs t/T), which makes them periodic; rows ascend.
    """
    result = np.empty((len(row), n, count), dtype=complex)
    time = np.arange(count) / count
    for r in np.unique(row):
        members = np.flatnonzero(row == r)
        values, modes, inverse = (part[r] for part in chain.generator.eigen)
        edges = np.append(0.0, np.cumsum(chain.fractions[r]))
        # A sample on an edge, but for rounding, is the first of the segment after it.
        places = np.ceil(edges * count - 1e-9).astype(int)
        places[-1] = count
        own, turns = state[members], logs[members, None]
        for s, d in enumerate(chain.states):
            rates = values[d] * period[members, None] - turns
            amplitude = own @ inverse[d].T
            inside = time[places[s] : places[s + 1]] - edges[s]
            result[members, :, places[s] : places[s + 1]] = modes[d, :n] @ (
                amplitude[:, :, None] * np.exp(rates[:, :, None] * inside)
            )
            own = (amplitude * np.exp(rates * (edges[s + 1] - edges[s]))) @ modes[d].T
    return result
