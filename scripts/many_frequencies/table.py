"""The table of docs/many_frequencies.md: exact common period, one mesh frequency at a time, Lyapunov exponent.

    python scripts/many_frequencies/table.py

prints it as Markdown, for the gearbox of configs/many_frequencies/train13.yaml with DAMPING times its damping. Growth
rates do not depend on the machine, times do.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.frequencies import common_period, groups, lyapunov, per_mesh
from gearstab.floquet.segments.pattern import prepare
from gearstab.system import GearSystem
from gearstab.systems import build

CONFIG = Path(__file__).parents[2] / "configs" / "many_frequencies" / "train13.yaml"
DAMPING = 0.05
"""With all of its damping no tongue is open from 300 Hz to 26 kHz."""
CYCLES = 500
"""Cycles of the slowest mesh, for the Lyapunov exponents."""
FREQUENCIES = (350.0, 1615.1, 1620.6, 1890.33, 2226.0, 2240.0, 2307.17, 2846.3, 2969.2, 3466.64, 3910.55, 3926.0)
"""Frequencies of mesh I (Hz): the speed of the paper, and places in and about tongues of meshes I and II."""
TIMED = 64
"""Points of a sweep that a time per point is taken from."""
EDGES = ((1580.0, 1650.0), (1878.0, 1905.0), (3400.0, 3520.0), (3640.0, 3680.0))
"""Ranges of the mesh frequency, Hz, with one wide tongue each: three of mesh I, one of mesh II."""
STEPS = 2001


@dataclass(frozen=True)
class Row:
    """Growth rates at one mesh frequency, 1/s; half: that of the interval of the Lyapunov exponent."""

    frequency: float
    exact: float
    by_mesh: tuple[float, ...]
    per_mesh: float
    lyapunov: float
    half: float


def train(damping: float = DAMPING) -> GearSystem:
    """The gearbox with a part of its damping."""
    system = build(load(CONFIG).system)
    assert system.damping is not None
    return replace(system, damping=damping * system.damping)


def rows(system: GearSystem, hertz: tuple[float, ...] = FREQUENCIES, cycles: float = CYCLES) -> list[Row]:
    """The three results at each frequency."""
    omega = 2 * np.pi * np.array(hertz)
    exact = solve(system, omega).growth_rate[0]
    single = per_mesh.solve(system, omega, solve)
    assert single.by_mesh is not None
    found = lyapunov.solve(system, omega, cycles=cycles)
    assert found.interval is not None
    return [
        Row(f, exact[k], tuple(single.by_mesh[0, k]), single.growth_rate[0, k], found.growth_rate[0, k],
            found.interval[0, k])
        for k, f in enumerate(hertz)
    ]  # fmt: skip


def middles(system: GearSystem, low: float, high: float) -> tuple[float, float]:
    """Middle of the unstable mesh frequencies in a range, Hz: exact and with one mesh frequency at a time."""
    hertz = np.linspace(low, high, STEPS)
    found = []
    for growth in (
        solve(system, 2 * np.pi * hertz).growth_rate[0],
        per_mesh.solve(system, 2 * np.pi * hertz, solve).growth_rate[0],
    ):
        runs = np.split(np.flatnonzero(growth > 0), np.flatnonzero(np.diff(np.flatnonzero(growth > 0)) > 1) + 1)
        widest = max(runs, key=len)
        found.append(0.5 * (hertz[widest[0]] + hertz[widest[-1]]))
    return found[0], found[1]


def seconds(run: Callable[[], object], points: int) -> float:
    """Time of a point in seconds, the better of two."""
    taken = []
    for _ in range(2):
        start = time.perf_counter()
        run()
        taken.append((time.perf_counter() - start) / points)
    return min(taken)


def times(system: GearSystem) -> tuple[float, float, float]:
    """Seconds a point of the three ways, in a sweep of TIMED points."""
    omega = 2 * np.pi * np.linspace(1600.0, 1630.0, TIMED)
    return (
        seconds(lambda: solve(system, omega), TIMED),
        seconds(lambda: per_mesh.solve(system, omega, solve), TIMED),
        seconds(lambda: lyapunov.solve(system, omega, cycles=CYCLES), TIMED),
    )


def table(found: list[Row]) -> str:
    """In Markdown."""
    lines = [
        "| mesh I, Hz | exact | one mesh at a time | (of mesh) | Lyapunov exponent |",
        "| ---: | ---: | ---: | :--- | ---: |",
    ]
    names = [group.name for group in groups(train())]
    for row in found:
        of = names[int(np.argmax(row.by_mesh))] if row.per_mesh > 0 else "-"
        estimate = f"{row.lyapunov:.3f} ± {row.half:.3f}"
        lines.append(f"| {row.frequency:.2f} | {row.exact:.3f} | {row.per_mesh:.3f} | {of} | {estimate} |")
    return "\n".join(lines)


def main() -> None:
    """Print everything."""
    system = train()
    period, (pattern,) = common_period(system), prepare(system)
    assert period is not None
    print(f"Common period: {period.cycles:g} cycles of mesh I, {len(pattern.states)} segments of", end=" ")
    print(f"{pattern.stiffness.shape[1]} distinct stiffness matrices, {pattern.size} elastic coordinates.\n")
    print(table(rows(system)))
    print("\n| tongue about, Hz | middle, exact | middle, one mesh at a time | difference |")
    print("| ---: | ---: | ---: | ---: |")
    for low, high in EDGES:
        first, second = middles(system, low, high)
        print(f"| {0.5 * (low + high):.0f} | {first:.2f} | {second:.2f} | {100 * (second / first - 1):.2f} % |")
    exact, single, estimate = (f"{1e3 * t:.2g} ms" for t in times(system))
    print(f"\nTime per point: exact {exact}, one mesh at a time {single}, Lyapunov exponent {estimate}.")


if __name__ == "__main__":
    main()
