"""Cost per point of a sweep against coordinates, segments and threads, with the exponents of the laws.

Processor time of one thread, minima of some rounds taken in turn, of everything that a sweep does for a block but
encoding.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from bench.measuring import show, turns
from bench.scenes import chain
from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.system import GearSystem

SIZES = (1, 2, 3, 5, 8, 12, 20, 31, 59)
RATIOS = tuple(Fraction(k + 1, k) for k in (1, 2, 4, 8, 16, 32, 64))
"""Ratios of the second mesh's frequency to the first's: the common period has k + 1 and k periods of them."""
MESHES = (1, 2, 3, 4, 6, 8)
"""Numbers of meshes of one frequency and different phases."""
ROUNDS = 3
FROM = 8
"""Coordinates from which the law is fitted: what a point costs besides shows below."""
RANGE = (1.5, 1.8)
"""Mesh frequencies within which the edges of all regions are found."""
DAMPING = 0.02
"""Damping of the damped systems, relative to the stiffness."""


def segments(system: GearSystem) -> int:
    """Count the pieces of the common period in which the stiffness is constant."""
    _, cycles = system.common_period()
    jumps = [
        np.mod((np.arange(n)[:, None] + mesh.waveform.breakpoints() + mesh.lag) / n, 1.0).ravel()
        for mesh, n in zip(system.meshes, cycles, strict=True)
    ]
    return len(np.unique(np.round(np.concatenate(jumps), 12)))


def costs(systems: Sequence[GearSystem], points: Sequence[int]) -> list[float]:
    """Microseconds per point of the Floquet analysis of each system, over a row of so many mesh frequencies."""
    rows = [np.linspace(0.7, 6.0, count) for count in points]
    works = [lambda s=s, w=w: solve(s, w) for s, w in zip(systems, rows, strict=True)]
    return [1e6 * seconds / count for seconds, count in zip(turns(works, ROUNDS).min(axis=0), points, strict=True)]


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Fit y ~ x^p by least squares of the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def enough(size: int, count: int) -> int:
    """Points that take some tens of milliseconds: what a call costs of its own is less than a tenth of that."""
    return int(np.clip(1e7 / (count * max(size, 3) ** 3), 100, 100_000))


def coordinates() -> None:
    """Print the cost against the number of coordinates, undamped and damped, and of the boundaries of a row."""
    undamped, damped = ([chain(n, damping=damping) for n in SIZES] for damping in (0.0, DAMPING))
    points = [enough(n, 4) for n in SIZES]
    plain, lossy = costs(undamped, points), costs(damped, points)
    edges = turns([lambda s=s: boundaries(s, *RANGE, tolerance=1e-6) for s in undamped], ROUNDS).min(axis=0)  # type: ignore[misc]
    headings = ("n", "undamped us", "damped us", "damped / undamped", "edges of a row ms")
    rows = [(n, a, b, b / a, 1e3 * c) for n, a, b, c in zip(SIZES, plain, lossy, edges, strict=True)]
    show("Coordinates: 2 meshes, 4 segments", headings, rows)
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
        show(title, ("segments", "us per point", "us per segment"), list(zip(counts, found, each, strict=True)))
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

        seconds = float(turns([work], ROUNDS).min())
        rows.append((count, 1e6 * seconds / (64 * 200), 1e6 * min(clock) / (64 * 200)))
    show(
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
