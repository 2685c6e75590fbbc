"""Text of ``gearstab info`` on a result: its origin, its axes, groups and variables, and jumps of its branches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.model.units import scale
from gearstab.info import columns
from gearstab.info.outcome import outcome
from gearstab.results.display import FACTOR, SHOWN_SCALE, SPEEDS, in_display_units
from gearstab.results.read import SIGNATURE, attributes, branches_of, is_sealed, reading

if TYPE_CHECKING:
    import xarray as xr

MEASURE = "transmission_error_rms"
PLACE = "branch", "point"
RPM = "rpm"


def jumps(tree: xr.DataTree) -> list[dict[str, Any]]:
    """Return the jumps of all systems, in the order of the axes, then of the value.

    value: of the axis along which motions were followed, as it is shown, an input speed in rpm. before, after: root
    mean squares of the transmission error, of the mesh where it changes most; after is None where that is not known.
    """
    data = branches_of(tree)
    own = "branch_value" in data
    axis = tree[str(data.attrs["over"])] if own else next(tree[name] for name in SPEEDS if name in tree.coords)
    parameter = "branch_value" if own else "mesh_frequency"
    factor, unit = float(axis.attrs.get(SHOWN_SCALE if own else FACTOR, 1.0)), str(axis.attrs.get("units", "1"))
    if axis.name == SPEEDS[1]:
        factor, unit = factor * scale(RPM, "rad/s") / scale(unit, "rad/s"), RPM
    found = []
    for index in np.argwhere(data["jump"].values != 0):
        row = dict(zip(map(str, data["jump"].dims), map(int, index), strict=True))
        one = data.isel({name: k for name, k in row.items() if name not in PLACE})
        here = one.isel({name: row[name] for name in PLACE})
        landing = {name: int(here[f"landing_{name}"]) for name in PLACE}
        before = here[MEASURE].values
        value = float(here[parameter])
        own_branch = one.isel(branch=landing["branch"])
        after = None if landing["branch"] < 0 else _between(own_branch, parameter, value, landing["point"])
        mesh = int(np.argmax(before if after is None else np.abs(after - before)))
        axes = [name for name in row if name in data.coords and name not in PLACE]
        found.append({
            "at": {name: data[name].values[row[name]].item() for name in axes},
            "of": str(axis.name), "value": value / factor,
            "unit": "" if unit == "1" else unit,
            "direction": "rising" if int(here["jump"]) > 0 else "falling",
            "mesh": str(data["mesh"].values[mesh]), "before": float(before[mesh]),
            "after": None if after is None else float(after[mesh]), "measured_in": str(data[MEASURE].attrs["units"]),
        })  # fmt: skip
    return sorted(found, key=lambda jump: ([str(value) for value in jump["at"].values()], jump["value"]))


def _between(branch: xr.Dataset, parameter: str, value: float, place: int) -> Any:
    """The measure ``(meshes,)`` at a value of the parameter: between the motion next to it and the one behind it."""
    there, measures = branch[parameter].values, branch[MEASURE].values
    for other in (place - 1, place + 1):
        if 0 <= other < len(there) and (there[place] - value) * (there[other] - value) < 0:
            part = (value - there[place]) / (there[other] - there[place])
            return measures[place] + part * (measures[other] - measures[place])
    return measures[place]


def jump_table(found: list[dict[str, Any]]) -> list[str]:
    """Return the table of jumps."""
    if not found:
        return ["no jumps: no stable motion ends within the range"]
    own = "" if found[0]["measured_in"] == "1" else f" ({found[0]['measured_in']})"
    head = [found[0]["of"], "as it is", *found[0]["at"], "mesh", f"rms error before{own}", f"after{own}"]
    rows = [
        [
            f"{jump['value']:.6g} {jump['unit']}".strip(), jump["direction"],
            *(f"{value:.6g}" if isinstance(value, float) else str(value) for value in jump["at"].values()),
            jump["mesh"], f"{jump['before']:.4g}", "not known" if jump["after"] is None else f"{jump['after']:.4g}",
        ]
        for jump in found
    ]  # fmt: skip
    return ["jumps of the motion:", *columns(head, rows)]


PROVENANCE = (
    ("command", "command"), ("config_file", "configuration"), ("config_overrides", "with --set"),
    ("created", "created"), ("gearstab_version", "gearstab"), ("format_version", "format of the file"),
    ("kernel", "kernel"), ("numpy_version", "NumPy"), ("h5py_version", "h5py"), ("hdf5_version", "HDF5"),
    ("python_version", "Python"), ("config_digest", "digest"),
)  # fmt: skip
"""Attributes of the root, and what they are called here."""


def is_result(path: Path) -> bool:
    """Return whether a file is meant as a result rather than as a configuration: it begins as HDF5 does."""
    try:
        if not path.is_file():
            return False
        with open(path, "rb") as file:
            return file.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False


def describe(path: Path, unit: Sequence[str] = (), judged: bool = False) -> dict[str, Any]:
    """Return all that is shown, as plain numbers, texts and lists.

    unit: see :func:`gearstab.results.display.in_display_units`. judged: whether to say what came out, for which the
    values of a sweep are read. Raises ResultError.
    """
    with reading(path) as stored:
        root, tree = attributes(path), in_display_units(stored, unit)
        return {
            "title": root.get("title", ""),
            "provenance": {name: root[name] for name, _ in PROVENANCE if name in root},
            "unchanged": bool(is_sealed(path)),
            "certificates": _certificates(stored),
            "outcome": outcome(stored) if judged and root["command"] == "sweep" else None,
            "axes": _coordinates(tree.to_dataset()),
            "groups": [_group(str(name), node.to_dataset(inherit=False)) for name, node in tree.children.items()],
        } | ({"jumps": jumps(tree)} if "branches" in tree.children else {})


def _certificates(stored: xr.DataTree) -> str:
    """Share of the range with certificates, "" without any."""
    from gearstab.certificates.shares import said

    names = ("certified_share", "uncertified_width", "uncertified_at_boundary")
    if "boundaries" not in stored.children or not {*names} <= {*stored["boundaries"].data_vars}:
        return ""
    found = stored["boundaries"].to_dataset()
    return said(*(found[name].values for name in names))


def _group(name: str, dataset: xr.Dataset) -> dict[str, Any]:
    """A group with what it has besides the axes of the sweep."""
    return {
        "name": name,
        "dimensions": {str(dim): int(size) for dim, size in dataset.sizes.items()},
        "coordinates": _coordinates(dataset),
        "variables": [_variable(item) for item in dataset.data_vars.values()],
        "attributes": {str(key): _plain(value) for key, value in dataset.attrs.items() if key != "coordinates"},
    }


def _coordinates(dataset: xr.Dataset) -> list[dict[str, Any]]:
    return [_coordinate(item) for item in dataset.coords.values() if item.ndim == 1]


def _coordinate(item: xr.DataArray) -> dict[str, Any]:
    """A coordinate: its extent if it is numeric, else the first of its different values."""
    values = item.values
    found = _variable(item) | {"size": int(item.size)}
    if values.dtype.kind in "fiu":
        finite = values[np.isfinite(values)]
        ends = [finite.min(), finite.max()] if finite.size else [None, None]
        return found | {"extent": [_plain(end) for end in ends]}
    return found | {"values": list(dict.fromkeys(str(value) for value in values))[: SHOWN + 1]}


SHOWN = 4
"""Labels of an axis that are listed."""


def _variable(item: xr.DataArray) -> dict[str, Any]:
    flags = str(item.attrs.get("flag_meanings", "")).split()
    return {
        "name": str(item.name),
        "dimensions": [str(dim) for dim in item.dims],
        "units": str(item.attrs.get("units", "")),
        "long_name": str(item.attrs.get("long_name", "")),
    } | ({"flags": flags} if flags else {})


def _plain(value: Any) -> Any:
    """A value for JSON: no NaN, no types of NumPy."""
    if isinstance(value, np.ndarray):
        return [_plain(item) for item in value.tolist()]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def report(facts: dict[str, Any]) -> str:
    """Return the text for a reader; of a design its answer, in some ten lines."""
    answer = next((group["attributes"]["answer"] for group in facts["groups"] if "answer" in group["attributes"]), None)
    if answer is not None:
        return "\n".join([facts["title"], *answer.splitlines(), "(--json lists the groups and variables of the file)"])
    lines = [facts["title"], ""]
    known = facts["provenance"]
    width = max(len(text) for _, text in PROVENANCE)
    lines += [f"{text:<{width}}  {' '.join(known[name].split())}" for name, text in PROVENANCE if known.get(name)]
    if not facts["unchanged"]:
        lines.append(f"{'checksum':<{width}}  none: the file was changed after it was written, or is an old one")
    if facts["certificates"]:
        lines.append(f"{'certificates':<{width}}  {facts['certificates']}; gearstab verify proves them")
    lines += _listed("axes of the sweep", {}, facts["axes"], [])
    for group in facts["groups"]:
        sizes = ", ".join(f"{name} {size:,}" for name, size in group["dimensions"].items())
        title = f"/{group['name']}" + (f" ({sizes})" if sizes else "")
        lines += _listed(title, group["attributes"], group["coordinates"], group["variables"])
        if group["name"] == "branches":
            lines += ["", *jump_table(facts["jumps"])]
    return "\n".join(lines)


def _listed(
    title: str, attributes: dict[str, Any], coordinates: list[dict[str, Any]], variables: list[dict[str, Any]]
) -> list[str]:
    """A title and what is below it, nothing where nothing is."""
    lines = [f"{name}: {_short(value)}" for name, value in attributes.items()]
    if coordinates:
        rows = [[item["name"], _over(item), _extent(item), _unit(item), item["long_name"]] for item in coordinates]
        lines += ["", *columns(["coordinate", "over", "from .. to", "unit", "long name"], rows)]
    if variables:
        rows = [[item["name"], _over(item), _unit(item), _meaning(item)] for item in variables]
        lines += ["", *columns(["variable", "over", "unit", "long name"], rows)]
    return ["", title, *lines] if lines else []


def _over(item: dict[str, Any]) -> str:
    return ", ".join(item["dimensions"]) or "-"


def _unit(item: dict[str, Any]) -> str:
    return "" if item["units"] == "1" else item["units"]


def _meaning(item: dict[str, Any]) -> str:
    return item["long_name"] + (f": {', '.join(item['flags'])}" if "flags" in item else "")


def _extent(item: dict[str, Any]) -> str:
    if "values" in item:
        return "; ".join(item["values"][:SHOWN]) + ("; ..." if len(item["values"]) > SHOWN else "")
    low, high = (end if end is None else f"{end:.6g}" for end in item["extent"])
    if low is None:
        return "-"
    return low if low == high else f"{low} .. {high}"


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
