"""A scene of a benchmark: one system and its mesh frequencies, with its segments as plain numbers.

The segments are made here once more and independently of :mod:`gearstab.floquet`, so that the methods that are compared
with it do not inherit its errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem

COUPLED = 1e-12
"""Damping between rigid-body and elastic modes below this part of the largest is rounding."""


@dataclass(frozen=True)
class Scene:
    """One system (no batch) and the range of mesh frequencies (rad per unit time) it is looked at."""

    system: GearSystem
    start: float
    stop: float

    @cached_property
    def segments(self) -> list[tuple[float, tuple[float, ...]]]:
        """(duration in periods 2 pi/Omega of the first mesh, stiffness of each mesh), over one common period."""
        cycles, counts = self.system.common_period()
        edges = {0.0, 1.0}
        for mesh, count in zip(self.system.meshes, counts, strict=True):
            for point in np.ravel(mesh.waveform.breakpoints()):
                edges |= {float((point + mesh.lag + k) / count) % 1.0 for k in range(count)}
        result = []
        for a, b in pairwise(sorted(edges)):
            phases = [
                count * 0.5 * (a + b) - float(mesh.lag) for mesh, count in zip(self.system.meshes, counts, strict=True)
            ]
            levels = tuple(
                float(mesh.mean_stiffness + 2 * mesh.amplitude * mesh.waveform.value(np.asarray(x)))
                for mesh, x in zip(self.system.meshes, phases, strict=True)
            )
            result.append((float(cycles) * (b - a), levels))
        return result

    @property
    def cycles(self) -> float:
        """Common period in periods of the first mesh."""
        return float(self.system.common_period()[0])

    def generator(self, levels: tuple[float, ...]) -> Array:
        """A of (q, q')' = A (q, q'), ``(2n, 2n)``, with the mesh stiffnesses ``levels``."""
        system, n = self.system, self.system.size
        inverse = np.linalg.inv(system.mass)
        damping = np.zeros((n, n)) if system.damping is None else inverse @ system.damping
        stiffness = inverse @ system.stiffness_matrix([np.asarray(level) for level in levels])
        return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])

    def frequencies(self, count: int) -> Array:
        """``count`` mesh frequencies spread over the range, none of them a round number."""
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        return self.start + (self.stop - self.start) * ((np.arange(count) + 0.5) * golden % 1.0)


def without_rigid_modes(system: GearSystem) -> GearSystem:
    """The system (no batch) in its elastic modes, q = Phi_e u.

    Rigid-body modes take no part in stability, but their defective multiplier 1 would: the largest in a stable system,
    and known to eight digits only. They stay where damping couples them to the elastic modes.
    """
    modes = mean_modes(system)
    if not modes.rigid.any():
        return system
    elastic, damping = modes.shapes[:, ~modes.rigid], system.damping
    if damping is not None:
        modal = np.abs(modes.shapes.T @ damping @ modes.shapes)
        if modal[modes.rigid].max() > COUPLED * modal.max():
            return system
        damping = elastic.T @ damping @ elastic
    return replace(
        system,
        mass=elastic.T @ system.mass @ elastic,
        stiffness=elastic.T @ system.stiffness @ elastic,
        damping=damping,
        meshes=tuple(replace(mesh, direction=elastic.T @ mesh.direction) for mesh in system.meshes),
        coordinates=tuple(f"u{p + 1}" for p in range(elastic.shape[1])),
    )
