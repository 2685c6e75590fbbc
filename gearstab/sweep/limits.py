"""Limits that a sweep exceeds only when asked: more points, time or disk than anyone asks for by mistake."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearstab import ckernel
from gearstab.errors import RequestError
from gearstab.methods import RANGE
from gearstab.results.output import free_bytes
from gearstab.sweep.forecast import Clock, Estimate, estimate, work_of
from gearstab.sweep.layout import Layout
from gearstab.sweep.plan import Plan
from gearstab.sweep.progress import octets
from gearstab.sweep.storage.parts import PartFolder

QUICK_LOOK = 0.5
"""Seconds in which it is found out whether a method takes long."""
LONG = 120.0
"""Seconds of a method that are worth a word before it starts."""
MOST_POINTS = 1_000_000_000
MOST_SECONDS = 8 * 3600.0
MOST_BYTES = 10e9
"""Beyond these a sweep is begun with ``--yes`` only: a thousand maps of a thousand by a thousand points, a working day,
and what takes minutes to copy."""
SECONDS_OF_COST = 1e-7
"""Seconds of a unit of a method's cost, at most, roughly: three times UNIT."""
SMALL_COST = 1e6
"""Cost of searches of ranges that are done in seconds."""
SHORT = 60.0
"""Seconds of a sweep, by its cost, that is begun without measuring anything."""
TO_CONFIRM = "add --yes to begin it, or try --dry-run"


def refuse(plan: Plan, out: Path, jobs: int | None, confirmed: bool, confirm: str = TO_CONFIRM) -> Estimate | None:
    """Return what a sweep will take, as ``--dry-run`` tells it; None of one that is plainly small, as a closer look
    takes time itself.

    Raises RequestError for a sweep that is large and not ``confirmed``, or that does not fit on the disk. confirm: what
    the user can do to begin it all the same.
    """
    free = free_bytes(out)
    if plainly_small(plan, jobs, free):
        return None
    found = estimate(plan, jobs)
    # Finished blocks and the result are there at the same time; some may be there from an earlier run.
    folder = PartFolder(out, plan.digest).path
    kept = sum(path.stat().st_size for path in folder.glob("*.part")) if folder.is_dir() else 0
    needed = 2 * found.file_size - kept
    if needed > free:
        raise RequestError(
            f"{out}: the sweep needs about {octets(needed)} of disk for finished blocks and the result, and "
            f"{octets(free)} are free; make room or choose an output on another disk"
        )
    if not confirmed and (reasons := large(plan, found)):
        remedies = [f"; methods.{name}: {remedy}" for name, _, remedy in _expensive(plan, found)]
        raise RequestError(f"the sweep is large: {', '.join(reasons)}; {confirm}{''.join(remedies)}")
    return found


def plainly_small(plan: Plan, jobs: int | None, free: float) -> bool:
    """Whether nothing can make a sweep large, by numbers that cost nothing."""
    seconds = sum(_roughly(plan, layout, jobs or ckernel.threads()) for layout in plan.layouts)
    # Not compressed; lists of tongues, of unknown length, as if they had ten.
    size = sum(
        own.point_bytes * (10 if "tongue" in own.variable.dims else 1) * layout.points
        for layout in plan.layouts for own in layout.results
    )  # fmt: skip
    return plan.points <= MOST_POINTS and seconds < SHORT and 2 * size < min(free, MOST_BYTES)


def _roughly(plan: Plan, layout: Layout, workers: int) -> float:
    """Seconds of a method; infinite where that is not found out at once."""
    if layout.method.frequency != RANGE or layout.points * layout.cost < SMALL_COST:
        return layout.points * layout.cost * SECONDS_OF_COST / workers
    with ckernel.using(threads=1):
        work, _ = work_of(plan, layout, Clock(QUICK_LOOK))
    return np.inf if work is None else work / min(workers, layout.count)


def large(plan: Plan, found: Estimate) -> list[str]:
    """Say in which respects a sweep is large; empty for none."""
    reasons = []
    if plan.points > MOST_POINTS:
        reasons.append(f"{plan.points:,} points")
    if found.seconds > MOST_SECONDS:
        reasons.append(f"about {found.seconds / 3600:.3g} hours on {found.jobs} processors")
    if found.file_size > MOST_BYTES:
        reasons.append(f"a result of about {octets(found.file_size)}")
    return reasons


def long_runs(plan: Plan, found: Estimate) -> list[str]:
    """Warn of methods that are going to take long and could do with less, one line each."""
    return [f"methods.{name} {text}; {remedy}" for name, text, remedy in _expensive(plan, found)]


def _expensive(plan: Plan, found: Estimate) -> list[tuple[str, str, str]]:
    """Methods that take long and could do with less: name, how long, remedy."""
    return [
        (m.name, "may take very long" if m.seconds is None else f"will take some {m.time}", layout.method.relief)
        for layout, m in zip(plan.layouts, found.methods, strict=True)
        if layout.method.relief and (m.seconds is None or m.seconds > LONG)
    ]
