"""Work within a processor time, so that the answer does not hang on what else a machine does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from gearstab.ckernel import limited
from gearstab.interrupts import TimeUp

Found = TypeVar("Found")


def within(seconds: float, work: Callable[[], Found]) -> tuple[Found, float] | None:
    """Run ``work``; return its result and the processor time that it took (s), None where it takes more than
    ``seconds``.

    It is stopped where it heeds that (:func:`gearstab.interrupts.heed`), as the compiled kernel does everywhere.
    """
    start = time.thread_time()
    try:
        with limited(seconds):
            found = work()
    except TimeUp:
        return None
    return found, time.thread_time() - start
