"""What a sweep will take, from samples of its own grid that a clock interrupts.

A sample is a part of a block: of a row of mesh frequencies first, whose points share their system and what is prepared
for it, then several rows. Samples grow until one takes a fair part of the time that there is; two of different size
tell what points share and what each takes. Others elsewhere on the grid tell how much dearer points are there: at low
mesh frequencies, above all. A method to which a point is a whole range of mesh frequencies, of which none may be done
in the time that there is, gives an account of its effort, which samples correct where they can.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, prod
from typing import TypeVar

import numpy as np

from gearstab import ckernel
from gearstab.config import parameters_at
from gearstab.methods import RANGE, EffortEstimate
from gearstab.results.variables import GRID
from gearstab.sweep.compute import compute
from gearstab.sweep.effort.clock import within
from gearstab.sweep.plan import GridBlock, Layout, Plan
from gearstab.sweep.storage import store
from gearstab.systems import build

BUDGET = 1.0
"""Seconds for the samples of all methods together."""
WORD = 1.0
"""Seconds in which it is found out whether a method takes long."""
ROWS = 5
"""Rows that are asked where they differ in structure, as trains of other tooth ratios do."""
GROWTH = 2.0, 16.0
"""Least and greatest ratio of a sample's size to that before."""
PART = 1 / 3
"""Part of the time that is left that a sample may take: there are two of its size to come."""
BRIEF = 1e-4
"""Seconds below which a sample is not told from no work at all."""
APART = 4.0
"""Least ratio of the sizes of two samples whose difference tells what a further point takes."""
PLACES = (1 / 6, 5 / 6)
"""Where else on the grid a sample is taken, in parts of each axis; the others lie in the middle."""
SPREAD = 30.0
"""No place is so much dearer or cheaper than the middle that its sample is no accident."""
UNIT = 3e-8
"""Seconds of a unit of a method's cost, about."""
OVERHEAD = 2.5
"""Arrays of a block's size that a method holds at once besides its results, roughly."""
MANY = 1000
"""Points of which each takes as long as in a sweep."""
LONG = 120.0
"""Seconds of a method that are worth a word before it starts."""

Found = TypeVar("Found")


@dataclass(frozen=True)
class MethodEstimate:
    """One method.

    points, blocks: how many. work: seconds on one processor; seconds: on all; at_least: whether it may be far more than
    that. file_size: bytes in the file; memory: bytes that one block takes.
    """

    name: str
    points: int
    blocks: int
    work: float
    seconds: float
    at_least: bool
    file_size: float
    memory: float


@dataclass(frozen=True)
class Estimate:
    """All methods, and the whole: seconds, bytes in the file, bytes of memory; jobs: processors counted on."""

    methods: tuple[MethodEstimate, ...]
    jobs: int
    seconds: float
    file_size: float
    memory: float

    @property
    def at_least(self) -> bool:
        """Whether it may take far longer."""
        return any(method.at_least for method in self.methods)


@dataclass(frozen=True)
class Sample:
    """points: how many; seconds that they took; size: bytes of what is stored."""

    points: int
    seconds: float
    size: float


class Clock:
    """What is left of a number of seconds."""

    def __init__(self, seconds: float) -> None:
        self.total, self._end = seconds, time.perf_counter() + seconds

    @property
    def left(self) -> float:
        """Seconds, negative when they are over."""
        return self._end - time.perf_counter()

    def run(self, work: Callable[[], Found]) -> tuple[Found, float] | None:
        """Return the result of the work and the seconds that it takes; None where it does not end in time."""
        return within(self.left, work) if self.left > 0 else None


