"""Forecast of a sweep from samples of its own grid that a clock interrupts.

A sample is a part of a block: of a row of mesh frequencies first, whose points share their system and what is prepared
for it, then several rows. Samples grow until one takes a fair part of the time that there is; two of different size
tell what points share and what each takes. Others elsewhere on the grid tell how much dearer points are there: at low
mesh frequencies, above all. Of a method to which a point is a whole range of mesh frequencies parts of a range are
tried where no range is done in time. Where no sample ends in time, the time is not known.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import ceil, prod
from typing import TypeVar

import numpy as np

from gearstab import ckernel
from gearstab.errors import listed
from gearstab.methods import RANGE
from gearstab.results.variables import GRID
from gearstab.sweep.compute import compute
from gearstab.sweep.effort.clock import within
from gearstab.sweep.effort.words import duration
from gearstab.sweep.layout import GridBlock, Layout
from gearstab.sweep.plan import Plan
from gearstab.sweep.storage import store

BUDGET = 6.0
"""Seconds for the samples of all methods together."""
WORD = 0.5
"""Seconds in which it is found out whether a method takes long."""
GROWTH = 2.0, 16.0
"""Least and greatest ratio of a sample's size to that before."""
PART = 1 / 6
"""Part of the time that is left that a sample may take: those of other places are of its size."""
BRIEF = 1e-4
"""Seconds below which a sample is not told from no work at all."""
APART = 4.0
"""Least ratio of the sizes of two samples whose difference tells what a further point takes."""
PLACES = (1 / 8, 5 / 8, 3 / 8, 7 / 8)
"""Where else on the grid a sample is taken, in parts of an axis, half an axis further of every second one; the others
lie in the middle."""
SPREAD = 30.0
"""No place is so much dearer or cheaper than the middle that its sample is no accident."""
DOUBT = 3.0
"""A sample that does not end in so many times what it should take leaves the time unknown."""
UNIT = 3e-8
"""Seconds of a unit of a method's cost, about."""
OVERHEAD = 2.5
"""Arrays of a block's size that a method holds at once besides its results, roughly."""
LEAST_PART = 1 / 16
"""Part of a range from which on its time tells that of all of it: of less the search hardly knows."""
FIRST = 0.5
"""Part of the time in which a whole range is tried before parts of it."""
PARTS, PART_SIZES, GROWTH_OF_PARTS = 3, (1 / 4096, 1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0), 4.0
"""Places in a range that is too long to be tried, sizes of the part tried at each, and how these grow. The first tells
what does not grow with the range."""
SMALL = 1e6
"""Cost of what is done in seconds."""
IMPORTS = 0.5
"""Seconds of a first sample that may be those of imports."""
LONG = 120.0
"""Seconds of a method that are worth a word before it starts."""

Found = TypeVar("Found")


@dataclass(frozen=True)
class MethodEstimate:
    """One method.

    points, blocks: how many. work: seconds on one processor; seconds: on all; None where not even a sample ended in
    ``tried`` seconds. file_size: bytes in the file; memory: bytes that one block takes.
    """

    name: str
    points: int
    blocks: int
    work: float | None
    seconds: float | None
    tried: float
    file_size: float
    memory: float

    @property
    def time(self) -> str:
        """The time in words."""
        if self.seconds is None:
            return f"not known (a sample took more than {duration(self.tried)})"
        return duration(self.seconds)


@dataclass(frozen=True)
class Estimate:
    """All methods, and the whole: bytes in the file, bytes of memory; jobs: processors counted on."""

    methods: tuple[MethodEstimate, ...]
    jobs: int
    file_size: float
    memory: float

    @property
    def seconds(self) -> float:
        """Seconds of the methods whose time is known."""
        return sum(m.seconds or 0.0 for m in self.methods)

    def left(self, method: str, points: int) -> float | None:
        """Seconds of so many points of a method, None where they are not known."""
        found = next(m for m in self.methods if m.name == method)
        return None if found.seconds is None else found.seconds * points / found.points

    @property
    def time(self) -> str:
        """The time in words."""
        unknown = [m.name for m in self.methods if m.seconds is None]
        return f"not known: that of {listed(unknown)}" if unknown else duration(self.seconds)


@dataclass(frozen=True)
class Sample:
    """points: how many; seconds that they took; size: bytes of what is stored."""

    points: int
    seconds: float
    size: float


class Clock:
    """Rest of a budget of processor time, in seconds."""

    def __init__(self, seconds: float) -> None:
        self.total, self._end = max(seconds, 0.0), time.thread_time() + seconds

    @property
    def left(self) -> float:
        """Seconds, negative when they are over."""
        return self._end - time.thread_time()

    def run(self, work: Callable[[], Found]) -> tuple[Found, float] | None:
        """Return the result of the work and the seconds that it takes; None where it does not end in time."""
        return within(self.left, work) if self.left > 0 else None


