"""Work that a clock interrupts: on a thread of its own, which is stopped when its time is up."""

from __future__ import annotations

import ctypes
import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import copy_context
from threading import Thread
from typing import TypeVar

Found = TypeVar("Found")

GRACE = 0.05
"""Seconds for a stopped thread to get back to Python; one that computes in a library for longer is left to itself."""


class _TimeUp(SystemExit):
    """What stops a thread; nothing is printed of it."""


def within(seconds: float, work: Callable[[], Found]) -> tuple[Found, float] | None:
    """Run ``work``; return its result and the processor time that it took (s), None where it does not end within
    ``seconds``.

    What it raises is raised here. Work that is stopped must leave nothing half done behind.
    """
    done: list[tuple[Found, float]] = []
    failed: list[BaseException] = []
    context = copy_context()

    def run() -> None:
        start = time.thread_time()
        try:
            done.append((context.run(work), time.thread_time() - start))
        except _TimeUp:
            pass
        except BaseException as error:
            failed.append(error)

    thread = Thread(target=run, daemon=True, name="gearstab sample")
    with _without_collection():
        thread.start()
        thread.join(max(seconds, 0.0))
        if thread.is_alive() and not done:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(_TimeUp))
            thread.join(GRACE)
    if failed:
        raise failed[0]
    return done[0] if done else None


@contextmanager
def _without_collection() -> Iterator[None]:
    """Collect no garbage: the thread might be stopped in the midst of the end of an object that is not its own."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()
