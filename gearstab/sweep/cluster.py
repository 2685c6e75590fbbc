"""Blocks computed by the workers of a Dask scheduler, on this machine or on many (package ``distributed``).

Workers send finished blocks back as the encoded chunks of which part files are made, so that what lies on the disk here
is the same whoever computed it. When a worker dies, every task that was on it comes under suspicion, and the scheduler
gives a task up after a few such deaths; what is given up is computed again at the end, one block at a time: a block
that ends its worker even then is at fault, and named.
"""

from __future__ import annotations

import logging
import pickle
import re
import warnings
import zlib
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any
from uuid import uuid4

import numpy as np

from gearstab.errors import RequestError, SweepError, one_line
from gearstab.results.hdf5 import LEVEL, compress
from gearstab.sweep.compute import taken_over
from gearstab.sweep.plan import GridBlock, Plan
from gearstab.sweep.pool import ONE_THREAD, Executor, Failure, Result, attempt, interrupts_later, start_trackers
from gearstab.sweep.progress import Reporter
from gearstab.sweep.storage.store import Store
from gearstab.version import __version__

LOCAL = "local"
"""The address that stands for a scheduler and workers of our own."""
ADDRESS = r"\w+://.+:\d+"

CONNECT = 10.0
"""Seconds in which a scheduler must answer."""
LOOK = 2.0
"""Seconds after which the state of the cluster is looked at, when nothing else happens."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(ONE_THREAD, 1),
    "distributed.worker.profile.enabled": False,
}
"""Settings of our own scheduler and workers. Work of a worker that dies is repeated at once.

