"""The units of a system's coordinates in the variables that stand over them: metres, radians or both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gearstab.results.variables import Variable
from gearstab.system import GearSystem

ROTATION = {"m": "rad", "m/s": "rad/s", "kg^-1/2": "kg^-1/2 m^-1"}
"""Of a displacement, a velocity and an entry of a mode normalised by the mass matrix: the same of a rotation.

With Phi^T M Phi = I an entry is a coordinate over sqrt(kg) m, whatever the other coordinates are.
"""

TORSIONAL = {**ROTATION, "N": "N m"}
"""Of a mesh deflection and a mesh force: the same of a mesh whose stiffness is torsional."""

MIXED = "1"
"""Of values in several units; there is no unit that would hold for all of them."""


def in_units_of(system: GearSystem, table: Sequence[Variable]) -> tuple[Variable, ...]:
    """A table of variables with the units that the coordinates and mesh deflections of a system have.

    Variables over ``dof`` get the unit that all coordinates give; where they differ, ``MIXED``, a comment and the
    attributes ``units_of_rad`` and ``units_of_m``. Those over ``mesh`` go by the system's mesh deflections.
    """
    return tuple(_in_units(variable, system) for variable in table)


def _in_units(variable: Variable, system: GearSystem) -> Variable:
    if variable.coordinate:
        return variable
    if "mesh" in variable.dims and system.deflection_unit == "rad":
        return replace(variable, units=TORSIONAL.get(variable.units, variable.units))
    if "dof" not in variable.dims or "rad" not in system.coordinate_units:
        return variable
    rotation = ROTATION[variable.units]
    if set(system.coordinate_units) == {"rad"}:
        return replace(variable, units=rotation)
    said = {
        "comment": f"units differ: {rotation} where dof_units is rad, {variable.units} where it is m",
        "units_of_rad": rotation,
        "units_of_m": variable.units,
    }
    return replace(variable, units=MIXED, attributes={**variable.attributes, **said})
