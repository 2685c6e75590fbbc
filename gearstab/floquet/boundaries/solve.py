"""Edges of all instability regions of a (batched) gear system along the mesh frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gearstab.floquet.boundaries import damped, labels, naming, smooth
from gearstab.floquet.boundaries.labels import Unnamed
from gearstab.floquet.boundaries.parts import Part, Region, separated, united, without_damping
from gearstab.floquet.boundaries.regions import Boundaries, tongue_of
from gearstab.floquet.boundaries.search import Interval, Search, by_row
from gearstab.floquet.boundaries.undamped import search
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.modal import mean_modes
from gearstab.perturbation.tongues import Tongue, self_excited
from gearstab.system import Array, GearSystem

PRESENT = 0.4
"""The share that a tongue of a merged undamped region needs somewhere in a damped region to be named as part of it."""


def boundaries(
    system: GearSystem,
    start: float,
    stop: float,
    tolerance: float = 1e-10,
    width_floor: float = 1e-6,
    reduction: bool = True,
) -> Boundaries:
    """All instability regions between the mesh frequencies ``start`` and ``stop`` of the first mesh.

    Conservative rows: an integer count of the collisions of multipliers finds regions however narrow, and stable gaps
    too (:mod:`~gearstab.floquet.boundaries.krein`; for three and more modes with a test on the speeds of the phases).
    Edges lie in brackets between a stable and an unstable point. Damped rows: the zeros of the growth rate, looked
    for in and around the regions of the same system without damping, and on a scan uniform in the period
    (:mod:`~gearstab.floquet.boundaries.damped`). That is no proof: a damped region far from all undamped ones, or a
    gap between merged regions, may be missed if it is narrower than about a fiftieth of the distance of collisions.
    Where negative damping makes a mode grow by itself, be it a rigid-body mode, it is named first (``self-excited``).
    Where the mesh stiffness is smooth the tolerance of an edge contains the error of the Magnus steps
    (:mod:`~gearstab.floquet.boundaries.smooth`). Otherwise parts that the meshes do not couple are searched one by
    one and their regions united (:mod:`~gearstab.floquet.boundaries.parts`).

    Parameters
    ----------
    system: any batch shape; rows of the result are those of the flattened batch.
    start, stop: range of Omega, rad per unit time, 0 < start < stop.
    tolerance, width_floor: of the edges and of a region, relative to Omega. Below 1e-13 rounding has the last word.
    reduction: False to search every system as a whole (slower, for comparison).

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
    rows = int(np.prod(system.batch, dtype=int))
    # The same rows without damping are looked at too: the batch must not rest on the damping alone.
    system = system.over(system.batch)
    found = _Collected(system, start, stop, width_floor)
    if system.damping is None:
        for part, intervals in _undamped(system, start, stop, tolerance, width_floor, reduction):
            found.undamped(part, intervals)
    else:
        for part, guide, *both in _damped(system, start, stop, tolerance, width_floor, reduction):
            found.damped(part, guide, *both)
    return found.result(rows)


def _undamped(
    system: GearSystem, start: float, stop: float, tolerance: float, floor: float, reduction: bool
) -> Iterator[tuple[Part, Search]]:
    """Parts of all rows and their intervals."""
    if not system.piecewise_constant:
        for pattern, found in smooth.undamped(system, lambda p: _range(p, start, stop), tolerance, floor):
            yield next(separated(pattern, False)), found
        return
    for pattern in prepare(system):
        for part in separated(pattern, reduction):
            yield part, search(part.pattern, *_range(part.pattern, start, stop), tolerance, floor)


def _damped(
    system: GearSystem, start: float, stop: float, tolerance: float, floor: float, reduction: bool
) -> Iterator[tuple[Part, Pattern, Search, Search]]:
    """Parts of all rows, their patterns without damping, and the intervals of both."""
    if not system.piecewise_constant:
        for pattern, guide, *both in smooth.with_damping(system, lambda p: _range(p, start, stop), tolerance, floor):
            yield next(separated(pattern, False)), guide, both[0], both[1]
        return
    for pattern in prepare(system):
        for part in separated(pattern, reduction):
            guide = without_damping(part.pattern)
            yield part, guide, *damped.search(part.pattern, guide, *_range(guide, start, stop), tolerance, floor)


def _range(pattern: Pattern, start: float, stop: float) -> tuple[Array, Array]:
    """Cycles 1/Omega in the pattern's units, from the highest to the lowest mesh frequency."""
    return pattern.elastic.rate / stop, pattern.elastic.rate / start


