"""Torsional models of openTorsion (an optional package)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gearstab.exchange.files import dense
from gearstab.exchange.model import Model, merged, model
from gearstab.system import Array


def from_opentorsion(
    assembly: Any, meshes: Sequence[Mapping[str, Any]] | None = None, modes: int | None = None
) -> Model:
    """Turn an assembly of openTorsion into the section ``system`` of a configuration.

    Parameters
    ----------
    assembly: an ``opentorsion.Assembly``. Its elastic gears are the meshes: the angle between the gears is theta_parent
        + (R/R_parent) theta, the stiffness is in N m/rad; rigid gears are constraints, as there.
    meshes: what varies, one entry for each elastic gear in their order: ``[{"epsilon": 0.2, "contact_ratio": 1.6}]``,
        and any other key of a mesh; further entries need ``direction`` (one number per coordinate) and
        ``mean_stiffness``.
    modes: how many of the lowest modes to keep, default all; ``note`` of the result says what that neglects.

    Raises NotPossible where the meshes do not fit the assembly.
    """
    size = assembly.dofs
    transform = assembly.T(assembly.E()) if assembly.gear_elements is not None else np.eye(size)
    known: list[dict[str, Any]] = []
    stiffness = dense(assembly.K)
    for gear in assembly.elastic_gear_elements or ():
        if gear.parent is None:
            continue
        (mean, across), _ = gear.K()
        direction = np.zeros(size)
        direction[[gear.parent.node, gear.node]] = 1.0, across / mean
        direction = transform.T @ direction
        stiffness -= mean * np.outer(direction, direction)
        name = f"gear{len(known) + 1}"
        known.append({"name": name, "direction": direction, "mean_stiffness": float(mean)})
    entries = merged(known, meshes, "assembly")
    more = {"coordinates": _names(transform), "coordinate_units": "rad", "deflection_unit": "rad"}
    return model(dense(assembly.M), stiffness, dense(assembly.C), entries, modes, **more)


def _names(transform: Array) -> list[str]:
    """The nodes that are left after the rigid gears: those that are a coordinate by themselves."""
    rows = [np.flatnonzero((transform == unit).all(axis=1)) for unit in np.eye(transform.shape[1])]
    return [f"node{row[0]}" for row in rows]
