"""Parts that all results of responses share: root and modes, coordinates, forces of connections, loads of teeth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.mesh import by_part
from gearstab.modal import static_mesh_force
from gearstab.response import RampResponse, Response
from gearstab.response.loads import MOST_POINTS, LoadedTeeth, orders, phases, positions, tooth_loads
from gearstab.response.spectra import Windows
from gearstab.results import Group, ResultTree, Variable
from gearstab.results.display import unit_of
from gearstab.results.provenance import modes_group, root_attributes
from gearstab.results.read import RESPOND
from gearstab.results.variables.responses import MESH_ORDER, history_of_connections, load_of, run_up_of_connections
from gearstab.rotating_pair import RotatingPair
from gearstab.system import Array, GearSystem

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.systems.respond import Respond


def result(config: Config, system: GearSystem | RotatingPair, group: Group) -> ResultTree:
    """Return the result of a response: its root, ``/modes`` and the group ``/response``."""
    root = Group((), root_attributes(RESPOND, config))
    return ResultTree(root, {"modes": modes_group(system), "response": group})


def initial(section: Respond) -> tuple[Array, Array] | None:
    """Return the displacement and the velocity that a motion begins with; None where they are not given."""
    if section.initial is None:
        return None
    return np.array(section.initial.displacement), np.array(section.initial.velocity)


def common(system: GearSystem, found: Response | RampResponse) -> dict[str, Any]:
    """Return names of coordinates and meshes, flags and static mesh forces of a response."""
    static = {} if system.load is None else {"static_mesh_force": static_mesh_force(system)}
    return {
        "dof": list(system.coordinates), "dof_units": list(system.coordinate_units),
        "mesh": [mesh.name for mesh in system.whole_meshes], "status": found.flags,
    } | static  # fmt: skip


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


def tooth_values(config: Config, section: Respond, system: GearSystem, found: Response) -> dict[str, Any]:
    """The variables of TOOTH_LOADS, none where no teeth are known, nothing is loaded or a history begins anywhere."""
    known = teeth(config)
    if not known or system.load is None or not section.steady_state or found.status == "failed":
        return {}
    static = static_mesh_force(system)
    points = min(MOST_POINTS, section.samples_per_cycle)
    loads = [
        tooth_loads(
            item, phases(system, k, found.time, found.mesh_frequency), found.mesh_force[:, k], float(static[k]), points
        )
        for k, item in enumerate(known)
    ]
    stress = np.concatenate([load.stress for load in loads], axis=1)
    known_stress = np.isfinite(stress)
    largest = np.max(stress, axis=0, initial=0.0, where=known_stress)
    return {
        "contact": positions(points),
        "tooth_load": np.stack([load.load for load in loads], axis=1),
        "static_tooth_load": np.stack([load.static_load for load in loads], axis=1),
        "flank": [f"{gear}, mesh {system.meshes[k].name}" for k, item in enumerate(known) for gear in item.in_order],
        "root_stress": stress,
        "static_root_stress": np.concatenate([load.static_stress for load in loads], axis=1),
        "peak_root_stress": np.where(known_stress.any(axis=0), largest, np.nan),
    }


def teeth(config: Config) -> list[LoadedTeeth]:
    """Return those of all meshes, none of a system that is not computed from its teeth, or whose teeth have relief."""
    train = config.system.train()
    meshes = [] if train is None or any(mesh.teeth.relieved for mesh in train.meshes) else train.meshes
    return [LoadedTeeth(mesh.teeth.pairs[0], mesh.teeth.models[0], mesh.gears) for mesh in meshes]
