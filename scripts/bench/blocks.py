"""Speed that block reduction gains: a planetary gear of five planets with an elastic ring, as a whole and by blocks."""

from __future__ import annotations

import time

import numpy as np

from bench.measuring import show
from bench.scenes import CONFIGS
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.dispatch import reduction

CHANGES = (
    "system.planets=5", "system.phases.sun=[0, 0, 0, 0, 0]", "system.ring.harmonics=12",
    "sweep.mesh_frequency.num=400", "sweep.epsilon={start: 0.0, stop: 0.4, num: 100}",
)  # fmt: skip


def main(every: int = 5) -> None:
    """Solve the map by blocks, every so many rows and frequencies as a whole, and print the ratio of the speeds."""
    config = load(CONFIGS / "parker_2009" / "fig3.yaml", list(CHANGES))
    omega = np.asarray(next(axis.values for axis in config.axes if axis.name == "mesh_frequency"), dtype=float)
    rows = np.arange(next(axis.size for axis in config.axes if axis.name == "epsilon"))
    chosen = config.at({"epsilon": rows[::every]}).build()
    begin = time.perf_counter()
    blocks = solve(config.at({"epsilon": rows}).build(), omega)
    middle = time.perf_counter()
    whole = solve(chosen, omega[::every], reduction=False)
    seconds = middle - begin, time.perf_counter() - middle
    differ = int(np.sum(blocks.stable[::every, ::every] != whole.stable))
    rates = [result.stable.size / t for result, t in zip((blocks, whole), seconds, strict=True)]
    show(
        f"Five planets, elastic ring of 12 waves, {len(omega)} x {len(rows)} points",
        ("", "points", "points/s", "x the whole", "flags that differ"),
        [
            ("block by block", blocks.stable.size, rates[0], rates[0] / rates[1], differ),
            ("as a whole", whole.stable.size, rates[1], 1.0, 0),
        ],
        reduction(config.system.build()).text(),
    )
