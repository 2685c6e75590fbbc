"""Exact boundaries with names: processor time per row beside the aim, points of a map it is worth, proved share."""

from __future__ import annotations

import subprocess
import sys
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np

from bench.measuring import show, turns
from bench.scenes import CONFIGS, configured, train
from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.system import Array, GearSystem

POINTS = 20_000
"""Points of a map of the growth rate, to compare with."""
CHECK = 300.0
"""Milliseconds that ``gearstab check`` may take."""


def rising(rows: int) -> Array:
    """Return values of epsilon up to 0.5."""
    return np.linspace(0.5 / rows, 0.5, rows)


def scenes() -> dict[str, tuple[float | None, tuple[GearSystem, float, float]]]:
    """Name -> milliseconds aimed at per row, and the system with its first and last mesh frequency."""
    half, mild = rising(101), np.array([0.3])
    damped = (("1", 0.01), ("1", 0.001), ("3/5", 0.01), ("49/50", 0.01), ("99/100", 0.01), ("999/1000", 0.02))
    return {
        "one mesh frequency": (0.25, (train("1", half), 0.35, 7.0)),
        "R = 3/5": (1.5, (train("3/5", half[::4]), 0.35, 7.0)),
        "drive train, 33 coordinates": (1e3, configured("drive_train.yaml")),
        "planetary gear, 59 coordinates": (2e3, configured("parker_2009/fig3.yaml")),
        "reducer, 1 % damping": (1e3, configured("reducer.yaml")),
        **{
            f"R = {ratio}, {100 * zeta:g} % damping": (
                5e3 if ratio == "99/100" else None, (train(ratio, mild, damping_ratio=zeta), 0.35, 7.0)
            )
            for ratio, zeta in damped
        },
    }  # fmt: skip


def row(name: str, aim: float | None, system: GearSystem, start: float, stop: float, rounds: int) -> tuple[object, ...]:
    """Measure one scene."""
    found = boundaries(system, start, stop)
    once = float(turns([lambda: boundaries(system, start, stop)], 1).min())
    best = min(once, float(turns([lambda: boundaries(system, start, stop)], rounds).min())) if once < 1 else once
    each = 1e3 * best / found.rows
    damped = system.damping is not None
    point = 0.0
    if damped:
        point = float(turns([lambda: solve(system, np.geomspace(start, stop, POINTS))], 1).min()) / POINTS
    proved = f"{100 * float(found.stable_share(found.proved).min()):.3f} %" if damped else ""
    counted = f"{100 * float(found.stable_share(found.counted).min()):.3f} %" if damped else ""
    worth = f"{best / point:.0f}" if point else ""
    return name, len(found.row), each, aim or "", each / aim if aim else "", worth, proved, counted


def check_time(rounds: int) -> float:
    """Return the CPU time of ``gearstab check`` in milliseconds, with stored byte code, as users have it."""
    used = []
    command = [sys.executable, "-m", "gearstab", "check", str(CONFIGS / "lin_parker_2002" / "fig3.yaml")]
    for _ in range(2 * rounds):
        before = getrusage(RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = getrusage(RUSAGE_CHILDREN)
        used.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return 1e3 * min(used)


def main(rounds: int = 3) -> None:
    """Print the table."""
    with ckernel.using(threads=1):
        rows = [row(name, aim, *scene, rounds) for name, (aim, scene) in scenes().items()]
    taken = check_time(rounds)
    rows.append(("gearstab check", "", taken, CHECK, taken / CHECK, "", "", ""))
    headings = ("", "regions", "ms per row", "aim", "taken/aim", "points of a map", "proved", "counted")
    show("Boundaries, processor time per row", headings, rows)
