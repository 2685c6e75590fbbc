"""Whether the systems of a grid can exist: stiffness levels of the meshes, mass and stiffness matrices.

Only points that can be the worst are looked at: the ends of an axis along which all parameters are equal, and all
points of an axis that varies several differently. So the cost does not grow with the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.config.axes import Array, Axis, Config, parameters_at
from gearstab.config.document import Document
from gearstab.config.names import mesh_items
from gearstab.config.problems import Path
from gearstab.config.targets import value_at
from gearstab.modal import RIGID_TOLERANCE, eigenmodes
from gearstab.systems import build
from gearstab.systems.assembly import matrix, mesh

LEVEL_KEYS = ("mean_stiffness", "max_stiffness", "epsilon", "amplitude", "contact_ratio")
SYMMETRY_TOLERANCE = 1e-9
"""Asymmetry of a matrix, relative to its largest entry, that comes from writing it with few digits."""
DEFINITE_TOLERANCE = 1e-14
"""A mass matrix, scaled to a diagonal of ones, with a lower eigenvalue has no inverse in double precision."""

Selection = dict[str, Array]
"""Axis name -> indices of the points that are looked at, all of one shape."""


def check(document: Document, config: Config) -> None:
    """Report what cannot exist anywhere on the grid, or at the base values where a response asks for them."""
    # Exact ratios play no part here, and would have to be the same at all points.
    axes = [replace(a, assignments=tuple(item for item in a.assignments if not item.structural)) for a in config.axes]
    config = replace(config, axes=tuple(axes))
    for key, _ in mesh_items(config.parameters.get("meshes")):
        _check_levels(document, config, key)
    if _symmetric(document, config.parameters) and config.kind == "matrices":
        _check_definite(document, config)


def extreme_points(axes: Sequence[Axis], concerns: Callable[[Path], bool]) -> Selection:
    """The points that can be the worst for the parameters that a question concerns."""
    picks: Selection = {}
    for axis in axes:
        values = [a.values for a in axis.assignments if concerns(a.path)]
        if not values:
            continue
        keys = {a.path[-1] for a in axis.assignments if concerns(a.path)}
        if all(np.array_equal(v, values[0]) for v in values[1:]):
            # The contact ratio acts through its fraction, everything else monotonically.
            measure = values[0] - np.floor(values[0]) if keys == {"contact_ratio"} else values[0]
            picks[axis.name] = np.unique([np.argmin(measure), np.argmax(measure)])
        else:
            picks[axis.name] = np.arange(axis.size)
    grids = np.meshgrid(*picks.values(), indexing="ij")
    return {name: grid.ravel() for name, grid in zip(picks, grids, strict=True)}


def _check_levels(document: Document, config: Config, index: str | int) -> None:
    """Both stiffness levels of a mesh, or its mean where negative levels are allowed, must be positive."""

    def concerns(path: Path) -> bool:
        return path[:2] == ("meshes", index) and path[2] in LEVEL_KEYS

    points = extreme_points(config.axes, concerns)
    selections: list[Selection] = [points] if points else [{}]
    if points and config.respond is not None:
        selections.append({})
    allowed = config.parameters["allow_negative_stiffness"]
    for selection in selections:
        p = parameters_at(config, selection)["meshes"][index]
        with np.errstate(all="ignore"):  # what overflows is reported, or of no concern
            item = mesh({"name": ""} | p, np.ones(1))
            amplitude = p.get("amplitude", item.amplitude)
            lowest = item.mean_stiffness + 2 * np.asarray(amplitude) * item.waveform.extremes()[0]
            checked = np.atleast_1d(item.mean_stiffness if allowed else np.minimum(lowest, item.mean_stiffness))
            relative = checked / np.atleast_1d(p.get("mean_stiffness", p.get("max_stiffness")))
        worst = int(np.argmin(relative))
        if checked[worst] <= 0:
            at_worst = {k: float(np.broadcast_to(p[k], checked.shape)[worst]) for k in LEVEL_KEYS if k in p}
            chosen = {name: int(rows[worst]) for name, rows in selection.items()}
            _report_level(document, config, index, at_worst, float(checked[worst]), chosen)
            return


def _report_level(
    document: Document, config: Config, index: str | int, p: dict[str, float], level: float, chosen: dict[str, int]
) -> None:
    name = config.parameters["meshes"][index].get("name", index)
    allowed = config.parameters["allow_negative_stiffness"]
    key = "epsilon" if "epsilon" in p else "amplitude"
    fraction = p["contact_ratio"] - np.floor(p["contact_ratio"])
    if "max_stiffness" in p and key == "amplitude":
        limit, rule = p["max_stiffness"] / 2, "max_stiffness/2"
        if allowed:
            limit, rule = limit / (1 - fraction), f"max_stiffness/(2 (1 - d)), d = {fraction:.6g}"
    elif key == "amplitude":
        limit, rule = p["mean_stiffness"] / (2 * fraction), f"mean_stiffness/(2 d), d = {fraction:.6g}"
    else:
        limit, rule = 1 / (2 * fraction), f"1/(2 d), d = {fraction:.6g}"
    level_name = "mean stiffness" if allowed else "softer level"
    message = (
        f"mesh '{name}' has the {level_name} {level:.6g} <= 0 at {key} {p[key]:.6g} "
        f"and contact ratio {p['contact_ratio']:.6g}: the largest admissible {key} is below {limit:.6g} = {rule}"
    )
    remedy = f"reduce {key}" + ("" if allowed else ", or set system.allow_negative_stiffness: true")
    path = _place(document, config, index, key, chosen)
    document.report(path, message, remedy)


def _place(document: Document, config: Config, index: str | int, key: str, chosen: dict[str, int]) -> Path:
    """Where the value to blame stands: in an axis that sets it or another level key, or in the mesh."""
    for wanted in (key, *LEVEL_KEYS):
        for axis in config.axes:
            if axis.name in chosen and any(a.path == ("meshes", index, wanted) for a in axis.assignments):
                path: Path = ("sweep", axis.name)
                point = chosen[axis.name]
                inner = [(*path, point), (*path, "values", point), (*path, "values")]
                return next((p for p in inner if p in document.values and document.get(p) is not None), path)
    return ("system", "meshes", index, key)


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
            _report_matrix(document, path, name, message, f"make {full}.{i}.{j} and {full}.{j}.{i} equal")
    return good


def _report_matrix(document: Document, path: Path, name: str, message: str, hint: str) -> None:
    """At the entry as written, or at the file that holds it."""
    if document.get(path[:2]) is None:
        path, message = ("system", "file"), f"{name} {message}"
    document.report(path, message, hint)


def _check_definite(document: Document, config: Config) -> None:
    """The mass matrix is positive definite and the mean system has no negative eigenvalue, at the worst points."""

    def concerns(path: Path) -> bool:
        return path[0] in ("mass", "stiffness") or (path[0] == "meshes" and path[-1] in LEVEL_KEYS)

    selection = extreme_points(config.axes, concerns)
    parameters = parameters_at(config, selection)
    bare = [{key: value for key, value in item.items() if key != "damping"} for item in parameters["meshes"]]
    system = build(parameters | {"meshes": bare, "damping": None, "damping_ratio": 0.0})
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
