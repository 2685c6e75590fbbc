"""What is finished of a sweep: the blocks that are there, and what they add up to."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from gearstab.results.chunks import decode
from gearstab.sweep.parts import FinishedBlock
from gearstab.sweep.plan import Block, Layout, Plan


@dataclass(frozen=True)
class Finished:
    """The finished blocks of a plan, by key."""

    plan: Plan
    blocks: dict[str, FinishedBlock] = field(default_factory=dict)

    def of(self, layout: Layout) -> list[FinishedBlock]:
        """Return what is there of a method, in the order of its blocks."""
        return [self.blocks[block.key] for block in layout.blocks() if block.key in self.blocks]

    def missing(self, layout: Layout) -> list[Block]:
        """Return what is not there of a method."""
        return [block for block in layout.blocks() if block.key not in self.blocks]

    @property
    def size(self) -> int:
        """Bytes of all chunks."""
        return sum(block.size() for block in self.blocks.values())

    @property
    def kernels(self) -> set[str]:
        """Which kernels computed it."""
        return {name for block in self.blocks.values() for name in block.kernels}

    def flags(self, layout: Layout) -> dict[str, int]:
        """Count the points of a method that carry each flag of ``status``."""
        total: Counter[str] = Counter()
        for block in self.of(layout):
            total.update(block.flags)
        return dict(total)

    def mean(self, variable: str) -> float | None:
        """Return the mean of a variable of one value a row over all rows that have one; None where there is none."""
        total, count = 0.0, 0
        for layout in self.plan.layouts:
            if not layout.gives(variable):
                continue
            for block in layout.blocks():
                (data,) = self.blocks[block.key].pieces(variable)
                values = decode(data, layout.chunk, "f8")[tuple(slice(0, size) for size in block.shape)]
                total, count = total + float(np.nansum(values)), count + int(np.isfinite(values).sum())
        return total / count if count else None
