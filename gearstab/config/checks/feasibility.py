"""Whether the systems of a grid can exist: stiffness levels of the meshes, mass and stiffness matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.config.checks.levels import LEVEL_KEYS, Selection, check_levels, extreme_points
from gearstab.config.checks.plausibility import doubts
from gearstab.config.checks.train import check_train
from gearstab.config.document.problems import Path, Problem
from gearstab.config.document.yaml import Document, value_at
from gearstab.config.model.fields import SMALLEST_NUMBER
from gearstab.config.sections.axes import Array, Config, parameters_at
from gearstab.config.sections.names import mesh_items
from gearstab.config.sections.respond_pair import PairRespond
from gearstab.config.sections.targets import MESH_FREQUENCY
from gearstab.modal import RIGID_TOLERANCE, eigenmodes
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.assembly import matrix

SYMMETRY_TOLERANCE = 1e-9
"""Asymmetry of a matrix, relative to its largest entry, that comes from writing it with few digits."""
LARGEST_PHASE = 1e14
"""Radians; of larger ones double precision does not hold a hundredth."""
DEFINITE_TOLERANCE = 1e-14
"""A mass matrix, scaled to a diagonal of ones, with a lower eigenvalue has no inverse in double precision."""


def check(document: Document, config: Config) -> list[Problem]:
    """Report what cannot exist anywhere on the grid, or at the base values where a response asks for them.

    Returns what can, and is hardly what was meant.
    """
    if config.kind == "gearbox":
        check_train(document, config)
    else:
        _check_system(document, config)
    if document.problems:
        return []
    system = build(config.parameters)
    _check_phases(document, config, system)
    return doubts(document, config, system)


def _check_system(document: Document, config: Config) -> None:
    # Exact ratios play no part here, and would have to be the same at all points.
    axes = [replace(a, assignments=tuple(item for item in a.assignments if not item.structural)) for a in config.axes]
    config = replace(config, axes=tuple(axes))
    for key, _ in mesh_items(config.parameters.get("meshes")):
        check_levels(document, config, key)
    if _symmetric(document, config.parameters) and config.kind == "matrices":
        _check_definite(document, config)


def _check_phases(document: Document, config: Config, system: GearSystem) -> None:
    """Mesh frequencies so low that phase and decay of a vibration after a period are beyond double precision."""
    if not system.commensurate:
        return
    found = [
        (("sweep", axis.name), float(np.min(item.values)))
        for axis in config.axes
        for item in axis.assignments
        if item.path == MESH_FREQUENCY
    ]
    if config.respond is not None:
        key = "speed" if isinstance(config.respond, PairRespond) else "mesh_frequency"
        found.append((("respond", key), float(getattr(config.respond, key))))
    factor = np.linalg.inv(np.linalg.cholesky(system.mass))
    elastic = np.abs(np.linalg.eigvalsh(factor @ system.mean_stiffness_matrix() @ factor.T))
    viscous = np.zeros(1) if system.damping is None else np.abs(np.linalg.eigvals(factor @ system.damping @ factor.T))
    fastest = float(max(np.sqrt(elastic.max()), viscous.max()))
    lowest = 2 * np.pi * float(system.common_period()[0]) * fastest / LARGEST_PHASE
    for path, frequency in found:
        if frequency < lowest:
            message = (
                f"is too low for double precision at {frequency:.6g}: the fastest vibration or decay, at the rate "
                f"{fastest:.6g}, does not stand out from rounding over a period"
            )
            document.report(path, message, f"choose mesh frequencies above {lowest:.2g}")


def _symmetric(document: Document, parameters: dict[str, Any]) -> bool:
    """Whether mass and stiffness are; reports these and a damping matrix that are not."""
    good = True
    for where in (("mass",), ("stiffness",), ("damping", "matrix")):
        found = value_at(parameters, where)
        if found is None:
            continue
        name, values = where[0], matrix(found)
        difference = np.abs(values - values.T)
        if np.max(difference) > SYMMETRY_TOLERANCE * np.max(np.abs(values)):
            good = good and name == "damping"
            i, j = np.unravel_index(np.argmax(difference), difference.shape)
            path: Path = ("system", *where, int(i), int(j))
            message = f"is not symmetric: entry {i}.{j} is {values[i, j]:.6g}, entry {j}.{i} is {values[j, i]:.6g}"
            full = ".".join(where)
            remedy = f"make {full}.{i}.{j} and {full}.{j}.{i} equal"
            if parameters["kind"] == "matrices" and name != "mass":
                remedy += ", and give the rest as terms"
            _report_matrix(document, path, name, message, remedy)
    return good


def _report_matrix(document: Document, path: Path, name: str, message: str, hint: str) -> None:
    """At the entry as written, or at the file that holds it."""
    if document.get(path[:2]) is None:
        path, message = ("system", "file"), f"{name} {message}"
    document.report(path, message, hint)


def _check_definite(document: Document, config: Config) -> None:
    """The mass matrix is positive definite and the mean system has no negative eigenvalue, at the worst points."""

    def concerns(path: Path) -> bool:
        return path[0] in ("mass", "stiffness") or (path[0] == "meshes" and path[2] in LEVEL_KEYS)

    selection = extreme_points(config, concerns)
    parameters = parameters_at(config, selection)
    bare = [{key: value for key, value in item.items() if key != "damping"} for item in parameters["meshes"]]
    system = build(parameters | {"meshes": bare, "damping": None, "damping_ratio": 0.0})
    lightest = np.min(np.diagonal(system.mass, axis1=-2, axis2=-1))
    if 0 < lightest < SMALLEST_NUMBER:
        message = f"has the entry {lightest:.6g} on its diagonal, smaller than of any gear"
        _report_matrix(document, ("system", "mass"), "mass", message, f"stay above {SMALLEST_NUMBER:g}")
        return
    singular = _singular(system.mass)
    if np.any(singular):
        where = _axis_of(config, selection, "mass") if np.ndim(singular) else ""
        message = (
            f"is not positive definite{where}: its lowest eigenvalue is {np.min(np.linalg.eigvalsh(system.mass)):.6g}"
        )
        _report_matrix(
            document, ("system", "mass"), "mass", message, "give every coordinate a positive mass or inertia"
        )
        return
    squares = eigenmodes(system.mass, system.mean_stiffness_matrix())[0]
    negative = squares[..., 0] < -RIGID_TOLERANCE * np.max(np.abs(squares), axis=-1)
    if np.any(negative) and not config.parameters["allow_negative_stiffness"]:
        where = _axis_of(config, selection, "stiffness") if np.ndim(negative) else ""
        message = f"with the mean mesh stiffness has a negative eigenvalue{where}: omega^2 = {np.min(squares):.6g}"
        remedy = "check the signs of stiffness, or set system.allow_negative_stiffness: true"
        _report_matrix(document, ("system", "stiffness"), "stiffness", message, remedy)


def _singular(mass: Array) -> Array:
    """Where a mass matrix is not positive definite, whatever the units of its coordinates."""
    diagonal = np.diagonal(mass, axis1=-2, axis2=-1)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    lowest = np.linalg.eigvalsh(mass * scale[..., :, None] * scale[..., None, :])[..., 0]
    return np.any(diagonal <= 0, axis=-1) | (lowest <= DEFINITE_TOLERANCE)


def _axis_of(config: Config, selection: Selection, name: str) -> str:
    names = [a.name for a in config.axes if a.name in selection and any(i.path[0] == name for i in a.assignments)]
    return f" along the axis {' and '.join(names)}" if names else ""
