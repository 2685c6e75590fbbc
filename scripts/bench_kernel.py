"""Speed of the compiled kernel beside other ways to the same numbers: medians of one run, interleaved, on one core.

Single-core figures count processor time, so that other work on the machine shows less; the figure for threads counts
elapsed time. GEARSTAB_SIMD limits the vector instructions. Usage: python scripts/bench_kernel.py [ROUNDS]
"""

# ruff: noqa: E402 -- the environment is set before NumPy is imported

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # one core for everybody; read when NumPy is imported

import importlib.util
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.kernel import c_kernel, damped
from gearstab.floquet.kernel.invariants import DOUBTFUL
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import Array, GearSystem, Mesh
from gearstab.systems import build
from gearstab.waveforms import Rectangular

sys.path.append(str(Path(__file__).parent.parent / "tests" / "reference" / "kernel"))
import numpy_kernel

ACCURATE = 1e-10
"""Tolerance of DOP853 that leaves 1e-10..5e-9 on rho = lambda + 1/lambda of the train (Omega from 0.35 to 6.5)."""
ROWS = 100
"""Of a small map: some milliseconds, so that processors which begin wide instructions slowly are at their speed."""


@dataclass(frozen=True)
class Way:
    """One way to compute ``points`` points."""

    name: str
    points: int
    run: Callable[[], object]
    goal: float | None = None


def train(ratio: str, rows: int, damping: dict[str, object] | None = None) -> GearSystem:
    """Lin & Parker's gear train for ``rows`` values of epsilon; 4 segments per period for R = 1, 16 for R = 3/5."""
    epsilon = np.linspace(0.01, 0.5, rows)
    meshes = [
        {"name": "first", "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": 1.47},
        {"name": "second", "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": 1.64, "phasing": 0.13},
    ]
    scene = {
        "kind": "two_stage",
        "inertias": [1.0, 0.3, 4.0],
        "input_shaft_stiffness": 0.5,
        "tooth_ratio": Fraction(ratio),
        "meshes": meshes,
    }
    return build(scene | (damping or {}))


def gearbox() -> GearSystem:
    """33 coordinates, five meshes, ten segments."""
    n = 33
    rng = np.random.default_rng(n)
    difference = np.eye(n) - np.eye(n, k=-1)
    spring = difference.T @ np.diag(rng.uniform(0.5, 3.0, n)) @ difference
    meshes = tuple(
        Mesh(
            f"m{i}",
            np.eye(n)[p] - np.eye(n)[p - 1],
            np.array(2.0),
            np.array(0.3),
            Rectangular(1.2 + 0.17 * i),
            lag=0.13 * i,
        )
        for i, p in enumerate(np.linspace(1, n - 1, 5).astype(int))
    )
    return GearSystem(np.diag(rng.uniform(0.5, 2.0, n)), spring, meshes)


def generators(pattern: Pattern) -> Array:
    """``(D, 2n, 2n)`` of the first row."""
    return damped.generators(pattern).matrix[0]


def expm_product(pattern: Pattern, omega: Array) -> list[Array]:
    """scipy.linalg.expm per segment and point, the product, its eigenvalues."""
    a, durations = generators(pattern), pattern.durations(0, omega)
    found = []
    for k in range(len(omega)):
        product = np.eye(a.shape[-1])
        for s, state in enumerate(pattern.states):
            product = expm(a[state] * durations[s, k]) @ product
        found.append(np.linalg.eigvals(product))
    return found


def integrate(pattern: Pattern, omega: Array) -> list[Array]:
    """DOP853 over all 2n columns at once, begun afresh at every jump."""
    a, durations = generators(pattern), pattern.durations(0, omega)
    size = a.shape[-1]
    found = []
    for k in range(len(omega)):
        state = np.eye(size)
        jumps = np.append(0.0, np.cumsum(durations[:, k]))
        for (begin, end), which in zip(pairwise(jumps), pattern.states, strict=True):
            right = lambda _, y, m=a[which]: (m @ y.reshape(size, size)).ravel()  # noqa: E731
            done = solve_ivp(right, (begin, end), state.ravel(), method="DOP853", rtol=ACCURATE, atol=ACCURATE)
            state = done.y[:, -1].reshape(size, size)
        found.append(np.linalg.eigvals(state))
    return found


def numpy_eigenvalues(pattern: Pattern, omega: Array) -> Array:
    """Batched NumPy products, then numpy.linalg.eigvals."""
    return np.linalg.eigvals(numpy_kernel.monodromy(pattern, 0, omega)[0])


