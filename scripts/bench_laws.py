"""What a point of a sweep costs against coordinates, segments and threads, with the exponents of the laws.

Processor time of one thread, minima of some rounds taken in turn, of everything that a sweep does for a block but
encoding. Usage: python scripts/bench_laws.py
"""

# ruff: noqa: E402 -- the environment is set before NumPy is imported

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from fractions import Fraction

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from rich.console import Console
from rich.table import Column, Table

from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.system import GearSystem, Mesh
from gearstab.waveforms import Rectangular

SIZES = (1, 2, 3, 5, 8, 12, 20, 31, 59)
RATIOS = tuple(Fraction(k + 1, k) for k in (1, 2, 4, 8, 16, 32, 64))
"""Of the second mesh's frequency to the first's: the common period has k + 1 and k periods of them."""
MESHES = (1, 2, 3, 4, 6, 8)
"""Of one frequency and different phases."""
ROUNDS = 3
FROM = 8
"""Coordinates from which the law is fitted: what a point costs besides shows below."""
RANGE = (1.5, 1.8)
"""Mesh frequencies within which the edges of all regions are found."""
DAMPING = 0.02
"""Of the damped systems, relative to the stiffness."""


def chain(size: int, ratio: Fraction = Fraction(1), meshes: int = 2, damped: bool = False) -> GearSystem:
    """Build a chain of masses and springs that no symmetry divides, with meshes between masses or to the ground."""
    mass = 1 + 0.3 * np.sin(np.arange(size))
    springs = 1 + 0.2 * np.cos(np.arange(size + 1))
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    found = []
    for k in range(meshes):
        direction = np.zeros(size)
        place = k * size // meshes
        direction[place] = 1.0
        if place + 1 < size:
            direction[place + 1] = 1.0
        wave = Rectangular(1.4 + 0.37 * k / meshes)
        found.append(
            Mesh(f"mesh{k}", direction, np.array(0.8), np.array(0.1), wave, ratio if k else Fraction(1), 0.1 * k)
        )
    return GearSystem(np.diag(mass), stiffness, tuple(found), damping=DAMPING * stiffness if damped else None)


def segments(system: GearSystem) -> int:
    """Count the pieces of the common period in which the stiffness is constant."""
    _, cycles = system.common_period()
    jumps = [
        np.mod((np.arange(n)[:, None] + mesh.waveform.breakpoints() + mesh.lag) / n, 1.0).ravel()
        for mesh, n in zip(system.meshes, cycles, strict=True)
    ]
    return len(np.unique(np.round(np.concatenate(jumps), 12)))


def minima(works: Sequence[Callable[[], object]]) -> list[float]:
    """Seconds of the processor of each piece of work, which take turns."""
    found = np.full((ROUNDS, len(works)), np.inf)
    for turn in range(ROUNDS):
        for k, work in enumerate(works):
            start = time.process_time()
            work()
            found[turn, k] = time.process_time() - start
    return [float(least) for least in found.min(axis=0)]


def costs(systems: Sequence[GearSystem], points: Sequence[int]) -> list[float]:
    """Microseconds per point of the Floquet analysis of each system, over a row of so many mesh frequencies."""
    rows = [np.linspace(0.7, 6.0, count) for count in points]
    works = [lambda s=s, w=w: solve(s, w) for s, w in zip(systems, rows, strict=True)]
    return [1e6 * seconds / count for seconds, count in zip(minima(works), points, strict=True)]


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Fit y ~ x^p by least squares of the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def enough(size: int, count: int) -> int:
    """Points that take some tens of milliseconds: what a call costs of its own is less than a tenth of that."""
    return int(np.clip(1e7 / (count * max(size, 3) ** 3), 100, 100_000))


def shown(title: str, headings: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table."""
    table = Table(*(Column(heading, justify="right") for heading in headings), title=title)
    for row in rows:
        table.add_row(*(f"{x:.3g}" if isinstance(x, float) else str(x) for x in row))
    Console(width=110).print(table)


def coordinates() -> None:
    """Print the cost against the number of coordinates, undamped and damped, and of the boundaries of a row."""
    undamped, damped = ([chain(n, damped=with_damping) for n in SIZES] for with_damping in (False, True))
    points = [enough(n, 4) for n in SIZES]
    plain, lossy = costs(undamped, points), costs(damped, points)
    edges = minima([lambda s=s: boundaries(s, *RANGE, tolerance=1e-6) for s in undamped])  # type: ignore[misc]
    headings = ("n", "undamped us", "damped us", "damped / undamped", "edges of a row ms")
    rows = [(n, a, b, b / a, 1e3 * c) for n, a, b, c in zip(SIZES, plain, lossy, edges, strict=True)]
    shown("Coordinates: 2 meshes, 4 segments", headings, rows)
    large = [k for k, n in enumerate(SIZES) if n >= FROM]
    for name, found in (("undamped", plain), ("damped", lossy), ("edges", edges)):
        law = exponent([SIZES[k] for k in large], [found[k] for k in large])
        print(f"  {name}: n^{law:.2f} from n = {FROM}")


def periods() -> None:
    """Print the cost against the segments of a common period: long ones of two meshes, and meshes of many phases."""
    for title, systems in (
        ("Segments: 3 coordinates, 2 meshes, frequencies k + 1 to k", [chain(3, ratio) for ratio in RATIOS]),
        ("Segments: 12 coordinates, 2 meshes, frequencies k + 1 to k", [chain(12, ratio) for ratio in RATIOS]),
        ("Segments: 8 coordinates, meshes of one frequency", [chain(8, meshes=count) for count in MESHES]),
    ):
        counts = [segments(system) for system in systems]
        found = costs(systems, [enough(s.size, c) for s, c in zip(systems, counts, strict=True)])
        each = [cost / count for cost, count in zip(found, counts, strict=True)]
        shown(title, ("segments", "us per point", "us per segment"), list(zip(counts, found, each, strict=True)))
        print(f"  segments^{exponent(counts, found):.2f}")


def threads() -> None:
    """Print what is paid in processor time for more threads, and the clock."""
    rows = []
    for count in (1, *(n for n in (2, 4, 8, 16) if n <= ckernel.threads())):
        system = chain(12)
        batch = GearSystem(
            np.tile(system.mass, (64, 1, 1)), system.stiffness * np.linspace(1, 2, 64)[:, None, None], system.meshes
        )
        clock: list[float] = []

        def work(batch: GearSystem = batch, clock: list[float] = clock, count: int = count) -> None:
            start = time.perf_counter()
            with ckernel.using(count):
                solve(batch, np.linspace(0.7, 6.0, 200))
            clock.append(time.perf_counter() - start)

        (seconds,) = minima([work])
        rows.append((count, 1e6 * seconds / (64 * 200), 1e6 * min(clock) / (64 * 200)))
    shown(
        "Threads: 12 coordinates, 4 segments, 64 rows, per point",
        ("threads", "us of processors", "us of the clock"),
        rows,
    )


def main() -> None:
    """Print all tables."""
    print(f"{platform.machine()}, vector instructions: {ckernel.simd()}")
    with ckernel.using(1):
        coordinates()
        periods()
    threads()


if __name__ == "__main__":
    main()
