"""What block reduction saves: a planetary gear of five planets with an elastic ring, as a whole and block by block."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.report import reduction
from gearstab.systems import build

CONFIG = Path(__file__).parent.parent / "configs" / "parker_2009" / "fig3.yaml"
CHANGES = (
    "system.planets=5", "system.phases.sun=[0, 0, 0, 0, 0]", "system.ring.harmonics=12",
    "sweep.mesh_frequency.num=400", "sweep.epsilon={start: 0.0, stop: 0.4, num: 100}",
)  # fmt: skip
EVERY = 5
"""Of the rows and of the mesh frequencies of the map, those that are also solved as a whole."""


def main(every: int = EVERY) -> None:
    """Solve the map block by block, a part of it as a whole, and print the ratio of the two speeds."""
    config = load(CONFIG, list(CHANGES))
    omega = np.asarray(next(axis.values for axis in config.axes if axis.name == "mesh_frequency"), dtype=float)
    rows = np.arange(next(axis.size for axis in config.axes if axis.name == "epsilon"))
    chosen = build(config.at({"epsilon": rows[::every]}))
    start = perf_counter()
    blocks = solve(build(config.at({"epsilon": rows})), omega)
    middle = perf_counter()
    whole = solve(chosen, omega[::every], reduction=False)
    seconds = middle - start, perf_counter() - middle
    differ = int(np.sum(blocks.stable[::every, ::every] != whole.stable))
    found = reduction(build(config.system))
    rates = [result.stable.size / t for result, t in zip((blocks, whole), seconds, strict=True)]

    title = f"Five planets, elastic ring of 12 waves, {len(omega)} x {len(rows)} points"
    table = Table(title=title, caption=found.text())
    for heading in ("", "points", "points/s", "x the whole", "flags that differ"):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    ratio = rates[0] / rates[1]
    table.add_row("block by block", f"{blocks.stable.size}", f"{rates[0]:.3g}", f"{ratio:.3g}", f"{differ}")
    table.add_row("as a whole", f"{whole.stable.size}", f"{rates[1]:.3g}", "1", "0")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
