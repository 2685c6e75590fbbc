"""When a mesh has the fewest pairs of teeth in contact, and how many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class Contact:
    """Values of all meshes, ``(rows, meshes)`` each; NaN for waves of which the contact ratio c is not known.

    begin: phase from which on the fewest pairs carry, until the end of the mesh period: c - floor(c).
    pairs: how many these are, floor(c).
    lag: of the phase.
    """

    begin: Array
    pairs: Array
    lag: Array

    def fewest(self, phase: Array) -> Array:
        """Whether the fewest pairs carry at phases ``(..., rows, meshes)`` of the unlagged mesh cycle."""
        own = phase - self.lag
        return np.asarray(own - np.floor(own) >= self.begin)


def contact(system: GearSystem) -> Contact:
    """Return the pairs in contact of the meshes of a system of any batch."""
    waves = [mesh.waveform for mesh in system.whole_meshes]
    ratios = [getattr(wave, "total_contact_ratio", getattr(wave, "contact_ratio", None)) for wave in waves]
    c = np.stack([system.flat(np.nan if ratio is None else ratio, 0) for ratio in ratios], axis=-1)
    lag = np.stack([system.flat(mesh.lag, 0) for mesh in system.whole_meshes], axis=-1)
    return Contact(c - np.floor(c), np.floor(c), lag)