With Dask's own settings the workers return memory to the system after every array, and a profiler looks at them a
hundred times a second, which takes a third of their processor time."""
WINDOW = 2
"""Blocks in flight for each thread of the workers: one that is computed and one that waits."""


def about() -> str:
    """Return the versions that must be the same on all machines for their numbers to be."""
    return f"gearstab {__version__}, NumPy {np.__version__}"


@contextmanager
def connected(address: str, jobs: int, reporter: Reporter) -> Iterator[Executor]:
    """Connect to the scheduler at an address, or start one with ``jobs`` workers (``local``), and give its executor.

    Raises RequestError where the address is none or ``distributed`` is not installed; SweepError where no scheduler
    answers, or a worker has another gearstab or NumPy than this process.
    """
    if address != LOCAL and not re.fullmatch(ADDRESS, address):
        raise RequestError(f"--scheduler {address}: write tcp://HOST:PORT, or {LOCAL}")
    try:
        import distributed
    except ImportError:
        text = "--scheduler needs the package distributed: pip install 'gearstab[cluster]'"
        raise RequestError(text) from None
    # It tells on standard error of every worker that comes and goes.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        # What is taken over from an earlier result goes with the tasks, few at a time.
        stack.enter_context(warnings.catch_warnings())
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        target = stack.enter_context(_own_cluster(jobs)) if address == LOCAL else address
        try:
            client = stack.enter_context(distributed.Client(target, timeout=CONNECT))
        except OSError:
            text = f"{address}: no scheduler answers within {CONNECT:g} s; start one with 'dask scheduler'"
            raise SweepError(text) from None
        _refuse_foreign(client)
        if client.dashboard_link:
            reporter.message(f"dashboard: {client.dashboard_link}")
        yield Workers(client, address)


@contextmanager
def _own_cluster(jobs: int) -> Iterator[Any]:
    """Start a scheduler and workers of one thread each here, which interrupts from a terminal do not reach."""
    from importlib.util import find_spec
    from multiprocessing import resource_tracker

    import dask
    import distributed

    start_trackers(resource_tracker)
    dashboard = "127.0.0.1:0" if find_spec("bokeh") else None
    with dask.config.set(SETTINGS):
        with interrupts_later():
            cluster = distributed.LocalCluster(
                n_workers=jobs, threads_per_worker=1, memory_limit=0, dashboard_address=dashboard,
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
        with cluster:
            yield cluster


def _refuse_foreign(client: Any) -> None:
    """Raise SweepError if a worker cannot compute what this process would."""
    mine = about()
    for worker, found in client.run(about, on_error="return").items():
        if found != mine:
            has = found if isinstance(found, str) else f"no gearstab that works like this one ({found})"
            raise SweepError(_foreign(worker, has, mine))


def _foreign(worker: str, has: str, mine: str) -> str:
    return f"worker {worker} has {one_line(has)}; this process has {mine}: install the same on all"


@dataclass(frozen=True)
class Workers:
    """The workers of a scheduler; computes blocks like the pool of this process."""

    client: Any
    address: str

    def __call__(
        self, plan: Plan, blocks: Sequence[GridBlock], store: Store, reporter: Reporter
    ) -> Generator[Result, None, None]:
        """Compute blocks of one method, in any order; closing the generator cancels what is not finished.

        Raises SweepError where the scheduler is lost, or a worker cannot compute what this process would.
        """
        suspects: list[GridBlock] = []
        yield from self._spread(plan, blocks, reporter, suspects)
        for block in suspects:
            given_up: list[GridBlock] = []
            yield from self._spread(plan, [block], reporter, given_up)
            yield from (Failure(each, None) for each in given_up)

    def _spread(
        self, plan: Plan, blocks: Sequence[GridBlock], reporter: Reporter, suspects: list[GridBlock]
    ) -> Generator[Result, None, None]:
        """Compute blocks, few of them in flight at a time; ``suspects`` gets those whose workers died."""
        import distributed

        # No other run, nor another try, may be given the results of this one.
        token = uuid4().hex
        submit, waiting = self.client.submit, iter(blocks)
        running: dict[Any, GridBlock] = {}
        # A task of its own: the scheduler brings it to every worker once, and makes it again where it is lost.
        shared = submit(_same, pickle.dumps(plan), key=f"plan-{token}", pure=False)
        try:
            while True:
                room = WINDOW * max(1, sum(self.client.nthreads().values())) - len(running)
                for block in islice(waiting, max(0, room)):
                    key = f"{block.key}-{token}"
                    future = submit(_work, shared, block, about(), _packed(plan, block), key=key, pure=False, retries=0)
                    running[future] = block
                if not running:
                    return
                for future in self._done(list(running), reporter):
                    block = running.pop(future)
                    try:
                        result = future.result()
                    except distributed.KilledWorker:
                        suspects.append(block)
                        continue
                    if isinstance(result, str):
                        raise SweepError(result)
                    yield result
        except distributed.CancelledError:
            raise self._lost() from None
        finally:
            if self.client.status == "running":
                self.client.cancel(list(running), force=True)

    def _done(self, running: list[Any], reporter: Reporter) -> list[Any]:
        """Wait until some tasks are done; say once where there is nobody to do them."""
        import distributed

        told = False
        while True:
            try:
                return list(distributed.wait(running, timeout=LOOK, return_when="FIRST_COMPLETED").done)
            except TimeoutError:
                if self.client.status != "running":
                    raise self._lost() from None
                if not told and not self.client.nthreads():
                    reporter.message(f"{self.address}: no workers; waiting for some to join")
                    told = True

    def _lost(self) -> SweepError:
        return SweepError(f"{self.address}: the connection to the scheduler is lost")


def _same(plan: bytes) -> bytes:
    """On a worker: keep the pickled plan for the blocks to come."""
    return plan


def _packed(plan: Plan, block: GridBlock) -> bytes | None:
    """Values that a block takes over from an earlier result, which workers need not reach; None where that is
    nothing.
    """
    taken = taken_over(plan, block)
    return None if taken is None else bytes(compress(pickle.dumps(taken), LEVEL))


def _work(plan: bytes, block: GridBlock, expected: str, taken: bytes | None) -> Result | str:
    """On a worker: compute a block; where it joined late and is another program, say so."""
    mine = about()
    if mine != expected:
        from distributed import get_worker

        return _foreign(get_worker().address, mine, expected)
    return attempt(pickle.loads(plan), block, 1, None if taken is None else pickle.loads(zlib.decompress(taken)))
