"""Edges of all instability regions of a (batched) gear system along the mesh frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gearstab.floquet.boundaries import smooth
from gearstab.floquet.boundaries.coverage import Coverage
from gearstab.floquet.boundaries.damped.search import Found, Guide, Limits, collisions, growing
from gearstab.floquet.boundaries.names import harmonics, labels, naming
from gearstab.floquet.boundaries.parts import Part, Region, separated, united
from gearstab.floquet.boundaries.regions import Boundaries, tongue_of
from gearstab.floquet.boundaries.undamped.search import Interval, Search, by_row
from gearstab.floquet.kernel.chain import Chain, chain
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.modal import mean_modes
from gearstab.perturbation.tongues import Tongue, self_excited
from gearstab.system import Array, GearSystem

FEW = 500
"""Collisions of multipliers of a row without damping up to which damped regions are named after undamped ones."""
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
    set by damping (:mod:`~gearstab.floquet.boundaries.damped.search`). The result says what is proved and what is
    counted. Where negative damping makes a mode grow by itself, be it a rigid-body mode, it is named first
    (``self-excited``). Where the mesh stiffness is smooth the tolerance of an edge contains the error of the Magnus
    steps (:mod:`~gearstab.floquet.boundaries.smooth`). Otherwise parts that the meshes do not couple are searched one
    by one and their regions united (:mod:`~gearstab.floquet.boundaries.parts`).

    Parameters
    ----------
    system: any batch shape; rows of the result are those of the flattened batch.
    start, stop: range of Omega, rad per unit time, 0 < start < stop.
    tolerance, width_floor: of the edges and of a region, relative to Omega. Below 1e-13 rounding has the last word.
    reduction: False to search every system as a whole (slower, for comparison).
    budget: multiplications for the proof of a damped row, and as many again for its scan.

    Raises
    ------
    ValueError: an empty range, a tolerance or floor that is not positive, a system with further terms, or one without a
    common period.
    """
    if not 0 < start < stop < np.inf:
        raise ValueError(f"mesh frequencies must satisfy 0 < start < stop, not {start}, {stop}")
    if not (tolerance > 0 and width_floor > 0):
        raise ValueError(f"tolerance and width floor must be positive, not {tolerance}, {width_floor}")
    if system.terms:
        raise ValueError("boundaries need symmetric mesh stiffness and nothing else that varies")
    # The same rows without damping are looked at too: the batch must not rest on the damping alone.
    system = system.over(system.batch)
    found = _Collected(system, start, stop, width_floor)
    limits = Limits(start, stop, tolerance, width_floor, budget)
    for part, own in _searched(system, limits, reduction):
        found.rigid(part)
        if isinstance(own, Search):
            found.undamped(part, own)
        else:
            found.damped(part, *own)
    return found.result()


def _searched(
    system: GearSystem, limits: Limits, reduction: bool
) -> Iterator[tuple[Part, Search | tuple[Chain, Found]]]:
    """Parts of all rows and what is found out about them."""
    if not system.piecewise_constant:
        for pattern, found in smooth.searched(system, limits):
            yield next(separated(pattern, False)), found
        return
    for pattern in prepare(system):
        for part in separated(pattern, reduction):
            moving = (part.pattern.elastic.shift != 0) | (part.pattern.elastic.damping is not None)
            for rows in (np.flatnonzero(~moving), np.flatnonzero(moving)):
                if len(rows) == 0:
                    continue
                own = part.subset(rows)
                if not moving[rows[0]]:
                    yield own, limits.undamped(own.pattern)
                else:
                    flow = chain(own.pattern)
                    yield own, (flow, limits.damped(flow, own.pattern, _guide(own.pattern)))


def _guide(pattern: Pattern) -> Guide:
    """Rows of a pattern without damping."""
    return lambda rows: pattern.subset(rows).without_damping()


