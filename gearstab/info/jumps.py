"""The speeds at which motions with backlash jump, as ``gearstab info`` says them of a result with branches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gearstab.info.tables import columns
from gearstab.results.read import branches_of

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
    import numpy as np

    from gearstab.config.model.units import scale
    from gearstab.results.display import FACTOR, SHOWN_SCALE, SPEEDS

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


def text(found: list[dict[str, Any]]) -> list[str]:
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
