"""Let SIGINT, SIGTERM and SIGHUP end the program with exit code 130, leaving no half-written file behind.

A command ends at once (:func:`leave`): whatever it does, there is nothing to save but temporary files, which are
removed. A sweep has finished blocks to save and lets the signals raise KeyboardInterrupt (:func:`raised`).

This is the first module that the command line imports, and it imports little: signals that come before it is there end
in a traceback of Python.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
from _thread import _local, start_new_thread
from contextlib import contextmanager, suppress

from gearstab.errors import INTERRUPTED

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

PAUSE = 0.01
"""Seconds that Python is given to come out of what swallowed an interrupt."""

temporary: set[str] = set()
"""Files that are being written and have no final name yet."""

own = _local()
"""Processor time at which the work of each thread is to end (``end``), see :func:`gearstab.ckernel.limited`."""


class Stopped(KeyboardInterrupt):
    """The early end of a call of the compiled kernel because another thread asked all calls to end."""


class TimeUp(KeyboardInterrupt):
    """The early end of work whose time is up."""


_came = False
"""Whether a signal raised KeyboardInterrupt in :func:`raised`."""


def leave(number: int, frame: Any) -> None:
    """End the process at once, with one line on standard error; a signal handler.

    Not by an exception: that might surface anywhere, half-way through the import of a library among other places, as a
    traceback.
    """
    for path in list(temporary):
        with suppress(OSError):
            os.unlink(path)
    with suppress(OSError):
        os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


def install() -> None:
    """Let the signals end this process by :func:`leave`; those that are ignored (``nohup``) stay so."""
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, leave)
    # Registered first, and so called last: all is done, and Python's own end would let a signal change the exit code.
    atexit.register(_ignore)


def _ignore() -> None:
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def end_with(parent: int) -> None:
    """End this process, a child that has nobody else to report to, when its parent has ended."""

    from threading import Thread

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def heed() -> None:
    """Raise TimeUp when the time of this thread is up, KeyboardInterrupt if one of :func:`raised` had no effect.

    Libraries may make something else of it: NumPy a TypeError that structured arrays cannot be compared, or nothing.
    """
    from threading import current_thread, main_thread

    if time.thread_time() > getattr(own, "end", float("inf")):
        raise TimeUp
    if _came and current_thread() is main_thread():
        raise KeyboardInterrupt


@contextmanager
def raised(late: Callable[[], bool]) -> Iterator[None]:
    """Let the signals raise KeyboardInterrupt (where signals can be handled: in the main thread).

    What is ignored stays so, and so does an application's own treatment of Ctrl-C.

    late: whether it is too late for that; then they are ignored.
    """
    global _came

    from threading import current_thread, get_ident, main_thread

    if current_thread() is not main_thread():
        yield
        return

    last, hook, inside, me = signal.SIGINT, sys.unraisablehook, False, get_ident()
    # To this thread itself, which may be waiting.
    send = getattr(signal, "pthread_kill", lambda _, number: signal.raise_signal(number))

    def interrupt(number: int, frame: Any) -> None:
        global _came
        nonlocal last
        last = signal.Signals(number)
        if not late():
            _came = True
            raise KeyboardInterrupt

    def swallowed(lost: sys.UnraisableHookArgs) -> None:
        """Python swallows what is raised in a weak reference's callback: interrupt again when that is over."""
        nonlocal inside
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            hook(lost)
            return
        inside = True
        # No Timer: its start waits for its thread, and on a busy machine it fires meanwhile, to be swallowed in here.
        start_new_thread(again, ())
        inside = False

    def again() -> None:
        time.sleep(PAUSE)
        while inside:
            time.sleep(PAUSE)
        send(me, last)

    before = {number: signal.getsignal(number) for number in SIGNALS}
    ours = {signal.SIGINT: (signal.default_int_handler, leave)}
    changed = [
        number
        for number, handler in before.items()
        if handler != signal.SIG_IGN and (number not in ours or handler in ours[number])
    ]
    for number in changed:
        signal.signal(number, interrupt)
    if changed:
        sys.unraisablehook = swallowed
    try:
        yield
    except Exception:
        heed()
        raise
    finally:
        _came = False
        sys.unraisablehook = hook
        for number in changed:
            signal.signal(number, before[number])
