"""Running a plan: what is there already, who computes the rest, the result file at the end."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearstab import __version__, ckernel
from gearstab.results.chunks import decode
from gearstab.results.errors import ResultError
from gearstab.results.guard import refuse_foreign
from gearstab.results.read import attributes
from gearstab.sweep import merge
from gearstab.sweep.compute import results_of
from gearstab.sweep.errors import Interrupted, RequestError, SweepError
from gearstab.sweep.parts import PartFolder
from gearstab.sweep.plan import Plan
from gearstab.sweep.pool import Failure, run_blocks
from gearstab.sweep.reporter import Reporter
from gearstab.sweep.store import Store

MOST_FAILURES = 10
"""Blocks that may fail before the sweep stops: then nothing is wrong with a block, but with all of them."""


@dataclass(frozen=True)
class Summary:
    """What a sweep did.

    points: of the grid. blocks, reused: blocks of all methods, and how many of them an earlier run had finished.
    unstable, failed: points that are unstable (None without a method that tells), and that could not be computed.
    complete: whether the result was there already. kernels: which ones computed it.
    proved, counted: shares of the stable mesh frequencies that are proved stable, and that are searched by counting
        only, means of all rows; None without boundaries, or where nothing is stable.
    """

    points: int
    blocks: int
    reused: int = 0
    unstable: int | None = None
    failed: int = 0
    complete: bool = False
    kernels: tuple[str, ...] = ()
    proved: float | None = None
    counted: float | None = None


def run(
    plan: Plan,
    out: str | Path,
    jobs: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Reporter | None = None,
) -> Summary:
    """Compute a plan and write the result file ``out``, which has its name only when it is complete.

    What an earlier run of the same plan finished (``OUT.parts``) is used, unless ``overwrite``; ``resume`` only states
    that this is meant. A result of the same configuration is left as it is.

    jobs: threads or processes, default one a processor.

    Raises RequestError, before anything is computed, if ``out`` holds something else and ``overwrite`` is not given, or
    if it cannot be written; ResultError if ``overwrite`` is given and ``out`` is there and no result at all; SweepError
    if the disk is full or a block failed; Interrupted after SIGINT or SIGTERM. What is finished is kept.
    """
    out, reporter = Path(out), progress or Reporter()
    workers = jobs or ckernel.threads()
    if not overwrite and is_complete(plan, out):
        return Summary(plan.points, plan.blocks, complete=True)
    prepare(out)
    if overwrite:
        refuse_foreign(out)
    folder = PartFolder(out, plan.digest)
    if overwrite:
        folder.remove_all()
    store = Store(folder, folder.find({block.key for layout in plan.layouts for block in layout.blocks()}))
    reused = len(store.finished)
    if reused:
        reporter.message(f"going on with {reused} of {plan.blocks} blocks that are finished in {folder.every}")
    elif resume:
        reporter.message("nothing to go on with: starting anew")
    before = _identity(out)
    try:
        # From the moment the result has its name there is nothing left to interrupt.
        with interrupts(lambda: _identity(out) != before):
            _compute(plan, store, workers, reporter)
            summary = _summary(plan, store, reused)
            _finish(plan, store, out)
            folder.remove()
            return summary
    except KeyboardInterrupt:
        kept = store.rescue()
        raise Interrupted(_interrupted(kept, plan.blocks, folder)) from None


def _identity(path: Path) -> tuple[int, int] | None:
    """What tells a file from the one that was there before; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def is_complete(plan: Plan, out: Path) -> bool:
    """Whether ``out`` is the result of this plan. Raises RequestError if it is anything else."""
    if not out.exists():
        return False
    try:
        found = attributes(out)
    except ResultError as error:
        raise RequestError(f"{error}; choose another output or remove it") from None
    if found.get("config_digest") != plan.config.digest:
        raise RequestError(f"{out}: is the result of another configuration; choose another output or use --overwrite")
    if found["gearstab_version"] != __version__:
        raise RequestError(
            f"{out}: was computed by gearstab {found['gearstab_version']}; use --overwrite to compute it again"
        )
    return True


def prepare(out: Path) -> None:
    """Make the output's folder and see that files can be written there. Raises RequestError."""
    if out.is_dir():
        raise RequestError(f"{out}: is a folder")
    probe = out.with_name(f".{out.name}.{os.getpid()}.tmp")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise RequestError(f"{out}: cannot be written: {(error.strerror or str(error)).lower()}") from None


