"""Which modes and which frequency of excitation make a region unstable.

At epsilon = 0 a tongue is rooted where w_p + w_q = nu, nu = (M/N) Omega with the common period N 2 pi/Omega. How (p,
q, M) are carried on to finite epsilon: inside a tongue the growing Floquet solution is

    u(t) = exp(g t/T) sum_k c_k exp(i w_k t),    w_k = (psi + 2 pi k)/T,

and its Krein form vanishes. In the coordinates of the mean modes the form is the sum of the *actions* w_k |c_(k,
p)|^2 of all modes and frequencies, so that positive and negative frequencies balance. At epsilon = 0 there is one of
each, mode p at +w_p and mode q at -w_q, and their frequencies differ by nu: M = k - k'. At finite epsilon the largest
action of each sign takes their place. This is exact as long as one part carries more than half of its sign's action:
parts are continuous in epsilon, and two cannot exceed one half. Beyond that, and where tongues have merged, each row
distributes the roots over its regions, each once, so that the sum of the shares is greatest: a region has as many
roots of each class (meetings at +1: p = q, M even; at -1: p = q, M odd; elsewhere: p < q) as its meetings say, and a
root is preferred where the number of collisions of its class since T = 0 says that it is its turn. (The nearest root
w_p + w_q = nu, in contrast, is wrong as soon as tongues have shifted by their distance.) The phase of a multiplier
alone cannot tell: it is defined modulo 2 pi and is passed on where two positive multipliers avoid each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.counting.points import first_modes, propagate
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

BAND = 1.25
"""Frequencies up to this times the largest natural frequency of any state are looked at."""


@dataclass(frozen=True, order=True)
class Root:
    """Where a tongue is rooted: modes p <= q of the elastic coordinates, from 0, and M = nu N/Omega."""

    p: int
    q: int
    cycles: int


Shares = dict[Root, float]
"""How much of the action of an unstable solution a root accounts for, at most 1."""

LEADING = 5
"""Parts of each sign that are looked at,"""
LEAST = 1e-3
"""unless they carry less than this of the action of their sign."""
REACH = 1.3
"""How far, as a ratio of mesh frequencies, a root without a share may be from the regions of its row."""
NEARNESS = 0.1
"""What the distance from the root counts beside a share of 1; it fades with DISTANCE, as a part of ln Omega."""
DISTANCE = 0.1
SURE = 0.5
"""A larger share is that of the root itself: shares are continuous in epsilon, and two cannot both exceed a half."""
TURN = 0.5
"""What the order counts beside it: as long as two tongues of a class have not passed each other, their order is that at
epsilon = 0, and the counts of collisions say whose turn it is."""
ENTRIES_AT_ONCE = 2**20
"""Points times modes times frequencies that are treated together: 16 MB for an array."""
BELOW = 1e-9
"""Turns by which a root must lie below another one to be counted: rounding puts none below itself."""
FORBIDDEN = -10.0
"""Score of a root in a slot of another class: less than all that shares, nearness and order can add up to."""


def shares(pattern: Pattern, row: Array, cycle: Array) -> list[Shares]:
    """The shares of the unstable solutions at each point ``(P,)``; of several solutions, the largest of each root."""
    points = propagate(pattern, row, cycle)
    matrix = np.where(points.finite[:, None, None], points.matrix, np.eye(2 * pattern.size))
    found = spectrum(matrix)
    # Of a pair, its mirror images and its complex conjugates one is enough.
    point, place = np.nonzero(found.off & (np.abs(found.values) > 1) & (found.values.imag >= 0))
    result: list[Shares] = [{} for _ in row]
    if len(point) == 0:
        return result
    logs = np.log(found.values[point, place])
    vectors, turn = found.vectors[point, :, place], first_modes(pattern, row[point])
    vectors = np.concatenate([np.einsum("pij,pj->pi", turn, part) for part in np.split(vectors, 2, axis=1)], axis=1)
    # By ascending period, as few frequencies are looked at in short ones, and no more at once than fit in memory.
    order = np.argsort(cycle[point], kind="stable")
    step = max(1, ENTRIES_AT_ONCE // (pattern.size * _frequencies(pattern, row[point], cycle[point])))
    for begin in range(0, len(order), step):
        own = order[begin : begin + step]
        action = solution_actions(pattern, row[point[own]], cycle[point[own]], vectors[own], logs[own])
        for p, part in zip(point[own], action, strict=True):
            for root, share in leading_roots(part).items():
                result[p][root] = max(share, result[p].get(root, 0.0))
    return result


def _frequencies(pattern: Pattern, row: Array, cycle: Array) -> int:
    """How many frequencies k 2 pi/T there are in the band of some points."""
    highest = np.sqrt(np.abs(pattern.squared_frequency[row]).max())
    return 2 * int(np.ceil(BAND * highest * pattern.cycles * cycle.max())) + 3


def leading_roots(action: Array) -> Shares:
    """Pairs of the leading positive and negative parts of ``(n, K)``; the share is the smaller one of the two."""
    found: Shares = {}
    flat = action.ravel()
    order = np.argsort(flat)
    positive, negative = flat[flat > 0].sum(), flat[flat < 0].sum()
    for up in order[::-1][:LEADING]:
        for down in order[:LEADING]:
            if flat[up] <= LEAST * positive or flat[down] >= LEAST * negative:
                continue
            (p, k), (q, j) = divmod(int(up), action.shape[1]), divmod(int(down), action.shape[1])
            root = Root(min(p, q), max(p, q), k - j)
            found[root] = max(found.get(root, 0.0), float(min(flat[up] / positive, flat[down] / negative)))
    return found


def class_of(root: Root) -> int:
    """0, 1, 2: meetings at +1, at -1, elsewhere."""
    return 2 if root.p != root.q else root.cycles % 2


@dataclass(frozen=True)
class Unnamed:
    """A region that awaits its roots: where it is (cycle = 1/Omega), the shares found inside, and how many collisions
    of each class lie below it and inside it.
    """

    cycle: float
    shares: Shares
    passed: tuple[int, int, int]
    meetings: tuple[int, int, int]


def assign(regions: list[Unnamed], frequency: Array, cycles: float) -> list[tuple[Root, ...]]:
    """The roots of each region of one row, that with the largest share first; every region has at least one.

    frequency: ``(n,)``, natural frequencies of the mean system in the units of 1/cycle; cycles: N.
    """
    classes = [_classes(region) for region in regions]
    leading = [max(region.shares, key=region.shares.__getitem__, default=None) for region in regions]
    plain = [
        r is not None
        and c == [class_of(r)]
        and region.shares[r] > SURE
        and frequency[r.p] + frequency[r.q] > 0
        and _rank(r, frequency, cycles) == region.passed[class_of(r)]
        for r, c, region in zip(leading, classes, regions, strict=True)
    ]
    sure = [lead for lead, known in zip(leading, plain, strict=True) if known]
    left = [k for k, lead in enumerate(leading) if not plain[k] or sure.count(lead) > 1]
    taken = {root for k, root in enumerate(leading) if root is not None and k not in left}
    result: list[tuple[Root, ...]] = [() if root is None else (root,) for root in leading]
    found = _distributed([regions[k] for k in left], [classes[k] for k in left], taken, frequency, cycles)
    for k, own in zip(left, found, strict=True):
        result[k] = own
    return result


def _distributed(
    regions: list[Unnamed], classes: list[list[int]], taken: set[Root], frequency: Array, cycles: float
) -> list[tuple[Root, ...]]:
    """The roots of those regions whose solutions do not settle them; taken: roots of the others."""
    if not regions:
        return []
    leading = [max(region.shares, key=region.shares.__getitem__, default=None) for region in regions]
    slots = [(k, c, own[:j].count(c)) for k, own in enumerate(classes) for j, c in enumerate(own)]
    roots = [root for root in _candidates(regions, frequency, cycles) if root not in taken]
    score = _scores(regions, slots, roots, frequency, cycles)
    from scipy.optimize import linear_sum_assignment

    result: list[list[Root]] = [[] for _ in regions]
    for slot, column in zip(*linear_sum_assignment(score, maximize=True), strict=True):
        if score[slot, column] > FORBIDDEN:
            result[slots[slot][0]].append(roots[column])
    for k, own in enumerate(result):
        fallback = leading[k] or _nearest(regions[k].cycle, roots, frequency, cycles)
        own.sort(key=lambda root: (-round(regions[k].shares.get(root, 0.0), 3), root))
        own += [] if own else [fallback]
    return [tuple(own) for own in result]


def _classes(region: Unnamed) -> list[int]:
    """The class of each root that a region must have; where its counts cannot tell, those of the leading solution."""
    wanted = [c for c, count in enumerate(region.meetings) for _ in range(count)]
    if not wanted and region.shares:
        wanted = [class_of(max(region.shares, key=region.shares.__getitem__))]
    return wanted


def _center(root: Root, frequency: Array, cycles: float) -> float:
    """The cycle 1/Omega at which a root lies for epsilon = 0."""
    return root.cycles / (float(frequency[root.p] + frequency[root.q]) * cycles)


def _candidates(regions: list[Unnamed], frequency: Array, cycles: float) -> list[Root]:
    """All roots with a share anywhere, and all whose centre is near the regions."""
    found = {root: None for region in regions for root in region.shares}
    low, high = min(r.cycle for r in regions) / REACH, max(r.cycle for r in regions) * REACH
    n = len(frequency)
    for p in range(n):
        for q in range(p, n):
            rate = float(frequency[p] + frequency[q]) * cycles
            if rate > 0:
                found.update((Root(p, q, m), None) for m in range(max(1, int(low * rate)), int(high * rate) + 2))
    return [root for root in found if frequency[root.p] + frequency[root.q] > 0]


def _rank(root: Root, frequency: Array, cycles: float) -> int:
    """How many roots of the same class lie below a root, since T = 0."""
    turns = frequency * (cycles * _center(root, frequency, cycles))
    if class_of(root) == 2:
        total = (turns[:, None] + turns)[np.triu_indices(len(turns), 1)]
        return int(np.floor(total - BELOW).sum())
    return int(np.floor(turns + 0.5 * class_of(root) - BELOW).sum())


def _scores(
    regions: list[Unnamed], slots: list[tuple[int, int, int]], roots: list[Root], frequency: Array, cycles: float
) -> Array:
    """``(slots, roots)``: the share; something for a root whose turn it is by the count; a little for one that is near.

    slots: region, class, and the number of the root among those of its class in the region.
    """
    place = {root: k for k, root in enumerate(roots)}
    center = np.log([_center(root, frequency, cycles) for root in roots])
    cycle = np.log([regions[k].cycle for k, _, _ in slots])
    score = NEARNESS * np.exp(-np.abs(center[None, :] - cycle[:, None]) / DISTANCE)
    turn = np.array([regions[k].passed[c] + j for k, c, j in slots])
    rank = np.array([_rank(root, frequency, cycles) for root in roots])
    score += TURN * np.exp(-np.abs(rank[None, :] - turn[:, None]))
    for i, (k, _, _) in enumerate(slots):
        for root, share in regions[k].shares.items():
            if root in place:
                score[i, place[root]] += share
    kinds = np.array([class_of(root) for root in roots])
    return np.where(kinds[None, :] == np.array([c for _, c, _ in slots])[:, None], score, FORBIDDEN)


def _nearest(cycle: float, roots: list[Root], frequency: Array, cycles: float) -> Root:
    return min(roots, key=lambda root: abs(np.log(_center(root, frequency, cycles) / cycle)))


def solution_actions(pattern: Pattern, row: Array, cycle: Array, vector: Array, logs: Array) -> Array:
    """Re(w_k) |c_kp|^2 ``(P, n, 2K + 1)`` of the solutions that start at ``vector`` ``(P, 2n)`` with multipliers
    exp(logs).
    """
    n = pattern.size
    period = 2 * np.pi * pattern.cycles * cycle
    frequency = np.sqrt(pattern.squared_frequency[row].astype(complex))
    # Of a state without stiffness along a mode: it is divided by below. Its square is nothing beside usual ones.
    frequency = np.where(np.abs(frequency) < 1e-7, 1e-7, frequency)
    count = _frequencies(pattern, row, cycle) // 2
    w = (-1j * logs[:, None] + 2 * np.pi * np.arange(-count, count + 1)) / period[:, None]
    modes = pattern.modes[row]
    total = np.zeros((len(row), n, 2 * count + 1), dtype=complex)
    position, velocity = vector[:, :n], vector[:, n:]
    time = np.zeros(len(row))
    for s, state in enumerate(pattern.states):
        duration = pattern.fractions[row, s] * period
        own = frequency[:, state]
        up = _integral(own[:, :, None] - w[:, None, :], duration)
        down = _integral(-own[:, :, None] - w[:, None, :], duration)
        part = 0.5 * position[:, :, None] * (up + down) - 0.5j * (velocity / own)[:, :, None] * (up - down)
        total += (modes[:, state] @ part) * np.exp(-1j * w * time[:, None])[:, None, :]
        time += duration
        cosine, sine = np.cos(own * duration[:, None]), np.sin(own * duration[:, None])
        position, velocity = cosine * position + sine / own * velocity, cosine * velocity - own * sine * position
        if len(pattern.states) > 1:
            change = pattern.change(s)[row]
            position = np.einsum("pij,pj->pi", change, position)
            velocity = np.einsum("pij,pj->pi", change, velocity)
    return w.real[:, None, :] * np.abs(total) ** 2


def _integral(x: Array, duration: Array) -> Array:
    """int_0^d exp(i x t) dt for complex x ``(P, n, K)``."""
    half = 0.5 * x * duration[:, None, None]
    small = np.abs(half) < 1e-8  # sin(h)/h = 1 - h^2/6 is 1 in double precision
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(small, 1.0, np.sin(half) / half)
    return duration[:, None, None] * np.exp(1j * half) * ratio