def compare(title: str, ways: list[Way], rounds: int, clock: Callable[[], float] = time.thread_time) -> list[float]:
    """Print microseconds per point of all ways and their ratios to the first; returns medians in seconds per point."""
    for way in ways:
        way.run()
    times: list[list[float]] = [[] for _ in ways]
    for _ in range(rounds):
        for way, record in zip(ways, times, strict=True):
            begin = clock()
            way.run()
            record.append((clock() - begin) / way.points)
    medians = [float(np.median(record)) for record in times]
    print(title)
    for way, median in zip(ways, medians, strict=True):
        goal = f"   (goal {way.goal:,.0f})" if way.goal else ""
        print(f"  {way.name:34} {1e6 * median:12.4f} us per point {median / medians[0]:12,.1f} x{goal}")
    return medians


def closed_form(ratio: str, goals: tuple[float | None, ...], rounds: int) -> None:
    """n = 3 without damping."""
    (pattern,) = prepare(train(ratio, ROWS))
    omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
    row = omega[0]
    ways = [
        Way("compiled", omega.size, lambda: c_kernel.scan(pattern, omega, 1)),
        Way("NumPy product + eigvals", row.size, lambda: numpy_eigenvalues(pattern, row), goals[0]),
        Way("expm product", 20, lambda: expm_product(pattern, row[::50]), goals[1]),
        Way("DOP853, broken at the jumps", 2, lambda: integrate(pattern, row[::500]), goals[2]),
    ]
    compare(f"n = 3, R = {ratio}, {len(pattern.states)} segments", ways, rounds)


def preparation(rounds: int) -> None:
    """Rows against the 1000 points of a row."""
    rows = 1000

    def rows_only() -> None:
        for pattern in prepare(train("1", rows)):
            c_kernel.pattern_arguments(pattern)

    (pattern,) = prepare(train("1", 50))
    omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
    ways = [
        Way("preparation of a row", rows, rows_only),
        Way("its 1000 points", len(omega), lambda: c_kernel.scan(pattern, omega, 1), 10),
    ]
    compare(f"preparation of {rows} rows (a 'point' is a row)", ways, rounds)


DAMPING = {
    "usual damping": [0.01, 0.02, 0.05],
    "hardly any damping": [1e-6, 2e-6, 5e-6],
    "heavy damping": [0.4, 0.6, 0.8],
}
"""Damping ratios of the three modes of the train."""


@contextmanager
def counting() -> Iterator[ModuleType]:
    """Use a kernel that counts the points that take each way, built for the purpose."""
    root, usual = Path(__file__).parent.parent, ckernel.library
    with tempfile.TemporaryDirectory() as folder:
        build_it = [sys.executable, "setup.py", "-q", "build", "--build-base", folder, "--build-lib", folder]
        flags = os.environ.get("GEARSTAB_CFLAGS", "") + " -O1 -DGEARSTAB_COUNT_PATHS"
        chosen = os.environ | {"GEARSTAB_CFLAGS": flags}
        subprocess.run(build_it, cwd=root, env=chosen, check=True, capture_output=True)
        (built,) = Path(folder).glob("gearstab/ckernel/_kernel*.so")
        spec = importlib.util.spec_from_file_location("gearstab.ckernel._kernel", built)
        assert spec is not None
        assert spec.loader is not None
        ckernel.library = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(ckernel.library)
        try:
            yield ckernel.library
        finally:
            ckernel.library = usual


def shares() -> None:
    """Which part of the points the fast ways take, and what they leave to the slow ones."""
    print("shares of the points of a map of 100 x 1000")
    with counting() as counter:
        for name, ratios in DAMPING.items():
            (pattern,) = prepare(train("1", ROWS, {"damping": {"modal": ratios}}))
            generator = damped.generators(pattern)
            omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
            counter.paths()
            c_kernel.scan_damped(pattern, generator, omega, 1)
            share(f"moduli.h, {name}", counter.paths(), omega.size, "squared", "squared twice", "left to QR")
        (pattern,) = prepare(train("1", ROWS))
        omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
        counter.paths()
        c_kernel.scan(pattern, omega, 1)
        share("stretches.h", counter.paths(), omega.size, "interpolated", "propagated")
        verdict, *_ = c_kernel.scan_traces(pattern, omega, True, 1)
        share("interpolation.h", counter.paths(), omega.size, "interpolated", "propagated")
        doubtful = int((verdict == DOUBTFUL).sum())
        counts = {"decided": omega.size - doubtful, "doubtful": doubtful}
        share("traces.h, n = 3", counts, omega.size, *counts)
    print()


