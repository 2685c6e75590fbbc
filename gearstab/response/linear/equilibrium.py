"""The static equilibrium under the constant load, at the mean mesh stiffness."""

from __future__ import annotations

import numpy as np

from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem, of_wholes


def static_equilibrium(system: GearSystem) -> Array:
    """q ``(..., n)`` with (K0 + sum k_gi g_i g_i^T) q = f0, the part of f0 that rigid-body modes take up left out.

    Terms of K(t) besides the meshes (friction) and mean forces of other shapes play no part. NaN where the mean
    stiffness is negative or zero along a mode.
    """
    if system.load is None:
        return np.zeros((*system.batch, system.size))
    modes = mean_modes(system)
    force = np.einsum("...np,...n->...p", modes.shapes, system.load)
    squared = modes.squared_frequency
    inverse = np.where(squared > 0, 1 / np.where(squared > 0, squared, 1.0), np.where(modes.rigid, 0.0, np.nan))
    return np.einsum("...np,...p->...n", modes.shapes, inverse * force)


def static_mesh_force(system: GearSystem) -> Array:
    """k_gi g_i^T q of the static equilibrium, ``(..., meshes)``, of whole meshes."""
    q = static_equilibrium(system)
    forces = [mesh.mean_stiffness * np.einsum("...n,...n->...", mesh.direction, q) for mesh in system.meshes]
    return of_wholes(np.stack(np.broadcast_arrays(*forces), axis=-1), system.wholes)
