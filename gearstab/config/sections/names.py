"""Names that mean the same everywhere in a configuration: in ``sweep`` and in ``--set``."""

from __future__ import annotations

from typing import Any

TOP_LEVEL = ("title", "system", "sweep", "methods", "respond", "design")
"""The sections of a document."""


def mesh_items(meshes: Any) -> list[tuple[str | int, Any]]:
    """Key and value of every entry of the section ``meshes``, which is a list, or a mapping by name."""
    if isinstance(meshes, dict):
        return list(meshes.items())
    return list(enumerate(meshes)) if isinstance(meshes, list | tuple) else []
