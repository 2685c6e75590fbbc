"""Whether the matrices of a model can be those of a system that vibrates."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.config.document.problems import Path
from gearstab.config.document.tree import Document
from gearstab.config.model.axes import Array, Grid
from gearstab.config.model.units import SMALLEST_NUMBER
from gearstab.modal import RIGID_TOLERANCE, eigenmodes
from gearstab.systems.feasibility import LEVEL_KEYS, Selection, extreme_points, report_matrix

DEFINITE_TOLERANCE = 1e-14
"""A mass matrix, scaled to a diagonal of ones, with a lower eigenvalue has no inverse in double precision."""


def check_definite(document: Document, grid: Grid[Any]) -> None:
    """The mass matrix is positive definite and the mean system has no negative eigenvalue, at the worst points."""

    def concerns(path: Path) -> bool:
        return path[0] in ("mass", "stiffness") or (path[0] == "meshes" and path[2] in LEVEL_KEYS)

    selection = extreme_points(grid, concerns)
    section: Any = grid.at(selection)
    bare = [mesh.model_copy(update={"damping": None}) for mesh in section.meshes]
    system = section.model_copy(update={"meshes": bare, "damping": None, "damping_ratio": 0.0}).build()
    lightest = np.min(np.diagonal(system.mass, axis1=-2, axis2=-1))
    if 0 < lightest < SMALLEST_NUMBER:
        message = f"has the entry {lightest:.6g} on its diagonal, smaller than of any gear"
        report_matrix(document, ("system", "mass"), "mass", message, f"stay above {SMALLEST_NUMBER:g}")
        return
    singular = _singular(system.mass)
    if np.any(singular):
        where = _axis_of(grid, selection, "mass") if np.ndim(singular) else ""
        message = (
            f"is not positive definite{where}: its lowest eigenvalue is {np.min(np.linalg.eigvalsh(system.mass)):.6g}"
        )
        report_matrix(document, ("system", "mass"), "mass", message, "give every coordinate a positive mass or inertia")
        return
    squares = eigenmodes(system.mass, system.mean_stiffness_matrix())[0]
    negative = squares[..., 0] < -RIGID_TOLERANCE * np.max(np.abs(squares), axis=-1)
    if np.any(negative) and not grid.system.allow_negative_stiffness:
        where = _axis_of(grid, selection, "stiffness") if np.ndim(negative) else ""
        message = f"with the mean mesh stiffness has a negative eigenvalue{where}: omega^2 = {np.min(squares):.6g}"
        remedy = "check the signs of stiffness, or set system.allow_negative_stiffness: true"
        report_matrix(document, ("system", "stiffness"), "stiffness", message, remedy)


def _singular(mass: Array) -> Array:
    """Where a mass matrix is not positive definite, whatever the units of its coordinates."""
    diagonal = np.diagonal(mass, axis1=-2, axis2=-1)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    lowest = np.linalg.eigvalsh(mass * scale[..., :, None] * scale[..., None, :])[..., 0]
    return np.any(diagonal <= 0, axis=-1) | (lowest <= DEFINITE_TOLERANCE)


def _axis_of(grid: Grid[Any], selection: Selection, name: str) -> str:
    names = [a.name for a in grid.axes if a.name in selection and any(i.path[0] == name for i in a.assignments)]
    return f" along the axis {' and '.join(names)}" if names else ""
