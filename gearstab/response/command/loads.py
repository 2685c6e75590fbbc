"""Forces of bearings and torques of shafts over time, and of run-ups over the speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gearstab.connections import by_part
from gearstab.response import RampResponse
from gearstab.response.measures.connections import orders
from gearstab.response.measures.waterfall import Windows
from gearstab.results import Variable
from gearstab.results.display import unit_of
from gearstab.results.variables.responses import (
    MESH_ORDER,
    history_of_connections,
    load_of,
    run_up_of_connections,
)
from gearstab.system import GearSystem


def table(system: GearSystem, ramp: bool = False) -> list[Variable]:
    """Return the variables of a history, or of a run-up, in the units of the system."""
    variables = run_up_of_connections if ramp else history_of_connections
    return [
        variable for part, items in by_part(system.connections).items()
        for variable in variables(part, unit_of(system, items[0].unit))
    ]  # fmt: skip


def values(system: GearSystem, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return names and forces ``(time, connection)`` from ``displacement`` and ``velocity`` of a response."""
    q, v = found["displacement"], found["velocity"]
    known: dict[str, Any] = {}
    for part, items in by_part(system.connections).items():
        forces = np.stack([item.force(q, v) for item in items], axis=-1)
        known |= {part: [item.name for item in items], load_of(part)[0]: forces}
    return known


def harmonics(system: GearSystem, found: RampResponse, forces: Mapping[str, Any]) -> dict[str, Any]:
    """Return amplitudes of forces of a run-up at the orders of a steady state; forces: as :func:`values` gives them."""
    windows, known = Windows.of(found), orders(system)
    names = [load_of(part)[0] for part in by_part(system.connections)]
    if windows is None or not names:
        return {}
    multiples = np.array(known)[:, None]
    own = {f"{name}_harmonic": windows.harmonics(forces[name], multiples) for name in names}
    return {MESH_ORDER: known, **own}
