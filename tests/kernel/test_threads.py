"""Rows of a call in pieces on threads: each once, whoever else asks, and whatever fails."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gearstab import ckernel
from gearstab.floquet.kernel.threads import WORTH_A_THREAD, in_threads

MOST = max(os.cpu_count() or 1, ckernel.threads())


def _counted(rows: int, limit: int) -> tuple[np.ndarray, set[int]]:
    """How often each row was computed, and by which threads."""
    found, by = np.zeros(rows, dtype=int), set()

    def part(first: int, last: int) -> None:
        found[first:last] += 1
        by.add(threading.get_ident())

    in_threads(part, rows, WORTH_A_THREAD, limit)
    return found, by


@pytest.mark.parametrize("rows", [1, 2, 7, 100, 1001])
@pytest.mark.parametrize("limit", [1, 2, 3])
def test_every_row_once(rows: int, limit: int) -> None:
    found, by = _counted(rows, limit)
    assert np.all(found == 1)
    assert len(by) <= limit


def test_threads_are_kept() -> None:
    """The first call starts them, at most."""
    _counted(100, 2)
    helpers = {thread for thread in threading.enumerate() if thread.name.startswith("gearstab kernel")}
    for _ in range(50):
        _counted(100, 2)
    assert all(thread.is_alive() for thread in helpers)
    assert sum(thread.name.startswith("gearstab kernel") for thread in threading.enumerate()) <= MOST


def test_more_callers_than_helpers() -> None:
    with ThreadPoolExecutor(8) as pool:
        for found, _ in pool.map(lambda _: _counted(200, 3), range(100)):
            assert np.all(found == 1)


@pytest.mark.parametrize("at", [0, 50, 99])
def test_what_a_piece_raises_is_raised(at: int) -> None:
    def part(first: int, last: int) -> None:
        if first <= at < last:
            raise IndexError("of the piece itself")

    with pytest.raises(IndexError, match="of the piece itself"):
        in_threads(part, 100, WORTH_A_THREAD, 2)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
@pytest.mark.filterwarnings("ignore:.*fork")
def test_a_fork_computes_alone() -> None:
    """The threads that wait are not in it."""
    _counted(100, 2)
    child = os.fork()
    if child == 0:
        os._exit(0 if np.all(_counted(100, 2)[0] == 1) else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
