"""Speed of the compiled kernel beside other ways to the same numbers; the figure for threads counts elapsed time."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np

from bench import scenes
from bench.measuring import Way, compare
from bench.others import expm_product, integrate, numpy_eigenvalues
from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.kernel import c_kernel, damped
from gearstab.floquet.kernel.decision import DOUBTFUL
from gearstab.floquet.segments.pattern import prepare
from gearstab.system import GearSystem

ROWS = 100
"""Rows of a small map: some milliseconds, so that processors that begin wide instructions slowly reach their speed."""


def train(ratio: str, rows: int, **damping: object) -> GearSystem:
    """Build the train for ``rows`` values of epsilon; 4 segments per period for R = 1, 16 for R = 3/5."""
    return scenes.train(ratio, np.linspace(0.01, 0.5, rows), (1.47, 1.64), 0.13, **damping)


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
    root, usual = scenes.CONFIGS.parent, ckernel.library
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
            (pattern,) = prepare(train("1", ROWS, damping={"modal": ratios}))
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
    """Time the two resolutions of a smooth wave that compare.py asks for."""
    rng = np.random.default_rng(1)
    fine = rng.normal(size=(40, 1024, 3)) + 0j
    coarse, least = fine + 1e-9, np.full(1024, 1e-13)

    def work() -> None:
        c_kernel.trace_change(fine, coarse, 1.5)
        c_kernel.trace_condition(fine[0], least)

    compare("moved traces, n = 3", [Way("compiled", fine[..., 0].size, work)], rounds)


def general_damping(rounds: int) -> None:
    """n = 3, unequal modal damping."""
    (pattern,) = prepare(train("1", ROWS, damping={"modal": [0.01, 0.02, 0.05]}))
    generator = damped.generators(pattern)
    omega = np.linspace(0.35, 7, 1000) / pattern.elastic.rate[:, None]
    ways = [
        Way("compiled", omega.size, lambda: c_kernel.scan_damped(pattern, generator, omega, 1)),
        Way("expm product", 20, lambda: expm_product(pattern, omega[0, ::50]), 1200),
    ]
    compare("n = 3, general damping, 4 segments", ways, rounds)


def strong_damping(rounds: int) -> None:
    """n = 3, 30 % of critical damping: all exponents, the smallest multipliers lost in an explicit product."""
    (pattern,) = prepare(train("1", 1, damping_ratio=0.3))
    generator = damped.generators(pattern)
    omega = np.geomspace(0.35, 7, 1600)[None] / pattern.elastic.rate[:, None]
    ways = [
        Way("compiled", omega.size, lambda: c_kernel.log_multipliers_damped(pattern, generator, omega, 1)),
    ]
    compare("n = 3, strong damping, all exponents", ways, rounds)


def many_coordinates(rounds: int) -> None:
    """n = 33, all multipliers."""
    (pattern,) = prepare(scenes.gearbox())
    omega = np.linspace(0.4, 5, 64) / pattern.elastic.rate[0]
    ways = [
        Way("compiled, all multipliers", 64, lambda: c_kernel.log_multipliers(pattern, omega[None], np.inf)),
        Way("NumPy product + eigvals", 16, lambda: numpy_eigenvalues(pattern, omega[::4]), 12),
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


def main(rounds: int = 9) -> None:
    """Print all comparisons."""
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
