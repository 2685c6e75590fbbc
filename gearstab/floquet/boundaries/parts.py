"""Exact block reduction of the search: what the meshes never couple is searched apart, and the regions are united.

A block of few coordinates (:mod:`~gearstab.floquet.segments.blocks`) costs a small part of the whole, and multipliers
of different blocks pass each other without a collision that would have to be looked into. A point is unstable where
any block is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.segments.blocks import split, whole
from gearstab.floquet.segments.pattern import Pattern
from gearstab.perturbation.tongues import Tongue
from gearstab.system import Array

TAKES_PART = 1e-6
"""Share (squared) above which a mode takes part in a coordinate; of other frequencies than its own there is none."""


@dataclass(frozen=True)
class Part:
    """A block of a pattern.

    whole: the number of elastic modes of the whole. modes: ``(r, m)``, which of them, from 0, each coordinate is named
    after; of equal frequencies the first that is free. copies: how many identical blocks this one stands for.
    """

    pattern: Pattern
    whole: int
    modes: Array
    copies: int

    def subset(self, rows: Array) -> Part:
        """Some of the rows, by position."""
        if len(rows) == len(self.pattern.rows):
            return self
        return replace(self, pattern=self.pattern.subset(rows), modes=self.modes[rows])


def separated(pattern: Pattern, reduction: bool) -> Iterator[Part]:
    """The blocks of a pattern; one, the pattern, where nothing can be separated or ``reduction`` is False."""
    position = {int(row): k for k, row in enumerate(pattern.rows)}
    named = np.zeros((len(pattern.rows), pattern.size), dtype=bool)
    for block in split(pattern) if reduction else [whole(pattern)]:
        row = np.array([position[int(r)] for r in block.pattern.rows])
        each = np.arange(len(row))
        modes = np.zeros((len(row), block.pattern.size), dtype=int)
        for j in range(block.pattern.size):
            share = block.basis[:, :, j] ** 2
            free = (share > TAKES_PART) & ~named[row]
            modes[:, j] = np.where(free.any(axis=1), free.argmax(axis=1), share.argmax(axis=1))
            named[row[each], modes[:, j]] = True
        yield Part(block.pattern, pattern.size, modes, block.copies)


@dataclass(frozen=True)
class Region:
    """Edges in Omega of one region of one row; error and cut: of the lower and the upper one."""

    row: int
    edges: tuple[float, float]
    error: tuple[float, float]
    cut: tuple[bool, bool]
    members: tuple[Tongue, ...]


def united(regions: list[Region]) -> list[Region]:
    """Regions of different blocks that overlap as one, by row and mesh frequency.

    Of its tongues those of the widest region come first.
    """
    groups: list[list[Region]] = []
    upper = -np.inf
    for region in sorted(regions, key=lambda r: (r.row, r.edges)):
        if groups and groups[-1][0].row == region.row and region.edges[0] < upper:
            groups[-1].append(region)
            upper = max(upper, region.edges[1])
        else:
            groups.append([region])
            upper = region.edges[1]
    return [group[0] if len(group) == 1 else _union(group) for group in groups]


def _union(group: list[Region]) -> Region:
    low, high = min(group, key=lambda r: r.edges[0]), max(group, key=lambda r: r.edges[1])
    widest = sorted(group, key=lambda r: r.edges[0] - r.edges[1])
    members = dict.fromkeys(tongue for region in widest for tongue in region.members)
    edges, error = (low.edges[0], high.edges[1]), (low.error[0], high.error[1])
    return Region(low.row, edges, error, (low.cut[0], high.cut[1]), tuple(members))
