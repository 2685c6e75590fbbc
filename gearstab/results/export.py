"""A group of a result as tidy CSV: one row a grid point, one column an axis, a coordinate or a variable.

Numbers are written with the fewest digits that give the same double again, missing ones as empty cells.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from gearstab.results.errors import ResultError
from gearstab.results.read import open_result

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray

PREFERRED = ("floquet", "boundaries", "perturbation", "uncoupled", "response", "bench", "modes")
ROWS_AT_ONCE = 1 << 16


def export_csv(path: Path, out: Path, group: str | None = None, over: str | None = None) -> int:
    """Write a group of the result at ``path`` to ``out``, which gets its name when complete; the number of rows.

    group: default ``floquet``, else the first other one that there is.
    over: the dimensions of the rows, ``time,mesh`` or one of them, for groups whose variables lie across one another (a
        response has coordinates and mesh forces over ``time`` and spectra over ``frequency``), see :func:`led_by`.

    Raises ResultError for a file, a group or a dimension that is not there, OSError if ``out`` cannot be written.
    """
    if out.exists() and out.samefile(path):
        raise ResultError(f"{out}: is the result itself; choose another output")
    temporary = out.with_name(f".{out.name}.{os.getpid()}.tmp")
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        with open(temporary, "w", newline="", encoding="utf-8") as file:
            rows = to_stream(path, file, group, over)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, out)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.filename in (None, str(temporary)):
            # The user knows the name of the output only.
            raise OSError(error.errno, error.strerror, str(out)) from error
        raise
    return rows


def to_stream(path: Path, stream: TextIO, group: str | None = None, over: str | None = None) -> int:
    """Write a group of the result at ``path`` to a text stream; the number of rows."""
    with open_result(path) as tree:
        dataset = led_by(tree[chosen_group(tree, group, path)].to_dataset(), over, path)
        writer = csv.writer(stream, lineterminator="\n")
        dims = dimensions(dataset)
        columns = column_names(dataset, dims)
        writer.writerow(columns)
        rows = 0
        for block in blocks([dataset.sizes[dim] for dim in dims]):
            part = dataset.isel(dict(zip(dims, block, strict=True)))
            cells = [flat(part, dims, name) for name in columns]
            writer.writerows(zip(*cells, strict=True))
            rows += len(cells[0]) if cells else 0
    return rows


def chosen_group(tree: xr.DataTree, group: str | None, path: Path) -> str:
    """The group to write. Raises ResultError naming those there are."""
    there = [str(name) for name in tree.children]
    if group is not None:
        name = group.strip("/")
        if name not in there:
            raise ResultError(f"{path}: has no group '{group}'; it has {', '.join(there) or 'none'}")
        return name
    found = [name for name in PREFERRED if name in there] or there
    if not found:
        raise ResultError(f"{path}: has no groups")
    return found[0]


def led_by(dataset: xr.Dataset, over: str | None, path: Path) -> xr.Dataset:
    """The variables over the chosen dimensions, and those over some of them, whose values repeat.

    A table holds no two sets of dimensions that lie across one another: its rows would be the product of both. Without
    ``over`` the first variable's first dimension leads; of several sets the one with most variables is chosen.
    Raises ResultError naming the dimensions there are.
    """
    sets = widest_sets(dataset)
    asked = [part.strip() for part in over.split(",")] if over else []
    if not asked:
        asked = [str(dim) for dim in next((data.dims[:1] for data in dataset.data_vars.values() if data.dims), ())]
    matching = [dims for dims in sets if set(asked) <= set(dims)]
    if over and not matching:
        there = "; ".join(",".join(dims) for dims in sets) or "no dimension"
        raise ResultError(f"{path}: nothing stands over '{over}' there; there is {there}")
    if not asked or not matching:
        return dataset
    best: tuple[str, ...] = max(matching, key=lambda dims: sets[dims])
    chosen = set(best)
    return dataset[[name for name, data in dataset.data_vars.items() if set(data.dims) <= chosen]]


def widest_sets(dataset: xr.Dataset) -> dict[tuple[str, ...], int]:
    """The sets of dimensions that are no part of another, with the number of variables that stand over each."""
    counts: dict[tuple[str, ...], int] = {}
    for data in dataset.data_vars.values():
        dims = tuple(map(str, data.dims))
        counts[dims] = counts.get(dims, 0) + 1
    return {dims: n for dims, n in counts.items() if not any(set(dims) < set(other) for other in counts)}


def left_out(path: Path, group: str | None = None, over: str | None = None) -> str:
    """What the group holds beside the table, and how to get it; empty if the table holds everything."""
    with open_result(path) as tree:
        dataset = tree[chosen_group(tree, group, path)].to_dataset()
        missing = dataset.drop_vars(list(led_by(dataset, over, path).data_vars))
        sets = widest_sets(missing)
        parts = [f"{names_over(missing, dims)} (--over {','.join(dims)})" for dims in sets if dims]
    return "not in the table: " + "; ".join(parts) if parts else ""


def names_over(dataset: xr.Dataset, dims: tuple[str, ...]) -> str:
    """The variables over all or some of the dimensions."""
    return ", ".join(str(name) for name, data in dataset.data_vars.items() if set(data.dims) <= set(dims))


def dimensions(dataset: xr.Dataset) -> list[str]:
    """The dimensions of the variables, in the order in which they name them."""
    return list(dict.fromkeys(str(dim) for name in by_size(dataset) for dim in dataset[name].dims))


def by_size(dataset: xr.Dataset) -> list[str]:
    """The variables, those with most dimensions first."""
    return [str(name) for name in sorted(dataset.data_vars, key=lambda name: -dataset[name].ndim)]


def column_names(dataset: xr.Dataset, dims: Sequence[str]) -> list[str]:
    """Axes (tongues have no numbers and go by what describes them), coordinates beside them, then variables."""
    axes = [name for name in dims if name in dataset.coords]
    beside = [str(name) for name, c in dataset.coords.items() if name not in dims and set(c.dims) <= set(dims)]
    return [*axes, *beside, *(str(name) for name in dataset.data_vars)]


def blocks(shape: Sequence[int]) -> Iterator[tuple[slice, ...]]:
    """Slices that run over an array in order, with at most about ROWS_AT_ONCE points each."""
    lengths, left = [1] * len(shape), ROWS_AT_ONCE
    for k in reversed(range(len(shape))):
        lengths[k] = max(1, min(shape[k], left))
        left //= lengths[k]
        if lengths[k] < shape[k]:
            break
    ranges = [range(0, n, step) for n, step in zip(shape, lengths, strict=True)]
    for start in product(*ranges):
        yield tuple(slice(s, s + step) for s, step in zip(start, lengths, strict=True))


def flat(part: xr.Dataset, dims: Sequence[str], name: str) -> list[Any]:
    """A variable over all dims of the block, as cells."""
    sizes = [part.sizes[dim] for dim in dims]
    data = part[name]
    inner = [dim for dim in dims if dim in data.dims]
    shape = [part.sizes[dim] if dim in inner else 1 for dim in dims]
    values = np.broadcast_to(data.transpose(*inner).values.reshape(shape), sizes).ravel()
    return cells(values)


def cells(values: Array) -> list[Any]:
    """Texts, integers as they are, floats in their shortest exact form, NaN empty."""
    if values.dtype.kind != "f":
        return [str(v) for v in values.tolist()] if values.dtype.kind in "OUST" else list(values.tolist())
    return ["" if v != v else repr(v) for v in values.tolist()]
