"""The teeth over the grid of a gearbox: where they are undercut, interfere or cannot mesh as computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from gearstab.config import Axis, Config, alike
from gearstab.results.tree import Group, fields_of
from gearstab.results.variables import flagged
from gearstab.results.variables.responses import TEETH
from gearstab.system import Array, GearSystem

NAME = "teeth"
"""Name of the group in the result."""


@dataclass(frozen=True)
class ToothNotices:
    """Flags of :data:`gearstab.systems.gearbox.feasibility.NOTICE_FLAGS`.

    axes: those of the grid on which the geometry depends; flags: ``(*axes, mesh)``; meshes: their names.
    """

    axes: tuple[Axis, ...]
    flags: Array
    meshes: tuple[str, ...]


def over_grid(config: Config, row_axes: tuple[Axis, ...], base: GearSystem) -> ToothNotices | None:
    """Look at the teeth of every geometry of the grid; None for systems that are not given by their teeth."""
    if config.system.train() is None:
        return None
    from gearstab.systems.gearbox.feasibility import GEOMETRY, notice_flags

    axes = tuple(axis for axis in row_axes if any(item.path[-1] in GEOMETRY for item in axis.assignments))
    meshes = tuple(mesh.name for mesh in base.whole_meshes)
    shape = tuple(axis.size for axis in axes)
    index = np.indices(shape).reshape(len(shape), prod(shape))
    rows = dict(zip((axis.name for axis in axes), index, strict=True))
    flags = np.zeros((prod(shape), len(meshes)), dtype=np.int16)
    for members in alike(axes, rows, len(flags)):
        chosen = {name: places[members] for name, places in rows.items()}
        flags[members] = notice_flags(config.at(chosen))
    return ToothNotices(axes, flags.reshape(*shape, len(meshes)), meshes)


def group(found: ToothNotices) -> Group:
    """Return the group of the result."""
    from gearstab.systems.gearbox.feasibility import NOTICE_FLAGS

    names = tuple(axis.name for axis in found.axes)
    coordinate, notices = flagged(TEETH, NOTICE_FLAGS)
    table = (coordinate, replace(notices, dims=(*names, "mesh")))
    return Group(fields_of(table, {"mesh": found.meshes, "notices": found.flags}))
