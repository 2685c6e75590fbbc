"""A gear pair on rigid shafts: one degree of freedom, the dynamic transmission error."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import GearSystem
from gearstab.systems import assembly


def build(p: dict[str, Any]) -> GearSystem:
    """m x'' + c x' + k(t) x = f(t).

    Parameters: ``equivalent_mass`` m (kg), one mesh, damping. x is the deflection along the line of action.
    """
    mass = np.asarray(p["equivalent_mass"], dtype=float)[..., None, None]
    mesh = assembly.mesh(p["meshes"][0], np.ones(1))
    system = GearSystem(mass, np.zeros((1, 1)), (mesh,), coordinates=("x",))
    return assembly.driven(assembly.damped(system, p), p)