def estimate(plan: Plan, jobs: int | None = None, budget: float = BUDGET) -> Estimate:
    """Compute samples of every method's grid for ``budget`` seconds in all, and scale what they take."""
    workers = jobs or ckernel.threads()
    clock, methods = Clock(budget), []
    with ckernel.using(plan.kernel, threads=1):
        for layout in plan.layouts[:-1]:
            # What is called for the first time imports and allocates: that is no part of a method's share.
            if layout.method.frequency != RANGE:
                _sample(plan, layout, clock, 1.0)
        for k, layout in enumerate(plan.layouts):
            share = Clock(clock.left / (len(plan.layouts) - k))
            methods.append(_method(plan, layout, workers, share))
    file_size = sum(m.file_size for m in methods)
    memory = max(m.memory * min(workers, m.blocks) for m in methods) + min(file_size, store.MOST_BYTES)
    return Estimate(tuple(methods), workers, sum(m.seconds for m in methods), file_size, memory)


def seconds_per_point(work: Callable[[int], object], most: int = MANY, budget: float = BUDGET) -> float | None:
    """Seconds on one processor of each of many points that ``work`` is called with; None where not one ends in time."""
    clock = Clock(budget)

    def sample(wanted: float) -> Sample | None:
        points = min(most, max(1, round(wanted)))
        found = clock.run(lambda: work(points))
        return None if found is None else Sample(points, found[1], 0.0)

    with ckernel.using(threads=1):
        samples, _ = _samples(sample, most, clock)
    return samples[-1].seconds / samples[-1].points if samples else None


def long_runs(plan: Plan, jobs: int | None = None) -> list[str]:
    """Warn of methods that are going to take long before they start, one line each."""
    found = []
    for layout in plan.layouts:
        if layout.method.frequency != RANGE:
            continue
        seconds = by_effort(plan, layout, jobs or ckernel.threads())
        if seconds > LONG:
            text = f"{seconds / 60:.0f} minutes" if seconds < 5400 else f"{seconds / 3600:,.0f} hours"
            text = f"will take some {text}" if np.isfinite(seconds) else "may take very long"
            found.append(f"methods.{layout.method.name} {text}; {layout.method.relief}")
    return found


def by_effort(plan: Plan, layout: Layout, workers: int) -> float:
    """Seconds on all processors by a method's own account; infinite where it is not given at once."""
    work = _by_effort(plan, layout, Clock(WORD))
    return np.inf if work is None else work / min(workers, layout.count)


def _method(plan: Plan, layout: Layout, workers: int, clock: Clock) -> MethodEstimate:
    """An estimate of one method within the time that is left on its clock."""
    work, size = _ranges(plan, layout, clock) if layout.method.frequency == RANGE else _points(plan, layout, clock)
    at_least = work is None
    if work is None:
        work = max(clock.total, layout.points * UNIT * layout.cost)
    rounds = ceil(layout.count / min(workers, layout.count))
    seconds = work / layout.count * rounds if work > 1 else work
    memory = prod(layout.chunk) * _bytes_a_point(layout, size / layout.points) * (1 + OVERHEAD)
    return MethodEstimate(layout.method.name, layout.points, layout.count, work, seconds, at_least, size, memory)


def _points(plan: Plan, layout: Layout, clock: Clock) -> tuple[float | None, float]:
    """Seconds on one processor, None where not even one point is done in time, and bytes in the file."""
    known = UNIT * layout.cost
    samples, known = _samples(lambda wanted: _sample(plan, layout, clock, wanted), prod(layout.chunk), clock, known)
    if not samples:
        return None, 0.0
    inner = plan.inner(layout)
    row = 1 if inner is None else layout.chunk[inner]
    work, size = _whole(layout, row, samples, known, _bytes_a_point(layout, np.inf))
    return work * _dearer(plan, layout, clock, samples[-1]), size


def _ranges(plan: Plan, layout: Layout, clock: Clock) -> tuple[float | None, float]:
    """The same where a point is a whole range: by the method's own account, corrected by what some rows take."""
    work = _by_effort(plan, layout, clock)
    one = None if work is None else _effort(plan, layout, clock, 0.5)
    if work is None or one is None:
        return work, 0.0
    left, each = max(clock.left, 0.0), one.seconds(layout.points, layout.count)
    samples, _ = _samples(lambda wanted: _sample(plan, layout, clock, wanted), prod(layout.chunk), clock)
    if not samples:  # a row takes longer than that, whatever the account says
        return max(work, left * layout.points), 0.0
    # Where rows differ in structure, by the account; one in which no multipliers meet takes nothing by it.
    dearer = min(max(work / each, 1 / SPREAD), SPREAD) if each else 1.0
    seconds, size = _whole(layout, 1, samples, np.inf, np.inf)
    return dearer * seconds, size


