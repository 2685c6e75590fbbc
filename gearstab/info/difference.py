"""Differences between two results: verdicts, edges of regions, and every variable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.info.outcome import pieces
from gearstab.results.read import groups_of

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray

KEYS = ("mesh", "mode_p", "mode_q", "harmonic", "frequency_ratio", "occurrence")
"""Coordinates that say which region is which."""
ELSEWHERE = ("stable", "boundary_frequency")
"""Variables that verdicts and edges are about."""
WORK = (
    "status", "holder", "tolerance", "evaluations", "contacts", "sampled_step", "proved_frequency", "certificate",
    "certificate_frequency",
)  # fmt: skip
"""Variables that say how something was found and not what: they are not compared."""


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of equality.

    variables: difference of a variable, over the largest magnitude that it has in either result. edges: of an edge of a
    region, relative to it. verdicts: how many points may change between stable and unstable.
    """

    variables: float = 1e-9
    edges: float = 1e-9
    verdicts: int = 0


def difference(old: xr.DataTree, new: xr.DataTree, tolerances: Tolerances) -> dict[str, Any]:
    """Return what differs, as plain numbers, texts and lists; ``same`` says whether all lies within the tolerances.

    structure: groups, variables, axes and sizes that only one of them has, or that have other values. verdicts: by
    method, how many points changed, became unstable and became stable, and where the first of these lie. edges: regions
    that only one of them has, and edges that moved by more than the tolerance. variables: by group and name, the
    largest difference, over the largest magnitude.
    """
    before, after = groups_of(old), groups_of(new)
    structure = [f"group {name}: only in the {_which(name in before)}" for name in before.keys() ^ after.keys()]
    axes = _axes(old.to_dataset(), new.to_dataset())
    verdicts: dict[str, Any] = {}
    edges: dict[str, list[Any]] = {"only_first": [], "only_second": [], "moved": []}
    largest: dict[str, float | None] = {}
    for name in () if axes else (name for name in before if name in after):
        first, second = before[name], after[name]
        if "boundary_frequency" in first.data_vars and "boundary_frequency" in second.data_vars:
            first, second, known = _aligned(first, second)
            for key, values in _edges(name, first, second, known, tolerances.edges).items():
                edges[key] += values
        if "stable" in first.data_vars and "stable" in second.data_vars and first.sizes == second.sizes:
            verdicts[name] = _verdicts(first["stable"], second["stable"])
        lines, found = _variables(name, first, second)
        structure += lines
        largest |= found
    whole: dict[str, Any] = {"structure": [*axes, *sorted(structure)], "verdicts": verdicts, "edges": edges}
    whole["variables"] = largest
    changed = any(own["changed"] > tolerances.verdicts for own in verdicts.values())
    beyond = any(value is None or value > tolerances.variables for value in largest.values())
    return {"same": not (whole["structure"] or changed or beyond or any(edges.values())), **whole}


def _which(first: bool) -> str:
    return "first" if first else "second"


def _axes(first: xr.Dataset, second: xr.Dataset) -> list[str]:
    """Axes of the sweep that are not the same."""
    found = [f"axis {name}: only in the {_which(name in first.coords)}" for name in first.coords.keys() ^ second.coords]
    for name in first.coords:
        if name in second.coords:
            a, b = first[name].values, second[name].values
            if a.shape != b.shape:
                found.append(f"axis {name}: {a.size:,} values, {b.size:,} in the second")
            elif not np.array_equal(a, b):
                found.append(f"axis {name}: other values")
    return sorted(found)


def _verdicts(first: xr.DataArray, second: xr.DataArray) -> dict[str, Any]:
    counts = {"changed": 0, "to_unstable": 0, "to_stable": 0}
    places: list[dict[str, Any]] = []
    for part in pieces(first.shape):
        piece = first[part]
        a, b = piece.values, second[part].values
        differ = np.argwhere(a != b)
        counts["changed"] += len(differ)
        counts["to_unstable"] += int(np.sum((a != 0) & (b == 0)))
        counts["to_stable"] += int(np.sum((a != 1) & (b == 1)))
        for index in differ[: SHOWN - len(places)]:
            point = piece.isel(dict(zip(piece.dims, index, strict=True)))
            places.append({str(dim): point[dim].values.item() for dim in first.dims if dim in point.coords})
    return counts | {"first_places": places}


SHOWN = 5
"""Places that are listed."""


def _aligned(first: xr.Dataset, second: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset, tuple[list[Any], list[Any]]]:
    """Both groups cut down to the regions that both list, in one order; and the keys of each as they were."""
    keys = [_keys(first), _keys(second)]
    common = [key for key in keys[0] if key in keys[1]]
    places = [[own.index(key) for key in common] for own in keys]
    return first.isel(tongue=places[0]), second.isel(tongue=places[1]), (keys[0], keys[1])


def _keys(dataset: xr.Dataset) -> list[tuple[Any, ...]]:
    columns = [dataset[name].values.tolist() for name in KEYS if name in dataset.coords]
    return list(zip(*columns, strict=True))


