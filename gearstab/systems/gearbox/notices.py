"""What is wrong with the teeth of a gearbox, as flags: one number for each mesh and entry of the batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import Array
from gearstab.systems.gearbox.teeth import OF_GEAR
from gearstab.systems.gearbox.train import Train

NOTICE_FLAGS = {
    "undercut": 1, "top_land": 2, "interference": 4, "fillet_contact": 8, "contact_ratio": 16, "tip_clearance": 32,
    "backlash": 64, "trochoid_interference": 128, "trimming": 256,
}  # fmt: skip
"""Bits by the names of :class:`gearstab.gears.Notice`."""

GEOMETRY = frozenset({*OF_GEAR, "teeth", "centre_distance"})
"""Parameters that the notices depend on, by their own names."""


def notice_flags(p: Any) -> Array:
    """Return ``(..., meshes)`` flags for the parameters of a gearbox, whose batch is that of its teeth."""
    found = [
        mesh.each(lambda pair: sum(NOTICE_FLAGS[name] for name in {notice.name for notice in pair.notices}))
        for mesh in (mesh.teeth for mesh in Train(p).meshes)
    ]
    return np.stack(np.broadcast_arrays(*found), axis=-1).astype(np.int16)
