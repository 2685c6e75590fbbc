"""What a sweep will take, from a small sample of its own grid."""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import ceil, prod

import numpy as np

from gearstab import ckernel
from gearstab.results.variables import GRID
from gearstab.sweep import merge
from gearstab.sweep.compute import compute
from gearstab.sweep.plan import Block, Layout, Plan

SECONDS = 0.4
"""Time that the samples of one method may take."""
MOST_SAMPLES = 6
LONG = 5.0
"""Seconds of a single point that are sample enough."""
MANY = 20
"""Points of which a second one is worth its time all the same."""
OVERHEAD = 2.5
"""Arrays of a block's size that a method holds at once besides its results, roughly."""


@dataclass(frozen=True)
class MethodEstimate:
    """One method.

    points, blocks: how many. work: seconds on one processor; seconds: on all. file_size: bytes in the file;
    memory: bytes that one block takes.
    """

    name: str
    points: int
    blocks: int
    work: float
    seconds: float
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


def estimate(plan: Plan, jobs: int | None = None) -> Estimate:
    """Compute growing samples of every method's grid for a fraction of a second and scale what they take."""
    workers = jobs or ckernel.threads()
    with ckernel.using(plan.kernel, threads=1):
        methods = tuple(_method(plan, layout, workers) for layout in plan.layouts)
    file_size = sum(m.file_size for m in methods)
    memory = max(m.memory * min(workers, m.blocks) for m in methods) + min(file_size, merge.IN_MEMORY)
    return Estimate(methods, workers, sum(m.seconds for m in methods), file_size, memory)


def _method(plan: Plan, layout: Layout, workers: int) -> MethodEstimate:
    first = sample(layout, 1)
    start = time.process_time()
    part = compute(plan, first)  # first calls import and allocate
    spent, points, size, wanted = time.process_time() - start, first.points, part.size(), 64
    for _ in range(MOST_SAMPLES if spent < LONG else 0):
        block = sample(layout, wanted)
        start = time.process_time()
        part = compute(plan, block)
        spent = time.process_time() - start
        points, size = block.points, part.size()
        if spent > SECONDS / 4 or points >= min(layout.points, prod(layout.chunk)):
            break
        wanted = points * int(min(16, max(2, SECONDS / 2 / max(spent, 1e-4))))
    work = spent * layout.points / points
    if points < prod(layout.chunk) and (points > 1 or layout.points >= MANY):
        work = _shared(plan, layout, points, spent)
    rounds = ceil(layout.count / min(workers, layout.count))
    block_work = work / layout.count
    seconds = block_work * rounds if work > 1 else work
    memory = prod(layout.chunk) * _bytes_a_point(plan, layout, size / points) * (1 + OVERHEAD)
    return MethodEstimate(
        layout.method.name, layout.points, layout.count, work, seconds, size * layout.points / points, memory
    )


def _shared(plan: Plan, layout: Layout, points: int, spent: float) -> float:
    """The work from samples of less than a block, whose points share some of it: a first and every further point."""
    block = sample(layout, 1 if points > 1 else 2)
    start = time.process_time()
    compute(plan, block)
    other = time.process_time() - start
    alone, many, count = (other, spent, points) if points > 1 else (spent, other, block.points)
    further = min(max(0.0, many - alone) / max(1, count - 1), many / count)
    return min(alone, many) * layout.count + further * (layout.points - layout.count)


def _bytes_a_point(plan: Plan, layout: Layout, encoded: float) -> float:
    total, constants = 0.0, layout.method.constants()
    for variable in layout.method.results:
        if GRID in variable.dims:
            along = prod(len(constants[dim]) for dim in variable.dims if dim in constants)
            total += np.dtype(variable.dtype).itemsize * along
    return total or 4 * encoded


def sample(layout: Layout, wanted: int) -> Block:
    """A block in the middle of the grid of about ``wanted`` points, of the shape of the method's own blocks."""
    share = min(1.0, wanted / prod(layout.chunk))
    along = [n for n in layout.chunk if n > 1]
    factor = share ** (1 / len(along)) if along else 1.0
    shape = tuple(max(1, min(n, round(n * factor))) for n in layout.chunk)
    start = tuple((n - m) // 2 for n, m in zip(layout.shape, shape, strict=True))
    return Block(layout.method.name, 0, start, shape)