@dataclass
class _Collected:
    """Regions of all rows, gathered pattern by pattern."""

    system: GearSystem
    start: float
    stop: float
    floor: float

    def __post_init__(self) -> None:
        rows = self.system.rows
        self.regions: list[Region] = []
        self.contacts, self.evaluations = np.zeros((2, rows), dtype=np.int64)
        self.coverage = Coverage(rows, self.start, self.stop)
        modes = mean_modes(self.system)
        n = self.system.size
        self.squared = np.broadcast_to(modes.squared_frequency, (*self.system.batch, n)).reshape(rows, n)
        self.period = self.system.common_period()[0]
        self.tongues: dict[tuple[int, int, int], Tongue] = {}
        self.latest: tuple[Part | None, int, tuple[int, float, list[int]]] = None, -1, (-1, 0.0, [])

    def rigid(self, part: Part) -> None:
        """Rows in which a rigid-body mode grows are unstable everywhere."""
        rows = part.pattern.rows
        for row in rows[part.pattern.elastic.rigid_growth > 0]:
            tongue = self._self_excited(self._rigid(int(row), part.whole))
            self.regions.append(Region(int(row), (self.start, self.stop), (0.0, 0.0), (True, True), (tongue,)))

    def undamped(self, part: Part, found: Search) -> None:
        """Name and keep the regions of a part."""
        self.contacts[part.pattern.rows] += part.copies * found.contacts
        self.evaluations[part.pattern.rows] += found.evaluations
        names = self._named(part, part.pattern, found.intervals)
        for interval, roots in zip(found.intervals, names, strict=True):
            self._keep(part, interval, roots)
        self.coverage.count(part.pattern.rows)

    def damped(self, part: Part, flow: Chain, found: Found) -> None:
        """The same of a damped part."""
        pattern = part.pattern
        self.evaluations[pattern.rows] += found.evaluations
        names = self._of_damped(part, flow, found)
        driven = growing(pattern)
        for interval, roots in zip(found.intervals, naming.coupled(pattern, found.intervals, names), strict=True):
            self._keep(part, interval, roots, int(driven[interval.row]))
        for k, row in enumerate(pattern.rows):
            ranges = []
            for stretches in (found.proved, found.counted):
                own = stretches.row == k
                cycles = np.stack([stretches.stop[own], stretches.start[own]], axis=1)
                ranges.append(np.clip(pattern.elastic.rate[k] / cycles, self.start, self.stop))
            self.coverage.add(int(row), *ranges)

    def _of_damped(self, part: Part, flow: Chain, found: Found) -> list[tuple[labels.Root, ...]]:
        """The roots of each damped region; where harmonics leave doubts in a row, with the help of undamped ones."""
        seen = harmonics.seen(flow, found.intervals, found.peaks)
        plain = harmonics.plain(found.intervals, seen)
        names: list[tuple[labels.Root, ...]] = [() if root is None else (root,) for root in plain]
        doubtful = [k for k, root in enumerate(plain) if root is None]
        intervals = [found.intervals[k] for k in doubtful]
        allowed = self._of_undamped(part, flow, intervals)
        for k, own in zip(
            doubtful, harmonics.named(flow, intervals, [seen[k] for k in doubtful], allowed), strict=True
        ):
            names[k] = own
        return names

    def _of_undamped(self, part: Part, flow: Chain, intervals: list[Interval]) -> list[set[labels.Root]]:
        """The roots of those regions of the system without damping that each damped one overlaps, or of the nearest;
        none where the common period is so long that there are too many.
        """
        limits = Limits(self.start, self.stop, 0.1 * self.floor, self.floor, 0.0)
        owner = np.array([i.row for i in intervals], dtype=int)
        few = collisions(flow, *limits.cycles(part.pattern)) <= FEW
        rows = np.unique(owner[few[owner]])
        if len(rows) == 0:
            return [set() for _ in intervals]
        own = part.subset(rows)
        pattern = own.pattern.without_damping()
        free = limits.undamped(pattern)
        self.evaluations[pattern.rows] += free.evaluations
        of_row = by_row(np.array([g.row for g in free.intervals], dtype=int), len(rows))
        near: list[list[int]] = [[] for _ in intervals]
        for k, interval in enumerate(intervals):
            place = np.searchsorted(rows, interval.row)
            if place < len(rows) and rows[place] == interval.row:
                near[k] = _near(interval, free.intervals, of_row[place])
        wanted = sorted({j for own_guides in near for j in own_guides})
        names = dict(zip(wanted, self._named(own, pattern, [free.intervals[j] for j in wanted]), strict=True))
        return [{root for j in own_guides for root in names[j]} for own_guides in near]

    def _named(self, part: Part, pattern: Pattern, intervals: list[Interval]) -> list[tuple[labels.Root, ...]]:
        """The roots of each region of a part's undamped pattern, modes counted from 0 in the part."""
        frequency = np.stack([self._frequency(part, k) for k in range(len(pattern.rows))])
        names, extra = naming.named(pattern, intervals, frequency)
        self.evaluations[pattern.rows] += extra
        return names

    def _frequency(self, part: Part, k: int) -> Array:
        """``(n,)``, natural frequencies of a part's k-th row, in its units."""
        numbers = self._modes(int(part.pattern.rows[k]), part.whole)[part.modes[k]]
        squared = self.squared[part.pattern.rows[k], numbers]
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)) / part.pattern.elastic.rate[k])

    def _modes(self, row: int, elastic: int) -> Array:
        """Numbers from 0 of the elastic modes: rigid ones come between negative and positive squared frequencies."""
        below, size = int((self.squared[row] < 0).sum()), self.squared.shape[1]
        return np.delete(np.arange(size), np.arange(below, below + size - elastic))

    def _row(self, part: Part, k: int) -> tuple[int, float, list[int]]:
        """Of a part's k-th row: its number, the unit of frequency, and the mode from 0 of each coordinate."""
        if self.latest[0] is not part or self.latest[1] != k:
            row = int(part.pattern.rows[k])
            numbers = self._modes(row, part.whole)[part.modes[k]].tolist()
            self.latest = part, k, (row, float(part.pattern.elastic.rate[k]), numbers)
        return self.latest[2]

    def _rigid(self, row: int, elastic: int) -> int:
        """Number from 0 of the first rigid-body mode."""
        return int(np.setdiff1d(np.arange(self.system.size), self._modes(row, elastic))[0])

    def _self_excited(self, mode: int) -> Tongue:
        """Of a mode from 0."""
        return self.tongues.setdefault((mode + 1, mode + 1, 0), self_excited(self.system, mode + 1))

    def _tongue(self, root: labels.Root, numbers: list[int]) -> Tongue:
        key = numbers[root.p] + 1, numbers[root.q] + 1, root.cycles
        if key not in self.tongues:
            self.tongues[key] = tongue_of(self.system, key[0], key[1], Fraction(root.cycles) / self.period)
        return self.tongues[key]

    def _keep(self, part: Part, interval: Interval, roots: tuple[labels.Root, ...], growing: int = -1) -> None:
        """growing: the coordinate that grows by itself, after the elastic ones for rigid-body modes; -1 for none."""
        row, rate, numbers = self._row(part, interval.row)
        cut_upper, cut_lower = interval.cut
        # The ends of the range itself, not what two divisions make of them.
        lower = self.start if cut_lower else rate / interval.stop
        upper = self.stop if cut_upper else rate / interval.start
        error = interval.error[1] / interval.stop, interval.error[0] / interval.start
        members = tuple(self._tongue(root, numbers) for root in roots)
        if growing >= 0:
            mode = numbers[growing] if growing < len(numbers) else self._rigid(row, part.whole)
            members = (self._self_excited(mode), *members)
        self.regions.append(Region(row, (lower, upper), error, (cut_lower, cut_upper), members))

    def result(self) -> Boundaries:
        """Everything, by row and mesh frequency."""
        regions = united(self.regions)
        edges = np.array([region.edges for region in regions], dtype=float).reshape(-1, 2)
        row = np.array([region.row for region in regions], dtype=int)
        covered = [self.coverage.of(k, edges[own]) for k, own in enumerate(by_row(row, self.system.rows))]
        return Boundaries(
            self.system.rows,
            row,
            edges[:, 0],
            edges[:, 1],
            np.array([0.5 * max(region.error) for region in regions], dtype=float),
            np.array([region.cut for region in regions], dtype=bool).reshape(-1, 2),
            tuple(region.members for region in regions),
            self.contacts,
            self.evaluations,
            self.floor,
            tuple(proved for proved, _ in covered),
            tuple(counted for _, counted in covered),
            (self.start, self.stop),
        )


def _near(interval: Interval, guides: list[Interval], among: Array) -> list[int]:
    """Positions of the undamped regions of a row that an interval overlaps, or of the nearest."""
    found = [int(j) for j in among if max(guides[j].start, interval.start) < min(guides[j].stop, interval.stop)]
    if found or len(among) == 0:
        return found
    middle = 0.5 * (interval.start + interval.stop)
    return [min((int(j) for j in among), key=lambda j: max(guides[j].start - middle, middle - guides[j].stop))]
