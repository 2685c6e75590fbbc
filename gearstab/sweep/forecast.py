"""Forecast of a sweep: time, memory and size of the file, and limits that it exceeds only when asked.

A part of a block in the middle of the grid is measured: a point, then a row of mesh frequencies, which share their
system and what is prepared for it, then several rows, as long as that takes a small part of the time that there is. All
points together take their time as often as it goes into the grid. Where no part is done in time, the time is not known.

Methods that search a range of mesh frequencies have no point to begin with: if no row is done in time, parts of the
range are tried, of which the theory of the search says how they add up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import ceil, prod
from pathlib import Path
from typing import TypeVar

import numpy as np

from gearstab import ckernel
from gearstab.errors import RequestError, listed
from gearstab.interrupts import TimeUp
from gearstab.methods import RANGE
from gearstab.results.output import free_bytes
from gearstab.results.variables import GRID
from gearstab.sweep.compute import compute
from gearstab.sweep.plan import GridBlock, Layout, Plan
from gearstab.sweep.progress import duration, octets
from gearstab.sweep.storage import store
from gearstab.sweep.storage.parts import PartFolder

BUDGET = 6.0
"""Seconds for the samples of all methods together."""
GROWTH = 2.0, 16.0
"""Least and greatest ratio of a sample's size to that before."""
PART = 1 / 2
"""Part of the time that is left that a sample may take."""
DOUBT = 3.0
"""A sample that does not end in so many times what it should take leaves the time unknown."""
IMPORTS = 0.5
"""Seconds of a first sample that may be those of imports."""
UNIT = 3e-8
"""Seconds of a unit of a method's cost, about."""
OVERHEAD = 2.5
"""Arrays of a block's size that a method holds at once besides its results, roughly."""
LEAST_PART = 1 / 16
"""Part of a range from which on its time tells that of all of it: of less the search hardly knows."""
WHOLE_RANGE = 0.5
"""Part of the time in which a whole range is tried before parts of it."""
PARTS, PART_SIZES, GROWTH_OF_PARTS = 3, (1 / 4096, 1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0), 4.0
"""Places in a range that is too long to be tried, sizes of the part tried at each, and how these grow. The first tells
what does not grow with the range."""

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
    """Rest of a budget of processor time, in seconds, so that nothing depends on what else a machine does."""

    def __init__(self, seconds: float) -> None:
        self.total, self._end = max(seconds, 0.0), time.thread_time() + seconds

    @property
    def left(self) -> float:
        """Seconds, negative when they are over."""
        return self._end - time.thread_time()

    def run(self, work: Callable[[], Found]) -> tuple[Found, float] | None:
        """Return the result of the work and the seconds that it takes; None where it does not end in time."""
        return within(self.left, work) if self.left > 0 else None


def within(seconds: float, work: Callable[[], Found]) -> tuple[Found, float] | None:
    """Run ``work``; return its result and the processor time that it took (s), None where it takes more than
    ``seconds``.

    It is stopped where it heeds that (:func:`gearstab.interrupts.heed`), as the compiled kernel does everywhere.
    """
    start = time.thread_time()
    try:
        with ckernel.limited(seconds):
            found = work()
    except TimeUp:
        return None
    return found, time.thread_time() - start


def estimate(plan: Plan, jobs: int | None = None, budget: float = BUDGET) -> Estimate:
    """Measure samples of every method's grid for ``budget`` seconds in all, and scale what they take."""
    workers = jobs or ckernel.threads()
    clock, methods = Clock(budget), []
    with ckernel.using(threads=1):
        for k, layout in enumerate(plan.layouts):
            methods.append(_method(plan, layout, workers, Clock(clock.left / (len(plan.layouts) - k))))
    file_size = sum(m.file_size for m in methods)
    memory = max(m.memory * min(workers, m.blocks) for m in methods) + min(file_size, store.MOST_BYTES)
    return Estimate(tuple(methods), workers, file_size, memory)


