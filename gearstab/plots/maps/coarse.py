"""A map of more points than a picture can show, reduced block by block to one that it can.

Points of neighbouring values along both axes become one cell, which shows the worst of them: the largest growth rate,
unstable if one of them is. So no unstable point is lost, and memory does not grow with the map. What stands over one of
the axes, such as exact boundaries, is taken at the values nearest to the cells' middles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import xarray as xr

from gearstab.plots.axes import FigureAxis
from gearstab.plots.view import MapView

Array = np.ndarray

MOST_CELLS = 1000
"""Along each axis of a reduced map."""
LARGE = 4_000_000
"""Points from which a map is reduced; the colours of fewer are averaged where several share a pixel."""
TILE = 1 << 20
"""Points that are read together of a variable without chunks."""
BESIDE = ("growth_rate", "stable", "status", "notices", "dynamic_load_factor")
"""Variables over the points of a map that maps of others need."""

BADNESS = np.array([1, 2, 0], dtype=np.int8)
"""Codes of failed, unstable and stable points (-1, 0, 1): a cell shows the worst."""


@dataclass(frozen=True)
class Cells:
    """One axis of a map, reduced.

    axis: the reduced one, ascending. of ``(size,)``: the cell of every point in the order of the result. middle: the
    index of the point nearest to the middle of each cell.
    """

    axis: FigureAxis
    of: Array
    middle: Array


def coarse(tree: xr.DataTree, view: MapView, variable: str, large: int = LARGE) -> tuple[xr.DataTree, MapView]:
    """Return a tree, and the view of it, with no more points than a picture shows; small ones as they are.

    variable: that is drawn. Of the others over the points of the map only those that go with it are kept.
    """
    if view.x.size * view.y.size <= large:
        return tree, view
    cells = {axis.name: gathered(axis) for axis in (view.x, view.y)}
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    reduced = {path: _reduced(data, view, cells, {variable, *BESIDE}) for path, data in groups.items()}
    found = type(tree).from_dict(reduced, name=tree.name)
    return found, replace(view, x=cells[view.x.name].axis, y=cells[view.y.name].axis)


def gathered(axis: FigureAxis) -> Cells:
    """Divide an axis into cells of equal numbers of points, those at the ends of half as many.

    So evenly spaced cells have their middles where evenly spaced points have them, the first and the last value kept.
    """
    count = min(axis.size, MOST_CELLS) if axis.numeric else axis.size
    scale = (count - 1) / max(axis.size - 1, 1)
    of = np.empty(axis.size, dtype=np.intp)
    of[axis.order] = np.rint(np.arange(axis.size) * scale).astype(np.intp)
    middle = axis.order[np.rint(np.arange(count) / (scale or 1.0)).astype(np.intp)]
    values, low, high = axis.values[middle], axis.ascending[0], axis.ascending[-1]
    if count < axis.size and axis.uniform:
        values = np.linspace(low, high, count)
    elif count < axis.size and axis.logarithmic:
        values = np.geomspace(low, high, count)
    return Cells(replace(axis, values=values), of, middle)


def _reduced(data: xr.Dataset, view: MapView, cells: Mapping[str, Cells], wanted: set[str]) -> xr.Dataset:
    """A group over the cells of both axes."""
    variables = {}
    for name, item in data.data_vars.items():
        if not set(cells) <= set(map(str, item.dims)):
            variables[name] = item.isel({dim: cells[str(dim)].middle for dim in item.dims if dim in cells}).variable
        elif name in wanted:
            part = item.isel({dim: index for dim, index in view.fixed.items() if dim in item.dims}, drop=True)
            if part.ndim == 2:
                variables[name] = _worst(part, cells, _tile(item), str(name))
    coords = {}
    for name, item in data.coords.items():
        coords[name] = item.isel({dim: cells[str(dim)].middle for dim in item.dims if dim in cells}).variable
        if name in cells:
            coords[name] = xr.Variable(item.dims, cells[str(name)].axis.values, item.attrs)
    return xr.Dataset(variables, coords, data.attrs)


def _tile(data: xr.DataArray) -> dict[str, int]:
    """Sizes of the pieces that are read together: those in which the values are stored."""
    chunks = data.encoding.get("chunksizes")
    if chunks:
        return dict(zip(map(str, data.dims), chunks, strict=True))
    tile, left = {}, TILE
    for dim in reversed(data.dims):
        tile[str(dim)] = max(1, min(data.sizes[dim], left))
        left //= tile[str(dim)]
    return tile


def _worst(data: xr.DataArray, cells: Mapping[str, Cells], tile: Mapping[str, int], name: str) -> xr.Variable:
    """The worst value of each cell of a variable over both axes."""
    places = [cells[str(dim)] for dim in data.dims]
    shape = tuple(place.axis.size for place in places)
    flags = name in ("status", "notices")
    together = np.bitwise_or if flags else np.fmax if data.dtype.kind == "f" else np.maximum
    least = 0 if flags else np.nan if data.dtype.kind == "f" else np.iinfo(data.dtype).min
    found = np.full(shape, least, dtype=data.dtype)
    starts = product(*(range(0, data.sizes[dim], tile[str(dim)]) for dim in data.dims))
    for start in starts:
        span = [slice(first, first + tile[str(dim)]) for first, dim in zip(start, data.dims, strict=True)]
        values = data.isel(dict(zip(data.dims, span, strict=True))).values
        values = BADNESS[values + 1] if name == "stable" else values
        held = []
        for axis, (place, part) in enumerate(zip(places, span, strict=True)):
            own, values = _grouped(place.of[part], values, axis, together)
            held.append(own)
        there = np.ix_(*held)
        found[there] = together(found[there], values)
    if name == "stable":
        found = (np.argsort(BADNESS) - 1).astype(data.dtype)[found]
    return xr.Variable(data.dims, found, data.attrs)


def _grouped(of: Array, values: Array, axis: int, together: np.ufunc) -> tuple[Array, Array]:
    """The cells that points lie in, and what their values along an axis make together."""
    if np.any(np.diff(of) < 0):
        order = np.argsort(of, kind="stable")
        of, values = of[order], values.take(order, axis=axis)
    first = np.flatnonzero(np.diff(of, prepend=-1))
    if len(first) == len(of):
        return of, values
    return of[first], together.reduceat(values, first, axis=axis)
