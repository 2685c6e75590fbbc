"""Forces of bearings and torques of shafts in steady states, F = k r q + c r q'."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.response.linear.steady import SteadyStart
from gearstab.response.measures.extremes import CURVES, extremes
from gearstab.response.measures.panels import Readings
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


class ForceMeter:
    """Measures of the forces of connections, from one part of the common period after the other.

    Forces are exact at the nodes of the panels, their derivatives those of the polynomial through deflections and
    rates; see :mod:`.panels` for integrals and extremes.
    """

    def __init__(self, system: GearSystem, begin: SteadyStart) -> None:
        points, names = begin.points, system.connections
        rows = np.stack([system.flat(item.row, 1) for item in names], axis=1)[points.basis.rows]
        stiffness, damping = (
            np.stack([system.flat(getattr(item, what)) for item in names], axis=1) for what in ("stiffness", "damping")
        )
        self.k, self.c = (part[points.basis.rows][points.at] for part in (stiffness, damping))
        self.gauges = np.concatenate([rows @ points.basis.outlet, rows @ points.basis.speed], axis=1)
        """``(r, 2 C, m)``, deflections of the connections and their derivatives with respect to time from x."""
        self.period = 2 * np.pi * points.excitation.cycles / points.omega
        self.cycles = np.array(orders(system)) * points.excitation.cycles
        shape = (len(begin.x), len(names))
        self.low, self.high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self.first, self.second = np.zeros((2, *shape))
        self.harmonic = np.zeros((len(begin.x), len(self.cycles), len(names)), dtype=complex)
        self.origin: Array | None = None

    def add(self, piece: Readings) -> None:
        """Take a part of the common period into account."""
        force, rate = self._force(piece)
        # Deviations from a value of the motion itself: a small fluctuation of a large force keeps its digits.
        self.origin = force[0, 0, 0] if self.origin is None else self.origin
        least, greatest, _ = extremes(force, rate)
        self.low, self.high = np.minimum(self.low, least.min(axis=0)), np.maximum(self.high, greatest.max(axis=0))
        self.first = self.first + piece.mean(force - self.origin)
        self.second = self.second + piece.mean((force - self.origin) ** 2)
        turns = np.exp(-2j * np.pi * piece.tau[..., None] * self.cycles)
        self.harmonic += 2 * piece.mean(turns[..., None] * force[..., None, :])

    def found(self) -> ConnectionForces:
        """Return the measures of the whole period."""
        assert self.origin is not None
        rms = np.sqrt(np.maximum(self.second - self.first**2, 0.0))
        peak = np.maximum(np.abs(self.low), np.abs(self.high))
        return ConnectionForces(peak, self.origin + self.first, rms, np.abs(self.harmonic))

    def _force(self, piece: Readings) -> tuple[Array, Array]:
        """F and its derivative times the length of a panel, ``(panels, 5, Q, K, C)``."""
        deflection, speed = np.split(piece.values, 2, axis=-1)
        duration = (piece.length * self.period)[..., None]
        rate = speed * duration
        curve = np.einsum("fj,pj...->pf...", CURVES, np.concatenate([deflection, rate], axis=1))
        return self.k * deflection + self.c * speed, self.k * rate + self.c * curve / duration
