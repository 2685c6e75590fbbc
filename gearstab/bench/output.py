"""Benchmark results as a table of text and as the group ``/bench`` of a result file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearstab.bench.scene import Scene
from gearstab.bench.work_precision import Measurement
from gearstab.results import Group, fields_of
from gearstab.results.variables import BENCH


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
