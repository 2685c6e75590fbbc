"""Whole sweeps of a gear train over five axes beside the rate of the kernel alone, and workers beside the pool.

Processor time is counted, that of all processes of a command, as other work on the machine shows less in it; elapsed
time stands beside it. Needs the extra ``cluster``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import dask
import numpy as np
import psutil
from distributed import LocalCluster

from bench.measuring import show, turns
from bench.scenes import CONFIGS
from gearstab.config import load
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import prepare
from gearstab.floquet.stability import empty
from gearstab.sweep.cluster import SETTINGS
from gearstab.systems import build

CONFIG = CONFIGS / "lin_parker_2002" / "fig3.yaml"
LEAST, LARGEST = 5, 7
"""Powers of ten of the number of points; 8 only where it is asked for."""
ROUNDS = 3
"""Number of rounds; the fastest counts."""


@dataclass(frozen=True)
class Cost:
    """Seconds of all processors and of the clock, and the peak memory of the largest process in bytes."""

    processors: float
    clock: float
    memory: float


def changes(power: int) -> list[str]:
    """A grid of 10^power points: 1000 mesh frequencies, and 10^(power - 3) systems over four axes."""
    sizes = [10 ** ((power - 3 + k) // 4) for k in range(4)]
    axes = {
        "mesh_frequency": "{start: 0.35, stop: 7.0, num: 1000}",
        "input_shaft_stiffness": f"{{start: 0.4, stop: 0.6, num: {sizes[0]}}}",
        "meshes.first.epsilon": f"{{start: 0.1, stop: 0.5, num: {sizes[1]}}}",
        "meshes.second.epsilon": f"{{start: 0.1, stop: 0.5, num: {sizes[2]}}}",
        "meshes.second.phasing": f"{{start: 0.0, stop: 0.9, num: {sizes[3]}}}",
    }
    text = ", ".join(f"{name}: {values}" for name, values in axes.items())
    return [f"sweep={{{text}}}", "methods={floquet: {}}"]


def kernel_rate() -> tuple[float, float]:
    """Nanoseconds per point of the kernel alone on one core, over a block of a million points of the grid: for verdicts
    and growths per period, and for flags and growth rates in their places in a result, as a sweep calls it.
    """
    config = load(CONFIG, changes(6))
    axes = [axis for axis in config.axes if axis.name != "mesh_frequency"]
    index = np.unravel_index(np.arange(1000), [axis.size for axis in axes])
    rows = {axis.name: np.asarray(part) for axis, part in zip(axes, index, strict=True)}
    omega = np.linspace(0.35, 7.0, 1000)
    patterns = [block.pattern for whole in prepare(build(config.at(rows))) for block in split(whole)]
    own = [omega / pattern.elastic.rate[:, None] for pattern in patterns]
    into = empty(len(index[0]), len(omega))

    def scan() -> None:
        for pattern, frequencies in zip(patterns, own, strict=True):
            c_kernel.scan(pattern, frequencies, 1)

    def rates() -> None:
        for pattern in patterns:
            c_kernel.rates(pattern, omega, pattern.rows, into.stable, into.growth_rate, 1)

    scanned, rated = turns([scan, rates], ROUNDS).min(axis=0) * 1e9 / into.stable.size
    return scanned, rated


def own_processors() -> float:
    """Processor seconds of this process and of those that it started and that still run, as schedulers and workers."""
    running = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(used.user + used.system for used in (process.cpu_times() for process in running))


def sweep(power: int, out: Path, *options: str) -> Cost:
    """Run the whole command once; its processors are those of the command and of workers that this process started."""
    settings = [word for text in changes(power) for word in ("--set", text)]
    command = [sys.executable, "-m", "gearstab", "sweep", str(CONFIG), "-o", str(out), "-q", "--overwrite", "--yes"]
    start, others = time.perf_counter(), own_processors()
    process = subprocess.Popen([*command, *settings, *options])
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"the sweep of 10^{power} points ended with exit code {process.returncode}")
    processors = used.ru_utime + used.ru_stime + own_processors() - others
    return Cost(processors, time.perf_counter() - start, 1024.0 * used.ru_maxrss)


def fastest(power: int, out: Path, *options: str) -> Cost:
    """Run the whole command some times; the large ones once."""
    costs = [sweep(power, out, *options) for _ in range(ROUNDS if power < 8 else 1)]
    return Cost(*(min(getattr(cost, name) for cost in costs) for name in ("processors", "clock", "memory")))


@contextmanager
def workers() -> Iterator[str]:
    """Start two workers that are there before the clock runs; gives the address of their scheduler."""
    place = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": 50}
    with dask.config.set(SETTINGS), LocalCluster(n_workers=2, threads_per_worker=1, memory_limit=0, **place) as cluster:
        yield cluster.scheduler_address


def main(largest: int = LARGEST) -> None:
    """Print both tables."""
    alone, placed = kernel_rate()
    ways = f"{alone:.1f} ns per point on one core, {placed:.1f} with growth rates in their places"
    table = list[tuple[object, ...]]()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.h5"
        start = fastest(3, out, "-j", "2")
        for power in range(LEAST, largest + 1):
            cost = fastest(power, out, "-j", "2")
            each = (cost.processors - start.processors) * 1e9 / 10**power
            whole = cost.processors * 1e9 / 10**power
            ratios = f"{alone / whole:.2f} ({placed / whole:.2f})"
            table.append((f"10^{power}", cost.clock, cost.processors, each, ratios, cost.memory / 1e6))
        headings = ("points", "clock s", "processors s", "ns per point beyond start", "kernel / whole", "memory MB")
        show(f"Whole sweeps on two threads; the kernel alone: {ways}", headings, table)
        with workers() as address:
            begin = fastest(3, out, "--scheduler", address)
            away = fastest(largest, out, "--scheduler", address)
        here = fastest(largest, out, "-j", "2")
        own = fastest(largest, out, "--scheduler", "local", "-j", "2")
    beyond = (here.clock - start.clock) / (away.clock - begin.clock)
    print(f"10^{largest} points: two threads {here.clock:.2f} s, two workers that wait {away.clock:.2f} s, throughput "
          f"{here.clock / away.clock:.2f} of the threads', beyond the start of both commands {beyond:.2f}; "
          f"--scheduler local, which starts its workers, {own.clock:.2f} s, throughput {here.clock / own.clock:.2f}; "
          f"processor seconds, those of scheduler and workers included, {here.processors:.2f}, {away.processors:.2f}, "
          f"{own.processors:.2f}: by them {here.processors / away.processors:.2f} and "
          f"{here.processors / own.processors:.2f} of the threads' throughput")  # fmt: skip
