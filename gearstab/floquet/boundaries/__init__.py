"""Edges of all instability regions of a (batched) gear system along the mesh frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries import names as naming
from gearstab.floquet.boundaries import periodic, smooth
from gearstab.floquet.boundaries.damped.search import Limits, SearchResult, collisions, growing
from gearstab.floquet.boundaries.names import harmonics, whirl
from gearstab.floquet.boundaries.parts import Coverage, Interval, Intervals, Part, RegionEdges, by_row, united
from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS, Boundaries, Edges, union
from gearstab.floquet.boundaries.undamped import Search
from gearstab.floquet.dispatch import in_modes
from gearstab.floquet.kernel.chain import Chain, chain
from gearstab.floquet.segments.pattern import Pattern
from gearstab.modal import mean_modes
from gearstab.perturbation.multiple_scales import EQUAL_FREQUENCY
from gearstab.perturbation.tongues import ParametricExcitation, Tongue, self_excited, tongue
from gearstab.system import Array, GearSystem

__all__ = ["BOUNDARY_FLAGS", "Boundaries", "Edges", "boundaries", "union"]


FEW = 500
"""Collisions of multipliers of a row without damping up to which damped regions are named after undamped ones."""
LEAST_FLOOR = 1e-12
"""Rounding moves an edge by up to 1.4e-14 of Omega (64 eps), so that a region so wide is known to some per cent."""
BUDGET = 4e9
"""Multiplications for the proof of a damped row: about a second."""


def boundaries(
    system: GearSystem,
    start: float,
    stop: float,
    tolerance: float = 1e-10,
    width_floor: float = 1e-6,
    reduction: bool = True,
    budget: float = BUDGET,
) -> Boundaries:
    """All instability regions between the mesh frequencies ``start`` and ``stop`` of the first mesh.

    Conservative rows: an integer count of the collisions of multipliers finds regions however narrow, and stable gaps
    too (:mod:`~gearstab.floquet.boundaries.counting.krein`; for three and more modes with a test on the speeds of the
    phases). Edges lie in brackets between a stable and an unstable point. Damped rows: Lyapunov functions prove, in
    floating point, where the system is stable and where it is not, within a budget; the rest is scanned with a step
    set by damping, or about all meetings of multipliers (:mod:`~gearstab.floquet.boundaries.damped.search`). The result
    says what is proved, what is counted and with which step the rest was sampled. Where negative damping makes a mode
    grow by itself, be it a rigid-body mode, it is named first (``self-excited``). Parts that the meshes do not couple
    are searched one by one and their regions united (:mod:`~gearstab.floquet.boundaries.parts`). Where the mesh
    stiffness is smooth each part is cut into Magnus steps of its own, and the tolerance of an edge contains their error
    (:mod:`~gearstab.floquet.boundaries.smooth`).

    Parameters
    ----------
    system: any batch shape; rows of the result are those of the flattened batch.
    start, stop: range of Omega, rad per unit time, 0 < start < stop.
    tolerance, width_floor: of the edges and of a region, relative to Omega. Below a tolerance of 1e-13 rounding has the
        last word. Floors below 1e-6 take the reference search, which is slower, with edges to an eighth of the floor.
    reduction: False to search every system as a whole (slower, for comparison). Multipliers of three or more equal
        parts then coincide but for rounding, and edges may be off by 2e-8 whatever tolerance they state.
    budget: multiplications for the proof of a damped row, and as many again for its scan.

    Raises
    ------
    ValueError: an empty range, a tolerance that is not positive, a floor below LEAST_FLOOR, or no common period.
    """
    if not 0 < start < stop < np.inf:
        raise ValueError(f"mesh frequencies must satisfy 0 < start < stop, not {start}, {stop}")
    if not (tolerance > 0 and width_floor >= LEAST_FLOOR):
        message = f"tolerance must be > 0 and width floor >= {LEAST_FLOOR:g}, not {tolerance}, {width_floor}"
        raise ValueError(message)
    # The same rows without damping are looked at too: the batch must not rest on the damping alone.
    system = system.over(system.batch)
    found = _Collected(system, start, stop, width_floor)
    limits = Limits(start, stop, tolerance, width_floor, budget)
    if not in_modes(system):
        for every, whole, flow, edges in periodic.searched(system, limits):
            found.rigid(every.part)
            if system.rotations:
                found.turning(every.part, whole, flow, edges)
            else:
                found.periodic(every, whole, edges)
        return found.result()
    for part, own in _searched(system, limits, reduction):
        found.rigid(part)
        if isinstance(own, Search):
            found.undamped(part, own)
        else:
            found.damped(part, *own)
    return found.result()


def _searched(
    system: GearSystem, limits: Limits, reduction: bool
) -> Iterator[tuple[Part, Search | tuple[Chain, SearchResult]]]:
    """Parts of all rows and what is found out about them."""
    for part, division in smooth.parts(system, reduction):
        moving = part.pattern.elastic.damped
        for rows in (np.flatnonzero(~moving), np.flatnonzero(moving)):
            if len(rows) == 0:
                continue
            own = part.subset(rows)
            if division is not None:
                yield smooth.searched(own, division.subset(rows), limits)
            elif not moving[rows[0]]:
                yield own, limits.undamped(own.pattern)
            else:
                flow = chain(own.pattern)
                yield own, (flow, limits.damped(flow, own.pattern))


@dataclass
class _Collected:
    """Regions of all rows, gathered pattern by pattern."""

    system: GearSystem
    start: float
    stop: float
    floor: float

    def __post_init__(self) -> None:
        rows = self.system.rows
        self.regions = [RegionEdges.none()]
        self.contacts, self.evaluations = np.zeros((2, rows), dtype=np.int64)
        self.coverage = Coverage(rows, self.start, self.stop)
        self.step, self.coarse = np.zeros(rows), np.zeros(rows, dtype=bool)
        modes = mean_modes(self.system)
        n = self.system.size
        self.squared = np.broadcast_to(modes.squared_frequency, (*self.system.batch, n)).reshape(rows, n)
        self.first = _first_of_equals(np.sqrt(np.maximum(self.squared, 0.0)))
        self.period, self.cycles = self.system.common_period()
        self.excitations: dict[int, ParametricExcitation] = {}
        self.tongues: list[Tongue] = []
        self.number: dict[tuple[int, int, int, bool], int] = {}

    def rigid(self, part: Part) -> None:
        """Rows in which a rigid-body mode grows are unstable everywhere."""
        grows = part.pattern.elastic.rigid_growth > 0
        row = part.pattern.rows[grows]
        mode, pair = self._rigid(part)[grows], np.ones((len(row), 2))
        member = np.array([self._tongue(k, k, 0) for k in mode.tolist()], dtype=np.int64)
        whole = np.array([[self.start, self.stop]]) * pair
        self.regions.append(RegionEdges(row, whole, 0 * pair, pair > 0, np.arange(len(row)), member))

    def undamped(self, part: Part, found: Search) -> None:
        """Name and keep the regions of a part."""
        self.contacts[part.pattern.rows] += part.copies * found.contacts
        self.evaluations[part.pattern.rows] += found.evaluations
        self._keep(part, found.intervals, self._named(part, part.pattern, found.intervals))
        self.coverage.count(part.pattern.rows)

    def damped(self, part: Part, flow: Chain, found: SearchResult) -> None:
        """The same of a damped part."""
        names = naming.Names.of(self._of_damped(part, flow, found))
        self._covered(part, found)
        self._keep(part, found.intervals, naming.coupled(part.pattern, found.intervals, names), growing(part.pattern))

    def periodic(self, own: periodic.PeriodicPart, flow: Chain, found: SearchResult) -> None:
        """The same of rows with periodic terms, which are named after the harmonics of growing solutions only."""
        seen = harmonics.seen(flow, found.intervals, found.peaks)
        names = harmonics.named(flow, found.intervals, seen, [set() for _ in found.intervals])
        self._covered(own.part, found)
        self._keep(own.part, found.intervals, naming.Names.of(names), own.growing(flow))

    def turning(self, part: Part, whole: Chain, flow: Chain, found: SearchResult) -> None:
        """The same of rows with speeds of rotation, which are named after the motions at the speed of each region.

        flow: of the coordinates that were searched.
        """
        names = whirl.named(flow, whole, found.intervals, self.system.size)
        self._covered(part, found)
        if found.contacts is not None:
            self.contacts[part.pattern.rows] += found.contacts
        owner = np.repeat(np.arange(len(names)), [len(own) for own in names])
        member = [self._tongue(root.p, root.q, root.cycles, root.difference) for own in names for root in own]
        row, edges, error, cut = self._edges(part, found.intervals)
        self.regions.append(RegionEdges(row, edges, error, cut, owner, np.array(member, dtype=np.int64)))

    def _covered(self, part: Part, found: SearchResult) -> None:
        pattern = part.pattern
        self.evaluations[pattern.rows] += found.evaluations
        self.step[pattern.rows] = np.maximum(self.step[pattern.rows], found.step)
        self.coarse[pattern.rows] |= found.coarse
        for k, row in enumerate(pattern.rows):
            ranges = []
            for stretches in (found.proved, found.counted):
                own = stretches.row == k
                cycles = np.stack([stretches.stop[own], stretches.start[own]], axis=1)
                ranges.append(np.clip(pattern.elastic.rate[k] / cycles, self.start, self.stop))
            self.coverage.add(int(row), *ranges)

    def _of_damped(self, part: Part, flow: Chain, found: SearchResult) -> list[tuple[naming.Root, ...]]:
        """The roots of each damped region; where harmonics leave doubts in a row, with the help of undamped ones."""
        seen = harmonics.seen(flow, found.intervals, found.peaks)
        plain = harmonics.plain(found.intervals, seen)
        names: list[tuple[naming.Root, ...]] = [() if root is None else (root,) for root in plain]
        doubtful = [k for k, root in enumerate(plain) if root is None]
        intervals = found.intervals.subset(doubtful)
        allowed = self._of_undamped(part, flow, intervals)
        for k, own in zip(
            doubtful, harmonics.named(flow, intervals, [seen[k] for k in doubtful], allowed), strict=True
        ):
            names[k] = own
        return names

    def _of_undamped(self, part: Part, flow: Chain, intervals: Intervals) -> list[set[naming.Root]]:
        """The roots of those regions of the system without damping that each damped one overlaps, or of the nearest;
        none where the common period is so long that there are too many.
        """
        # Whether regions overlap is known with edges to a tenth of the narrowest one.
        limits = Limits(self.start, self.stop, 0.1 * self.floor, self.floor, 0.0)
        few = collisions(flow, *limits.cycles(part.pattern)) <= FEW
        rows = np.unique(intervals.row[few[intervals.row]])
        if len(rows) == 0:
            return [set() for _ in intervals]
        own = part.subset(rows)
        pattern = own.pattern.without_damping()
        free = limits.undamped(pattern)
        self.evaluations[pattern.rows] += free.evaluations
        of_row = by_row(free.intervals.row, len(rows))
        near: list[list[int]] = [[] for _ in intervals]
        for k, interval in enumerate(intervals):
            place = np.searchsorted(rows, interval.row)
            if place < len(rows) and rows[place] == interval.row:
                near[k] = _near(interval, free.intervals, of_row[place])
        wanted = sorted({j for own_guides in near for j in own_guides})
        found = self._named(own, pattern, free.intervals.subset(wanted)).roots(len(wanted))
        names = dict(zip(wanted, found, strict=True))
        return [{root for j in own_guides for root in names[j]} for own_guides in near]

    def _named(self, part: Part, pattern: Pattern, intervals: Intervals) -> naming.Names:
        """The roots of each region of a part's undamped pattern, modes counted from 0 in the part."""
        rows = part.pattern.rows[:, None]
        squared = self.squared[rows, self._modes(part)] / part.pattern.elastic.rate[:, None] ** 2
        names, extra = naming.named(pattern, intervals, squared)
        self.evaluations[pattern.rows] += extra
        return names

    def _modes(self, part: Part) -> Array:
        """``(r, m)``: the mode, from 0, that each coordinate of a part is named after, rigid ones included."""
        rigid = self._rigid(part)[:, None]
        return part.modes + np.where(part.modes >= rigid, self.system.size - part.whole, 0)

    def _rigid(self, part: Part) -> Array:
        """``(r,)``: the first rigid-body mode, from 0: between negative and positive squared frequencies."""
        return (self.squared[part.pattern.rows] < 0).sum(axis=1)

    def _tongue(self, p: int, q: int, cycles: int, difference: bool = False) -> int:
        """Number of the tongue of two modes from 0; of one that grows by itself, twice the mode and no cycles."""
        key = p + 1, q + 1, cycles, difference
        if key not in self.number:
            self.number[key] = len(self.tongues)
            force = self._excitation(cycles) if cycles else None
            own = tongue(self.system, force, p + 1, q + 1, difference) if force else self_excited(self.system, p + 1)
            self.tongues.append(own)
        return self.number[key]

    def _excitation(self, cycles: int) -> ParametricExcitation:
        """Return the excitation of so many cycles in the common period, in which each mesh has a whole number of its
        own.
        """
        if cycles not in self.excitations:
            parts = enumerate(self.cycles[: len(self.system.meshes)])
            harmonics = tuple((k, cycles // own) for k, own in parts if cycles % own == 0)
            self.excitations[cycles] = ParametricExcitation(cycles / self.period, harmonics)
        return self.excitations[cycles]

    def _keep(self, part: Part, found: Intervals, names: naming.Names, driven: Array | None = None) -> None:
        """driven: the coordinate of each row that grows by itself, rigid-body modes after the others; or -1."""
        modes = self._modes(part)
        row, owner = found.row[names.owner], names.owner
        # Which of several modes of one frequency grow is a matter of rounding.
        first, rows = self.first[part.pattern.rows], np.arange(len(modes))[:, None]
        named = first[rows, modes]
        p, q, cycles = named[row, names.root[:, 0]], named[row, names.root[:, 1]], names.root[:, 2]
        # One number for the three: rows of a matrix are sorted ten times as slowly.
        shape = (self.system.size, self.system.size, int(cycles.max(initial=0)) + 1)
        distinct, which = np.unique(np.ravel_multi_index((p, q, cycles), shape), return_inverse=True)
        roots = zip(*(part.tolist() for part in np.unravel_index(distinct, shape)), strict=True)
        member = np.array([self._tongue(*root) for root in roots], dtype=np.int64)[which]
        once = np.sort(np.unique(owner * (len(self.tongues) + 1) + member, return_index=True)[1])
        owner, member = owner[once], member[once]
        if driven is not None:
            by_itself = np.flatnonzero(driven[found.row] >= 0)
            itself = np.hstack([modes, self._rigid(part)[:, None]])[found.row[by_itself], driven[found.row[by_itself]]]
            order = np.argsort(np.concatenate([by_itself, owner]), kind="stable")
            owner = np.concatenate([by_itself, owner])[order]
            grown = np.array([self._tongue(k, k, 0) for k in itself.tolist()], dtype=np.int64)
            member = np.append(grown, member)[order]
        of_row, edges, error, cut = self._edges(part, found)
        self.regions.append(RegionEdges(of_row, edges, error, cut, owner, member))

    def _edges(self, part: Part, found: Intervals) -> tuple[Array, Array, Array, Array]:
        """(row, edges, error, cut) of the regions, as of :class:`RegionEdges`."""
        rate = part.pattern.elastic.rate[found.row]
        # The ends of the range itself, not what two divisions make of them.
        lower = np.where(found.cut[:, 1], self.start, rate / found.stop)
        upper = np.where(found.cut[:, 0], self.stop, rate / found.start)
        error = found.error[:, ::-1] / np.stack([found.stop, found.start], axis=1)
        return part.pattern.rows[found.row], np.stack([lower, upper], axis=1), error, found.cut[:, ::-1]

    def result(self) -> Boundaries:
        """Everything, by row and mesh frequency."""
        found = united(RegionEdges.joined(self.regions))
        covered = [self.coverage.of(k, found.edges[own]) for k, own in enumerate(by_row(found.row, self.system.rows))]
        return Boundaries(
            self.system.rows,
            found.row,
            found.edges[:, 0],
            found.edges[:, 1],
            0.5 * found.error.max(axis=1, initial=0.0),
            found.cut,
            tuple(self.tongues),
            found.owner,
            found.member,
            self.contacts,
            self.evaluations,
            self.floor,
            tuple(proved for proved, _ in covered),
            tuple(counted for _, counted in covered),
            self.step,
            self.coarse,
            (self.start, self.stop),
        )


def _first_of_equals(frequency: Array) -> Array:
    """``(rows, n)``: the first mode of the same frequency; frequencies ``(rows, n)`` ascend, 0 of rigid bodies."""
    same = (np.diff(frequency) <= EQUAL_FREQUENCY * frequency[:, 1:]) & (frequency[:, :-1] > 0)
    begins = np.where(np.pad(same, ((0, 0), (1, 0))), 0, np.arange(frequency.shape[1]))
    return np.maximum.accumulate(begins, axis=1)


def _near(interval: Interval, guides: Intervals, among: Array) -> list[int]:
    """Positions of the undamped regions of a row that an interval overlaps, or of the nearest."""
    found = [int(j) for j in among if max(guides[j].start, interval.start) < min(guides[j].stop, interval.stop)]
    if found or len(among) == 0:
        return found
    middle = 0.5 * (interval.start + interval.stop)
    return [min((int(j) for j in among), key=lambda j: max(guides[j].start - middle, middle - guides[j].stop))]
