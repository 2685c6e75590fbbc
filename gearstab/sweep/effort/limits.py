"""Limits that a sweep exceeds only when asked: more points, time or disk than anyone asks for by mistake."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearstab import ckernel
from gearstab.errors import RequestError
from gearstab.methods import RANGE
from gearstab.results.output import free_bytes
from gearstab.sweep.effort.estimate import LONG, Estimate, estimate, of_ranges, small
from gearstab.sweep.effort.words import octets
from gearstab.sweep.layout import Layout
from gearstab.sweep.plan import Plan
from gearstab.sweep.storage.parts import PartFolder

MOST_POINTS = 1_000_000_000
MOST_SECONDS = 8 * 3600.0
MOST_BYTES = 10e9
"""Beyond these a sweep is begun with ``--yes`` only: a thousand maps of a thousand by a thousand points, a working day,
and what takes minutes to copy."""

SECONDS_OF_COST = 1e-7
"""Seconds of a unit of a method's cost, roughly."""
SHORT = 60.0
"""Seconds of a sweep, roughly estimated, that is begun without a closer look at them."""


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
    # Finished blocks and the result are there at the same time.
    needed = 2 * found.file_size - _kept(plan, out)
    if needed > free:
        raise RequestError(
            f"{out}: the sweep needs about {octets(needed)} of disk for finished blocks and the result, and "
            f"{octets(free)} are free; make room or choose an output on another disk"
        )
    if not confirmed and (reasons := large(plan, found)):
        costly = [m.name for m in found.methods if m.seconds is None or m.seconds > LONG]
        remedies = [
            f"; methods.{layout.method.name}: {layout.method.relief}"
            for layout in plan.layouts
            if layout.method.relief and layout.method.name in costly
        ]
        raise RequestError(f"the sweep is large: {', '.join(reasons)}; {confirm}{''.join(remedies)}")
    return found


def plainly_small(plan: Plan, jobs: int | None, free: float) -> bool:
    """Whether nothing can make a sweep large, by numbers that cost nothing."""
    seconds = sum(_roughly(plan, layout, jobs or ckernel.threads()) for layout in plan.layouts)
    size = 2 * sum(_bytes(layout) for layout in plan.layouts)
    return plan.points <= MOST_POINTS and seconds < SHORT and size < min(free, MOST_BYTES)


def _roughly(plan: Plan, layout: Layout, workers: int) -> float:
    """Seconds of a method; infinite where that is not found out at once."""
    if layout.method.frequency == RANGE and not small(layout):
        found = of_ranges(plan, layout, workers)
        return np.inf if found is None else found
    return layout.points * layout.cost * SECONDS_OF_COST / workers


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


def _bytes(layout: Layout) -> int:
    """Return the size of a method's results over the grid, not compressed; lists of tongues, of unknown length, as if
    they had ten.
    """
    total = 0
    for own in layout.results:
        tongues = 10 if "tongue" in own.variable.dims else 1
        total += own.point_bytes * tongues * layout.points
    return total


def _kept(plan: Plan, out: Path) -> int:
    """Bytes of finished blocks of an earlier run."""
    folder = PartFolder(out, plan.digest).path
    return sum(path.stat().st_size for path in folder.glob("*.part")) if folder.is_dir() else 0
