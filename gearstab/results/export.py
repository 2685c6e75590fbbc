"""A group of a result as tidy CSV: one row per grid point, one column an axis, a coordinate or a variable.

Numbers are written with the fewest digits that give the same double again, missing ones as empty cells.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.errors import ResultError, listed
from gearstab.results.display import OF_MESH, in_display_units, in_speeds, number_of
from gearstab.results.output import FIGURES, OTHERS, RESULTS, Content, writing
from gearstab.results.read import blocks, reading
from gearstab.results.variables.responses import every_variable

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray

BRANCH, THERE = "branch", "stable"
"""Dimension of groups that hold branches, and the variable that is -1 beyond the last motion of one."""
PREFERRED = ("floquet", "boundaries", "perturbation", "uncoupled", "response", "branches", "bench", "modes")
ROWS_AT_ONCE, BYTES_AT_ONCE = 1 << 15, 1 << 26
"""Rows of a table that are made text together, and that are read together."""


def export(
    path: Path, out: Path | None, stream: io.RawIOBase, group: str | None = None, over: str | None = None,
    select: Mapping[str, str] | None = None, unit: Sequence[str] = (),
) -> tuple[int, list[str]]:  # fmt: skip
    """Write a group of the result at ``path`` to ``out``, without it to ``stream``, as UTF-8.

    group: default ``floquet``, else the first other one that there is.
    over: the dimensions of the rows, ``time,mesh`` or one of them, for groups whose variables lie across one another (a
        response has coordinates and mesh forces over ``time`` and spectra over ``frequency``), see :func:`led_by`.
    select: values of axes, to which the table is cut down (:func:`selected`). unit: units of axes other than those that
        were typed (:func:`gearstab.results.display.in_display_units`).

    Returns the number of rows, and notes: where a selected value is none of an axis, what the group holds besides.
    Raises ResultError for a file, a group or a dimension that is not there, OutputError where ``out`` must not be
    written and OSError where it cannot be.
    """
    if out is not None:
        TABLE.refuse(out, path)
    with reading(path) as tree:
        shown = in_display_units(tree, unit)
        whole = numbered(in_speeds(shown, chosen_group(shown, group, path)))
        dataset, notes = selected(whole, select or {}, path)
        table = led_by(dataset, over, path)
        if out is None:
            rows = write_rows(table, stream)
        else:
            with writing(out, TABLE.refuse) as file:
                rows = write_rows(table, file)
        missing = left_out(dataset, table)
        return rows, [*notes, *([missing] if missing else [])]


def numbered(dataset: xr.Dataset) -> xr.Dataset:
    """A group of real numbers whose rows can be told apart: complex variables as two, branches with their numbers."""
    variables: dict[Any, xr.DataArray] = {}
    for name, data in dataset.data_vars.items():
        parts = {f"{name}_real": data.real, f"{name}_imag": data.imag} if data.dtype.kind == "c" else {name: data}
        variables |= {own: part.assign_attrs(data.attrs) for own, part in parts.items()}
    coords: dict[Any, Any] = dict(dataset.coords)
    if BRANCH in dataset.dims and BRANCH not in coords:
        coords = {BRANCH: np.arange(dataset.sizes[BRANCH])} | coords
    return type(dataset)(variables, coords, dataset.attrs)


def selected(dataset: xr.Dataset, select: Mapping[str, str], path: Path) -> tuple[xr.Dataset, list[str]]:
    """The rows at the number nearest to one that is asked for, or at a label, and notes on numbers that are not there.

    Raises ResultError for an axis or a label that is not there, and for a number beyond the values of its axis.
    """
    notes = []
    for name, text in select.items():
        label = "label" if name == "tongue" and "label" in dataset.coords else name
        if label not in dataset.coords or dataset[label].ndim != 1:
            there = listed(str(dim) for dim in dataset.dims if dim in dataset.coords or dim == "tongue")
            raise ResultError(f"{path}: there is no axis '{name}' in this table; there is {there}")
        values = dataset[label].values
        if values.dtype.kind in "fiu":
            kept, note = nearest(
                name, np.asarray(values, dtype=float), text, str(dataset[label].attrs.get("units", "1"))
            )
            notes += note
        else:
            kept = [k for k, value in enumerate(values) if str(value) == text]
            if not kept:
                raise ResultError(f"{path}: {name} has no value '{text}'; its values: {listed(map(str, values))}")
        dataset = dataset.isel({str(dataset[label].dims[0]): kept})
    return dataset, notes


def nearest(name: str, values: Array, text: str, units: str) -> tuple[list[int], list[str]]:
    """The index of the number nearest to a text, as a list, and a note where the two differ."""
    try:
        wanted = number_of(text, units)
    except ValueError as error:
        raise ResultError(f"--select {name}: {error}; it is a number in {units}") from None
    unit, order = "" if units == "1" else f" {units}", np.sort(values)
    # As far beyond the first and the last value as half a step.
    low, high = order[0] - 0.5 * (order[:2][-1] - order[0]), order[-1] + 0.5 * (order[-1] - order[-2:][0])
    if not low <= wanted <= high:
        raise ResultError(f"{name} = {text} is outside the result: {order[0]:.6g} to {order[-1]:.6g}{unit}")
    index = int(np.argmin(np.abs(values - wanted)))
    if np.isclose(values[index], wanted, rtol=1e-9, atol=0.0):
        return [index], []
    return [index], [f"{name} = {text} is not one of its values; nearest: {values[index]:.6g}{unit}"]


def write_rows(dataset: xr.Dataset, file: Any) -> int:
    """Write the table to a binary file; the number of rows."""
    stream = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=False)
    try:
        writer = csv.writer(stream, lineterminator="\n")
        dims = dimensions(dataset)
        columns = column_names(dataset, dims)
        writer.writerow([heading(dataset, name) for name in columns])
        rows = 0
        for part in pieces(dataset, dims):
            cells = [flat(part, dims, name) for name in columns]
            lines = [*zip(*cells, strict=True)]
            if BRANCH in dims and THERE in part:
                # Branches have different numbers of motions.
                lines = [*compress(lines, (motion >= 0 for motion in flat(part, dims, THERE)))]
            writer.writerows(lines)
            rows += len(lines)
        stream.flush()
    finally:
        # The file is closed by whoever opened it.
        with suppress(OSError):
            stream.detach()
    return rows


def heading(dataset: xr.Dataset, name: str) -> str:
    """The name of a column, with its unit where that is no SI unit."""
    attributes = dataset[name].attrs
    return safe(f"{name} ({attributes['units']})" if "si_units" in attributes else name)


def no_table(path: Path) -> str:
    """Return what a file is instead of a table of results, "" for one: the names of its columns tell."""
    with open(path, "rb") as file:
        head = file.read(HEAD).decode("utf-8", errors="replace").split("\n")[0]
    try:
        names = next(csv.reader([head]), [])
    except csv.Error:
        names = []
    known = {variable.name for variable in every_variable() if not variable.coordinate}
    known |= {name.replace("frequency", "input_speed") for name in OF_MESH}
    plain = {name.partition(" (")[0] for name in names}
    return "" if known & plain else "is no table that gearstab wrote"


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
        raise ResultError(f"{path}: no variable has the dimension '{over}'; available: {there}")
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
    """Say what a group holds beside the table and how to export it; empty if the table holds everything."""
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


def pieces(dataset: xr.Dataset, dims: Sequence[str]) -> Iterator[xr.Dataset]:
    """The table in order, ROWS_AT_ONCE at a time.

    Blocks of a sweep lie across the order of the rows, so that rows next to each other are stored in many of them: as
    many rows as memory has room for are read at once, and no block for every piece.
    """
    each = sum(item.dtype.itemsize for item in dataset.data_vars.values()) or 1
    for region in blocks([dataset.sizes[dim] for dim in dims], max(ROWS_AT_ONCE, BYTES_AT_ONCE // each)):
        part = dataset.isel(dict(zip(dims, region, strict=True))).load()
        for block in blocks([part.sizes[dim] for dim in dims], ROWS_AT_ONCE):
            yield part.isel(dict(zip(dims, block, strict=True)))


def flat(part: xr.Dataset, dims: Sequence[str], name: str) -> list[Any]:
    """A variable over all dims of the block, as cells."""
    sizes = [part.sizes[dim] for dim in dims]
    data = part[name]
    inner = [dim for dim in dims if dim in data.dims]
    shape = [part.sizes[dim] if dim in inner else 1 for dim in dims]
    values = np.broadcast_to(data.transpose(*inner).values.reshape(shape), sizes).ravel()
    return cells(values)


FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of texts that spreadsheets take for formulas and compute."""


def safe(text: str) -> str:
    """Return a text as a cell that is no formula: with an apostrophe before what would begin one."""
    return f"'{text}" if text.startswith(FORMULA) else text


def cells(values: Array) -> list[Any]:
    """Safe texts, integers as they are, floats in their shortest exact form, NaN empty."""
    if values.dtype.kind != "f":
        return [safe(str(v)) for v in values.tolist()] if values.dtype.kind in "OUST" else list(values.tolist())
    return ["" if v != v else repr(v) for v in values.tolist()]
