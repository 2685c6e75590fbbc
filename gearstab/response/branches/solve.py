"""All branches of periodic motions that starts lead to: isolated ones, and those that leave at period doublings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from gearstab.response.backlash.history import BACKLASH_FLAGS
from gearstab.response.backlash.measure import LimitCycle, repetition
from gearstab.response.branches.continuation import (
    BRANCHING,
    CLOSED,
    DOUBLING,
    FOLD,
    MORE,
    NEIMARK_SACKER,
    Curve,
    Point,
    StepLimits,
)  # fmt: skip
from gearstab.response.branches.sections import Lap, SectionMap
from gearstab.response.branches.stability import MotionStability, stability
from gearstab.system import Array

GRAZING = "grazing"
KINDS = {"none": 0, FOLD: 1, DOUBLING: 2, NEIMARK_SACKER: 3, BRANCHING: 4, GRAZING: 5}
"""Of motions: what crosses the unit circle; the first of a doubled branch, up to which motions are linear."""
BRANCH_FLAGS = {
    "range_end": 1, "closed": 2, "unbounded": 4, "more_points": 8, "step_failed": 16, "linear_motions": 32,
    "doubling": 64, "grazing": BACKLASH_FLAGS["grazing"],
}  # fmt: skip
"""Bits of ``status``: why a branch ends at a motion, at an end of the range, where it began, or beyond the amplitude
limit; as so many points were asked for; as no step was short enough; at linear motions of any amplitude; at the
doubling that it leaves from. ``grazing``: a flank is hardly touched or missed."""
SAME = 1e-6
"""Difference of two motions, in units of the state, below which they are one."""
UNDISTURBED = 1e-10
"""Residual of a linear motion, relative to its amplitude."""
SMALLEST = 1e-3
"""Amplitude, in units of the state, with which a doubled branch begins."""
BEYOND = 2e-3
"""Part of the range by which the speed goes past the end of stable motions, to see what follows."""
LONGEST = 16
"""Common periods of a motion on a doubled branch."""
MOST_BRANCHES = 64
FAR = 3.0
"""Extent of random initial states, in units of the state."""


@dataclass(frozen=True)
class BranchMotion:
    """A point of a branch. x, parameter, kind, multiplicity, vector: as there.  grazing: a flank is hardly touched."""

    x: Array
    parameter: float
    kind: str
    multiplicity: int
    vector: Array | None
    stability: MotionStability
    cycle: LimitCycle
    grazing: bool


@dataclass(frozen=True)
class Branch:
    """Periodic motions along a curve.

    motions: in its order;  periods: common periods of each.
    parent, leaves: the branch that it leaves and the number of the motion there, -1 for none.
    ends: why it ends at the first and the last, of BRANCH_FLAGS.
    """

    motions: tuple[BranchMotion, ...]
    periods: int
    ends: tuple[str, str]
    parent: int = -1
    leaves: int = -1


@dataclass(frozen=True)
class Starts:
    """Where motions are looked for by running on.

    values: of the parameter.  states: initial states at each, the first the static equilibrium, the others random.
    cycles: of the first mesh, that a motion is given to settle.  seed: of the random states.
    """

    values: tuple[float, ...]
    states: int = 1
    cycles: float = 200
    seed: int = 0


class BranchSearch:
    """The branches of one system over its mesh frequency, or the parameter of its section map.

    limits: of every branch;  switch: whether to follow those that leave at period doublings.
    found: the branches;  unit: of the state, the extent of the first motion.
    jumps: by branch and motion where a stable motion ends: 1 where it does as the parameter rises, -1 as it falls, and
        the branch and motion next to the one that follows, None where that is not known.
    """

    def __init__(self, laps: SectionMap, limits: StepLimits, switch: bool) -> None:
        self.laps, self.limits, self.switch = laps, limits, switch
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

    def run(self, starts: Starts) -> list[Branch]:
        """Follow the branch of every start that is on none that is known, and of every doubling on the way."""
        for value, x, periods in self._settled(starts):
            try:
                point = self.curve(periods).at(x, value)
            except ArithmeticError:
                continue
            self._lead(point, periods)
        for number, branch in enumerate(self.found):
            for k in range(len(branch.motions)):
                sign, beyond = self._ends(number, k)
                if sign:
                    value = branch.motions[k].parameter
                    self.jumps[number, k] = sign, self._landing(beyond, value, sign, starts.cycles)
        return self.found

    def _lead(self, point: Point, periods: int) -> tuple[int, int] | None:
        """Where a motion is, as in :meth:`place`, on a branch that is followed now if it is on none that is known."""
        place = self.place(point, periods)
        if place is None and self._room():
            self._add(self._both_ways(point, periods))
            place = self.place(point, periods)
        return place

    def _room(self) -> bool:
        return self.points + 4 < self.limits.most and len(self.found) < MOST_BRANCHES

    def _count(self, value: float, cycles: float) -> int:
        """Common periods in so many cycles of the first mesh."""
        return max(2, int(np.ceil(cycles / self.laps.at(value).model.motion.drive.counts[0])))

    def _settled(self, starts: Starts) -> Iterator[tuple[float, Array, int]]:
        """Mesh frequencies, states and common periods of motions that have come to repeat themselves."""
        random = np.random.default_rng(starts.seed)
        for value in starts.values:
            equilibrium = self.laps.at(value).rest()
            count = self._count(value, starts.cycles)
            for number in range(starts.states):
                x = equilibrium
                if number:
                    x = x + FAR * self.unit * random.uniform(-1, 1, len(x))
                try:
                    lap = self.laps.lap(x, value, count)
                except ArithmeticError:
                    continue
                if not number and not self.found:
                    self.unit = float(np.abs(lap.sections()[count // 2 :]).max(initial=0.0)) or 1.0
                periods, _ = repetition(lap.sections())
                if periods:
                    yield value, lap.end, periods

    def _both_ways(self, start: Point, periods: int) -> Branch:
        down, first = self._one_way(start, np.append(np.zeros(len(start.x)), -1.0), periods, 1)
        if first == CLOSED:
            return Branch((self.motion(start), *down), periods, (first, first))
        up, last = self._one_way(start, np.append(np.zeros(len(start.x)), 1.0), periods, 1 + len(down))
        return Branch((*reversed(down), self.motion(start), *up), periods, (first, last))

    def _one_way(self, start: Point, along: Array, periods: int, known: int) -> tuple[list[BranchMotion], str]:
        """Motions from the start on, and why they end; known: motions of the branch that count already."""
        motions: list[BranchMotion] = []
        limits = replace(self.limits, most=self.limits.most - self.points - known)
        for item in self.curve(periods).follow(start, along, limits):
            if isinstance(item, str):
                return motions, item
            if len(motions) >= limits.most:
                break
            motions.append(self.motion(item))
        return motions, MORE

    def motion(self, point: Point) -> BranchMotion:
        """Sum up a point; the motion itself, which takes far more memory, is let go."""
        lap = point.visit
        assert isinstance(lap, Lap)
        found = stability(self.laps, lap, point.parameter)
        own = point.x, point.parameter, point.kind or "none", point.multiplicity, point.vector
        return BranchMotion(*own, found, lap.cycle, lap.grazing)

    def _add(self, branch: Branch) -> None:
        self.found.append(branch)
        if not self.switch or 2 * branch.periods > LONGEST:
            return
        parent = len(self.found) - 1
        for number, motion in enumerate(branch.motions):
            if motion.kind == DOUBLING and motion.vector is not None:
                for vector in _directions(motion.vector):
                    doubled = self._doubled(motion, vector, branch.periods) if self._room() else None
                    if doubled is not None:
                        self._add(replace(doubled, parent=parent, leaves=number))

    def _doubled(self, point: BranchMotion, vector: Array, periods: int) -> Branch | None:
        """The branch of twice the period that leaves along a vector; None where it is known, or not found."""
        curve = self.curve(2 * periods)
        amplitude, first = self._grazing(curve, point, vector), []
        if amplitude:
            x = point.x + amplitude * self.unit * vector
            first = [self.motion(Point(x, point.parameter, curve.mapping(x, point.parameter), GRAZING))]
        normal = np.append(vector, 0.0)
        try:
            x = point.x + (amplitude + SMALLEST) * self.unit * vector
            start, _ = curve.corrected(x, point.parameter, normal)
        except ArithmeticError:
            return None
        if self.place(start, 2 * periods) is not None:
            return None
        motions, end = self._one_way(start, normal, 2 * periods, len(first) + 1)
        return Branch((*first, self.motion(start), *motions), 2 * periods, ("doubling", end))

    def _grazing(self, curve: Curve, point: BranchMotion, vector: Array) -> float:
        """The amplitude up to which the doubled motion is linear, at the same parameter; 0 where it is not at all.

        Teeth in contact move linearly: at an edge of an instability region there is a motion of twice the period of any
        amplitude, up to the one at which a flank is left, or met.
        """

        def linear(amplitude: float) -> bool:
            x = point.x + amplitude * self.unit * vector
            off = np.abs(curve.mapping(x, point.parameter).end - x).max(initial=0.0) / self.unit
            return bool(off <= UNDISTURBED * max(1.0, amplitude))

        low, high = 0.0, SMALLEST
        if not linear(SMALLEST):
            return 0.0
        while linear(high):
            low, high = high, 2 * high
            if high > self.limits.largest:
                return 0.0
        while high - low > 1e-12 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if linear(middle) else (low, middle)
        return low

    def place(self, point: Point, periods: int) -> tuple[int, int] | None:
        """Branch and motion next to a motion, begun at any of its periods; None where it is on no known branch."""
        lap = point.visit
        assert isinstance(lap, Lap)
        phases = lap.sections()[:periods]
        for number, branch in enumerate(self.found):
            if branch.periods != periods:
                continue
            for k, (one, other) in enumerate(pairwise(branch.motions)):
                if (one.parameter - point.parameter) * (other.parameter - point.parameter) > 0:
                    continue
                part = (point.parameter - one.parameter) / (other.parameter - one.parameter or 1.0)
                guess = one.x + part * (other.x - one.x)
                if np.abs(phases - guess).max(axis=1).min() > np.abs(other.x - one.x).max() + SAME * self.unit:
                    continue
                try:
                    there = self.curve(periods).at(guess, point.parameter)
                except ArithmeticError:
                    continue
                if np.abs(phases - there.x).max(axis=1).min() <= SAME * self.unit:
                    return number, k + round(part)
        return None

    def _ends(self, number: int, k: int) -> tuple[int, Array]:
        """Whether a stable motion ends at a motion of a branch: 1 if in rising speed, -1 if in falling, else 0.

        At a fold it does; at a period doubling if the doubled motion is unstable. And a state to go on from: of a
        doubled motion, as a small deviation would take its time to grow.
        """
        motions = self.found[number].motions
        here = motions[k]
        if here.kind not in (FOLD, DOUBLING) or not 0 < k < len(motions) - 1:
            return 0, here.x
        before, after = motions[k - 1], motions[k + 1]
        if before.stability.stable == after.stability.stable:
            return 0, here.x
        stable, x = before if before.stability.stable else after, here.x
        if here.kind == DOUBLING:
            doubled = [b.motions[min(2, len(b.motions) - 1)] for b in self.found if (b.parent, b.leaves) == (number, k)]
            if not doubled or doubled[0].stability.stable:
                return 0, x
            x = doubled[0].x
        return 1 if stable.parameter < here.parameter else -1, x

    def _landing(self, x: Array, parameter: float, sign: int, cycles: float) -> tuple[int, int] | None:
        """Where the motion goes from a state beyond the end of stable ones; its branch may be a new one."""
        value = parameter + sign * BEYOND * self.span
        if not self.limits.low <= value <= self.limits.high:
            return None
        try:
            lap = self.laps.lap(x * (1 + BEYOND), value, self._count(value, cycles))
            periods, _ = repetition(lap.sections())
            return self._lead(self.curve(periods).at(lap.end, value), periods) if periods else None
        except ArithmeticError:
            return None


def _directions(space: Array) -> list[Array]:
    """Directions ``(m,)`` in a null space ``(m, k)`` along which branches may leave: k = 1, its only one.

    Of symmetric systems they leave along what keeps some of the symmetry: one part alone, or parts that move alike or
    opposite to each other. Hence a basis of vectors with as many zeros as there can be, their sums and differences.
    """
    from scipy.linalg import qr

    _, _, pivots = qr(space.T, pivoting=True)
    sparse = space @ np.linalg.inv(space[pivots[: space.shape[1]]])
    sparse /= np.linalg.norm(sparse, axis=0)
    pairs = combinations(range(space.shape[1]), 2)
    both = [sparse[:, i] + sign * sparse[:, j] for i, j in pairs for sign in (1, -1)]
    return [*sparse.T, *(vector / np.linalg.norm(vector) for vector in both)]
