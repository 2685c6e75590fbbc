"""The parts of the search for exact boundaries that are compiled: edges, shares of modes, names."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab import ckernel
from gearstab.floquet.kernel.c_kernel import contiguous, cost, pattern_arguments, portions
from gearstab.floquet.kernel.threads import in_threads
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

POINTS_OF_A_ROW = 500
"""Monodromy matrices that the boundaries of a row take, about."""
RUN = 32
"""Rows whose search follows the edges from one to the next; what is found must not hang on the number of threads."""
SHARES_OF_A_POINT = 30
"""The shares of a point take so many times the operations of a monodromy matrix, about."""
SHARE = np.dtype([("point", "i8"), ("p", "i8"), ("q", "i8"), ("cycles", "i8"), ("share", "f8")])
"""``struct share`` of kernel.h."""
NAME = np.dtype([("region", "i8"), ("p", "i8"), ("q", "i8"), ("cycles", "i8")])
"""``struct name`` of kernel.h."""
EDGE = np.dtype([("row", "i8"), ("cycle", "f8"), ("error", "f8"), ("enters", "i8"), ("passed", "i8", 3)])
"""``struct edge`` of kernel.h."""
BEFORE, AFTER = 2, 3
REACH = np.dtype([("evaluations", "i8"), ("stable", "i8", 2), ("passed", "i8", (2, 3))])
"""``struct reach`` of kernel.h."""


def edges(
    pattern: Pattern,
    coarse: Pattern,
    first: Array,
    last: Array,
    tolerance: float,
    floor: float,
    gap: float,
    density: float,
    limit: int | None = None,
) -> tuple[Array, Array]:
    """Edges of instability regions (EDGE, by row and place) between two cycles ``(r,)``, and what is known of the rows
    (REACH, ``(r,)``).

    coarse: the pattern that gives the rotation counts, of the same rows; gap: the least width of a stable gap between
    two regions; density: points of the scan a collision. With a gap below the floor collisions that open no wider
    region are listed too, as two stable points on both sides (BEFORE, AFTER).
    """
    begin, end = contiguous(first), contiguous(last)
    found: dict[int, tuple[Array, bytes]] = {}
    segments = max(len(pattern.states), len(coarse.states))
    for rows in portions(len(begin), segments, pattern.size):
        given = pattern_arguments(pattern, rows)
        other = given if coarse is pattern else pattern_arguments(coarse, rows)
        arguments = (*given, *other[0][1:3], *other[1:])
        options = (tolerance, floor, gap, density, begin[rows], end[rows])

        count = rows.stop - rows.start

        def part(
            low: int,
            high: int,
            all_of: tuple[Any, ...] = (arguments, options),
            base: int = rows.start,
            count: int = count,
        ) -> None:
            for run in range(low * RUN, min(high * RUN, count), RUN):
                of_edges, of_rows = ckernel.library.edges(
                    ckernel.simd(), *all_of[0], run, min(run + RUN, count), *all_of[1]
                )
                own = np.frombuffer(of_edges, dtype=EDGE).copy()
                own["row"] += base
                found[base + run] = own, of_rows

        in_threads(part, -(-count // RUN), RUN * POINTS_OF_A_ROW * cost(pattern), limit)
    known = np.empty(len(begin), dtype=REACH)
    every = [np.empty(0, dtype=EDGE)]
    for base, (of_edges, of_rows) in sorted(found.items()):
        rows_of = np.frombuffer(of_rows, dtype=REACH)
        known[base : base + len(rows_of)] = rows_of
        every.append(of_edges)
    return np.concatenate(every), known


def shares(
    pattern: Pattern, coarse: Pattern, mean: Array, turn: Array, row: Array, cycle: Array, limit: int | None = None
) -> Array:
    """Shares of roots (SHARE) in the unstable solutions at points (row, cycle) ``(P,)``, see boundaries/names.

    coarse: the pattern that gives the solutions between the ends of the period; mean: ``(r, n)``, squared frequencies
    of the mean system; turn: ``(r, n, n)``, from the first modes of the pattern to those of the coarse one.
    """
    order = np.argsort(row, kind="stable")
    index, place = np.ascontiguousarray(row[order], dtype=np.int64), contiguous(cycle[order])
    found: dict[int, Array] = {}
    segments = max(len(pattern.states), len(coarse.states))
    for rows in portions(len(pattern.rows), segments, pattern.size):
        low, high = np.searchsorted(index, (rows.start, rows.stop))
        if low == high:
            continue
        given = pattern_arguments(pattern, rows)
        other = given if coarse is pattern else pattern_arguments(coarse, rows)
        arguments = (*given, *other[0][1:3], *other[1:])
        acting = [contiguous(values) for values in (*_acting(coarse, rows, mean[rows]), mean[rows], turn[rows])]
        points = (acting[1].shape[1], *acting, index[low:high] - rows.start, place[low:high])

        def part(first: int, last: int, all_of: tuple[Any, ...] = (arguments, points), base: int = int(low)) -> None:
            raw = ckernel.library.shares(ckernel.simd(), *all_of[0], first, last, len(all_of[1][-1]), *all_of[1])
            own = np.frombuffer(raw, dtype=SHARE)
            own["point"] = order[own["point"] + base]
            found[base + first] = own

        in_threads(part, int(high - low), SHARES_OF_A_POINT * cost(coarse), limit)
    parts = [found[k] for k in sorted(found)]
    return parts[0] if len(parts) == 1 else np.concatenate([np.empty(0, dtype=SHARE), *parts])


def _acting(pattern: Pattern, rows: slice, mean: Array) -> tuple[Array, Array]:
    """``struct acting`` of kernel.h for some rows: across ``(r, D, m, n)`` and direction ``(r, m, n)``.

    The states differ only by what the meshes do: along their directions where these are few.
    """
    n, of_meshes = pattern.size, pattern.elastic.directions[rows]
    directions = np.broadcast_to(np.eye(n), (len(mean), n, n))
    if 2 * of_meshes.shape[1] <= n:
        directions = np.swapaxes(np.linalg.qr(np.swapaxes(of_meshes, -1, -2))[0], -1, -2)
    change = pattern.stiffness[rows] - (mean[:, :, None] * np.eye(n))[:, None]
    return directions[:, None] @ change @ pattern.modes[rows], directions


def names(
    frequency: Array, cycles: float, row: Array, cycle: Array, passed: Array, meetings: Array, found: Array
) -> Array:
    """The roots (NAME) of R regions that are ordered by row, each region's leading one first, see boundaries/names.

    frequency: ``(r, n)``, of the mean systems in the units of 1/cycle; passed, meetings: ``(R, 3)``; found: shares
    (SHARE) whose points are numbers of regions, in their order.
    """
    count, (rows, n) = len(row), frequency.shape
    whole = (np.ascontiguousarray(part, dtype=np.int64) for part in (passed, meetings))
    index, known = np.ascontiguousarray(row, dtype=np.int64), np.ascontiguousarray(found).view(np.int8)
    given = (contiguous(frequency), index, contiguous(cycle), *whole, known)
    return np.frombuffer(ckernel.library.names(count, rows, n, float(cycles), *given), dtype=NAME)
