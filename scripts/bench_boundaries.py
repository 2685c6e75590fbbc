"""Exact boundaries with names: the times that are aimed at beside those that are taken."""

from __future__ import annotations

import os
import sys
from fractions import Fraction
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from subprocess import run
from time import process_time

# Its threads go on spinning for a while after a large product, and that would count.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from rich.console import Console
from rich.table import Table

from gearstab import ckernel
from gearstab.config import load
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.sweep import plan
from gearstab.system import GearSystem
from gearstab.systems import build

CONFIGS = Path(__file__).parent.parent / "configs"
REPEATS = 3


def train(ratio: str, epsilon: np.ndarray, damping_ratio: float = 0.0) -> GearSystem:
    """Lin & Parker's two-stage train over epsilon."""
    names = ("first", "second")
    meshes = [{"name": n, "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": 1.5} for n in names]
    meshes[1]["phasing"] = 0.0
    document = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "meshes": meshes}
    return build({**document, "tooth_ratio": Fraction(ratio), "damping_ratio": damping_ratio})


def rising(rows: int) -> np.ndarray:
    """Values of epsilon up to 0.5."""
    return np.linspace(0.5 / rows, 0.5, rows)


def configured(name: str) -> tuple[GearSystem, float, float]:
    """A system of a configuration, without its axes, and its range of mesh frequencies."""
    planned = plan(load(CONFIGS / name))
    return planned.base, *planned.mesh_frequency_range


def measured(system: GearSystem, start: float, stop: float, repeats: int) -> tuple[Boundaries, float]:
    """What is found and the CPU time of a row in milliseconds, the least of so many runs."""
    best = np.inf
    with ckernel.using(threads=1):
        for _ in range(repeats):
            begin = process_time()
            found = boundaries(system, start, stop)
            best = min(best, process_time() - begin)
    return found, 1e3 * best / found.rows


def check_time() -> float:
    """CPU time of ``gearstab check`` in milliseconds, with stored byte code, as users have it."""
    used = []
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": ""}
    for _ in range(2 * REPEATS):
        before = getrusage(RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "gearstab", "check", str(CONFIGS / "lin_parker_2002" / "fig3.yaml")]
        run(command, check=True, capture_output=True, env=environment)
        after = getrusage(RUSAGE_CHILDREN)
        used.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return 1e3 * min(used)


def aims() -> None:
    """Print what a row takes beside what is aimed at; with damping, how much of the stable part is proved."""
    table = Table(title="CPU time of a row, and what is aimed at")
    for heading in ("", "taken, ms", "aim, ms", "taken/aim", "proved"):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    half, mild = rising(101), np.array([0.3])
    scenes = (
        ("one mesh frequency", 0.25, (train("1", half), 0.35, 7.0), REPEATS),
        ("R = 3/5", 1.5, (train("3/5", half[::4]), 0.35, 7.0), REPEATS),
        ("drive train, 33 coordinates", 1e3, configured("drive_train.yaml"), REPEATS),
        ("planetary gear, 59 coordinates", 2e3, configured("parker_2009/fig3.yaml"), 1),
        ("reducer, 1 % damping", 1e3, configured("reducer.yaml"), REPEATS),
        ("R = 99/100, 1 % damping", 5e3, (train("99/100", mild, 0.01), 0.35, 7.0), REPEATS),
    )
    for title, aim, scene, repeats in scenes:
        found, time = measured(*scene, repeats)
        damped = scene[0].damping is not None
        proved = f"{100 * float(found.stable_share(found.proved).min()):.3f} %" if damped else ""
        table.add_row(title, f"{time:.3g}", f"{aim:g}", f"{time / aim:.2f}", proved)
    time = check_time()
    table.add_row("gearstab check", f"{time:.0f}", "300", f"{time / 300:.2f}", "")
    Console(width=110).print(table)


def main() -> None:
    """Print both tables."""
    aims()


if __name__ == "__main__":
    main()
