"""Regions against flags: what the tests of the instability boundaries share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries
from gearstab.system import GearSystem


def inside(found: Boundaries, row: int, omega: np.ndarray) -> np.ndarray:
    """Which mesh frequencies lie in a region of a row."""
    mine = found.row == row
    low, high = found.lower[mine], found.upper[mine]
    return ((omega[:, None] > low) & (omega[:, None] < high)).any(axis=1)


def near_edge(found: Boundaries, row: int, omega: np.ndarray, distance: float) -> np.ndarray:
    """Which mesh frequencies are within a relative distance of an edge."""
    mine = found.row == row
    edges = np.concatenate([found.lower[mine], found.upper[mine]])
    return (np.abs(omega[:, None] / edges - 1) < distance).any(axis=1)


def disagreements(found: Boundaries, system: GearSystem, start: float, stop: float, points: int) -> Mapping[int, list]:
    """Raster points, uniform in the period, whose flag is not that of the regions; none at all where empty."""
    omega = 1 / np.linspace(1 / stop, 1 / start, points + 2)[1:-1]
    stable = solve(system, omega).stable
    result = {}
    for row in range(found.rows):
        wrong = inside(found, row, omega) == (stable[row] == 1)
        wrong &= ~near_edge(found, row, omega, 1e-9)
        if wrong.any():
            result[row] = omega[wrong].tolist()
    return result