def estimate(plan: Plan, jobs: int | None = None, budget: float = BUDGET) -> Estimate:
    """Compute samples of every method's grid for ``budget`` seconds in all, and scale what they take."""
    workers = jobs or ckernel.threads()
    clock, methods = Clock(budget), []
    with ckernel.using(threads=1):
        for k, layout in enumerate(plan.layouts):
            share = Clock(clock.left / (len(plan.layouts) - k))
            methods.append(_method(plan, layout, workers, share))
    file_size = sum(m.file_size for m in methods)
    memory = max(m.memory * min(workers, m.blocks) for m in methods) + min(file_size, store.MOST_BYTES)
    return Estimate(tuple(methods), workers, file_size, memory)


def long_runs(plan: Plan, found: Estimate) -> list[str]:
    """Warn of methods that are going to take long and could do with less, one line each."""
    said = []
    for layout, method in zip(plan.layouts, found.methods, strict=True):
        if layout.method.relief and (method.seconds is None or method.seconds > LONG):
            text = "may take very long" if method.seconds is None else f"will take some {method.time}"
            said.append(f"methods.{method.name} {text}; {layout.method.relief}")
    return said


def small(layout: Layout) -> bool:
    """Whether a method of which a point is a whole range is plainly done in no time."""
    return layout.points * layout.cost < SMALL


def of_ranges(plan: Plan, layout: Layout, workers: int) -> float | None:
    """Seconds on all processors of such a method; None where that is not found out in WORD seconds."""
    with ckernel.using(threads=1):
        work, _ = _work(plan, layout, Clock(WORD))
    return None if work is None else work / min(workers, layout.count)


def _method(plan: Plan, layout: Layout, workers: int, clock: Clock) -> MethodEstimate:
    """An estimate of one method within the time that is left on its clock."""
    work, size = _work(plan, layout, clock)
    rounds, seconds = ceil(layout.count / min(workers, layout.count)), work
    if work is not None and work > 1:
        seconds = work / layout.count * rounds
    memory = prod(layout.chunk) * _bytes_a_point(layout, size / layout.points) * (1 + OVERHEAD)
    tried = clock.total
    return MethodEstimate(layout.method.name, layout.points, layout.count, work, seconds, tried, size, memory)


def _work(plan: Plan, layout: Layout, clock: Clock) -> tuple[float | None, float]:
    """Seconds on one processor, None where not even a sample ends in time, and bytes in the file."""
    ranges = layout.method.frequency == RANGE
    known = np.inf if ranges else UNIT * layout.cost
    # What a range takes is told from parts of it if all of it takes too long.
    share = Clock(clock.left * (FIRST if ranges else 1.0))
    samples, known = _samples(lambda wanted: _sample(plan, layout, share, wanted), prod(layout.chunk), share, known)
    if not samples:
        if layout.method.bounded:
            return UNIT * layout.cost * layout.points, 0.0
        return (_of_parts(plan, layout, clock) if ranges else None), 0.0
    inner = plan.inner(layout)
    row = 1 if inner is None else layout.chunk[inner]
    if len(samples) == 1 and samples[0].seconds > IMPORTS and samples[0].points < prod(layout.chunk):
        return None, 0.0  # what of it the points of a block share is not known
    work, size = _whole(layout, row, samples, known, np.inf if ranges else _bytes_a_point(layout, np.inf))
    dearer = _dearer(plan, layout, clock, samples[-1])
    return None if dearer is None else work * dearer, size


