"""A group of a result as tidy CSV: one row a grid point, one column an axis, a coordinate or a variable.

Numbers are written with the fewest digits that give the same double again, missing ones as empty cells.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.errors import ResultError
from gearstab.results.output import FIGURES, OTHERS, RESULTS, Content, writing
from gearstab.results.read import reading
from gearstab.results.variables import every_variable

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray

PREFERRED = ("floquet", "boundaries", "perturbation", "uncoupled", "response", "bench", "modes")
ROWS_AT_ONCE = 1 << 16


def export(
    path: Path, out: Path | None, stream: io.RawIOBase, group: str | None = None, over: str | None = None
) -> tuple[int, str]:
    """Write a group of the result at ``path`` to ``out``, without it to ``stream``, as UTF-8.

    group: default ``floquet``, else the first other one that there is.
    over: the dimensions of the rows, ``time,mesh`` or one of them, for groups whose variables lie across one another (a
        response has coordinates and mesh forces over ``time`` and spectra over ``frequency``), see :func:`led_by`.

    Returns the number of rows, and what the group holds besides (:func:`left_out`).
    Raises ResultError for a file, a group or a dimension that is not there, OutputError where ``out`` must not be
    written and OSError where it cannot be.
    """
    if out is not None:
        TABLE.refuse(out, path)
    with reading(path) as tree:
        dataset = tree[chosen_group(tree, group, path)].to_dataset()
        table = led_by(dataset, over, path)
        if out is None:
            rows = write_rows(table, stream)
        else:
            with writing(out, TABLE.refuse) as file:
                rows = write_rows(table, file)
        return rows, left_out(dataset, table)


def write_rows(dataset: xr.Dataset, file: Any) -> int:
    """Write the table to a binary file; the number of rows."""
    stream = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=False)
    try:
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
        stream.flush()
    finally:
        # The file is closed by whoever opened it.
        with suppress(OSError):
            stream.detach()
    return rows


def no_table(path: Path) -> str:
    """Return what a file is instead of a table of results, "" for one: the names of its columns tell."""
    with open(path, "rb") as file:
        head = file.read(HEAD).decode("utf-8", errors="replace").split("\n")[0]
    try:
        names = next(csv.reader([head]), [])
    except csv.Error:
        names = []
    known = {variable.name for variable in every_variable() if not variable.coordinate}
    return "" if known.intersection(names) else "is no table that gearstab wrote"


HEAD = 1 << 14
TABLE = Content("a table", ".csv", no_table, (*RESULTS, *FIGURES, *OTHERS), streams=True)


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


def left_out(dataset: xr.Dataset, table: xr.Dataset) -> str:
    """What a group holds beside the table, and how to get it; empty if the table holds everything."""
    missing = dataset.drop_vars(list(table.data_vars))
    parts = [f"{names_over(missing, dims)} (--over {','.join(dims)})" for dims in widest_sets(missing) if dims]
    return "not in the table: " + "; ".join(parts) if parts else ""


def names_over(dataset: xr.Dataset, dims: tuple[str, ...]) -> str:
    """The variables over all or some of the dimensions."""
    return ", ".join(str(name) for name, data in dataset.data_vars.items() if set(data.dims) <= set(dims))


def dimensions(dataset: xr.Dataset) -> list[str]:
    """The dimensions of the variables, in the order in which they name them, those with most dimensions first."""
    by_size = sorted(dataset.data_vars, key=lambda name: -dataset[name].ndim)
    return list(dict.fromkeys(str(dim) for name in by_size for dim in dataset[name].dims))


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
