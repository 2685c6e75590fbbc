"""Statements of a reproduction table, the sweeps behind them, and how to read those."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from gearstab.config import load
from gearstab.floquet.boundaries import BOUNDARY_FLAGS
from gearstab.response.command import respond
from gearstab.results import open_result
from gearstab.sweep import plan, run

CONFIGS = Path(__file__).parent.parent / "configs"

MERGED = BOUNDARY_FLAGS["merged"] | BOUNDARY_FLAGS["absorbed"]


@dataclass(frozen=True)
class Statement:
    """One statement of a paper, and what comes out here.

    place: where the paper says so. claim: what it says. ours: what was computed.
    agrees: True, False, or None for "in part": a comparison of the numbers in ``ours``, never a constant.
    rule: that comparison in words: when the statement agrees and, after "in part", when it does in part.
    why: what explains a disagreement, or what the agreement means.
    """

    place: str
    claim: str
    ours: str
    agrees: bool | None
    rule: str
    why: str = ""


SAME_TO_ROUNDING = "equal to 1e-9"
EVERY = "so for every number here"
EVERY_OR_SOME = "so for every number here; in part: for some"
AS_PRINTED = "as printed"
OVERLAP_RULE = "all overlaps at least 0.8; in part: at least 0.5"


@dataclass(frozen=True)
class Paper:
    """A paper and what is checked of it.

    name: authors and year. reference: the whole reference. remarks: what a reader of the table must know, a paragraph.
    sections: under the title of each, functions that compute statements.
    """

    name: str
    reference: str
    remarks: str
    sections: Mapping[str, Sequence[Callable[[Runs], Iterator[Statement]]]]


class Runs:
    """Result files of the configurations with changed values, each computed once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known: dict[tuple[str, ...], xr.DataTree] = {}

    def sweep(self, config: str, **changes: object) -> xr.DataTree:
        """The result of ``gearstab sweep configs/CONFIG.yaml --set PATH=VALUE ...``; ``__`` is a dot of a path.

        config: may also be the absolute path, without its ending, of a configuration made for the purpose.
        """
        key, settings = self._key("sweep", config, changes)
        if key not in self._known:
            out = self._out()
            run(plan(load(CONFIGS / f"{config}.yaml", settings)), out)
            self._known[key] = open_result(out)
        return self._known[key]

    def respond(self, config: str, **changes: object) -> xr.DataTree:
        """The result of ``gearstab respond`` with changed values."""
        key, settings = self._key("respond", config, changes)
        if key not in self._known:
            out = self._out()
            respond(load(CONFIGS / f"{config}.yaml", settings), out)
            self._known[key] = open_result(out)
        return self._known[key]

    @staticmethod
    def _key(command: str, config: str, changes: Mapping[str, object]) -> tuple[tuple[str, ...], list[str]]:
        settings = [f"{name.replace('__', '.')}={json.dumps(value)}" for name, value in changes.items()]
        return (command, config, *settings), settings

    def _out(self) -> Path:
        return self.folder / f"{len(self._known)}.h5"

    def config(self, text: str) -> str:
        """A configuration made for the purpose, as ``sweep`` takes it."""
        path = self.folder / f"made-{hashlib.sha256(text.encode()).hexdigest()[:16]}.yaml"
        path.write_text(text)
        return str(path.with_suffix(""))


def tongue(tree: xr.DataTree, group: str, variable: str, label: str) -> xr.DataArray:
    """A variable of the one tongue with this label, without the ``tongue`` dimension."""
    values = tree[group].to_dataset()
    (index,) = np.flatnonzero(values["label"].values.astype(str) == label)
    return values[variable].isel(tongue=index, drop=True)


def half_width(tree: xr.DataTree, label: str) -> xr.DataArray:
    """First-order half-width."""
    return tongue(tree, "perturbation", "half_width", label)