def _edges(
    group: str, first: xr.Dataset, second: xr.Dataset, known: tuple[list[Any], list[Any]], tolerance: float
) -> dict[str, list[Any]]:
    """Regions that open in one of two results only, and those whose edges moved."""
    moved: list[dict[str, Any]] = []
    gone: list[dict[str, Any]] = []
    come: list[dict[str, Any]] = []
    a, b = (own["boundary_frequency"].transpose("tongue", "side", ...).values for own in (first, second))
    if a.shape == b.shape:
        there = np.isfinite(a), np.isfinite(b)
        with np.errstate(invalid="ignore"):
            shift = np.abs(a - b) / np.abs(a)
        for k in range(len(a)):
            label, mesh = (str(first[name].values[k]) for name in ("label", "mesh"))
            both, only, new = there[0][k] & there[1][k], there[0][k] & ~there[1][k], ~there[0][k] & there[1][k]
            said = {"group": group, "label": label, "mesh": mesh}
            if only.any():
                gone.append(said | {"rows": int(only.any(axis=0).sum())})
            if new.any():
                come.append(said | {"rows": int(new.any(axis=0).sum())})
            if both.any() and (far := float(shift[k][both].max())) > tolerance:
                moved.append(said | {"largest_shift": far, "rows": int((shift[k] > tolerance).any(axis=0).sum())})
    for own, other, found in ((known[0], known[1], gone), (known[1], known[0], come)):
        found += [{"group": group, "region": list(key)} for key in own if key not in other]
    return {"only_first": gone, "only_second": come, "moved": moved}


def _variables(group: str, first: xr.Dataset, second: xr.Dataset) -> tuple[list[str], dict[str, float | None]]:
    """Variables that are not comparable, in words, and the largest difference of the others; None of a lost value."""
    lines, found = [], {}
    for name in sorted({*first.data_vars, *second.data_vars} - {*ELSEWHERE, *WORK}):
        where = f"/{group}/{name}"
        if name not in first.data_vars or name not in second.data_vars:
            lines.append(f"variable {where}: only in the {_which(name in first.data_vars)}")
            continue
        a, b = first[name], second[name]
        if a.dims != b.dims or a.shape != b.shape:
            lines.append(f"variable {where}: {dict(a.sizes)}, {dict(b.sizes)} in the second")
        elif a.dtype.kind in "fiuc":
            found[where] = _largest(a, b)
        elif not np.array_equal(a.values, b.values):
            lines.append(f"variable {where}: other texts")
    return lines, found


def _largest(first: xr.DataArray, second: xr.DataArray) -> float | None:
    """The largest difference over the largest magnitude; None where one of them lacks a value that the other has."""
    far, size = 0.0, 0.0
    for part in pieces(first.shape):
        a, b = (np.asarray(own[part].values, dtype=np.result_type(own.dtype, float)) for own in (first, second))
        if not np.array_equal(np.isnan(a), np.isnan(b)):
            return None
        with np.errstate(invalid="ignore"):
            apart = np.where(a == b, 0.0, np.abs(a - b))
        far = max(far, float(np.nanmax(apart, initial=0.0)))
        size = max([size, *(float(np.nanmax(np.abs(own), initial=0.0, where=np.isfinite(own))) for own in (a, b))])
    return far / size if size else far


def report(facts: dict[str, Any], names: tuple[str, str], tolerances: Tolerances) -> str:
    """Return the text for a reader: what differs, nothing that does not."""
    lines = [f"{names[0]} and {names[1]} are {'the same' if facts['same'] else 'different'}"]
    lines += facts["structure"]
    for group, own in facts["verdicts"].items():
        if own["changed"]:
            said = f"{own['to_unstable']:,} became unstable, {own['to_stable']:,} stable"
            count, places = own["changed"], "; ".join(map(_point, own["first_places"]))
            lines.append(f"/{group}: {count:,} verdict{'s' * (count != 1)} changed: {said}; first: {places}")
    for key, words in (("only_first", "only in the first"), ("only_second", "only in the second")):
        lines += [f"/{item['group']}: region {_region(item)}: {words}" for item in facts["edges"][key]]
    for item in facts["edges"]["moved"]:
        moved = f"an edge moved by {item['largest_shift']:.3g} of itself"
        lines.append(f"/{item['group']}: region {_region(item)}: {moved}")
    for name, value in facts["variables"].items():
        if value is None:
            lines.append(f"{name}: values are missing in one of them")
        elif value > tolerances.variables:
            lines.append(f"{name}: differs by {value:.3g} of its largest magnitude")
    return "\n".join(lines)


def _point(place: dict[str, Any]) -> str:
    return ", ".join(
        f"{key} {value:.6g}" if isinstance(value, float) else f"{key} {value}" for key, value in place.items()
    )


def _region(item: dict[str, Any]) -> str:
    if "region" in item:
        return " ".join(str(part) for part in item["region"])
    rows = f", {item['rows']:,} rows" if item["rows"] > 1 else ""
    return f"{item['label']} of {item['mesh']}{rows}"
