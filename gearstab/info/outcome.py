"""Outcome of a sweep, for machines: shares, the worst point, flags, regions with their edges, what is proved.

``gearstab sweep --json`` and ``gearstab info RESULT --json`` print it, ``gearstab sweep --fail-if`` judges by it.
"""

from __future__ import annotations

import operator
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.errors import RequestError
from gearstab.methods import METHODS
from gearstab.results.read import blocks, groups_of
from gearstab.results.variables import Flags

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 1 << 22
"""Points that are read together."""
NEAR = ("failed", "near_boundary", "coarse")
"""Flags of doubt that no note of a sweep mentions."""
NO_MOTION = "no_motion"
"""Meaning of a value of ``stable`` where a branch has no further point."""


def outcome(tree: xr.DataTree) -> dict[str, Any]:
    """Return the outcome of a sweep as plain numbers, texts and lists; axes are in SI units.

    points: of the grid. unstable, failed: how many points are unstable, and how many could not be computed.
    share_unstable: of all points. worst: the point of the largest growth rate, 1/s. flags: by method, how many points
    or regions carry each flag of ``status``; flagged: how many points carry a flag of doubt, and their share. regions:
    by ``boundaries``, with their edges for each value of the other axes, rad/s. proved: mean shares of the mesh
    frequencies. What the methods of the sweep do not tell is null.
    """
    groups = groups_of(tree)
    found: dict[str, Any] = {"points": None, "unstable": None, "share_unstable": None, "failed": None, "worst": None}
    tells = sorted(groups.items(), key=lambda item: item[0] != "floquet")
    dataset = next((own for _, own in tells if "stable" in own.data_vars and "status" in own.data_vars), None)
    if dataset is not None:
        found |= _verdicts(dataset)
    flags = {name: counts for name, own in groups.items() if (counts := _flags(own)) is not None}
    doubt = None if dataset is None else _doubtful(dataset)
    shares = None if doubt is None else {"points": doubt, "share": doubt / max(1, found["points"])}
    regions = _regions(groups["boundaries"]) if "boundaries" in groups else None
    return found | {"flags": flags, "flagged": shares, "regions": regions, "proved": _proved(groups)}


