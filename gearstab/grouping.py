"""Groups: rows of a table of small integers that are equal, found without sorting whole rows; numbers within groups;
tables by columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Self

import numpy as np

from gearstab.system import Array

LARGEST = 2**62


class Columns:
    """A dataclass whose fields are arrays over the same items, in their leading dimensions."""

    def chosen(self, index: Array | Sequence[int] | slice) -> Self:
        """Return some of the items: by position, by a mask, or a range of them."""
        return type(self)(*(values[index] for values in vars(self).values()))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All of several, one after the other."""
        return cls(*(np.concatenate(column) for column in zip(*(vars(part).values() for part in parts), strict=True)))


def equal_rows(table: Array) -> Iterator[tuple[Array, Array]]:
    """(members, row) for each distinct row of ``table`` (rows, columns), in lexicographic order; members ascend."""
    if len(table) == 0:
        return
    varied = np.ptp(table, axis=0) > 0
    if not varied.any():
        yield np.arange(len(table)), table[0]
        return
    code = _codes(table[:, varied])
    order = np.argsort(code, kind="stable")
    starts = np.flatnonzero(np.diff(code[order], prepend=code[order[0]] - 1))
    for members in np.split(order, starts[1:]):
        yield members, table[members[0]]


def numbered(count: Array) -> tuple[Array, Array]:
    """(group, number) of each member of groups that have ``count`` members; both count from 0."""
    group = np.repeat(np.arange(len(count)), count)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)


def _codes(table: Array) -> Array:
    """``(rows,)``, one integer a row, ordered as the rows are."""
    code, limit = np.zeros(len(table), dtype=np.int64), 1
    for column in table.T:
        lowest = int(column.min())
        span = int(column.max()) - lowest + 1
        if limit * span > LARGEST:
            distinct, code = np.unique(code, return_inverse=True)
            limit = len(distinct)
        code = code * span + (column - lowest)
        limit *= span
    return code