def _method(plan: Plan, layout: Layout, workers: int, clock: Clock) -> MethodEstimate:
    """An estimate of one method within the time that is left on its clock."""
    work, point_bytes = work_of(plan, layout, clock)
    over_grid = sum(own.point_bytes for own in layout.results if GRID in own.variable.dims)
    point_bytes = min(point_bytes, over_grid or np.inf)
    rounds, seconds = ceil(layout.count / min(workers, layout.count)), work
    if work is not None and work > 1:
        seconds = work / layout.count * rounds
    memory = prod(layout.chunk) * (over_grid or 4 * point_bytes) * (1 + OVERHEAD)
    size = layout.points * point_bytes
    return MethodEstimate(layout.method.name, layout.points, layout.count, work, seconds, clock.total, size, memory)


def work_of(plan: Plan, layout: Layout, clock: Clock) -> tuple[float | None, float]:
    """Seconds on one processor, None where they are not known, and bytes of a point in the file."""
    ranges = layout.method.frequency == RANGE
    share = Clock(clock.left * (WHOLE_RANGE if ranges else 1.0))
    sample = _largest(plan, layout, share)
    if sample is None:
        if layout.method.bounded:
            return UNIT * layout.cost * layout.points, 0.0
        return (_of_parts(plan, layout, clock) if ranges else None), 0.0
    # What of a long first sample the points of a row share is not known.
    if sample.points == 1 < _row(plan, layout) and sample.seconds > IMPORTS:
        return None, sample.size
    return sample.seconds / sample.points * layout.points, sample.size / sample.points


def _row(plan: Plan, layout: Layout) -> int:
    """Number of points of a block that share their system."""
    inner = plan.inner(layout)
    return 1 if inner is None else layout.chunk[inner]


def _largest(plan: Plan, layout: Layout, clock: Clock) -> Sample | None:
    """The largest sample in the middle that takes PART of the time; None where none is done, or they differ too much.

    One of the size of a row is taken whole.
    """
    last = _sample(plan, layout, clock, 1.0)
    if last is not None and last.seconds < IMPORTS:
        # What is called for the first time imports and allocates as well.
        last = min(last, _sample(plan, layout, clock, 1.0) or last, key=lambda sample: sample.seconds)
    row, size = _row(plan, layout), 1.0
    while last is not None and last.points < prod(layout.chunk):
        growth = min(PART * clock.left / max(last.seconds, 1e-6), GROWTH[1])
        if last.points == 1 and clock.left > DOUBT * last.seconds:
            growth = max(growth, GROWTH[0])
        if growth < GROWTH[0]:
            break
        size, before = max(size, last.points) * growth, clock.left
        size = float(row) if last.points < row < size else size
        further = _sample(plan, layout, clock, size)
        if further is None:
            return None if before > DOUBT * growth * last.seconds else last
        last = further if further.points > last.points else last
    return last


def _sample(plan: Plan, layout: Layout, clock: Clock, size: float) -> Sample | None:
    """One sample of about ``size`` points in the middle of the grid; None where it does not end in time."""
    block = middle_block(layout, plan.inner(layout), size)
    found = clock.run(lambda: compute(plan, block).size())
    return None if found is None else Sample(block.points, found[1], found[0])