def pieces(shape: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Return parts of an array of few enough values to be read together, each value once."""
    return blocks(shape, AT_ONCE)


def _verdicts(dataset: xr.Dataset) -> dict[str, Any]:
    stable, growth = dataset["stable"], dataset.get("growth_rate")
    points, unstable, failed = stable.size, 0, 0
    motions = NO_MOTION in str(stable.attrs.get("flag_meanings", "")).split()
    worst: dict[str, Any] | None = None
    for part in pieces(stable.shape):
        values = stable[part].values
        unstable, lacking = unstable + int(np.sum(values == 0)), int(np.sum(values < 0))
        # Branches have as many points as the longest; what is behind the end of another one is no failure.
        points, failed = (points - lacking, failed) if motions else (points, failed + lacking)
        if growth is not None and np.isfinite(rates := growth[part].values).any():
            at = np.unravel_index(np.nanargmax(rates), rates.shape)
            best = growth[part].isel(dict(zip(growth[part].dims, at, strict=True)))
            if worst is None or float(best) > worst["growth_rate"]:
                worst = {"growth_rate": float(best), "at": _place(best, stable.dims)}
    share = unstable / max(1, points)
    return {"points": points, "unstable": unstable, "share_unstable": share, "failed": failed, "worst": worst}


def _place(point: xr.DataArray, dims: tuple[Any, ...]) -> dict[str, Any]:
    """Where a point lies on the axes, whose index stands for values that they do not have."""
    return {str(dim): point[dim].values.item() for dim in dims if dim in point.coords}


def _flags(dataset: xr.Dataset) -> dict[str, int] | None:
    """How many values of ``status`` carry each flag, those that none carries left out."""
    if "status" not in dataset.data_vars or not (flags := Flags.of(dataset["status"].attrs)):
        return None
    total: Counter[str] = Counter()
    for part in pieces(dataset["status"].shape):
        total.update(flags.counted(dataset["status"][part].values))
    return {name: total[name] for name in flags if total[name]}


def _doubtful(dataset: xr.Dataset) -> int:
    """How many points carry a flag that tells of doubt."""
    noted = {name for method in METHODS.values() for name in method.flag_notes} | set(NEAR)
    mask = sum(bit for name, bit in Flags.of(dataset["status"].attrs).items() if name in noted)
    status = dataset["status"]
    return sum(int(np.count_nonzero(status[part].values & mask)) for part in pieces(status.shape))


def _regions(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """The regions that are open anywhere, in the order of the file."""
    found, edges = [], dataset["boundary_frequency"].transpose("tongue", "side", ...)
    rows = edges.dims[2:]
    for k in range(edges.sizes["tongue"]):
        own = edges.isel(tongue=k)
        values = own.values.reshape(2, -1)
        open_ = np.flatnonzero(np.isfinite(values).all(axis=0))
        if not len(open_):
            continue
        listed = []
        for row in open_:
            at = dict(zip(rows, np.unravel_index(row, own.shape[1:]), strict=True))
            low, high = values[:, row].tolist()
            listed.append({**_place(own.isel(at), rows), "lower": low, "upper": high})
        names = ("label", "mesh", "kind", "mode_p", "mode_q", "harmonic", "occurrence")
        values_of = {name: dataset[name].values[k] for name in names if name in dataset.coords}
        known = {name: value if isinstance(value, str) else value.item() for name, value in values_of.items()}
        found.append({**known, "edges": listed})
    return found


def _proved(groups: dict[str, xr.Dataset]) -> dict[str, float] | None:
    """Mean shares of what is proved stable, only counted, and certified, by name."""
    said = {"proved_share": "stable", "counted_share": "counted", "certified_share": "certified"}
    own, found = groups.get("boundaries"), {}
    for name, key in said.items():
        if own is not None and name in own.data_vars and np.isfinite(own[name].values).any():
            found[key] = float(np.nanmean(own[name].values))
    floquet = groups.get("floquet")
    if floquet is not None and "certified" in floquet.data_vars:
        array = floquet["certified"]
        found["certified_points"] = sum(int(array[part].values.sum()) for part in pieces(array.shape)) / array.size
    return found or None


# ---- conditions

QUANTITIES = {
    "unstable": "share of the points that are unstable",
    "growth": "largest growth rate, 1/s",
    "flagged": "share of the points with a flag of doubt",
    "failed": "share of the points that could not be computed",
    "regions": "number of regions of boundaries that are open anywhere",
}
"""Quantities of a condition."""
SIGNS = {">": operator.gt, ">=": operator.ge}
FORM = re.compile(r"\s*([a-z]+)\s*(?:(>=|>)\s*(\S+)\s*)?")


@dataclass(frozen=True)
class Condition:
    """QUANTITY, QUANTITY > NUMBER or QUANTITY >= NUMBER; a quantity alone means that it is above 0."""

    text: str
    quantity: str
    sign: str
    bound: float

    def value(self, found: dict[str, Any]) -> float | None:
        """Return the quantity in an :func:`outcome`, None where the methods of the sweep do not tell."""
        points = found["points"]
        if self.quantity == "growth":
            return None if found["worst"] is None else float(found["worst"]["growth_rate"])
        if self.quantity == "regions":
            return None if found["regions"] is None else float(len(found["regions"]))
        if points is None:
            return None
        counts = {"unstable": found["unstable"], "failed": found["failed"], "flagged": found["flagged"]["points"]}
        return float(counts[self.quantity] / points)

    def met(self, value: float) -> bool:
        """Return whether a value of the quantity meets it."""
        return bool(SIGNS[self.sign](value, self.bound))


def condition(text: str) -> Condition:
    """Return the condition that a text means. Raises RequestError, with what may stand there."""
    found = FORM.fullmatch(text)
    try:
        quantity, sign, number = found.groups() if found else ("", None, None)
        bound = 0.0 if number is None else float(number)
    except ValueError:
        quantity, sign, bound = "", None, 0.0
    if quantity not in QUANTITIES or not np.isfinite(bound):
        known = ", ".join(QUANTITIES)
        raise RequestError(f"--fail-if {text!r}: write a quantity, or QUANTITY > NUMBER or >=; quantities: {known}")
    return Condition(text, quantity, sign or ">", bound)


NEEDED = {"regions": "holder"}
"""Variable that a quantity comes from, where that is not ``stable``."""


def refuse(path: Path, conditions: list[Condition], variables: list[str]) -> None:
    """Raise RequestError for a condition that a sweep with these variables cannot tell of."""
    for item in conditions:
        if NEEDED.get(item.quantity, "stable") not in variables:
            needs = "boundaries" if item.quantity == "regions" else "floquet"
            raise RequestError(f"{path}: --fail-if {item.text!r}: no method of the sweep tells; add methods: {needs}")


def judged(path: Path, conditions: list[Condition], found: dict[str, Any]) -> list[str]:
    """Return a line for each condition that an :func:`outcome` meets."""
    values = [(item, item.value(found)) for item in conditions]
    return [
        f"{path}: {item.text}: the {QUANTITIES[item.quantity]} is {value:.6g}"
        for item, value in values
        if value is not None and item.met(value)
    ]
