"""Windows of time over mesh stiffness that is not piecewise constant, cut into Magnus steps.

Between the jumps and kinks of all meshes the window is cut into steps of about equal length; each is a product of a few
exponentials, which are segments of constant stiffness (:mod:`~gearstab.floquet.smooth.schemes`), so that vectors are
carried through them as through any others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.segments.pattern import CONSTANT, PROBES, SHORTEST, Pattern
from gearstab.floquet.segments.reduction import Elastic, reduce
from gearstab.floquet.smooth.schemes import CF6_5
from gearstab.system import Array, GearSystem, Mesh


@dataclass(frozen=True)
class Window:
    """One row of a system over ``cycles`` periods 2 pi/Omega from t = 0.

    row: position in the flattened batch. elastic: its reduced coordinates. start, length ``(Q,)``: of the pieces, in
    periods 2 pi/Omega. constant ``(Q,)`` bool.
    """

    system: GearSystem
    row: int
    elastic: Elastic
    cycles: float
    start: Array
    length: Array
    constant: Array

    def pattern(self, steps: int) -> Pattern:
        """With about so many steps a period of the fastest mesh."""
        density = steps * max(float(mesh.frequency_ratio) for mesh in self.system.meshes)
        counts = np.where(self.constant, 1, np.ceil(density * self.length)).astype(int)
        piece = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
        length = self.length[piece] / counts[piece]
        start = self.start[piece] + number * length
        known = stiffness(self.system, self.row, start[:, None] + length[:, None] * CF6_5.nodes)
        levels = np.einsum("ij,sjm->sim", CF6_5.mixture, known)
        still = self.constant[piece]
        levels[still] = known[still, 1, None]
        durations = length[:, None] * np.where(still[:, None], 1.0, CF6_5.durations) / self.cycles
        kept = ~still[:, None] | (np.arange(CF6_5.exponentials) == 0)
        fractions, levels = durations[kept][None], levels[kept][None]
        states, begin = np.arange(fractions.shape[1]), np.zeros(1)
        every = self.elastic.stiffness_of(levels)
        row = np.array([self.row])
        return Pattern(row, self.cycles, fractions, begin, states, levels, self.elastic, every, closed=False)


def windows(system: GearSystem, cycles: float) -> Iterator[Window]:
    """Every row once."""
    for elastic in reduce(system):
        for k, row in enumerate(elastic.rows):
            edges = _edges(system, int(row), cycles)
            length = np.diff(edges)
            start, length = edges[:-1][length > SHORTEST * cycles], length[length > SHORTEST * cycles]
            known = stiffness(system, int(row), start[:, None] + length[:, None] * PROBES)
            constant = np.all(np.ptp(known, axis=1) <= CONSTANT * np.abs(known).max(axis=1), axis=-1)
            yield Window(system, int(row), elastic.subset(np.array([k])), cycles, start, length, constant)


def _edges(system: GearSystem, row: int, cycles: float) -> Array:
    """``(Q + 1,)``, jumps and kinks of all meshes from 0 to ``cycles``."""
    found = [np.array([0.0, cycles])]
    for mesh in system.meshes:
        every = mesh.waveform.breakpoints()
        points = system.flat(every, 1)[row]
        points, ratio = points + system.flat(mesh.lag)[row], float(mesh.frequency_ratio)
        if len(points) and system.flat(mesh.epsilon)[row] != 0:
            turns = np.arange(np.floor(-points.max()), np.ceil(ratio * cycles - points.min()) + 1)
            found.append(((points[:, None] + turns) / ratio).ravel())
    edges = np.concatenate(found)
    return np.unique(edges[(edges >= 0) & (edges <= cycles)])


def stiffness(system: GearSystem, row: int, place: Array) -> Array:
    """``(..., meshes)``, the mesh stiffnesses of one row at the places ``(...)`` in periods 2 pi/Omega."""
    return np.stack([_mesh_stiffness(system, mesh, row, place) for mesh in system.meshes], axis=-1)


def _mesh_stiffness(system: GearSystem, mesh: Mesh, row: int, place: Array) -> Array:
    x = float(mesh.frequency_ratio) * place.ravel() - system.flat(mesh.lag)[row]
    if mesh.waveform.batch == ():
        value = mesh.waveform.value(x)
    else:
        every = np.broadcast_to(x.reshape(-1, *(1,) * len(system.batch)), (len(x), *system.batch))
        value = mesh.waveform.value(every).reshape(len(x), -1)[:, row]
    mean, amplitude = (system.flat(part)[row] for part in (mesh.mean_stiffness, mesh.amplitude))
    return (mean + 2 * amplitude * value).reshape(place.shape)
