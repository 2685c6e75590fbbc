"""What the boundaries of damped systems cost, in points of a map, and how much of the stable range is proved."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from time import process_time

import numpy as np
from rich.console import Console
from rich.table import Table

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.segments.pattern import prepare
from gearstab.sweep import plan
from gearstab.system import GearSystem
from gearstab.systems import build

REDUCER = Path(__file__).parent.parent / "configs" / "reducer.yaml"
POINTS = 20_000
"""Of a map of the growth rate, to compare with."""
REPEATS = 3


def train(ratio: str, damping: float) -> GearSystem:
    """Lin & Parker's train with damping."""
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    return build({
        "kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "tooth_ratio": Fraction(ratio),
        "damping_ratio": damping, "meshes": [{"name": "first", **mesh}, {"name": "second", **mesh}],
    })  # fmt: skip


def scenes() -> list[tuple[str, GearSystem, float, float]]:
    """(name, system, first and last mesh frequency)."""
    planned = plan(load(REDUCER))
    reducer = ("reducer, 1 %", planned.base, *planned.mesh_frequency_range)
    cases = (("1", 0.01), ("1", 0.001), ("3/5", 0.01), ("49/50", 0.01), ("99/100", 0.01), ("999/1000", 0.02))
    trains = [(f"ratio {ratio}, {100 * damping:g} %", train(ratio, damping), 0.35, 7.0) for ratio, damping in cases]
    return [reducer, *trains]


def main(points: int = POINTS) -> None:
    """Print a table: segments, regions, CPU time and how many points of a map it is worth, what is proved and counted.

    A map of so many points has edges within its spacing, and proves nothing between them.
    """
    table = Table(title="Boundaries of damped systems, one row each")
    headings = ("", "segments", "regions", "evaluations", "CPU (s)", "points of a map", "proved", "counted")
    for heading in headings:
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    boundaries(train("1", 0.01), 1.0, 2.0)
    for name, system, start, stop in scenes():
        seconds = []
        for _ in range(REPEATS):
            begin = process_time()
            found = boundaries(system, start, stop)
            seconds.append(process_time() - begin)
        begin = process_time()
        solve(system, np.geomspace(start, stop, points))
        a_point = (process_time() - begin) / points
        proved, counted = (float(found.stable_share(parts)[0]) for parts in (found.proved, found.counted))
        best = min(seconds)
        (pattern,) = prepare(system)
        table.add_row(
            name, f"{len(pattern.states)}", f"{len(found.row)}", f"{found.evaluations.sum()}", f"{best:.3f}",
            f"{best / a_point:.0f}", f"{100 * proved:.3f} %", f"{100 * counted:.3f} %",
        )  # fmt: skip
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
