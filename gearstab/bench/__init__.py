"""Speed against error: every way to compute stability that fits a scene, measured side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from gearstab.bench import reference
from gearstab.bench.methods import METHODS, Entry
from gearstab.bench.scene import Scene, without_rigid_modes
from gearstab.results import Group, fields_of
from gearstab.results.variables import BENCH
from gearstab.system import Array

__all__ = ["Measurement", "Scene", "measure", "without_rigid_modes"]


BATCH = (4096, 65536)
"""Mesh frequencies on which methods that treat many at once are timed: the larger number if they are quick."""
QUICK = 0.02
"""Seconds for the smaller batch below which the larger is taken, so that a call's own cost does not count."""


@dataclass(frozen=True)
class Measurement:
    """One method with one tolerance.

    seconds: median processor time per point, on which other programs have little influence.  error: the largest
    |growth - reference| over the reference points, growth being ln max |lambda| over one common period.  wrong: how
    many of these points get the wrong stability flag, taking a growth above FLAG as unstable.
    """

    method: str
    tolerance: float
    seconds: float
    error: float
    wrong: int


MOST_RUNS = 15
FLAG = 1e-6
"""Integrators cannot tell a growth smaller than their error from none; they are given this much."""


def measure(
    scene: Scene, points: int = 8, budget: float = 1.0, progress: Callable[[str], None] = lambda text: None
) -> list[Measurement]:
    """All methods of the table on one scene.

    Parameters
    ----------
    points: reference points, spread over the scene's range of mesh frequencies.
    budget: seconds to spend on timing each setting, at least one run.
    progress: is told what is going on.
    """
    omega = scene.frequencies(points)
    progress("reference")
    truth = np.array([reference.growth(scene, value) for value in omega])
    found = []
    for entry in METHODS:
        if not entry.fits(scene):
            continue
        for tolerance in entry.tolerances:
            progress(entry.name if np.isnan(tolerance) else f"{entry.name}, {tolerance:.0e}")
            found.append(_measure(entry, tolerance, scene, omega, truth, budget))
    return found


def _measure(entry: Entry, tolerance: float, scene: Scene, omega: Array, truth: Array, budget: float) -> Measurement:
    growth = entry.run(scene, omega, tolerance)
    error = float(np.max(np.abs(growth - truth)))
    wrong = int(np.sum((growth > FLAG) != (truth > FLAG)))
    sample = omega
    if entry.batch:
        sample = np.linspace(scene.start, scene.stop, BATCH[0])
        if _timed(entry, scene, sample, tolerance) < QUICK:
            sample = np.linspace(scene.start, scene.stop, BATCH[1])
    times: list[float] = []
    while not times or (sum(times) < budget and len(times) < MOST_RUNS):
        times.append(_timed(entry, scene, sample, tolerance))
    return Measurement(entry.name, tolerance, float(np.median(times)) / len(sample), error, wrong)


def _timed(entry: Entry, scene: Scene, omega: Array, tolerance: float) -> float:
    """Seconds of a run; of several where the clock does not tick within one."""
    start, runs, seconds = process_time(), 0, 0.0
    while seconds <= 0.0:
        entry.run(scene, omega, tolerance)
        runs, seconds = runs + 1, process_time() - start
    return seconds / runs


def bench_group(scene: Scene, points: int, found: Sequence[Measurement]) -> Group:
    """The group ``/bench``."""
    values = {
        "method": [m.method for m in found],
        "tolerance": np.array([m.tolerance for m in found]),
        "seconds": np.array([m.seconds for m in found]),
        "error": np.array([m.error for m in found]),
        "wrong_flags": np.array([m.wrong for m in found]),
    }
    attributes = {
        "coordinates_of_the_system": scene.system.size,
        "segments": len(scene.segments),
        "reference_points": points,
        "mesh_frequency_range": [scene.start, scene.stop],
    }
    return Group(fields_of(BENCH, values), attributes)


def table(found: Sequence[Measurement], points: int) -> str:
    """One line per setting: points per second, the ratio to the fastest, the error, wrong flags."""
    fastest = min(m.seconds for m in found)
    lines = [f"{'method':<26}{'rtol':>8}{'points/s':>12}{'times slower':>14}{'error':>11}{'wrong flags':>14}"]
    for m in found:
        tolerance = "exact" if np.isnan(m.tolerance) else f"{m.tolerance:.0e}"
        ratio = f"{m.seconds / fastest:.1f}" if m.seconds < 100 * fastest else f"{m.seconds / fastest:,.0f}"
        flags = f"{m.wrong} of {points}"
        lines.append(f"{m.method:<26}{tolerance:>8}{1 / m.seconds:>12,.0f}{ratio:>14}{m.error:>11.1e}{flags:>14}")
    return "\n".join(lines)