def _of_parts(plan: Plan, layout: Layout, clock: Clock) -> float | None:
    """Seconds of all rows like that in the middle, from short parts of its range; None where none ends in time.

    Parts lie at several places, evenly on a logarithmic scale, and grow as long as there is time.
    """
    index = np.unravel_index(layout.points // 2, layout.shape) if layout.shape else ()
    rows = {name: np.asarray(k) for name, k in zip(layout.dims, index, strict=True)}
    method, runs = layout.method.once()
    method = method.of(plan.config.at(rows).build())
    ends, total = np.geomspace(*plan.mesh_frequency_range, PARTS + 1), 0.0
    for k, (low, high) in enumerate(pairwise(ends)):
        share = Clock(clock.left / (PARTS - k))
        spent: list[tuple[float, float]] = []
        for part in PART_SIZES:
            if len(spent) > 1 and GROWTH_OF_PARTS * spent[-1][1] > share.left:
                break
            # Cycles, and with them regions, lie evenly in 1/Omega.
            middle, half = 0.5 * (1 / low + 1 / high), 0.5 * part * (1 / low - 1 / high)
            found = share.run(partial(method.run, np.array([1 / (middle + half), 1 / (middle - half)])))
            if found is None:
                break
            spent.append((part, found[1]))
        if not spent or spent[-1][0] < LEAST_PART:
            return None
        (less, before), (part, last) = spent[-2:]
        total += last + (1 - part) * max(last - before, 0.0) / (part - less)
    return total * layout.points * runs


def _samples(
    sample: Callable[[float], Sample | None], most: int, clock: Clock, known: float = np.inf
) -> tuple[list[Sample], float]:
    """Samples of ascending size up to ``most`` points; none where not even a point is done in time.

    sample: computes one of about so many points. known: seconds of a point besides what it shares, roughly; returned as
    well, infinite where that was disproved.
    """
    wanted, first = 1.0, sample(1.0)
    if first is None:
        return [], known
    # What is called for the first time imports and allocates as well.
    again = sample(wanted) if first.seconds < IMPORTS else None
    samples = [first if again is None else min(first, again, key=lambda s: s.seconds)]
    while (last := samples[-1]).points < most:
        further = _further([(s.points, s.seconds) for s in samples[-2:]], known)
        room = PART * clock.left - (last.seconds - further * last.points)
        growth = min(room / max(further * last.points, BRIEF), GROWTH[1])
        if len(samples) == 1 and clock.left > last.seconds:
            growth = max(growth, APART)  # Much of what a single point takes may be shared.
        if growth < GROWTH[0]:
            break
        wanted, before = max(wanted, last.points) * growth, clock.left
        found = sample(wanted)
        if found is None and before > DOUBT * min(growth, most / last.points) * last.seconds:
            return [], np.inf  # points differ so much that a few do not tell of all
        if found is None:
            known = np.inf if len(samples) == 1 else known
            break
        samples = [s for s in samples if s.points < found.points] + [found]
    return samples, known


def _further(values: list[tuple[int, float]], known: float) -> float:
    """Return the time per further point by the first and the last of samples (points, what they take).

    known: what it takes about, if there is but one sample. It cannot be more than points take that share nothing.
    """
    (few, less), (points, total) = values[0], values[-1]
    further = known if few == points else (total - less) / (points - few)
    return min(max(0.0, further), total / points)


def _whole(layout: Layout, row: int, samples: list[Sample], seconds: float, size: float) -> tuple[float, float]:
    """Seconds and bytes of all blocks by those of samples; ``seconds`` and ``size`` of a further point, roughly."""
    return (
        _scaled(layout, row, [(s.points, s.seconds) for s in samples], seconds),
        _scaled(layout, row, [(s.points, s.size) for s in samples], size),
    )


def _scaled(layout: Layout, row: int, values: list[tuple[int, float]], known: float) -> float:
    """Return the time of all blocks if samples (points, what they take) do: some of it once per block, the rest per
    point.

    row: how many points of a row of mesh frequencies a block has. A sample of fewer tells of a row, not of a block.
    known: what a point takes besides what it shares, roughly.
    """
    points, total = values[-1]
    within = points < row
    if points >= prod(layout.chunk):
        return total * layout.points / points
    # Whole rows are compared with whole rows; and the difference of two that are hardly different is rounding.
    fitting = [value for value in values[:-1] if (within or value[0] >= row) and APART * value[0] <= points]
    further = _further([*fitting[-1:], values[-1]], known if within else np.inf)
    shares = layout.points / row if within else layout.count
    return (total - further * points) * shares + further * layout.points


def _dearer(plan: Plan, layout: Layout, clock: Clock, middle: Sample) -> float | None:
    """Return the average time of a point over the time in the middle of the grid; None where one does not end."""
    if middle.points == layout.points:
        return 1.0
    ratios = []
    for place in PLACES:
        before = clock.left
        if before < middle.seconds:
            break
        found = _sample(plan, layout, clock, middle.points, place)
        if found is None and before > DOUBT * middle.seconds:
            return None
        if found is None:
            ratios.append(before / middle.seconds)
        elif middle.seconds > 0:
            ratios.append(found.seconds / found.points * middle.points / middle.seconds)
    return float(np.mean(np.clip(ratios, 1 / SPREAD, SPREAD))) if len(ratios) > len(PLACES) // 2 else 1.0


def _sample(plan: Plan, layout: Layout, clock: Clock, wanted: float, place: float = 0.5) -> Sample | None:
    """One sample of about ``wanted`` points somewhere on the grid; None where it does not end in time."""
    block = block_at(layout, plan.inner(layout), wanted, place)
    found = clock.run(lambda: compute(plan, block).size())
    return None if found is None else Sample(block.points, found[1], found[0])


def _bytes_a_point(layout: Layout, encoded: float) -> float:
    over_grid = [own.point_bytes for own in layout.results if GRID in own.variable.dims]
    return sum(over_grid) or 4 * encoded


def block_at(layout: Layout, inner: int | None, wanted: float, place: float = 0.5) -> GridBlock:
    """A part of a block, of about ``wanted`` points, at a place in parts of each axis.

    inner: the axis that is filled before the others, if any; these are parts of the block's own in the same ratio.
    """
    shape, rest = [1] * len(layout.chunk), max(1.0, wanted)
    if inner is not None:
        shape[inner] = min(layout.chunk[inner], round(rest))
        rest /= shape[inner]
    others = [k for k, n in enumerate(layout.chunk) if n > 1 and k != inner]
    share = min(1.0, rest / prod(layout.chunk[k] for k in others))
    for k in others:
        shape[k] = max(1, round(layout.chunk[k] * share ** (1 / len(others))))
    places = [place if k % 2 == 0 or place == 0.5 else (place + 0.5) % 1 for k in range(len(shape))]
    ends = zip(places, layout.shape, shape, strict=True)
    start = tuple(min(max(round(p * n - 0.5 * m), 0), n - m) for p, n, m in ends)
    return GridBlock(layout.method.name, 0, start, tuple(shape))
