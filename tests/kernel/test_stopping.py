"""Calls of the compiled kernel end early: by a signal, by another thread, or because their time is up."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction

import numpy as np
import pytest

from gearstab import ckernel
from gearstab.ckernel import limited
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.kernel.threads import in_threads
from gearstab.interrupts import Stopped, TimeUp, heed
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

PROMPT = 1.0
"""Seconds of a processor in which a call ends; it looks every 0.05 s."""


def long_search() -> None:
    """Search the regions of a train whose common period has 999 cycles: for minutes."""
    mass, stiffness = np.diag([1.0, 0.3, 4.0]), np.diag([0.5, 0.0, 0.0])
    wave, level = Rectangular(1.5), np.asarray(0.3)
    first = Mesh("first", np.array([1.0, 1.0, 0.0]), np.asarray(1.0), level, wave)
    second = Mesh("second", np.array([0.0, 1.0, 1.0]), np.asarray(1.0), level, wave, Fraction(999, 1000))
    boundaries(GearSystem(mass, stiffness, (first, second), None), 0.35, 7.0)


def long_call() -> None:
    """Follow exponents of 60 coordinates over many points in one call: for minutes."""
    m, points, states = 60, 512, 8
    generator = np.random.default_rng(5)
    change = np.linalg.qr(generator.standard_normal((1, states, m, m)))[0]
    frequency = np.tile([1.0, -1.0], m // 2) * np.repeat(np.arange(1.0, m // 2 + 1), 2)
    values = np.broadcast_to(frequency, (1, states, m)).copy()
    index = np.arange(states, dtype=np.int64)
    ckernel.library.exponents(
        ckernel.simd(), (1, states, states, states, m, -1, 1.0), -0.2 * np.abs(values), values,
        np.full((1, states), 1 / states), index, index, change, *np.empty((2, 0)), 0, points // 8, points,
        np.linspace(0.05, 0.06, points)[None], np.empty((1, points, m), dtype=complex),
    )  # fmt: skip


@contextmanager
def handled() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


WORK = [long_search, long_call]


@pytest.mark.parametrize("work", WORK)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_signal_ends_a_call_at_once(work: Callable[[], None], threads: int) -> None:
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM))
    with handled(), ckernel.using(threads=threads):
        timer.start()
        start = time.process_time()
        with pytest.raises(KeyboardInterrupt):
            work()
    # Two threads, which wait for processors that others use.
    assert time.process_time() - start < 2 * (0.2 + PROMPT)


@pytest.mark.parametrize("work", WORK)
def test_work_whose_time_is_up_ends(work: Callable[[], None]) -> None:
    start = time.process_time()
    with pytest.raises(TimeUp), ckernel.using(threads=1), limited(0.1):
        work()
    assert time.process_time() - start < 0.1 + PROMPT
    heed()


def test_an_inner_limit_is_no_longer_than_the_outer_one() -> None:
    with limited(0.0), limited(100.0):
        time.sleep(0.001)
        with pytest.raises(TimeUp):
            heed()
    with limited(100.0):
        with limited(0.0), pytest.raises(TimeUp):
            long_call()
        heed()


def test_calls_in_other_threads_end_where_the_caller_is_interrupted() -> None:
    ended: list[type[BaseException]] = []
    main = threading.get_ident()

    def part(first: int, last: int) -> None:
        if threading.get_ident() == main:
            time.sleep(0.3)
            raise KeyboardInterrupt
        try:
            long_call()
        except BaseException as error:
            ended.append(type(error))
            raise

    with pytest.raises(KeyboardInterrupt):
        in_threads(part, 8, 1e9, 2)
    assert ended == [Stopped]
    # Nothing is left that would stop the next call.
    ckernel.symmetric_eigen(np.eye(3))
