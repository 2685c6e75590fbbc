"""Executors of the blocks on this machine: this process, its threads, or a pool of processes.

A first block is computed here. If what remains is worth it the others go to threads, where the method spends its time
outside of Python, and else to processes (joblib's loky), which write part files and return receipts: a process that is
killed costs no result. The blocks it may have been working on then run one by one in processes of their own, and one
that kills its process again is given up and named, while all others go on.

This takes joblib's own pool (``joblib.externals.loky``) and not ``joblib.Parallel(return_as="generator_unordered")``,
with which three things would be lost. An interrupt or an error closes its generator, which kills the processes, so that
the blocks in work are computed again; here those that end within a second are kept. A single job (n_jobs=1) runs in
the process of the caller, which a block that kills its process would end; here it gets a pool of one. And joblib starts
the processes with signals as they are, so that an interrupt from the terminal would reach them; here they are started
without.
"""

from __future__ import annotations

import multiprocessing.resource_tracker
import os
import signal
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any

from gearstab import ckernel
from gearstab.interrupts import end_with, heed
from gearstab.methods import Outcome
from gearstab.sweep.compute import compute
from gearstab.sweep.plan import GridBlock, Plan
from gearstab.sweep.progress import Reporter
from gearstab.sweep.storage.parts import FinishedBlock, PartFolder
from gearstab.sweep.storage.store import Store

WORTH_THREADS, WORTH_PROCESSES = 0.05, 3.0
"""Seconds of remaining work from which threads and processes (which take about a second to start) pay."""

PATIENCE = 1.0
"""Seconds that an interrupted sweep leaves to its processes for the blocks that they compute."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Variables that keep the processes of a pool from competing for processors."""

WARNINGS = "PYTHONWARNINGS"
TRACKERS = ("joblib.externals.loky.backend.resource_tracker", "multiprocessing.resource_tracker")


@dataclass(frozen=True)
class Failure:
    """A block that could not be computed: by an exception, or (None) because it killed its process twice."""

    block: GridBlock
    error: BaseException | None


Result = FinishedBlock | Failure
Executor = Callable[[Plan, Sequence[GridBlock], Store, Reporter], Generator[Result, None, None]]
"""Generator that computes blocks of one method, in any order; closing the generator stops all work."""


def run_blocks(
    plan: Plan, blocks: Sequence[GridBlock], store: Store, reporter: Reporter, jobs: int
) -> Generator[Result, None, None]:
    """Compute blocks of one method, in any order, with ``jobs`` threads or processes of this machine.

    Processes write to the folder of the store. Closing the generator (or an exception in it) stops all work; processes
    may finish their blocks before if that takes a second at most.
    """
    rest = list(blocks)
    seconds = 0.0
    while rest:
        layout = plan.layout(rest[0].method)
        threads = layout.method.parallel
        if jobs > 1 and len(rest) > 1 and seconds * len(rest) > (WORTH_THREADS if threads else WORTH_PROCESSES):
            break
        start = time.perf_counter()
        result = attempt(plan, rest.pop(0), jobs)
        seconds = time.perf_counter() - start
        yield result
    if not rest:
        return
    if threads:
        yield from _in_threads(plan, rest, jobs)
    else:
        store.take()
        store.flush()
        yield from _in_processes(plan, rest, store, jobs)


def attempt(plan: Plan, block: GridBlock, threads: int, taken: Outcome | None = None) -> FinishedBlock | Failure:
    """Compute a block; one that fails does not end the sweep.

    threads: how many a call of the compiled kernel may use, in which it runs rows of the block side by side. taken:
    what it takes over from an earlier result, where that was read before.
    """
    found: FinishedBlock | Failure
    try:
        with ckernel.using(threads):
            found = compute(plan, block, taken)
    except Exception as error:
        found = Failure(block, error)
    heed()
    return found