def middle_block(layout: Layout, inner: int | None, size: float) -> GridBlock:
    """A part of a block, of about ``size`` points, in the middle of the grid.

    inner: the axis that is filled before the others, if any; these are parts of the block's own in the same ratio.
    """
    shape, rest = [1] * len(layout.chunk), max(1.0, size)
    if inner is not None:
        shape[inner] = min(layout.chunk[inner], round(rest))
        rest /= shape[inner]
    others = [k for k, n in enumerate(layout.chunk) if n > 1 and k != inner]
    share = min(1.0, rest / prod(layout.chunk[k] for k in others))
    for k in others:
        shape[k] = max(1, round(layout.chunk[k] * share ** (1 / len(others))))
    start = tuple((n - m) // 2 for n, m in zip(layout.shape, shape, strict=True))
    return GridBlock(layout.method.name, 0, start, tuple(shape))


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


QUICK_LOOK = 0.5
"""Seconds in which it is found out whether a method takes long."""
LONG = 120.0
"""Seconds of a method that are worth a word before it starts."""
MOST_POINTS = 1_000_000_000
MOST_SECONDS = 8 * 3600.0
MOST_BYTES = 10e9
"""Beyond these a sweep is begun with ``--yes`` only: a thousand maps of a thousand by a thousand points, a working day,
and what takes minutes to copy."""
SECONDS_OF_COST = 1e-7
"""Seconds of a unit of a method's cost, at most, roughly: three times UNIT."""
SMALL_COST = 1e6
"""Cost of searches of ranges that are done in seconds."""
SHORT = 60.0
"""Seconds of a sweep, by its cost, that is begun without measuring anything."""
TO_CONFIRM = "add --yes to begin it, or try --dry-run"


def refuse(plan: Plan, out: Path, jobs: int | None, confirmed: bool, confirm: str = TO_CONFIRM) -> Estimate | None:
    """Return what a sweep will take, as ``--dry-run`` tells it; None of one that is plainly small, as a closer look
    takes time itself.

    Raises RequestError for a sweep that is large and not ``confirmed``, or that does not fit on the disk. confirm: what
    the user can do to begin it all the same.
    """
    free = free_bytes(out)
    if plainly_small(plan, jobs, free):
        return None
    found = estimate(plan, jobs)
    # Finished blocks and the result are there at the same time; some may be there from an earlier run.
    folder = PartFolder(out, plan.digest).path
    kept = sum(path.stat().st_size for path in folder.glob("*.part")) if folder.is_dir() else 0
    needed = 2 * found.file_size - kept
    if needed > free:
        raise RequestError(
            f"{out}: the sweep needs about {octets(needed)} of disk for finished blocks and the result, and "
            f"{octets(free)} are free; make room or choose an output on another disk"
        )
    if not confirmed and (reasons := large(plan, found)):
        remedies = [f"; methods.{name}: {remedy}" for name, _, remedy in _expensive(plan, found)]
        raise RequestError(f"the sweep is large: {', '.join(reasons)}; {confirm}{''.join(remedies)}")
    return found


def plainly_small(plan: Plan, jobs: int | None, free: float) -> bool:
    """Whether nothing can make a sweep large, by numbers that cost nothing."""
    seconds = sum(_roughly(plan, layout, jobs or ckernel.threads()) for layout in plan.layouts)
    # Not compressed; lists of tongues, of unknown length, as if they had ten.
    size = sum(
        own.point_bytes * (10 if "tongue" in own.variable.dims else 1) * layout.points
        for layout in plan.layouts for own in layout.results
    )  # fmt: skip
    return plan.points <= MOST_POINTS and seconds < SHORT and 2 * size < min(free, MOST_BYTES)


def _roughly(plan: Plan, layout: Layout, workers: int) -> float:
    """Seconds of a method; infinite where that is not found out at once."""
    if layout.method.frequency != RANGE or layout.points * layout.cost < SMALL_COST:
        return layout.points * layout.cost * SECONDS_OF_COST / workers
    with ckernel.using(threads=1):
        work, _ = work_of(plan, layout, Clock(QUICK_LOOK))
    return np.inf if work is None else work / min(workers, layout.count)


def large(plan: Plan, found: Estimate) -> list[str]:
    """Say in which respects a sweep is large; empty for none."""
    reasons = []
    if plan.points > MOST_POINTS:
        reasons.append(f"{plan.points:,} points")
    if found.seconds > MOST_SECONDS:
        reasons.append(f"about {found.seconds / 3600:.3g} hours on {found.jobs} processors")
    if found.file_size > MOST_BYTES:
        reasons.append(f"a result of about {octets(found.file_size)}")
    return reasons


def long_runs(plan: Plan, found: Estimate) -> list[str]:
    """Warn of methods that are going to take long and could do with less, one line each."""
    return [f"methods.{name} {text}; {remedy}" for name, text, remedy in _expensive(plan, found)]


def _expensive(plan: Plan, found: Estimate) -> list[tuple[str, str, str]]:
    """Methods that take long and could do with less: name, how long, remedy."""
    return [
        (m.name, "may take very long" if m.seconds is None else f"will take some {m.time}", layout.method.relief)
        for layout, m in zip(plan.layouts, found.methods, strict=True)
        if layout.method.relief and (m.seconds is None or m.seconds > LONG)
    ]