def slope(tree: xr.DataTree, label: str) -> xr.DataArray:
    """First-order half-width per unit of epsilon; the sweep has an axis ``epsilon``."""
    values = half_width(tree, label)
    return (values / values["epsilon"]).isel(epsilon=-1, drop=True)


def predicted(tree: xr.DataTree, label: str) -> xr.DataArray:
    """First-order edges, over ``side``."""
    return tongue(tree, "perturbation", "boundary_frequency", label)


def regions(tree: xr.DataTree, label: str) -> xr.Dataset:
    """The regions by Floquet theory that the tongue with this label belongs to, one or (where it is split) more."""
    values = tree["boundaries"].to_dataset().drop_vars("mesh_frequency", errors="ignore")
    parts = values.isel(tongue=np.flatnonzero(values["label"].values.astype(str) == label))
    # A tongue that has merged into another one's region has that region's edges.
    of_holder = values["boundary_frequency"].isel(tongue=parts["holder"].clip(min=0))
    parts["boundary_frequency"] = of_holder.where(parts["holder"] >= 0)
    return parts


def edges(tree: xr.DataTree, label: str) -> xr.DataArray:
    """Edges by Floquet theory, over ``side``; NaN where the region is closed, the outermost ones where it is split."""
    found = regions(tree, label)["boundary_frequency"]
    return xr.concat([found.isel(side=0).min("tongue"), found.isel(side=1).max("tongue")], found["side"])


def measured(tree: xr.DataTree, label: str, **selection: object) -> str:
    """Widths by Floquet theory as the table prints them: with a star where the region has merged with another one."""
    merged = (regions(tree, label)["status"] & MERGED).any("tongue")
    size = width(edges(tree, label))
    values, stars = (v.sel(selection).values.ravel() for v in (size, merged))
    return ", ".join(number(v) + "*" * bool(star) for v, star in zip(values, stars, strict=True))


def width(values: xr.DataArray) -> xr.DataArray:
    """Upper less lower edge, 0 where there is no region."""
    return (values.isel(side=1, drop=True) - values.isel(side=0, drop=True)).fillna(0.0)


def overlap(tree: xr.DataTree, label: str) -> xr.DataArray:
    """Common part of a region by first order and by Floquet theory, over what either covers."""
    first, exact = predicted(tree, label), edges(tree, label)
    lower, upper = first.clip(min=exact), first.clip(max=exact)
    both = xr.concat([lower.isel(side=0, drop=True), upper.isel(side=1, drop=True)], first["side"])
    common = width(both).clip(min=0.0)
    return common / (width(first) + width(exact) - common)


def well(overlaps: Iterable[object]) -> bool | None:
    """Whether boundaries agree well by their overlaps: OVERLAP_RULE."""
    least = min(float(np.min(values)) for values in map(np.asarray, overlaps))
    return sort_of(least >= 0.8, least >= 0.5)


def center(values: xr.DataArray) -> xr.DataArray:
    """The middle of a region."""
    return values.mean("side")


def by_label(tree: xr.DataTree, labels: Iterable[str], **selection: object) -> str:
    """The same of several regions, each with its name."""
    return "; ".join(f"{label}: {measured(tree, label, **selection)}" for label in labels)


def number(value: object, digits: int = 3) -> str:
    """A number as the table prints it; rounding errors are 0."""
    x = float(np.asarray(value))
    return "0" if abs(x) < 1e-9 else f"{x:.{digits}g}"


def numbers(values: Iterable[object], digits: int = 3) -> str:
    """Several of them."""
    return ", ".join(number(v, digits) for v in np.asarray(values).ravel())


def at_most(error: object, bound: str = "1e-9") -> str:
    """An upper bound of an error that is nothing but rounding (which differs from machine to machine), or the error."""
    x = float(np.asarray(error))
    return f"equal to {bound}" if x < float(bound) else f"largest relative difference {x:.2g}"


def sort_of(fully: bool, partly: bool) -> bool | None:
    """True where a statement holds, None where it does in part, else False."""
    return True if fully else (None if partly else False)
