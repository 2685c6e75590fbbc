"""Any linear model from elsewhere: matrices and one direction vector a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import GearSystem
from gearstab.systems import assembly
from gearstab.systems.terms import periodic_terms


def build(p: dict[str, Any]) -> GearSystem:
    """M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = f(t).

    Parameters: ``mass``, ``stiffness`` (K0, without meshes) as nested numbers or arrays, damping, ``meshes`` with
    ``direction`` g_i, ``frequency_ratio`` Omega_i/Omega (a Fraction) and ``lag`` (fraction of the mesh's own period),
    ``load`` and ``forces`` (:func:`~gearstab.systems.assembly.driven`) and ``terms``
    (:func:`~gearstab.systems.terms.periodic_terms`); ``coordinate_units`` (one for all, or one a coordinate) and
    ``deflection_unit``, m or rad.
    """
    mass = assembly.matrix(p["mass"])
    meshes = tuple(
        assembly.mesh(m, assembly.vector(m["direction"]), m["frequency_ratio"], np.asarray(m.get("lag", 0.0), float))
        for m in p["meshes"]
    )
    names = tuple(p.get("coordinates") or (f"q{i + 1}" for i in range(mass.shape[-1])))
    stiffness, terms = assembly.matrix(p["stiffness"]), periodic_terms(p)
    units = tuple(p.get("coordinate_units") or ("m",))
    units = units * len(names) if len(units) == 1 else units
    deflection = p.get("deflection_unit", "m")
    system = GearSystem(
        mass, stiffness, meshes, coordinates=names, terms=terms, units=units, deflection_unit=deflection
    )
    return assembly.driven(assembly.damped(system, p), p)
