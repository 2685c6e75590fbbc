"""Loads and root stresses of teeth in the response of a gearbox."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.response import Response
    from gearstab.response.loads import LoadedTeeth
    from gearstab.system import GearSystem
    from gearstab.systems.parts.respond import Respond


def values(config: Config, wanted: Respond, system: GearSystem, found: Response) -> dict[str, Any]:
    """The variables of TOOTH_LOADS, none where no teeth are known, nothing is loaded or a history begins anywhere."""
    import numpy as np

    from gearstab.modal import static_mesh_force
    from gearstab.response.loads import MOST_POINTS, phases, positions, tooth_loads

    known = teeth(config)
    if not known or system.load is None or not wanted.steady_state or found.status == "failed":
        return {}
    static = static_mesh_force(system)
    points = min(MOST_POINTS, wanted.samples_per_cycle)
    loads = []
    for k, item in enumerate(known):
        phase = phases(system, k, found.time, found.mesh_frequency)
        loads.append(tooth_loads(item, phase, found.mesh_force[:, k], float(static[k]), points))
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
    from gearstab.response.loads import LoadedTeeth

    train = config.system.train()
    meshes = [] if train is None or any(mesh.teeth.relieved for mesh in train.meshes) else train.meshes
    return [LoadedTeeth(mesh.teeth.pairs[0], mesh.teeth.models[0], mesh.gears) for mesh in meshes]
