"""Describe the block reduction of a single system, for people and result files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.frequencies import sample, segments_a_cycle
from gearstab.floquet.segments.blocks import Block, split
from gearstab.modal import mean_modes
from gearstab.propagation.elastic import free_rotations
from gearstab.system import GearSystem

SHARE = 1e-9
"""A mode takes part in a block with at least this part of its energy."""
STANDARD = 4 * 3**3
"""Segments times coordinates cubed of the point whose work is the unit of cost: four segments of three coordinates."""
SEARCH = 4000
"""Points that take as long as a search for regions without damping: measured with two meshes over mesh frequencies of 1
to 8, 1,000, 2,600 and 4,800 for one to three coordinates. With damping a search takes 50 to 200 times as long, up to
its budget."""


@dataclass(frozen=True)
class BlockSummary:
    """A block of a system: numbers (from 1) of its modes, its size, how often it occurs, segments per period, distinct
    stiffness states.

    Identical blocks share modes of equal frequency: each is made of ``size`` combinations of ``copies`` times as many.
    """

    modes: tuple[int, ...]
    size: int
    copies: int
    segments: int
    states: int


@dataclass(frozen=True)
class Reduction:
    """Blocks and kinds of a system's modes.

    rigid: rigid-body modes; dropped: modes that no mesh excites; parts: the blocks that are solved; saving: how many
    times less work (segments times coordinates cubed) they take than the elastic modes together.
    """

    rigid: tuple[int, ...]
    dropped: tuple[int, ...]
    parts: tuple[BlockSummary, ...]
    saving: float

    @property
    def cost(self) -> float:
        """Work of a point over that of three coordinates and four segments, and no less."""
        return max(1.0, sum(part.segments * part.size**3 for part in self.parts) / STANDARD)

    def text(self) -> str:
        """Say it in one line, for instance "2 modes dropped; blocks of 7, 9 (twice) modes"."""
        words = []
        if self.rigid:
            words.append(f"{_modes(len(self.rigid))} of rigid bodies dropped")
        if self.dropped:
            words.append(f"{_modes(len(self.dropped))} without mesh deflection dropped")
        sizes = [str(part.size) + _times(part.copies) for part in self.parts]
        if len(self.parts) == 1 and self.parts[0].copies == 1:
            words.append(f"one block of {_modes(self.parts[0].size)}")
        elif sizes:
            words.append(f"blocks of {', '.join(sizes)} modes")
        return "; ".join(words)


def search_cost(system: GearSystem, size: int) -> float:
    """Return the cost of a search for all regions of a single system, of which ``size`` coordinates are searched.

    A cycle of a mesh has two segments.
    """
    segments = 2 * sum(system.common_period()[1])
    return SEARCH * max(1.0, segments * size**3 / STANDARD)


def reduced(system: GearSystem) -> Reduction:
    """Return the reduction of a single system in the modes of the mean system."""
    modes = mean_modes(system)
    rigid = modes.rigid
    elastic = np.flatnonzero(~rigid) + 1
    pattern = sample(system)
    blocks = [block for block in split(pattern) if block.pattern.size]
    dropped = [block for block in blocks if block.constant]
    kept = [block for block in blocks if not block.constant]
    work = sum(_work(block) for block in kept)
    whole = len(pattern.states) * pattern.size**3
    return Reduction(
        tuple((np.flatnonzero(rigid) + 1).tolist()),
        tuple(sorted(k for block in dropped for k in _numbers(block, elastic))),
        tuple(
            BlockSummary(
                _numbers(block, elastic),
                block.pattern.size,
                block.copies,
                len(block.pattern.states),
                block.pattern.stiffness.shape[1],
            )
            for block in kept
        ),
        whole / work if work else float("inf"),
    )


def whole(system: GearSystem) -> Reduction:
    """Return the reduction of a single system in its first-order form: only rigid-body modes are left out."""
    rigid = free_rotations(system)[0]
    size = int(np.sum(~rigid))
    # Without a common period the segments of one cycle are told.
    cycles = system.common_period()[0] if system.commensurate else 1
    segments = max(1, round(segments_a_cycle(system) * float(cycles)))
    part = BlockSummary(tuple((np.flatnonzero(~rigid) + 1).tolist()), size, 1, segments, segments)
    return Reduction(tuple((np.flatnonzero(rigid) + 1).tolist()), (), (part,) if size else (), 1.0)


def _work(block: Block) -> int:
    return len(block.pattern.states) * block.pattern.size**3


def _numbers(block: Block, elastic: np.ndarray) -> tuple[int, ...]:
    shares = np.sum(block.basis[0] ** 2, axis=1)
    return tuple(elastic[shares > SHARE].tolist())


def _modes(count: int) -> str:
    return "1 mode" if count == 1 else f"{count} modes"


def _times(copies: int) -> str:
    return {1: "", 2: " (twice)"}.get(copies, f" ({copies} times)")
