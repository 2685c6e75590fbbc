"""Names that mean the same everywhere in a configuration: in ``sweep`` and in ``--set``."""

from __future__ import annotations

from typing import Any

TOP_LEVEL = ("title", "system", "sweep", "methods", "respond")
"""The sections of a document."""

EVERY_MESH = ("epsilon", "amplitude", "contact_ratio")
"""Short names that mean this number of every mesh that has one."""

BUT_THE_FIRST = ("phasing", "lag")
"""Short names that mean this number of every mesh but the first, against which it counts."""

RIVALS = {"epsilon": "amplitude", "amplitude": "epsilon"}
"""A mesh that gives one of these does not have the other."""


def mesh_items(meshes: Any) -> list[tuple[str | int, Any]]:
    """Key and value of every entry of the section ``meshes``, which is a list, or a mapping by name."""
    if isinstance(meshes, dict):
        return list(meshes.items())
    return list(enumerate(meshes)) if isinstance(meshes, list | tuple) else []
