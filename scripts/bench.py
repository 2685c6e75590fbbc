"""Speed of the Floquet analysis against what one would write first, on the map of Lin & Parker (2002), Fig. 3.

All methods answer the same question for the same points, in one process and one run, a repetition of each in turn; the
table shows medians.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.modal import eigenmodes
from gearstab.system import Array, GearSystem
from gearstab.systems import build

CONFIG = Path(__file__).parent.parent / "configs" / "lin_parker_2002" / "fig3.yaml"
ON_CIRCLE = 1e-8
"""Multipliers of this distance from the unit circle count as on it, in the methods that only have eigenvalues."""


def segments(system: GearSystem) -> tuple[Array, Array]:
    """Durations (of the common period 1) and stiffness matrices of the pieces between the jumps of a single system."""
    _, cycles = system.common_period()
    jumps = {0.0, 1.0}
    for mesh, n in zip(system.meshes, cycles, strict=True):
        starts = (np.arange(n)[:, None] + mesh.waveform.breakpoints() + mesh.lag) / n
        jumps |= set(np.mod(starts, 1.0).ravel().tolist())
    ends = np.unique(np.round(sorted(jumps), 14))
    middle = (ends[1:] + ends[:-1]) / 2
    levels = [
        mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(n * middle - mesh.lag))
        for mesh, n in zip(system.meshes, cycles, strict=True)
    ]
    return np.diff(ends), np.stack([system.stiffness_matrix(list(level)) for level in np.transpose(levels)])


def periods(system: GearSystem, omega: Array) -> Array:
    """The common period for every mesh frequency."""
    return 2 * np.pi * float(system.common_period()[0]) / omega


def batched(system: GearSystem, omega: Array) -> Array:
    """Monodromy matrices from the modes of each piece, multiplied and solved as one batch: numpy.linalg.eigvals."""
    durations, stiffness = segments(system)
    squared, shapes = eigenmodes(system.mass, stiffness)
    n, times = system.size, periods(system, omega)[:, None]
    product = np.eye(2 * n)
    for duration, values, phi in zip(durations, squared, shapes, strict=True):
        w = np.sqrt(values)
        cosine, sine = np.cos(w * duration * times)[:, None], np.sin(w * duration * times)[:, None]
        back = phi.T @ system.mass
        blocks = [[phi * cosine @ back, phi * (sine / w) @ back], [phi * (-sine * w) @ back, phi * cosine @ back]]
        product = np.block(blocks) @ product
    return np.abs(np.linalg.eigvals(product)).max(axis=-1) <= 1 + ON_CIRCLE


def generators(system: GearSystem) -> tuple[Array, Array]:
    """Durations and first-order matrices of the pieces."""
    durations, stiffness = segments(system)
    n = system.size
    a = np.zeros((len(durations), 2 * n, 2 * n))
    a[:, :n, n:] = np.eye(n)
    a[:, n:, :n] = -np.linalg.solve(system.mass, stiffness)
    return durations, a


def exponentials(system: GearSystem, omega: Array) -> Array:
    """Products of scipy.linalg.expm."""
    durations, a = generators(system)
    found = []
    for period in periods(system, omega):
        product = np.eye(a.shape[-1])
        for factor in expm(a * (durations * period)[:, None, None]):
            product = factor @ product
        found.append(np.abs(np.linalg.eigvals(product)).max() <= 1 + ON_CIRCLE)
    return np.array(found)


def integrated(system: GearSystem, omega: Array) -> Array:
    """Numerical integration by DOP853, broken at the jumps."""
    durations, a = generators(system)
    size, found = a.shape[-1], []
    for period in periods(system, omega):
        product = np.eye(size)
        for duration, matrix in zip(durations * period, a, strict=True):
            done = solve_ivp(
                lambda _, y, m=matrix: (m @ y.reshape(size, size)).ravel(), (0, duration), product.ravel(),
                method="DOP853", rtol=1e-10, atol=1e-12,
            )  # fmt: skip
            product = done.y[:, -1].reshape(size, size)
        found.append(np.abs(np.linalg.eigvals(product)).max() <= 1 + 1e-6)
    return np.array(found)


def timed(work: Callable[[], Array]) -> tuple[float, Array]:
    """Seconds and the answer."""
    start = perf_counter()
    answer = work()
    return perf_counter() - start, answer


def main() -> None:
    """Run all methods and print the table."""
    config = load(CONFIG, ["sweep.mesh_frequency.num=1000", "sweep.epsilon={start: 0.002, stop: 0.4, num: 200}"])
    omega = np.asarray(next(axis.values for axis in config.axes if axis.name == "mesh_frequency"), dtype=float)
    rows = np.arange(200)
    system = build(config.at({"epsilon": rows}))
    single = [build(config.at({"epsilon": np.array(k)})) for k in rows]

    def loop(method: Callable[[GearSystem, Array], Array], step: int, every: int) -> Callable[[], Array]:
        return lambda: np.stack([method(s, omega[::every]) for s in single[::step]])

    methods: dict[str, tuple[Callable[[], Array], int, int]] = {
        "gearstab": (lambda: solve(system, omega).stable == 1, 1, 1),
        "batched numpy.linalg.eigvals": (loop(batched, 1, 1), 1, 1),
        "products of scipy.linalg.expm": (loop(exponentials, 40, 50), 40, 50),
        "DOP853, broken at the jumps": (loop(integrated, 100, 100), 100, 100),
    }

    seconds: dict[str, list[float]] = {name: [] for name in methods}
    answers: dict[str, Array] = {}
    for _ in range(5):
        for name, (work, _, _) in methods.items():
            took, answers[name] = timed(work)
            seconds[name].append(took)

    reference = answers[next(iter(methods))]
    rate = {name: answers[name].size / median(seconds[name]) for name in methods}
    table = Table(title="Fig. 3, 1000 mesh frequencies x 200 amplitudes; medians of 5 runs")
    for heading in ("method", "points", "points/s", "x eigvals", "flags that differ"):
        table.add_column(heading, justify="left" if heading == "method" else "right", no_wrap=True)
    for name, (_, step, every) in methods.items():
        differ = int(np.sum(answers[name] != reference[::step, ::every]))
        ratio = rate[name] / rate["batched numpy.linalg.eigvals"]
        table.add_row(name, f"{answers[name].size}", f"{rate[name]:.3g}", f"{ratio:.3g}", f"{differ}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
