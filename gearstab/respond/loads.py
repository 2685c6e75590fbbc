"""Forces of bearings and torques of shafts over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gearstab.connections import Connection
from gearstab.results import Variable
from gearstab.results.units import unit_of
from gearstab.results.variables.responses import history_of_connections, load_of
from gearstab.system import GearSystem


def _parts(system: GearSystem) -> dict[str, list[Connection]]:
    """The connections of a system by what they are."""
    found: dict[str, list[Connection]] = {}
    for item in system.connections:
        found.setdefault(item.part.value, []).append(item)
    return found


def table(system: GearSystem) -> list[Variable]:
    """Return the variables, in the units of the system."""
    return [
        variable for part, items in _parts(system).items()
        for variable in history_of_connections(part, unit_of(system, items[0].unit))
    ]  # fmt: skip


def values(system: GearSystem, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return names and forces ``(time, connection)`` from ``displacement`` and ``velocity`` of a response."""
    q, v = found["displacement"], found["velocity"]
    known: dict[str, Any] = {}
    for part, items in _parts(system).items():
        forces = np.stack([item.force(q, v) for item in items], axis=-1)
        known |= {part: [item.name for item in items], load_of(part)[0]: forces}
    return known