def _by_effort(plan: Plan, layout: Layout, clock: Clock) -> float | None:
    """Seconds of all rows by the account of the method; None where that is not done in time."""
    structural = any(item.structural for axis in plan.row_axes for item in axis.assignments)
    places = np.linspace(0.0, 1.0, min(ROWS, layout.points)) if structural else np.array([0.5])
    efforts = [_effort(plan, layout, clock, float(place)) for place in places]
    seconds = [e.seconds(layout.points, layout.count) for e in efforts if e is not None]
    return float(np.mean(seconds)) if len(seconds) == len(efforts) else None


def _effort(plan: Plan, layout: Layout, clock: Clock, place: float) -> EffortEstimate | None:
    """What the row at a place of the grid takes; None where that is not found out in time."""
    number = round(place * (layout.points - 1))
    index = np.unravel_index(number, layout.shape) if layout.shape else ()
    rows = {name: np.asarray(k) for name, k in zip(layout.dims, index, strict=True)}
    ends = np.array(plan.mesh_frequency_range)
    found = clock.run(lambda: layout.method.of(build(parameters_at(plan.config, rows))).effort(ends))
    return None if found is None else found[0]


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
    again = sample(wanted)
    samples = [first if again is None else min(first, again, key=lambda s: s.seconds)]
    while (last := samples[-1]).points < most:
        further = _further([(s.points, s.seconds) for s in samples[-2:]], known)
        room = PART * clock.left - (last.seconds - further * last.points)
        growth = min(room / max(further * last.points, BRIEF), GROWTH[1])
        if len(samples) == 1 and clock.left > GROWTH[0] * last.seconds:
            growth = max(growth, APART)  # Much of what a single point takes may be shared.
        if growth < GROWTH[0]:
            break
        wanted = max(wanted, last.points) * growth
        found = sample(wanted)
        if found is None:
            known = np.inf if len(samples) == 1 else known
            break
        samples = [s for s in samples if s.points < found.points] + [found]
    return samples, known


def _further(values: list[tuple[int, float]], known: float) -> float:
    """What each further point takes by the first and the last of samples (points, what they take).

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
    """What all blocks take if samples (points, what they take) do: some of it once per block, the rest per point.

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


def _dearer(plan: Plan, layout: Layout, clock: Clock, middle: Sample) -> float:
    """What a point takes on average over what it takes in the middle of the grid."""
    ratios = [1.0]
    for place in PLACES:
        before = clock.left
        if before < middle.seconds:
            break
        found = _sample(plan, layout, clock, middle.points, place)
        if found is None:
            ratios.append(before / middle.seconds)
        elif found.points == middle.points and middle.seconds > 0:
            ratios.append(found.seconds / middle.seconds)
    if len(ratios) < 1 + len(PLACES):
        return 1.0
    return float(np.mean(np.clip(ratios, 1 / SPREAD, SPREAD)))


def _sample(plan: Plan, layout: Layout, clock: Clock, wanted: float, place: float = 0.5) -> Sample | None:
    """One sample of about ``wanted`` points somewhere on the grid; None where it does not end in time."""
    block = block_at(layout, plan.inner(layout), wanted, place)
    found = clock.run(lambda: compute(plan, block).size())
    return None if found is None else Sample(block.points, found[1], found[0])


def _bytes_a_point(layout: Layout, encoded: float) -> float:
    over_grid = [variable for variable in layout.method.results if GRID in variable.dims]
    return sum(np.dtype(v.dtype).itemsize * prod(layout.inner(v)) for v in over_grid) or 4 * encoded


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
    start = tuple(min(max(round(place * n - 0.5 * m), 0), n - m) for n, m in zip(layout.shape, shape, strict=True))
    return GridBlock(layout.method.name, 0, start, tuple(shape))