@dataclass
class _Collected:
    """Regions of all rows, gathered pattern by pattern."""

    system: GearSystem
    start: float
    stop: float
    floor: float

    def __post_init__(self) -> None:
        rows = int(np.prod(self.system.batch, dtype=int))
        self.regions: list[Region] = []
        self.contacts, self.evaluations = np.zeros((2, rows), dtype=np.int64)
        modes = mean_modes(self.system)
        n = self.system.size
        self.squared = np.broadcast_to(modes.squared_frequency, (*self.system.batch, n)).reshape(rows, n)
        self.period = self.system.common_period()[0]
        self.tongues: dict[tuple[int, int, int], Tongue] = {}
        self.latest: tuple[Part | None, int, tuple[int, float, list[int]]] = None, -1, (-1, 0.0, [])

    def undamped(self, part: Part, found: Search) -> None:
        """Name and keep the regions of a part."""
        self._count(part, found)
        names = self._named(part, part.pattern, found.intervals)
        for interval, roots in zip(found.intervals, names, strict=True):
            self._keep(part, interval, roots)

    def _count(self, part: Part, found: Search) -> None:
        self.contacts[part.pattern.rows] += part.copies * found.contacts
        self.evaluations[part.pattern.rows] += found.evaluations

    def damped(self, part: Part, guide: Pattern, found: Search, free: Search) -> None:
        """Name the regions of a damped part by the undamped ones they overlap, and keep them."""
        self._count(part, found)
        pattern = part.pattern
        names = self._named(part, guide, free.intervals)
        guides = by_row(np.array([g.row for g in free.intervals], dtype=int), len(pattern.rows))
        probes = [
            (k, j, c)
            for k, interval in enumerate(found.intervals)
            for j, c in _probes(interval, [(int(j), free.intervals[j]) for j in guides[interval.row]])
        ]
        rows = np.array([found.intervals[k].row for k, _, _ in probes], dtype=int)
        seen = naming.shares(guide, rows, np.array([c for _, _, c in probes])) if probes else []
        self.evaluations[pattern.rows] += np.bincount(rows, minlength=len(pattern.rows))
        shares: list[labels.Shares] = [{} for _ in found.intervals]
        for (k, j, _), there in zip(probes, seen, strict=True):
            for root in names[j]:
                shares[k][root] = max(shares[k].get(root, 0.0), there.get(root, 0.0))
        growing = damped.growing(pattern)
        for interval, share in zip(found.intervals, shares, strict=True):
            best = sorted(share, key=lambda root: (-round(share[root], 3), root))
            roots = tuple(r for r in best if r == best[0] or share[r] > PRESENT)
            if not roots and growing[interval.row] < 0:
                roots = self._nearest(part, interval)
            self._keep(part, interval, roots, int(growing[interval.row]))
        for member in np.flatnonzero(pattern.elastic.rigid_growth > 0):
            tongue = self._self_excited(self._rigid(int(pattern.rows[member]), part.whole))
            ends, nowhere = (self.start, self.stop), (0.0, 0.0)
            self.regions.append(Region(int(pattern.rows[member]), ends, nowhere, (True, True), (tongue,)))

    def _named(self, part: Part, pattern: Pattern, intervals: list[Interval]) -> list[tuple[labels.Root, ...]]:
        """The roots of each region of a part's undamped pattern, modes counted from 0 in the part."""
        frequency = np.stack([self._frequency(part, k) for k in range(len(pattern.rows))])
        names, extra = naming.named(pattern, intervals, frequency)
        self.evaluations[pattern.rows] += extra
        return names

    def _nearest(self, part: Part, interval: Interval) -> tuple[labels.Root, ...]:
        """The root of a damped region that has no undamped one to be named after."""
        region = Unnamed(0.5 * (interval.start + interval.stop), {}, (0, 0, 0), (0, 0, 0))
        return labels.assign([region], self._frequency(part, interval.row), part.pattern.cycles)[0]

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

    def result(self, rows: int) -> Boundaries:
        """Everything, by row and mesh frequency."""
        regions = united(self.regions)
        edges = np.array([region.edges for region in regions], dtype=float).reshape(-1, 2)
        return Boundaries(
            rows,
            np.array([region.row for region in regions], dtype=int),
            edges[:, 0],
            edges[:, 1],
            np.array([0.5 * max(region.error) for region in regions], dtype=float),
            np.array([region.cut for region in regions], dtype=bool).reshape(-1, 2),
            tuple(region.members for region in regions),
            self.contacts,
            self.evaluations,
            self.floor,
        )


def _probes(interval: Interval, guides: list[tuple[int, Interval]]) -> list[tuple[int, float]]:
    """Points of the undamped regions that overlap a damped one, or of the nearest, at which to look for its tongues."""
    found = []
    for j, g in guides:
        low, high = max(g.start, interval.start), min(g.stop, interval.stop)
        if low < high:
            found += [(j, low + part * (high - low)) for part in (0.1, 0.5, 0.9)]
    if not found and guides:
        middle = 0.5 * (interval.start + interval.stop)
        j, g = min(guides, key=lambda item: max(item[1].start - middle, middle - item[1].stop))
        found.append((j, 0.5 * (g.start + g.stop)))
    return found
