"""Forces of bearings and torques of shafts over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gearstab.connections import by_part
from gearstab.results import Variable
from gearstab.results.units import unit_of
from gearstab.results.variables.responses import history_of_connections, load_of
from gearstab.system import GearSystem


def table(system: GearSystem) -> list[Variable]:
    """Return the variables, in the units of the system."""
    return [
        variable for part, items in by_part(system.connections).items()
        for variable in history_of_connections(part, unit_of(system, items[0].unit))
    ]  # fmt: skip


def values(system: GearSystem, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return names and forces ``(time, connection)`` from ``displacement`` and ``velocity`` of a response."""
    q, v = found["displacement"], found["velocity"]
    known: dict[str, Any] = {}
    for part, items in by_part(system.connections).items():
        forces = np.stack([item.force(q, v) for item in items], axis=-1)
        known |= {part: [item.name for item in items], load_of(part)[0]: forces}
    return known
