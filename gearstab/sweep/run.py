"""Running a plan: what is there already, who computes the rest, the result file at the end."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory

from gearstab import ckernel, interrupts
from gearstab.errors import Interrupted, OutputError, SweepError, listed
from gearstab.results.output import free_bytes, prepare
from gearstab.results.read import SWEEP, result_of
from gearstab.results.write import image, rewrite_attributes
from gearstab.sweep.forecast import Estimate, long_runs
from gearstab.sweep.plan import Layout, Plan
from gearstab.sweep.pool import Executor, Failure, run_blocks
from gearstab.sweep.progress import Reporter, octets
from gearstab.sweep.storage import merge, previous
from gearstab.sweep.storage.merge import Summary
from gearstab.sweep.storage.parts import PartFolder
from gearstab.sweep.storage.store import Store

MOST_FAILURES = 10
"""Stop after this many failed blocks, unless told otherwise: the cause is then common to all."""


def run(
    plan: Plan,
    out: str | Path,
    jobs: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Reporter | None = None,
    most_failures: int | None = MOST_FAILURES,
    scheduler: str | None = None,
    forecast: Estimate | None = None,
) -> Summary:
    """Compute a plan and write the result file ``out``, which has its name only when it is complete.

    What an earlier run of the same plan finished (``OUT.parts``) is used, unless ``overwrite``; ``resume`` only states
    that this is meant. A result of the same configuration that is whole is left as it is, but for its time stamp, as
    ``make`` goes by that. One of an earlier state of the configuration file is replaced when the new one is complete.

    jobs: threads or processes, default one per processor. most_failures: after so many failed blocks nothing further
    is computed; None: whatever fails, all other blocks are computed and kept. scheduler: the address of a Dask
    scheduler, whose workers then compute, or ``local`` for a new one with ``jobs`` workers. forecast: what it will
    take, where that is known.

    Raises OutputError, before anything is computed, if ``out`` holds something else (the result of another
    configuration is replaced with ``overwrite``), or if it cannot be written; SweepError if the disk is full, a block
    failed, or another process put something else at ``out`` meanwhile; Interrupted after SIGINT, SIGTERM or SIGHUP.
    What is finished is kept.
    """
    out, reporter = Path(out), progress or Reporter()
    before = previous.identity(out)
    found = previous.look(plan.config, out, overwrite)
    folder = PartFolder(out, plan.digest)
    if found.complete:
        _refresh(plan, out, found)
        _remove_parts(plan, folder)
        return Summary(plan.points, plan.blocks, complete=True)
    folder.check()
    prepare(out)
    if found.note:
        reporter.message(f"{out}: {found.note}")
    if others := folder.others():
        reporter.message(_others(folder, others))
    with closing(Store(plan, folder)) as store:
        if not overwrite and (useless := store.find()):
            reporter.message(
                f"{folder.path}: {_blocks(useless)} damaged, or not as this sweep writes them: computed again"
            )
        if store.blocks:
            kept = f"{len(store.blocks)} of {plan.blocks} blocks"
            reporter.message(f"going on with {kept} that are finished in {folder.every}")
        elif resume:
            reporter.message("no finished blocks found: starting from the beginning")
        work = Work(plan, store, jobs or ckernel.threads(), reporter, most_failures, scheduler, forecast)
        return _run(work, out, before)


def _remove_parts(plan: Plan, folder: PartFolder) -> None:
    """Remove the parts of a complete result, which a sweep that was killed at its very end left."""
    if folder.path.is_dir():
        with suppress(OutputError, OSError), closing(Store(plan, folder)) as store:
            folder.check()
            store.take()
            store.remove()


@dataclass(frozen=True)
class Work:
    """A run: its plan, store, executor, reporter and the number of failures that it bears.

    jobs: threads or processes. scheduler: where the workers are, None for this process and its pool. forecast: what it
    will take, None of a sweep that is plainly small.
    """

    plan: Plan
    store: Store
    jobs: int
    reporter: Reporter
    most_failures: int | None = MOST_FAILURES
    scheduler: str | None = None
    forecast: Estimate | None = None

    @contextmanager
    def executor(self) -> Iterator[Executor]:
        """Give what computes the blocks. Raises RequestError and SweepError where it cannot be reached."""
        if self.scheduler is None:
            yield partial(run_blocks, jobs=self.jobs)
            return
        from gearstab.sweep.cluster import connected

        with connected(self.scheduler, self.jobs, self.reporter) as workers:
            yield workers


def _run(work: Work, out: Path, before: previous.Identity | None) -> Summary:
    """Compute what is missing and write the result; raises SweepError and Interrupted."""
    store = work.store
    reused, computed = len(store.blocks), False
    try:
        # From the moment the result has its name there is nothing left to interrupt.
        with interrupts.raised(lambda: computed and previous.replaced(out, before)):
            _compute(work)
            computed = True
            summary = merge.summary_of(store, reused)
            _finish(store, out, before)
            store.remove()
            return summary
    except KeyboardInterrupt:
        kept, every = (
            store.rescue(),
            f"blocks are kept in {store.folder.every}: run the same command with --resume to go on",
        )
        if not kept:
            raise Interrupted("interrupted before anything was finished") from None
        raise Interrupted(f"interrupted; {kept} of {work.plan.blocks} {every}") from None


def run_in_memory(
    plan: Plan,
    jobs: int | None = None,
    progress: Reporter | None = None,
    attributes: Mapping[str, str] | None = None,
    forecast: Estimate | None = None,
) -> memoryview:
    """Compute a plan and return the bytes of its result file; finished blocks wait in a temporary folder meanwhile.

    An interrupt is a KeyboardInterrupt that ends all processes; nothing is kept. attributes: further ones of the root.

    Raises SweepError.
    """
    reporter = progress or Reporter()
    with TemporaryDirectory(prefix="gearstab-") as folder:
        parts = PartFolder(Path(folder) / "result.h5", plan.digest)
        with closing(Store(plan, parts, kept=False)) as store:
            _compute(Work(plan, store, jobs or ckernel.threads(), reporter, forecast=forecast))
            return image(merge.result_tree(store, attributes or {}))


def _refresh(plan: Plan, out: Path, found: previous.AtOutput) -> None:
    """Give a result that is still right the title of the configuration, and a new time stamp."""
    if found.retitled:
        rewrite_attributes(out, {"title": plan.config.title, "config": plan.config.resolved}, result_of(SWEEP).refuse)
    else:
        with suppress(PermissionError):
            os.utime(out)


def _others(folder: PartFolder, others: list[Path]) -> str:
    """Return a note on finished blocks that nothing will use unless the configuration is changed back."""
    size = sum(file.stat().st_size for path in others for file in path.glob("*.part") if file.is_file())
    number = f"{len(others)} earlier state{'s' * (len(others) > 1)}"
    return (
        f"note: {folder.every} also holds finished blocks of {number} of the configuration ({octets(size)}); "
        "remove the folder if you do not go back to them"
    )


def _compute(work: Work) -> None:
    """Compute what is missing; raises SweepError if something failed."""
    failures: list[Failure] = []
    for text in long_runs(work.plan, work.forecast) if work.forecast else ():
        work.reporter.message(f"warning: {text}")
    try:
        with work.executor() as executor:
            for layout in work.plan.layouts:
                _compute_method(work, layout, executor, failures)
    except OSError as error:
        raise _unwritable(error, work.store) from error
    finally:
        work.reporter.end()
    if failures:
        raise _failed(failures, work.store)


def _compute_method(work: Work, layout: Layout, executor: Executor, failures: list[Failure]) -> None:
    """Compute what is missing of a method; ``failures`` gets the blocks that fail."""
    store, reporter = work.store, work.reporter
    missing, there = store.missing(layout), store.of(layout)
    done = sum(part.points for part in there)
    seconds = None if work.forecast is None else work.forecast.left(layout.method.name, layout.points - done)
    reporter.begin(layout.method.name, layout.points, done, seconds, prod(layout.chunk) * work.jobs)
    reporter.advance(0, sum(part.unstable for part in there), sum(part.failed for part in there))
    with closing(executor(work.plan, missing, store, reporter)) as results:
        for result in results:
            if isinstance(result, Failure):
                _note(result, store, failures)
                if len(failures) == work.most_failures:
                    raise _failed(failures, store)
                continue
            store.add(result)
            reporter.advance(result.points, result.unstable, result.failed)


def _note(failure: Failure, store: Store, failures: list[Failure]) -> None:
    """Keep a failure for the end, unless it is of the disk and concerns more than its block."""
    if isinstance(failure.error, OSError) and str(failure.error.filename).startswith(str(store.folder.every)):
        raise failure.error
    failures.append(failure)


def _failed(failures: list[Failure], store: Store) -> BaseException:
    """Return the error to raise: an unexpected exception itself, else one line."""
    kept = _kept(store)
    for failure in failures:
        if failure.error is not None and not isinstance(failure.error, MemoryError):
            failure.error.add_note(f"in {_where(failure)}{kept}")
            return failure.error
    names = listed(map(_where, failures))
    if failures[0].error is None:
        return SweepError(f"the process that computed {names} was killed twice (out of memory?){kept}")
    return SweepError(f"not enough memory for {names}{kept}")


def _where(failure: Failure) -> str:
    block = failure.block
    place = " x ".join(f"{start}..{start + size - 1}" for start, size in zip(block.start, block.shape, strict=True))
    return f"block {block.key} (points {place})" if place else f"block {block.key}"


def _finish(store: Store, out: Path, before: previous.Identity | None) -> None:
    """Write the result file. Raises SweepError, with the parts kept, if it cannot be written or must not be."""
    try:
        if free_bytes(out) < store.size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out))
        merge.write(store, out, lambda path: previous.look_again(store.plan.config, path, before))
    except OSError as error:
        raise _unwritable(error, store) from error
    except OutputError as error:
        raise SweepError(f"{error}{_kept(store)}") from error


def _unwritable(error: OSError, store: Store) -> SweepError:
    reason = (error.strerror or str(error)).lower()
    place = f"{error.filename}: " if error.filename else ""
    return SweepError(f"{place}{reason}{_kept(store)}")


def _kept(store: Store) -> str:
    """Return a note on finished blocks after an error, "" where they are not kept."""
    if not store.kept:
        return ""
    count = store.rescue()
    if not count:
        return "; no block was kept: the next call begins from the start"
    return f"; {_blocks(count)} kept in {store.folder.every}"


def _blocks(count: int) -> str:
    return "1 finished block is" if count == 1 else f"{count} finished blocks are"
