"""From parameters to a :class:`~gearstab.system.GearSystem`: one file a kind, one line in ``BUILDERS``.

A builder takes the validated ``system`` section as a nested mapping in which any number may be replaced by an
array of batch shape, and uses array operations only, so that every number of a configuration can be an axis.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from gearstab.system import GearSystem
from gearstab.systems import gear_pair, gearbox, matrices, planetary, two_stage

BUILDERS: dict[str, Callable[[dict[str, Any]], GearSystem]] = {
    "gear_pair": gear_pair.build,
    "two_stage": two_stage.build,
    "planetary": planetary.build,
    "gearbox": gearbox.build,
    "matrices": matrices.build,
}


def build(parameters: dict[str, Any]) -> GearSystem:
    """Build the system of ``parameters["kind"]``; see the file of that kind for its parameters.

    With ``units: none`` nothing in it has a unit.
    """
    system = BUILDERS[parameters["kind"]](parameters)
    return replace(system, dimensionless=("mass", "length", "time")) if parameters.get("units") == "none" else system


__all__ = ["BUILDERS", "build"]
