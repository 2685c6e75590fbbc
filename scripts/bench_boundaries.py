"""Exact boundaries of the compiled search, with names, beside the NumPy search that it is tested against."""

from __future__ import annotations

from fractions import Fraction
from time import process_time

import numpy as np
from rich.console import Console
from rich.table import Table

from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.kernel.choice import using
from gearstab.system import GearSystem
from gearstab.systems import build

REPEATS = 3
SAME = 1e-8
"""Relative distance within which two edges are of one region."""


def train(ratio: str, rows: int) -> GearSystem:
    """Lin & Parker's two-stage train over epsilon."""
    epsilon = np.linspace(0.5 / rows, 0.5, rows)
    names = ("first", "second")
    meshes = [{"name": n, "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": 1.5} for n in names]
    meshes[1]["phasing"] = 0.0
    document = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "meshes": meshes}
    return build({**document, "tooth_ratio": Fraction(ratio)})


def measured(system: GearSystem, start: float, stop: float, kernel: str, repeats: int) -> tuple[Boundaries, float]:
    """What is found and the CPU time of a row in milliseconds, the least of so many runs."""
    best = np.inf
    with using(kernel=kernel, threads=1):
        for _ in range(repeats):
            begin = process_time()
            found = boundaries(system, start, stop)
            best = min(best, process_time() - begin)
    return found, 1e3 * best / found.rows


def differing(found: Boundaries, known: Boundaries) -> tuple[int, int]:
    """Regions of which the other search has none, and regions with other names."""
    left, names = 0, 0
    own, other = found.labels(), known.labels()
    for row in range(found.rows):
        mine, theirs = np.flatnonzero(found.row == row), np.flatnonzero(known.row == row)
        for k in mine:
            apart = np.abs(known.lower[theirs] / found.lower[k] - 1) + np.abs(known.upper[theirs] / found.upper[k] - 1)
            if len(apart) == 0 or apart.min() > SAME:
                left += 1
            elif own[k] != other[theirs[apart.argmin()]]:
                names += 1
    return left, names


def main() -> None:
    """Measure both and print the ratio of the two speeds."""
    table = Table(title="Instability boundaries with names, CPU time of a row")
    for heading in (
        "",
        "regions",
        "compiled, ms",
        "NumPy, ms",
        "times faster",
        "regions that differ",
        "names that differ",
    ):
        table.add_column(heading, justify="left" if not heading else "right")
    for title, ratio, start, rows in (("one mesh frequency", "1", 0.35, 101), ("R = 3/5", "3/5", 0.35, 26)):
        found, time = measured(train(ratio, rows), start, 7.0, "c", REPEATS)
        known, slow = measured(train(ratio, rows), start, 7.0, "numpy", 1)
        left, names = differing(found, known)
        numbers = (f"{time:.3g}", f"{slow:.3g}", f"{slow / time:.3g}", str(left), str(names))
        table.add_row(title, f"{len(found.row) / found.rows:.1f}", *numbers)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
