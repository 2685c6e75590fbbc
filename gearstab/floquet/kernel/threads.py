"""Rows of a call of the compiled kernel, which lets other threads run, in pieces on several threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

from gearstab.ckernel import stopping, threads
from gearstab.interrupts import heed

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

WORTH_A_THREAD = 2e5
"""Operations of a chunk of rows (segments times coordinates cubed) below which a thread costs more than it gains."""
CHUNKS_A_THREAD = 4
"""Rows are handed out in so many pieces at least, so that a thread whose rows are quick takes more of them."""
LARGEST_PIECE = 2e7
"""Operations of a piece, if a row is not more: the milliseconds for which the last one may keep a thread alone."""


def in_threads(part: Callable[[int, int], None], rows: int, cost_of_row: float, limit: int | None) -> None:
    """Call part(first, last) on pieces of the rows, in as many threads as pay, of which the caller is one."""
    from concurrent.futures import wait

    heed()
    workers = min(limit or threads(), rows, int(rows * cost_of_row / WORTH_A_THREAD))
    if workers <= 1:
        part(0, rows)
        return
    count = min(rows, max(CHUNKS_A_THREAD * workers, int(rows * cost_of_row / LARGEST_PIECE)))
    pieces = deque(pairwise(rows * k // count for k in range(count + 1)))

    def work() -> None:
        while True:
            try:
                first, last = pieces.popleft()
            except IndexError:  # nothing is left
                return
            part(first, last)

    helpers = [_helpers().submit(work) for _ in range(workers - 1)]
    try:
        work()
        # One that has not begun, as all threads help others or a fork has none, is not waited for.
        for helper in helpers:
            if not helper.cancel():
                helper.result()
    except BaseException as error:
        pieces.clear()
        with stopping() if isinstance(error, KeyboardInterrupt) else nullcontext():
            wait([helper for helper in helpers if not helper.cancel()])
        raise


@cache
def _helpers() -> ThreadPoolExecutor:
    """Threads that wait for work: to start them for every call takes as long as half a small scan."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(max(os.cpu_count() or 1, threads()), "gearstab kernel")
