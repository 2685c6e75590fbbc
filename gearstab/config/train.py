"""Whether the gearboxes of a grid can be built: trains that turn, gears that mesh, stiffness that stays positive."""

from __future__ import annotations

from itertools import islice, product

import numpy as np

from gearstab.config.axes import Config, parameters_at
from gearstab.config.document import Document
from gearstab.systems.gearbox import TrainError, build

MOST_CORNERS = 32
"""Of the grid that are looked at."""


def check_train(document: Document, config: Config) -> None:
    """Report the first corner of the grid, or the base values, at which there is no such train."""
    axes = [axis for axis in config.axes if any(item.path != ("mesh_frequency",) for item in axis.assignments)]
    corners = islice(product(*(sorted({0, axis.size - 1}) for axis in axes)), MOST_CORNERS)
    names = [axis.name for axis in axes]
    for corner in corners:
        where = ", ".join(f"{axis.name} = {axis.values[k]}" for axis, k in zip(axes, corner, strict=True))
        chosen = dict(zip(names, map(np.array, corner), strict=True))
        if not _buildable(document, config, chosen, f" (at {where})" if where else ""):
            return


def _buildable(document: Document, config: Config, chosen: dict[str, np.ndarray], where: str) -> bool:
    try:
        system = build(parameters_at(config, chosen))
    except TrainError as error:
        path = ("system", *error.where)
        document.report(path, f"{error.message}{where}", error.remedy, at_key=True)
        return False
    if config.parameters["allow_negative_stiffness"]:
        return True
    for k, mesh in enumerate(system.meshes):
        lowest = float(np.min(mesh.lowest_stiffness))
        if not lowest > 0:
            message = f"the softer level {lowest:.6g} of the mesh stiffness is <= 0{where}"
            remedy = "reduce epsilon, or set system.allow_negative_stiffness: true"
            document.report(("system", "meshes", k), message, remedy, at_key=True)
            return False
    return True
