"""Units of variables as a system has them: coordinates in metres, radians or both, and quantities without units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from gearstab.results.variables import Variable
from gearstab.system import GearSystem

ROTATION = {"m": "rad", "m/s": "rad/s", "kg^-1/2": "kg^-1/2 m^-1"}
"""Units of a displacement, a velocity and an entry of a mode normalised by the mass matrix: the same of a rotation.

With Phi^T M Phi = I an entry is a coordinate over sqrt(kg) m, whatever the other coordinates are.
"""

TORSIONAL = {**ROTATION, "N": "N m", "N^2 s": "N^2 m^2 s", "m^2 s": "rad^2 s"}
"""Units of a mesh deflection, a mesh force and their spectra: the same of a mesh whose stiffness is torsional."""

OF_MESHES = frozenset(("mesh", "event", "peak"))
"""Dimensions of variables that concern a mesh."""

MIXED = "1"
"""Unit of values in several units: none would hold for all of them."""

LENGTHS = {"m": 1, "N": 1, "J": 2, "Pa": -1}
"""Powers of the length in a unit; kg, s and rad have none."""


def in_units_of(system: GearSystem, table: Sequence[Variable]) -> tuple[Variable, ...]:
    """A table of variables with the units that the coordinates and mesh deflections of a system have.

    Variables over ``dof`` get the unit that all coordinates give; where they differ, ``MIXED``, a comment and the
    attributes ``units_of_rad`` and ``units_of_m``. Those over ``mesh`` go by the system's mesh deflections. What has no
    unit in the system gets the unit 1.
    """
    return tuple(_in_units(variable, system) for variable in table)


def unit_of(system: GearSystem, unit: str) -> str:
    """An SI unit without what is dimensionless in the system: ``rad/s`` is 1 where times have no unit."""
    if not system.dimensionless:
        return unit
    if "length" in system.dimensionless or unit == "1":
        return "1"
    power = 0
    for sign, part in re.findall(r"(^| |/)([^ /]+)", unit):
        name, _, exponent = part.partition("^")
        if name in LENGTHS:
            power += (-1 if sign == "/" else 1) * LENGTHS[name] * int(exponent or 1)
    return "1" if power == 0 else "m" if power == 1 else f"m^{power}"


def in_brackets(system: GearSystem, unit: str) -> str:
    """`` (rad/s)`` for texts, nothing where a quantity has no unit in the system."""
    own = unit_of(system, unit)
    return "" if own == "1" else f" ({own})"


def _in_units(variable: Variable, system: GearSystem) -> Variable:
    if system.dimensionless:
        return replace(variable, units=unit_of(system, variable.units))
    if variable.coordinate:
        return variable
    if system.deflection_unit == "rad" and not OF_MESHES.isdisjoint(variable.dims):
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