def _in_threads(plan: Plan, blocks: list[GridBlock], jobs: int) -> Iterator[Result]:
    each = max(1, jobs // len(blocks))
    pool = ThreadPoolExecutor(min(jobs, len(blocks)))
    try:
        waiting = iter(blocks)
        running: set[Future[FinishedBlock | Failure]] = set()
        while True:
            for block in waiting:
                running.add(pool.submit(attempt, plan, block, each))
                if len(running) >= 2 * jobs:
                    break
            if not running:
                break
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BaseException:
        with ckernel.stopping():
            pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


def _in_processes(plan: Plan, blocks: list[GridBlock], store: Store, jobs: int) -> Iterator[Result]:
    pending = {block.key: block for block in blocks}
    while pending:
        started: dict[str, GridBlock] = {}
        for result in _pooled(plan, list(pending.values()), store, min(jobs, len(pending)), started):
            del pending[result.block.key if isinstance(result, Failure) else result.key]
            yield result
        # What the pool left undone was in a process that died, or waiting; what finished unseen is in its part file.
        for part in store.collect(pending.values()):
            del pending[part.key]
            yield part
        for key in [key for key in started if key in pending]:
            block = pending.pop(key)
            results = list(_pooled(plan, [block], store, 1, {}))
            yield results[0] if results else Failure(block, None)


def _pooled(
    plan: Plan, blocks: list[GridBlock], store: Store, jobs: int, started: dict[str, GridBlock]
) -> Iterator[Result]:
    """Compute blocks in processes until all are done or a process dies; ``started`` gets those handed out."""
    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.backend import resource_tracker
    from joblib.externals.loky.process_executor import BrokenProcessPool

    start_trackers(resource_tracker, multiprocessing.resource_tracker)
    waiting = iter(blocks)
    running: set[Future[FinishedBlock | Failure]] = set()
    with interrupts_later():
        pool = get_reusable_executor(
            jobs, env=dict.fromkeys(ONE_THREAD, "1"), initializer=_prepare, initargs=(os.getpid(),)
        )
    finished = False
    try:
        while True:
            with interrupts_later():
                # As many as processes: one that dies takes all with it, and none can be called back.
                for block in islice(waiting, jobs - len(running)):
                    started[block.key] = block
                    running.add(pool.submit(_work, plan, block, store.folder))
            if not running:
                break
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
        finished = True
    except BrokenProcessPool:
        finished = True
    finally:
        _wake()
        if not finished:
            _end(running if store.kept else set(), pool)


def _wake() -> None:
    """Let processes that somebody stopped go on: they would never end, nor whoever waits for them."""
    if hasattr(signal, "SIGCONT"):
        for child in multiprocessing.active_children():
            with suppress(OSError):
                if child.pid is not None:
                    os.kill(child.pid, signal.SIGCONT)


def start_trackers(*trackers: Any) -> None:
    """Start the processes that clean up after a killed sweep, such that they do so without a word.

    They outlive it, and would warn of every semaphore that it left to them, in the middle of what comes next. Started
    later, within :func:`interrupts_later`, they would let interrupts through.
    """
    before = os.environ.get(WARNINGS)
    quiet = [f"ignore:resource_tracker:UserWarning:{module}" for module in TRACKERS]
    os.environ[WARNINGS] = ",".join([*([before] if before else []), *quiet])
    try:
        for tracker in trackers:
            tracker.ensure_running()
    finally:
        os.environ.pop(WARNINGS)
        if before is not None:
            os.environ[WARNINGS] = before


def _end(running: set[Future[FinishedBlock | Failure]], pool: Any) -> None:
    """Give processes a moment to finish the blocks that are to be kept, then end them."""
    try:
        wait(running, PATIENCE)
    finally:
        with interrupts_later():
            pool.shutdown(wait=True, kill_workers=True)


@contextmanager
def interrupts_later() -> Iterator[None]:
    """Hold back interrupts (where the system can do that), so that they leave no half-started pool behind.

    Processes started meanwhile never get one from the terminal.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(plan: Plan, block: GridBlock, folder: PartFolder) -> FinishedBlock | Failure:
    """In a process of the pool: compute a block and write its part file."""
    part = attempt(plan, block, 1)
    if isinstance(part, Failure):
        return part
    try:
        return folder.write(part)
    except OSError as error:
        return Failure(block, error)


def _prepare(parent: int) -> None:
    """Once in every process: an interrupt is the parent's to handle, and without a parent there is nothing to do."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_SETMASK, [])
    end_with(parent)
