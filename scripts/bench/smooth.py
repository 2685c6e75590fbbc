"""Smooth mesh stiffness: how much faster than DOP853 the Magnus steps are at an equal measured error.

Both are given several tolerances; the CPU time per point that an error of 1e-6 takes is read off their curves: time
over the largest error of the growth per period at some points, against an integrator in extended precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bench.measuring import show, turns
from bench.scenes import CONFIGS
from gearstab.bench import reference
from gearstab.bench.methods import integration, periods
from gearstab.bench.scene import Scene
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.system import Array
from gearstab.systems import build

WAVEFORMS = CONFIGS / "waveforms"
SCENES = {"four harmonics": WAVEFORMS / "harmonics.yaml", "trapezoid": WAVEFORMS / "trapezoidal.yaml"}
ERROR = 1e-6
CHECKED = 16
"""Mesh frequencies at which the errors are measured; DOP853 is timed on these."""
MAGNUS = 10.0 ** -np.arange(3.0, 7.0)
DOP853 = 10.0 ** -np.arange(4.0, 7.0, 0.5)
ROUNDS = 7
"""Number of rounds, of which the quickest counts; of single rows, which take milliseconds, six times as many."""


@dataclass(frozen=True)
class Setting:
    """A method with a tolerance: seconds per point, the least of all rounds, and the measured error."""

    seconds: float
    error: float


def magnus(scene: Scene, epsilon: Array, points: int, tolerance: float) -> Callable[[], Array]:
    """Growth a period at the checked mesh frequencies, from all points of a map; the scene is the middle row."""
    checked = scene.frequencies(CHECKED)
    omega = np.sort(np.concatenate([np.linspace(scene.start, scene.stop, points - CHECKED), checked]))
    system = replace(scene.system, meshes=tuple(replace(mesh, epsilon=epsilon) for mesh in scene.system.meshes))
    chosen = np.searchsorted(omega, checked)

    def work() -> Array:
        found = solve(system, omega, tolerance=tolerance)
        return found.growth_rate[len(epsilon) // 2, chosen] * periods(scene, checked)

    return work


def measured(works: list[tuple[Callable[[], Array], int]], truth: Array, rounds: int) -> list[Setting]:
    """(work, its number of points) for each setting, a repetition of each in turn."""
    seconds = turns([work for work, _ in works], rounds).min(axis=0) / [points for _, points in works]
    errors = [float(np.abs(work() - truth).max()) for work, _ in works]
    return [Setting(float(s), e) for s, e in zip(seconds, errors, strict=True)]


def seconds_at(settings: list[Setting]) -> float:
    """A point, for the error ERROR: the cheapest setting that is as accurate, or between it and a less accurate one."""
    enough = [setting for setting in settings if setting.error <= ERROR]
    best = min(setting.seconds for setting in enough)
    for more in enough:
        for less in (setting for setting in settings if setting.error > ERROR):
            share = np.log(ERROR / more.error) / np.log(less.error / more.error)
            best = min(best, more.seconds * float((less.seconds / more.seconds) ** share))
    return best


def main() -> None:
    """Measure and print the table."""
    rows_of_table = list[tuple[object, ...]]()
    for name, path in SCENES.items():
        config = load(path)
        axis = np.asarray(next(axis.values for axis in config.axes if axis.name == "mesh_frequency"), dtype=float)
        scene = Scene(build(config.system), float(axis.min()), float(axis.max()))
        middle = float(scene.system.meshes[0].epsilon)
        checked = scene.frequencies(CHECKED)
        truth = np.array([reference.growth(scene, omega) for omega in checked])

        def integrated(tolerance: float, scene: Scene = scene, checked: Array = checked) -> Callable[[], Array]:
            return lambda: integration("DOP853", True)(scene, checked, tolerance)

        slow = seconds_at(measured([(integrated(t), CHECKED) for t in DOP853], truth, ROUNDS))
        for rows, points in ((40, 1024), (1, 4000)):
            epsilon = np.linspace(middle - 0.1, middle + 0.1, rows + 1)[:rows] if rows > 1 else np.array([middle])
            works = [(magnus(scene, epsilon, points, t), rows * points) for t in MAGNUS]
            fast = seconds_at(measured(works, truth, ROUNDS if rows > 1 else 6 * ROUNDS))
            rows_of_table.append((name, f"{rows} x {points}", 1e6 * fast, 1e3 * slow, f"{slow / fast:.0f}"))
    show(
        f"CPU time per point for an error of {ERROR:.0e} in the growth per period, one core",
        ("wave", "points", "Magnus, us", "DOP853, ms", "times faster"), rows_of_table,
    )  # fmt: skip