@contextmanager
def interrupts(late: Callable[[], bool]) -> Iterator[None]:
    """Let SIGTERM and SIGHUP interrupt as Ctrl-C does (where signals can be handled: in the main thread).

    late: whether it is too late for that; then interrupts are ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: Any) -> None:
        if not late():
            raise KeyboardInterrupt

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    # What is ignored (nohup) stays so, and so does an application's own treatment of Ctrl-C.
    before = {number: signal.getsignal(number) for number in numbers if signal.getsignal(number) != signal.SIG_IGN}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.default_int_handler
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _compute(plan: Plan, store: Store, jobs: int, reporter: Reporter) -> None:
    """Compute what is missing, method by method; raises SweepError if something failed."""
    failures: list[Failure] = []
    try:
        for layout in plan.layouts:
            missing = [block for block in layout.blocks() if block.key not in store]
            there = [part for block in layout.blocks() if (part := store.finished.get(block.key))]
            reporter.begin(layout.method.name, layout.points, sum(part.points for part in there))
            reporter.advance(0, sum(part.unstable for part in there), sum(part.failed for part in there))
            with closing(run_blocks(plan, missing, store.folder, jobs, store.flush, reporter)) as results:
                for result in results:
                    if isinstance(result, Failure):
                        _note(result, store, failures)
                        continue
                    store.add(result)
                    reporter.advance(result.points, result.unstable, result.failed)
    except OSError as error:
        raise _unwritable(error, store) from error
    finally:
        reporter.end()
    if failures:
        raise _failed(failures, store)


def _note(failure: Failure, store: Store, failures: list[Failure]) -> None:
    """Keep a failure for the end, unless it concerns more than its block."""
    if isinstance(failure.error, OSError):
        raise failure.error
    failures.append(failure)
    if len(failures) == MOST_FAILURES:
        raise _failed(failures, store)


def _failed(failures: list[Failure], store: Store) -> BaseException:
    """What to raise: an unexpected exception itself, else one line."""
    kept = f"{store.rescue()} finished blocks are kept in {store.folder.every}"
    for failure in failures:
        if failure.error is not None and not isinstance(failure.error, MemoryError):
            failure.error.add_note(f"in {_where(failure)}; {kept}")
            return failure.error
    names = ", ".join(_where(failure) for failure in failures)
    if failures[0].error is None:
        return SweepError(f"the process that computed {names} was killed twice (out of memory?); {kept}")
    return SweepError(f"not enough memory for {names}; {kept}")


def _where(failure: Failure) -> str:
    block = failure.block
    place = " x ".join(f"{start}..{start + size - 1}" for start, size in zip(block.start, block.shape, strict=True))
    return f"block {block.key} (points {place})" if place else f"block {block.key}"


def _finish(plan: Plan, store: Store, out: Path) -> None:
    """Write the result file. Raises SweepError, with the parts kept, if the disk is full."""
    size = sum(part.size() for part in store.finished.values())
    try:
        free = shutil.disk_usage(out.parent).free
        if free < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out))
        if size >= merge.IN_MEMORY:
            store.flush()
        merge.write(plan, store.finished, out, store.folder.path)
    except OSError as error:
        raise _unwritable(error, store) from error


def _unwritable(error: OSError, store: Store) -> SweepError:
    reason = (error.strerror or str(error)).lower()
    place = f"{error.filename}: " if error.filename else ""
    return SweepError(f"{place}{reason}; {store.rescue()} finished blocks are kept in {store.folder.every}")


def _interrupted(kept: int, total: int, folder: PartFolder) -> str:
    if not kept:
        return "interrupted before anything was finished"
    return (
        f"interrupted; {kept} of {total} blocks are kept in {folder.every}: run the same command with --resume to go on"
    )


def _summary(plan: Plan, store: Store, reused: int) -> Summary:
    """What was done, from the finished blocks."""
    tells = [
        store.finished[block.key]
        for layout in plan.layouts
        if any(variable.name == "stable" for variable in results_of(plan, layout))
        for block in layout.blocks()
    ]
    unstable = sum(part.unstable for part in tells) if tells else None
    failed, kernels = sum(part.failed for part in tells), {k for part in store.finished.values() for k in part.kernels}
    proved, counted = (_mean(plan, store, name) for name in ("proved_share", "counted_share"))
    ran = tuple(sorted(kernels))
    return Summary(plan.points, plan.blocks, reused, unstable, failed, kernels=ran, proved=proved, counted=counted)


def _mean(plan: Plan, store: Store, name: str) -> float | None:
    """The mean of a variable of one value a row over all rows that have one; None where there is none."""
    total, count = 0.0, 0
    for layout in plan.layouts:
        if not any(variable.name == name for variable in results_of(plan, layout)):
            continue
        for block in layout.blocks():
            (data,) = store.finished[block.key].pieces(name)
            values = decode(data, layout.chunk, "f8")[tuple(slice(0, size) for size in block.shape)]
            total, count = total + float(np.nansum(values)), count + int(np.isfinite(values).sum())
    return total / count if count else None
