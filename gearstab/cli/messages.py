"""Messages of ``gearstab sweep``: its progress, and at its end notes on points whose answers need a word."""

from __future__ import annotations

import sys
from math import floor
from typing import TYPE_CHECKING

import numpy as np

from gearstab.cli.terminal import is_quiet, note, tell
from gearstab.sweep import Reporter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gearstab.sweep import Plan, Summary
    from gearstab.sweep.storage.merge import RegionSearches


def notes(plan: Plan, summary: Summary) -> list[str]:
    """Return one line for each flag that points carry, and for each mesh whose teeth are not sound."""
    found = []
    for layout in plan.layouts:
        for flag, count in summary.flags.get(layout.method.name, {}).items():
            # Steady states beside growth rates need not repeat these.
            known = flag == "unstable" and "floquet" in summary.flags
            if flag in layout.method.flag_notes and not known:
                found.append(layout.method.flag_notes[flag].format(points=share(count, layout.points)))
    return found + teeth(plan)


HUNDREDTH = 1e-4
"""A hundredth of a per cent: less is not mentioned."""


def searched(searches: Mapping[str, RegionSearches]) -> list[str]:
    """Return one line for each method that searches all regions: how much of the stable mesh frequencies is proved so
    and how the rest was sampled; none where all is counted, as it is without damping.
    """
    if not searches:
        return []
    from gearstab.floquet.boundaries.regions import sampled  # takes longer to load than a small sweep to run

    found = []
    for name, own in searches.items():
        rest = f": {sampled(own.step, own.coarse, own.systems)}" if own.step else ", beside edges"
        if own.proved is None or own.counted is None:
            words = f"{name}: some mesh frequencies are neither proved nor counted{rest}"
            found += [words] if own.step else []
        elif own.counted <= 1 - HUNDREDTH:
            shares = [(own.counted, "counted"), (1 - own.proved - own.counted, f"neither{rest}")]
            parts = [f"{percent(part)} {word}" for part, word in shares if part >= HUNDREDTH]
            words = ", ".join([f"{percent(own.proved)} proved stable (in floating point)", *parts])
            found.append(f"stable mesh frequencies: {words}")
    return found


def percent(part: float) -> str:
    """Return a share in hundredths of a per cent, rounded down: all is all."""
    return f"{floor(part / HUNDREDTH + 1e-6) / 100:g} %"


def share(count: int, total: int) -> str:
    """Return ``12.3 % of the points``; never 0.0 % or 100.0 % where that is rounded."""
    if count == total:
        return "every point"
    part = 100 * count / total
    return f"{part:.1f} % of the points" if 0.05 <= part < 99.95 else f"{count:,} of {total:,} points"


def teeth(plan: Plan) -> list[str]:
    """Return one line for each mesh and notice of a gearbox."""
    if plan.teeth is None:
        return []
    from gearstab.systems.gearbox.feasibility import NOTICES

    over = " x ".join(axis.name for axis in plan.teeth.axes)
    flags = plan.teeth.flags.reshape(-1, len(plan.teeth.meshes))
    found = []
    for mesh, column in zip(plan.teeth.meshes, flags.T, strict=True):
        for words in NOTICES.values():
            count = int(np.count_nonzero(column & words.bit))
            where = f" at {count:,} of {len(column):,} values of {over}" if over and count < len(column) else ""
            if count:
                found.append(f"teeth of mesh {mesh} {words.teeth}{where}; gearstab info tells more")
    return found


class Messages(Reporter):
    """Messages alone; none of them if the command is quiet."""

    def message(self, text: str) -> None:
        note(text)


def reporter() -> Reporter:
    """Return a bar if someone can see it."""
    if is_quiet() or not sys.stderr.isatty():
        return Messages()
    from gearstab.sweep.progress import Bar

    return Bar(tell)
