"""Branches that leave another one: at period doublings with twice its period, at branch points with its own.

**Symmetric systems.** Several multipliers are 1 or -1 at once, and branches leave along those directions of the null
space that keep some of the symmetry: one part alone, or parts that move alike or opposite to each other, or what is at
right angles to these. Branches that a symmetry takes into each other have the same multipliers and the same
deflections, of other meshes: one of them is followed.

**A branch point** is left on both sides, at right angles to the branch itself. At a fold of several multipliers one of
them is the fold, and what is at right angles to the branch belongs to the others.

Source: Seydel 2010, chapter 5; Golubitsky, Stewart & Schaeffer 1988, chapter XIII (symmetry).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.linalg import qr

from gearstab.response.backlash.continuation import BRANCHING, DOUBLING, FOLD, MORE, Curve, Point, StepLimits
from gearstab.response.backlash.motions import GRAZING, MOST_BRANCHES, Branch, BranchMotion, stability
from gearstab.response.backlash.sections import Lap, SectionMap
from gearstab.system import Array

UNDISTURBED = 1e-10
"""Residual of a linear motion, relative to its amplitude."""
SMALLEST = 1e-3
"""Amplitude, in units of the state, with which a branch that leaves begins."""
ALONG = 0.3
"""Part of a direction at right angles to the branch, below which it is the branch itself."""
SAME = 1e-6
"""Difference of two motions, in units of the state, below which they are one."""
COMPARED = 8
"""The motion by which two branches are told apart: nearer to where they leave all are alike."""
ALIKE = 1e-6
"""Difference of deflections, in units of the state, and of multipliers, of motions that a symmetry relates."""
LONGEST = 16
"""Common periods of a motion on a doubled branch."""
LEFT = {DOUBLING: "doubling", BRANCHING: "branch_point", FOLD: "branch_point"}
"""How the branch begins that leaves there."""


class Branches:
    """The branches that are known of one system over its mesh frequency, or the parameter of its section map.

    limits: of every branch;  follow: where those that leave are followed, too: at period doublings, at branch points.
    found: the branches;  unit: of the state, the extent of the first motion.
    jumps: by branch and motion where a stable motion ends: 1 where it does as the parameter rises, -1 as it falls, and
        the branch and motion next to the one that follows, None where that is not known.
    """

    def __init__(self, laps: SectionMap, limits: StepLimits, follow: Container[str] = ()) -> None:
        self.laps, self.limits, self.follow = laps, limits, follow
        self.span = limits.high - limits.low
        self.unit = 1.0
        self.found: list[Branch] = []
        self.jumps: dict[tuple[int, int], tuple[int, tuple[int, int] | None]] = {}

    @property
    def points(self) -> int:
        """How many motions have been found."""
        return sum(len(branch.motions) for branch in self.found)

    def curve(self, periods: int) -> Curve:
        """The motions that repeat themselves after so many common periods."""
        return Curve(lambda x, value: self.laps.lap(x, value, periods), self.unit, self.span)

    def room(self) -> bool:
        """Whether another branch may be followed."""
        return self.points + 4 < self.limits.most and len(self.found) < MOST_BRANCHES

    def one_way(
        self, start: Point, along: Array, periods: int, known: int, most: int | None = None
    ) -> tuple[list[BranchMotion], str]:
        """Motions from the start on, so many at most, and why they end; known: of the branch, that count already."""
        motions: list[BranchMotion] = []
        left = self.limits.most - self.points - known
        limits = replace(self.limits, most=left if most is None else min(most, left))
        curve, before = self.curve(periods), start
        for item in curve.follow(start, along, limits):
            if isinstance(item, str):
                return motions, item
            found = [grazing_between(curve, before, item), item]
            motions += [self.motion(point) for point in found if point is not None][: limits.most - len(motions)]
            if len(motions) >= limits.most:
                break
            before = item
        return motions, MORE

    def motion(self, point: Point) -> BranchMotion:
        """Sum up a point; the motion itself, which takes far more memory, is let go."""
        lap = point.visit
        assert isinstance(lap, Lap)
        found = stability(self.laps, lap, point.parameter)
        own = point.x, point.parameter, point.kind or "none", point.multiplicity, point.vector
        return BranchMotion(*own, found, lap.cycle, lap.grazing)

    def place(self, point: Point, periods: int) -> tuple[int, int] | None:
        """Branch and motion next to a motion, begun at any of its periods; None where it is on no known branch."""
        lap = point.visit
        assert isinstance(lap, Lap)
        phases = lap.sections()[:periods]
        for number, branch in enumerate(self.found):
            if branch.periods != periods:
                continue
            for k, guess, extent in branch.between(point.parameter):
                if np.abs(phases - guess).max(axis=1).min() > extent + SAME * self.unit:
                    continue
                try:
                    there = self.curve(periods).at(guess, point.parameter)
                except ArithmeticError:
                    continue
                if np.abs(phases - there.x).max(axis=1).min() <= SAME * self.unit:
                    return number, k
        return None


def leaving(search: Branches, parent: int) -> Iterator[Branch]:
    """Follow all branches that leave a known one, each when the ones before it are known."""
    branch = search.found[parent]
    for number, motion in enumerate(branch.motions):
        at = BRANCHING if motion.kind == FOLD and motion.multiplicity > 1 else motion.kind
        if motion.vector is None or at not in search.follow or at not in LEFT:
            continue
        periods = branch.periods * (2 if motion.kind == DOUBLING else 1)
        if periods > LONGEST:
            continue
        for normal in _normals(search, branch, number):
            found = _left(search, motion, normal, periods, (parent, number)) if search.room() else None
            if found is not None:
                yield found


def _normals(search: Branches, branch: Branch, number: int) -> list[Array]:
    """``(m + 1,)``, of unit length, in units of the curve: across what planes branches leave a motion."""
    motion = branch.motions[number]
    assert motion.vector is not None
    own = search.laps.at(motion.parameter)
    physical = np.concatenate(own.physical(), axis=1).T @ own.basis
    found = [np.append(v, 0.0) for v in directions(motion.vector, physical @ motion.vector)]
    if motion.kind == DOUBLING:
        return found  # The opposite one is the same motion a period later.
    near = branch.motions[max(0, number - 1)], branch.motions[min(number + 1, len(branch.motions) - 1)]
    along = np.append((near[1].x - near[0].x) / search.unit, (near[1].parameter - near[0].parameter) / search.span)
    along /= np.linalg.norm(along)
    across = [v - (v @ along) * along for v in found]
    return [s * v / np.linalg.norm(v) for v in across if np.linalg.norm(v) > ALONG for s in (1, -1)]


def _left(
    search: Branches, motion: BranchMotion, normal: Array, periods: int, leaves: tuple[int, int]
) -> Branch | None:
    """The branch through the plane across ``normal``; None where it is known, or not found."""
    curve, first = search.curve(periods), []
    amplitude = _grazing(curve, motion, normal[:-1], search.limits.largest) if not normal[-1] else 0.0
    if amplitude:
        x = motion.x + amplitude * curve.unit * normal[:-1]
        first = [search.motion(Point(x, motion.parameter, curve.mapping(x, motion.parameter), GRAZING))]
    step = (amplitude + SMALLEST) * normal
    try:
        there = motion.x + curve.unit * step[:-1], motion.parameter + curve.span * float(step[-1])
        start, _ = curve.corrected(*there, normal)
    except ArithmeticError:
        return None
    if search.place(start, periods) is not None:
        return None
    few, _ = search.one_way(start, normal, periods, 1, COMPARED)
    if few and any(_alike(search, few[-1], other) for other in search.found if (other.parent, other.leaves) == leaves):
        return None
    motions, end = search.one_way(start, normal, periods, len(first) + 1)
    return Branch((*first, search.motion(start), *motions), periods, (LEFT[motion.kind], end), *leaves)


def _alike(search: Branches, motion: BranchMotion, other: Branch) -> bool:
    """Whether a symmetry takes a motion into one of a branch."""
    own = _signature(motion, search.unit)
    for _, guess, _ in other.between(motion.parameter):
        try:
            there = search.motion(search.curve(other.periods).at(guess, motion.parameter))
        except ArithmeticError:
            continue
        if np.abs(_signature(there, search.unit) - own).max() < ALIKE:
            return True
    return False


def _signature(motion: BranchMotion, unit: float) -> Array:
    """Return the features that symmetries keep: multipliers, and deflections of the meshes by size."""
    return np.concatenate([np.sort(np.abs(motion.stability.multipliers)), np.sort(motion.cycle.rms) / unit])


def _grazing(curve: Curve, motion: BranchMotion, vector: Array, largest: float) -> float:
    """The amplitude up to which what leaves is linear, at the same parameter; 0 where it is not at all.

    Teeth in contact move linearly: at an edge of an instability region there is a motion of twice the period of any
    amplitude, up to the one at which a flank is left, or met.
    """

    def linear(amplitude: float) -> bool:
        x = motion.x + amplitude * curve.unit * vector
        off = np.abs(curve.mapping(x, motion.parameter).end - x).max(initial=0.0) / curve.unit
        return bool(off <= UNDISTURBED * max(1.0, amplitude))

    low, high = 0.0, SMALLEST
    if not linear(SMALLEST):
        return 0.0
    while linear(high):
        low, high = high, 2 * high
        if high > largest:
            return 0.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if linear(middle) else (low, middle)
    return low


def directions(space: Array, seen: Array) -> list[Array]:
    """Directions ``(m,)`` in a null space ``(m, k)`` along which branches may leave; k = 1: its only one.

    seen: ``(n, k)``, its columns in coordinates of the parts. A basis of vectors with as many zeros there as there can
    be, their sums and differences; of two dimensions also what is at right angles to each.
    """
    k = space.shape[1]
    if k == 1:
        return [space[:, 0]]
    _, _, pivots = qr(seen.T, pivoting=True)
    sparse = np.linalg.inv(seen[pivots[:k]])
    sparse /= np.linalg.norm(space @ sparse, axis=0)
    every = [*sparse.T]
    every += [sparse[:, i] + sign * sparse[:, j] for i, j in combinations(range(k), 2) for sign in (1, -1)]
    if k == 2:
        every += [np.array([-v[1], v[0]]) for v in every]
    found: list[Array] = []
    for share in every:
        vector = space @ share
        vector = vector / np.linalg.norm(vector)
        if all(abs(vector @ other) < 1 - ALIKE for other in found):
            found.append(vector)
    return found


NARROW = 1e-5
"""Part of the step between two motions within which the grazing one is found."""
MOST = 20
"""Evaluations: bisection alone needs 17."""


def contacts(point: Point) -> tuple[Counter[tuple[int, int]], float]:
    """How often each mesh changes its contact in each way, and the square of the least speed with which one does."""
    lap = point.visit
    assert isinstance(lap, Lap)
    met = lap.track.mesh >= 0
    pairs = zip(lap.track.mesh[met].tolist(), lap.track.kind[met].tolist(), strict=True)
    return Counter(pairs), float(np.min(np.abs(lap.track.speed[met]), initial=np.inf)) ** 2


def grazing_between(curve: Curve, here: Point, there: Point) -> Point | None:
    """Return the motion between two that grazes, on the side with more contacts; None where both have the same.

    Of several grazing ones between the two it is one. None, too, where the curve is lost between them.

    Near such a motion the square of the speed with which the flank is met falls to 0 in proportion to the distance
    along the branch, on the side where it is met; on the other it is missed. Source: di Bernardo et al. 2008, chapter
    6.
    """
    (own, _), (others, _) = contacts(here), contacts(there)
    if own == others:
        return None
    few, many = (here, there) if own.total() < others.total() else (there, here)
    along = curve.difference(many, few)
    whole = float(np.linalg.norm(along))
    along /= whole
    without, known = contacts(few)[0], [(whole, contacts(many)[1])]
    low, high, found = 0.0, whole, many
    points = {low: few, high: many}
    for _ in range(MOST):
        if high - low <= NARROW * whole:
            break
        s = _guess(low, high, known)
        try:
            point, _ = curve.corrected(*curve.between(points, s, along), along)
        except ArithmeticError:
            return None
        points[s] = point
        count, speed = contacts(point)
        if count == without:
            low = s
        else:
            high, found = s, point
            known = [*known[-1:], (s, speed)]
    return replace(found, kind=GRAZING)


def _guess(low: float, high: float, known: list[tuple[float, float]]) -> float:
    """Where the square of the speed is 0 by a straight line, a little to the side of it; else the middle."""
    middle, margin = 0.5 * (low + high), 0.4 * NARROW * known[0][0]
    if len(known) < 2:
        return middle
    (a, u), (b, v) = known
    zero = (a * v - b * u) / (v - u) if u != v else middle
    # A little beyond on the side that is wider: then the bracket closes from both.
    zero += margin if zero - low > high - zero else -margin
    return zero if low < zero < high else middle
