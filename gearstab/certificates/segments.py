"""The segments of constant matrices of a gear system, as certificates are about them."""

from __future__ import annotations

import numpy as np

from gearstab.certificates.equations import Segments
from gearstab.modal import mean_modes
from gearstab.propagation.schedule import schedule
from gearstab.system import Array, GearSystem


def segments(system: GearSystem) -> list[Segments]:
    """Values of all rows of the flattened batch.

    Raises ValueError where something varies between jumps, and NotPossible where there is no common period.
    """
    if not system.piecewise_constant:
        raise ValueError("certificates are about systems that are constant between jumps")
    found, cycles = schedule(system), float(system.common_period()[0])
    values = found.values(found.edges[:, :-1] + 0.5 * found.lengths)
    modes, n = mean_modes(system), system.size
    rigid, shapes = system.flat(modes.rigid, 1) == 1, system.flat(modes.shapes, 2)
    base = [np.zeros((n, n)) if part is None else part for part in (system.mass, system.damping, system.stiffness)]
    mass, damping, stiffness = (system.flat(part, 2) for part in base)
    parts = [(False, system.flat(mesh.outer, 2)) for mesh in system.meshes]
    for term in system.terms:
        outer = system.flat(np.asarray(term.left)[..., :, None] * np.asarray(term.right)[..., None, :], 2)
        parts += [(profile is term.damping, outer) for profile in term.profiles]
    result = []
    for row in range(system.rows):
        there = found.lengths[row] > 0
        distinct, states = np.unique(values[row, there], axis=0, return_inverse=True)
        c, k = np.array([damping[row]] * len(distinct)), np.array([stiffness[row]] * len(distinct))
        for j, (on_velocity, outer) in enumerate(parts):
            (c if on_velocity else k)[...] += distinct[:, j, None, None] * outer[row]
        still = rigid[row] & _unfelt(k, shapes[row])
        fractions = found.lengths[row, there].tolist()
        result.append(Segments(mass[row], c, k, np.ravel(states).tolist(), fractions, cycles, shapes[row][:, still]))
    return result


def _unfelt(stiffness: Array, shapes: Array) -> Array:
    """Which modes no stiffness of any segment feels: terms may hold what no mesh does."""
    force = np.abs(stiffness @ shapes).max(axis=(0, 1))
    return np.asarray(force <= 1e-9 * (np.abs(stiffness) @ np.abs(shapes)).max(axis=(0, 1)))
