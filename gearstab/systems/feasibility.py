"""Whether systems can exist: every mesh stiffness is positive wherever it is asked for, matrices are symmetric and fit.

Only points that can be the worst are looked at: the ends of an axis along which the levels are monotonic or concave,
and all points of other axes. So the cost does not grow with the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path, dotted, value_at
from gearstab.config.model import Array, Grid, matrix
from gearstab.config.model.conflicts import items
from gearstab.config.model.fields import SMALLEST_NUMBER
from gearstab.modal import RIGID_TOLERANCE, eigenmodes
from gearstab.systems.mesh import build_mesh
from gearstab.waveforms import WAVEFORMS, Waveform
from gearstab.waveforms.base import stiff_fraction
from gearstab.waveforms.section import wave_of

SYMMETRY_TOLERANCE = 1e-9
"""Asymmetry of a matrix, relative to its largest entry, that comes from writing it with few digits."""

LEVEL_KEYS = ("mean_stiffness", "max_stiffness", "epsilon", "amplitude", "contact_ratio", "waveform")

AT_THE_ENDS = frozenset(key for wave in WAVEFORMS.values() for key in wave.worst_at_ends)
"""Keys of a waveform whose worst value is the least or the greatest."""

Selection = dict[str, Array]
"""Axis name -> indices of the points that are looked at, all of one shape."""


def extreme_points(grid: Grid[Any], concerns: Callable[[Path], bool]) -> Selection:
    """The points that can be the worst for the parameters that a question concerns."""
    picks: Selection = {}
    for axis in grid.axes:
        found = [item for item in axis.assignments if concerns(item.path)]
        if not found:
            continue
        values = [item.values for item in found]
        keys = {_key(item.path) for item in found}
        known = (len(keys) == 1 or not keys & AT_THE_ENDS) and all(_ends_suffice(grid, i.path) for i in found)
        if known and all(np.array_equal(v, values[0]) for v in values[1:]):
            # The contact ratio acts through its fraction.
            measure = np.asarray(values[0])
            measure = stiff_fraction(measure) if keys == {"contact_ratio"} else measure
            picks[axis.name] = np.array(sorted({int(np.argmin(measure)), int(np.argmax(measure))}))
        else:
            picks[axis.name] = np.arange(axis.size)
    grids = np.meshgrid(*picks.values(), indexing="ij")
    return {name: grid.ravel() for name, grid in zip(picks, grids, strict=True)}


def _key(path: Path) -> str:
    return str(path[3] if len(path) > 3 and path[2] == "waveform" else path[-1])


def _ends_suffice(grid: Grid[Any], path: Path) -> bool:
    if path[0] != "meshes" or (path[2] == "waveform" and _key(path) in AT_THE_ENDS):
        return True
    wave = wave_of(grid.system.meshes[path[1]].waveform)
    return path[2] != "waveform" and (path[2] != "contact_ratio" or (wave is not None and wave.fraction_sets_levels))


def check_mesh_levels(document: Document, grid: Grid[Any]) -> None:
    """Report meshes whose stiffness is not positive somewhere on the grid."""
    grid = numbers_only(grid)
    for key, _ in items(getattr(grid.system, "meshes", None)):
        check_levels(document, grid, key)


def numbers_only(grid: Grid[Any]) -> Grid[Any]:
    """Return the configuration without exact ratios on its axes, which play no part and must not change in a batch."""
    axes = [replace(a, assignments=tuple(item for item in a.assignments if not item.structural)) for a in grid.axes]
    return replace(grid, axes=tuple(axes))


def check_levels(document: Document, grid: Grid[Any], index: str | int) -> None:
    """Both extremes of a mesh stiffness, or its mean where negative stiffness is allowed, must be positive."""

    def concerns(path: Path) -> bool:
        return path[:2] == ("meshes", index) and path[2] in LEVEL_KEYS

    points = extreme_points(grid, concerns)
    selections: list[Selection] = [points] if points else [{}]
    if points and getattr(grid, "respond", None) is not None:  # which asks for the base values
        selections.append({})
    allowed = grid.system.allow_negative_stiffness
    for selection in selections:
        p = grid.at(selection).meshes[index]
        with np.errstate(all="ignore"):  # what overflows is reported, or of no concern
            item = build_mesh(p, np.ones(1))
            depth, above = -item.waveform.extremes()[0], item.waveform.stiffer_level
            lowest = (
                item.mean_stiffness - 2 * np.asarray(item.amplitude if p.amplitude is None else p.amplitude) * depth
            )
            checked = np.atleast_1d(item.mean_stiffness if allowed else np.minimum(lowest, item.mean_stiffness))
            levels = (p.mean_stiffness, p.max_stiffness, item.mean_stiffness)
            relative = checked / np.abs(next(level for level in levels if level is not None))
        worst = int(np.argmin(np.where(np.isnan(relative), -np.inf, relative)))
        if not checked[worst] > 0:

            def at_worst(value: Any, shape: tuple[int, ...] = checked.shape, place: int = worst) -> float:
                return float(np.broadcast_to(value, shape)[place])

            numbers = {k: at_worst(p[k]) for k in LEVEL_KEYS if p[k] is not None and k != "waveform"}
            numbers |= {"depth": at_worst(depth), "above": at_worst(above), "mean": at_worst(item.mean_stiffness)}
            chosen = {name: int(rows[worst]) for name, rows in selection.items()}
            _report(document, grid, index, numbers, at_worst(checked), chosen)
            return


def _report(
    document: Document, grid: Grid[Any], index: str | int, p: dict[str, float], level: float, chosen: dict[str, int]
) -> None:
    own = grid.system.meshes[index]
    allowed = grid.system.allow_negative_stiffness
    level_name = "mean stiffness" if allowed else "softer level"
    key = "epsilon" if "epsilon" in p else "amplitude" if "amplitude" in p else ""
    ratio = f" and contact ratio {p['contact_ratio']:.6g}" if "contact_ratio" in p else ""
    start = f"mesh '{getattr(own, 'name', index)}' has the {level_name} {level:.6g} <= 0"
    option = "" if allowed else ", or set system.allow_negative_stiffness: true"
    if not key:
        place = _place(document, grid, index, "waveform", chosen)
        document.report(place, "impossible", f"{start}, which its samples give", f"check the samples{option}")
        return
    limit, rule = _limit(p, key, allowed, wave_of(own.waveform))
    message = f"{start} at {key} {p[key]:.6g}{ratio}: the largest admissible {key} is below {limit:.6g} = {rule}"
    document.report(_place(document, grid, index, key, chosen), "impossible", message, f"reduce {key}{option}")


def _limit(p: dict[str, float], key: str, allowed: bool, wave: type[Waveform] | None) -> tuple[float, str]:
    """The largest epsilon or amplitude, and the formula for it."""
    depth, above, fraction = p["depth"], p["above"], wave is not None and wave.fraction_sets_levels
    low = f"d = {depth:.6g}" if fraction else f"-w = {depth:.6g} the least value of the wave"
    if "max_stiffness" in p and key == "amplitude":
        if allowed:
            if fraction:
                return p["max_stiffness"] / (2 * above), f"max_stiffness/(2 (1 - d)), d = {1 - above:.6g}"
            return p["max_stiffness"] / (2 * above), f"max_stiffness/(2 w), w = {above:.6g} the stiffer level"
        total = depth + above
        known = fraction or abs(total - 1) < 1e-12
        rule = "max_stiffness/2" if known else f"max_stiffness/(2 {total:.6g}), the peak-to-peak of the wave"
        return p["max_stiffness"] / (2 * total), rule
    divisor = "2 d" if fraction else "-2 w"
    if key == "amplitude":
        return p["mean"] / (2 * depth), f"mean_stiffness/({divisor}), {low}"
    return 1 / (2 * depth), f"1/({divisor}), {low}"


def _place(document: Document, grid: Grid[Any], index: str | int, key: str, chosen: dict[str, int]) -> Path:
    """Return the place of the value to blame: an axis that sets it or another level key, or the mesh."""
    for wanted in (key, *LEVEL_KEYS):
        for axis in grid.axes:
            if axis.name in chosen and any(a.path[:3] == ("meshes", index, wanted) for a in axis.assignments):
                path: Path = ("sweep", axis.name)
                point = chosen[axis.name]
                inner = [(*path, point), (*path, "values", point), (*path, "values")]
                return next((p for p in inner if document.get(p) is not None), path)
    return ("system", "meshes", index, key)


def check_symmetric(
    document: Document, system: Any, places: Sequence[tuple[str, ...]] = (("damping", "matrix"),)
) -> bool:
    """Report matrices below ``system`` that are not symmetric; return whether all are."""
    good = True
    for where in places:
        found = value_at(system, where)
        if found is None:
            continue
        values = matrix(found)
        difference = asymmetry(values)
        if np.any(difference):
            good = False
            i, j, entries = worst_entry(values, difference)
            path: Path = ("system", *where, i, j)
            full = ".".join(where)
            remedy = f"make {full}.{i}.{j} and {full}.{j}.{i} equal"
            report_matrix(document, path, where[0], f"is not symmetric: {entries}", remedy)
    return good


def asymmetry(values: Array) -> Array:
    """Return the entries of |A - A^T| of a matrix ``(n, n)``, zeros where all of them are rounding."""
    difference = np.abs(values - values.T)
    rounding = np.max(difference) <= SYMMETRY_TOLERANCE * np.max(np.abs(values))
    return np.zeros_like(difference) if rounding else difference


def worst_entry(values: Array, difference: Array) -> tuple[int, int, str]:
    """Return where a matrix ``(n, n)`` differs most from what it should be, and both entries of the place in words."""
    i, j = (int(k) for k in np.unravel_index(np.argmax(difference), difference.shape))
    return i, j, f"entry {i}.{j} is {values[i, j]:.6g}, entry {j}.{i} is {values[j, i]:.6g}"


def report_matrix(document: Document, path: Path, name: str, message: str, hint: str) -> None:
    """Report a matrix at the entry as written, or at the file that holds it."""
    if document.get(path[:2]) is None:
        held = document.get(("system", "files")) is not None
        path, message = ("system", *(("files", name) if held else ("file",))), f"{name} {message}"
    document.report(path, "matrix", message, hint)


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


def check_axes(document: Document, grid: Grid[Any]) -> None:
    """Report axes that set an entry of a matrix of a file and its transpose, where the two differ."""
    unlike: dict[Path, Array] = {
        path: asymmetry(held)
        for path in (("stiffness",), ("damping", "matrix"))
        if isinstance(held := value_at(grid.system, path), np.ndarray)
    }
    for axis in grid.axes:
        for path in (item.path for item in axis.assignments):
            found = unlike.get(path[:-2])
            if found is not None and found[int(path[-2]), int(path[-1])]:
                message = f"sets {dotted(path)} and its transpose, which differ in the file"
                document.report(("sweep", axis.name), "not_an_axis", message, "vary a term instead", at_key=True)
                break
