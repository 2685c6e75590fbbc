"""Forces of bearings and torques of shafts in steady states, F = k r q + c r q'."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.interrupts import heed
from gearstab.propagation.intervals import SteadyPoints
from gearstab.response.linear.steady import SteadyStart
from gearstab.response.measures.extremes import CURVES, extremes
from gearstab.response.measures.panels import Readings, readings
from gearstab.system import Array, GearSystem

HARMONICS = 4
"""Harmonics of each mesh frequency that are followed."""


@dataclass(frozen=True)
class ConnectionForces:
    """Measures of the forces of connections at K operating points.

    peak, mean, rms: ``(K, C)``, largest magnitude, mean and root mean square about it.
    harmonic: ``(K, O, C)``, amplitudes at the orders of :func:`orders`.
    """

    peak: Array
    mean: Array
    rms: Array
    harmonic: Array

    @classmethod
    def empty(cls, system: GearSystem, shape: tuple[int, ...]) -> ConnectionForces:
        """Return NaN for points of a shape in place of K."""
        count = len(system.connections)
        peak, mean, rms = np.full((3, *shape, count), np.nan)
        return cls(peak, mean, rms, np.full((*shape, len(orders(system)), count), np.nan))

    def put(self, row: Array, column: Array, found: ConnectionForces, failed: Array) -> None:
        """Write what was found at some points, but for those that failed."""
        for name, table in vars(self).items():
            values = getattr(found, name)
            values[failed] = np.nan
            table[row, column] = values


def orders(system: GearSystem) -> list[float]:
    """Multiples of the mesh frequency Omega at which meshes excite: the first harmonics of each, in ascending order."""
    ratios = {mesh.frequency_ratio for mesh in system.meshes}
    return sorted({float(s * ratio) for ratio in ratios for s in range(1, HARMONICS + 1)})


def forces(system: GearSystem, begin: SteadyStart, panels: float) -> ConnectionForces:
    """Measures of a steady state; panels: about so many in a common period.

    Forces are exact at the nodes of the panels, their derivatives those of the polynomial through deflections and
    rates; see :mod:`.panels` for integrals and extremes.
    """
    points, names = begin.points, system.connections
    rows = np.stack([system.flat(item.row, 1) for item in names], axis=1)[points.basis.rows]
    k, c = (np.stack([system.flat(getattr(item, what)) for item in names], axis=1)[points.basis.rows][points.at]
            for what in ("stiffness", "damping"))  # fmt: skip
    gauges = np.concatenate([rows @ points.basis.outlet, rows @ points.basis.speed], axis=1)
    cycles = np.array(orders(system)) * points.excitation.cycles
    low, high = np.full((len(begin.x), len(names)), np.inf), np.full((len(begin.x), len(names)), -np.inf)
    first, second = np.zeros((2, *low.shape))
    harmonic = np.zeros((len(begin.x), len(cycles), len(names)), dtype=complex)
    origin: Array | None = None
    with np.errstate(over="ignore", invalid="ignore"):
        for piece in readings(points, begin.x, gauges, panels):
            heed()
            force, rate = _force(points, piece, k, c)
            # Deviations from a value of the motion itself: a small fluctuation of a large force keeps its digits.
            origin = force[0, 0, 0] if origin is None else origin
            least, greatest, _ = extremes(force, rate)
            low, high = np.minimum(low, least.min(axis=0)), np.maximum(high, greatest.max(axis=0))
            first = first + piece.mean(force - origin)
            second = second + piece.mean((force - origin) ** 2)
            turns = np.exp(-2j * np.pi * piece.tau[..., None] * cycles)
            harmonic += 2 * piece.mean(turns[..., None] * force[..., None, :])
    assert origin is not None
    rms = np.sqrt(np.maximum(second - first**2, 0.0))
    return ConnectionForces(np.maximum(np.abs(low), np.abs(high)), origin + first, rms, np.abs(harmonic))


def _force(points: SteadyPoints, piece: Readings, k: Array, c: Array) -> tuple[Array, Array]:
    """F and its derivative times the length of a panel, ``(panels, 5, Q, K, C)``."""
    deflection, speed = np.split(piece.values, 2, axis=-1)
    period = 2 * np.pi * points.excitation.cycles / points.omega
    duration = (piece.length * period)[..., None]
    rate = speed * duration
    curve = np.einsum("fj,pj...->pf...", CURVES, np.concatenate([deflection, rate], axis=1))
    return k * deflection + c * speed, k * rate + c * curve / duration