def share(name: str, counts: dict[str, int], points: int, *ways: str) -> None:
    """Print one line of :func:`shares`."""
    print(f"  {name:34} " + ", ".join(f"{100 * counts[way] / points:.3f} % {way}" for way in ways))


def moved_traces(rounds: int) -> None:
    """What compare.py asks of two resolutions of a smooth wave."""
    rng = np.random.default_rng(1)
    fine = rng.normal(size=(40, 1024, 3)) + 0j
    coarse, least = fine + 1e-9, np.full(1024, 1e-13)

    def work() -> None:
        c_kernel.trace_change(fine, coarse, 1.5)
        c_kernel.trace_condition(fine[0], least)

    compare("moved traces, n = 3", [Way("compiled", fine[..., 0].size, work)], rounds)


def general_damping(rounds: int) -> None:
    """n = 3, unequal modal damping."""
    (pattern,) = prepare(train("1", ROWS, {"damping": {"modal": [0.01, 0.02, 0.05]}}))
    generator = damped.generators(pattern)
    omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
    ways = [
        Way("compiled", omega.size, lambda: c_kernel.scan_damped(pattern, generator, omega, 1)),
        Way("expm product", 20, lambda: expm_product(pattern, omega[0, ::50]), 1200),
    ]
    compare("n = 3, general damping, 4 segments", ways, rounds)


def strong_damping(rounds: int) -> None:
    """n = 3, 30 % of critical damping: all exponents, the smallest multipliers lost in an explicit product."""
    (pattern,) = prepare(train("1", 1, {"damping_ratio": 0.3}))
    generator = damped.generators(pattern)
    omega = np.geomspace(0.35, 7, 1600)[None] / pattern.elastic.rate[:, None]
    ways = [
        Way("compiled", omega.size, lambda: c_kernel.log_multipliers_damped(pattern, generator, omega, 1)),
    ]
    compare("n = 3, strong damping, all exponents", ways, rounds)


def many_coordinates(rounds: int) -> None:
    """n = 33, all multipliers."""
    (pattern,) = prepare(gearbox())
    omega = np.linspace(0.4, 5, 64) / pattern.elastic.rate[0]
    ways = [
        Way("compiled, all multipliers", 64, lambda: c_kernel.log_multipliers(pattern, omega[None], np.inf)),
        Way("NumPy product + eigvals", 16, lambda: numpy_eigenvalues(pattern, omega[::4]), 4),
        Way("DOP853, broken at the jumps", 1, lambda: integrate(pattern, omega[31:32]), 40),
    ]
    compare(f"n = 33, five meshes, {len(pattern.states)} segments", ways, max(3, rounds // 3))


def threads(rounds: int) -> None:
    """Two threads against one, elapsed time of some tenths of a second each."""
    (pattern,) = prepare(train("3/5", 1500))
    omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
    ways = [
        Way("two threads", omega.size, lambda: c_kernel.scan(pattern, omega, 2)),
        Way("one thread", omega.size, lambda: c_kernel.scan(pattern, omega, 1), 1.7),
    ]
    compare("threads (elapsed time)", ways, rounds, time.perf_counter)


def whole_map(rounds: int) -> None:
    """solve() on a map against the kernel's own part of it."""
    system, axis = train("1", 500), np.linspace(0.35, 7, 2000)
    (pattern,) = prepare(system)
    omega = axis / pattern.elastic.rate[:, None]
    ways = [
        Way("scan alone", omega.size, lambda: c_kernel.scan(pattern, omega, 1)),
        Way("floquet.solve", omega.size, lambda: solve(system, axis)),
    ]
    compare("a map of 500 x 2000 points", ways, rounds)


def main() -> None:
    """All comparisons."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    os.environ["GEARSTAB_THREADS"] = "1"
    print(f"vector instructions: {ckernel.simd()}; medians of {rounds} rounds\n")
    closed_form("1", (100, 2000, 40000), rounds)
    closed_form("3/5", (75, None, None), rounds)
    preparation(rounds)
    general_damping(rounds)
    strong_damping(rounds)
    many_coordinates(rounds)
    whole_map(rounds)
    moved_traces(rounds)
    threads(rounds)
    shares()


if __name__ == "__main__":
    main()
