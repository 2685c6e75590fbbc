"""Two-stage gear trains with three or four gears (Lin & Parker 2002, Fig. 1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import GearSystem
from gearstab.systems import assembly


def build(p: dict[str, Any]) -> GearSystem:
    """Three rotations measured along the lines of action, an input shaft and two meshes.

        M = diag(m1, m2, m3),  K0 = diag(k0, 0, 0),  g_1 = (1, 1, 0),  g_2 = (0, 1, 1)

    Parameters: ``inertias`` m1..m3, ``input_shaft_stiffness`` k0, ``tooth_ratio`` R = Z2/Z4 = Omega_1/Omega_2 (a
    Fraction; 1 for three gears), ``meshes``; ``phasing`` h of the second mesh is a *lead* by h of its own period;
    ``load``: constant forces, one a coordinate.

    Source: Lin & Parker 2002, (1), (2) and section 3.2.
    """
    first, second = p["meshes"]
    stiffness = assembly.diagonal([p["input_shaft_stiffness"], 0.0, 0.0])
    phasing = np.asarray(second.get("phasing", 0.0), dtype=float)
    meshes = (
        assembly.mesh(first, np.array([1.0, 1.0, 0.0])),
        assembly.mesh(second, np.array([0.0, 1.0, 1.0]), frequency_ratio=1 / p["tooth_ratio"], lag=-phasing),
    )
    system = GearSystem(assembly.diagonal(p["inertias"]), stiffness, meshes, coordinates=("x1", "x2", "x3"))
    return assembly.driven(assembly.damped(system, p), p)
