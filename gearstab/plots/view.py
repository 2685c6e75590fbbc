"""Part of a result that a figure shows: the request of the user, its one or two axes, and the cases left over."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from math import ceil, prod
from typing import TYPE_CHECKING, Self

import numpy as np
import xarray as xr

from gearstab.errors import PlotError
from gearstab.plots.axes import Array, FigureAxis, axes_text, axis_of, find_axis, mesh_numbers, sweep_axes
from gearstab.results.display import SPEEDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def nearest_values(tree: xr.DataTree, select: Mapping[str, str]) -> list[str]:
    """Sentences on what was selected between two values of an axis, which shows the nearest of them."""
    axes, said = sweep_axes(tree) if select else {}, []
    for name, text in select.items():
        axis = axes.get(name) or next((a for a in axes.values() if a.name.endswith("." + name)), None)
        if axis is None or not axis.numeric:
            continue
        index, wanted = axis.find(text), axis.number(text)
        if not np.isclose(axis.positions[index], wanted, rtol=1e-9, atol=0.0):
            unit = "" if axis.units == "1" else f" {axis.units}"
            said.append(f"{axis.name} = {text} is not one of its values; nearest: {axis.text(index)}{unit}")
    return said


@dataclass(frozen=True)
class View:
    """Which part of a result a figure shows: two axes, an index on each fixed one, and what is left over."""

    x: FigureAxis
    y: FigureAxis | None
    fixed: Mapping[str, int]
    free: tuple[FigureAxis, ...]
    chosen: tuple[str, ...] = ()
    """Captions of what the user selected, for the title."""
    tongue: str | None = None
    """The label of the tongue selected, to which lines are then restricted."""

    @property
    def speed(self) -> FigureAxis | None:
        """The axis drawn along which the mesh frequency varies."""
        return next((axis for axis in (self.x, self.y) if axis is not None and axis.name in SPEEDS), None)

    @property
    def factor(self) -> float | None:
        """Mesh frequency over what is drawn in its place; None where it is not known."""
        return 1.0 if self.speed is None else self.speed.factor

    def at(self, **fixed: int) -> Self:
        """The view with further axes fixed."""
        return replace(
            self, fixed={**self.fixed, **fixed}, free=tuple(axis for axis in self.free if axis.name not in fixed)
        )

    def cut(self, data: xr.DataArray, *dims: str) -> Array:
        """The values over ``dims`` (in this order) at the fixed indices, axes of the view in ascending order."""
        fixed = {name: index for name, index in self.fixed.items() if name in data.dims and name not in dims}
        part = data.isel(fixed)
        for axis in (self.x, self.y):
            if axis is not None and axis.name in part.dims:
                part = part.isel({axis.name: axis.order})
        return part.transpose(*dims).values


@dataclass(frozen=True)
class MapView(View):
    """A view over two axes."""

    y: FigureAxis


@dataclass(frozen=True)
class Request:
    """Wishes of the user; ``x`` and ``y`` default to the mesh frequency and epsilon.

    unit: units of axes instead of those that were typed, see :func:`gearstab.results.display.in_display_units`.
    partial: whether a figure may leave something out where all would be too much; else that is an error.
    title: over the figure: that of the result, none or a text.
    levels: of contours, in a kind that draws some.
    ax: the frame to draw into, for kinds of figures with one frame; None for a figure of its own.
    marks: points of a map by name, (x, y) in units of its axes.
    decibels: whether amplitudes are drawn as levels; ``unit`` says so with dB.
    style: see :func:`gearstab.plots.drawing.style.style`.
    """

    x: str | None = None
    y: str | None = None
    select: Mapping[str, str] = field(default_factory=dict)
    variable: str | None = None
    size: str | None = None
    title: bool | str = True
    dpi: int | None = None
    unit: Sequence[str] = ()
    partial: bool = False
    levels: tuple[float, ...] = ()
    ax: Axes | None = None
    marks: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    style: str = ""
    decibels: bool = False

    def wide(self, default: str = "single") -> bool:
        """Whether the figure is as wide as two columns of a journal; default: its size unless one is asked for."""
        return (self.size or default) == "double"


def view_of(tree: xr.DataTree, dims: Iterable[str], request: Request, own: xr.Dataset | None = None) -> MapView:
    """The part of a result over ``dims`` that a request means, over two axes.

    Axes with one value are fixed by themselves; ``own`` is the group of the variable, whose list of tongues counts.
    Raises PlotError for unknown axes or values, and if there are no two axes.
    """
    found = _view(tree, dims, request, own, True)
    return MapView(**{item.name: getattr(found, item.name) for item in fields(found)})


def view_along(tree: xr.DataTree, dims: Iterable[str], request: Request, own: xr.Dataset) -> View:
    """The same, over x alone."""
    return _view(tree, dims, request, own, False)


def _view(tree: xr.DataTree, dims: Iterable[str], request: Request, own: xr.Dataset | None, two: bool) -> View:
    every = sweep_axes(tree)
    if own is not None:
        every.update({name: axis_of(own, name, mesh_numbers(tree)) for name in map(str, own.sizes) if name in every})
    fixed, chosen, tongue = {}, [], None
    for name, text in request.select.items():
        axis = find_axis(every, name)
        fixed[axis.name] = axis.find(text)
        chosen.append(axis.caption(fixed[axis.name]))
        tongue = axis.text(fixed[axis.name]) if axis.name == "tongue" else tongue
    axes = {name: every[name] for name in dims if name not in fixed}
    asked = {name: chosen_axis(axes, every, fixed, name) for name in (request.x, request.y) if name}
    taken = {axis.name for axis in asked.values()}
    if request.x and request.y and len(taken) == 1:
        raise PlotError(f"--x and --y are both {request.x}")
    rest = [axis for axis in axes.values() if axis.size > 1 and axis.name not in taken]
    x = asked[request.x] if request.x else default(rest, list(SPEEDS))
    rest = [axis for axis in rest if axis is not x]
    y = asked[request.y] if request.y else default(rest, ["epsilon", "amplitude"]) if two else None
    if x is None or (two and y is None):
        needed = "two axes" if two else "an axis"
        raise PlotError(f"this figure needs {needed} with several values; {axes_text(axes)}")
    free = tuple(axis for axis in rest if axis is not y)
    single = {axis.name: 0 for axis in axes.values() if axis.size == 1 and axis.name not in taken}
    return View(x, y, {**fixed, **single}, free, tuple(chosen), tongue)


def chosen_axis(
    axes: Mapping[str, FigureAxis], every: Mapping[str, FigureAxis], fixed: Mapping[str, int], name: str
) -> FigureAxis:
    """The axis asked for by ``--x`` or ``--y``. Raises PlotError if it is fixed or not among those of the variable."""
    axis = find_axis(every, name)
    if axis.name in fixed:
        raise PlotError(f"{axis.name} cannot be drawn along an axis and selected at once")
    return find_axis(axes, axis.name)


def default(axes: list[FigureAxis], preferred: list[str]) -> FigureAxis | None:
    """The axis with a preferred name (or ending so), else the longest with numbers, else the first."""
    named = [axis for name in preferred for axis in axes if axis.name.split(".")[-1] == name]
    numeric = sorted((axis for axis in axes if axis.numeric), key=lambda axis: -axis.size)
    return next(iter([*named, *numeric, *axes]), None)


def two_axes_only(view: View, otherwise: str = "") -> None:
    """Raise PlotError, naming axes and values, where a map would leave axes over; otherwise: another way to draw it."""
    if view.free:
        left = "; ".join(f"{axis.name}: {axis.extent()}" for axis in view.free)
        raise PlotError(f"a map shows two axes: choose with --select AXIS=VALUE{otherwise}; left over: {left}")


Index = dict[str, int]

FEW = 4
"""Panels that stand over one another in one column of a journal."""
TALL = 2.6
"""Height over width of a figure in one column."""
MOST_PANELS = 12
"""More panels than this are too small to read on a page."""


def combinations(free: tuple[FigureAxis, ...], most: int, what: str) -> list[Index]:
    """Every combination of indices on the axes left over. Raises PlotError if there are more than ``most``."""
    names = [axis.name for axis in free]
    chosen = [dict(zip(names, index, strict=True)) for index in product(*(range(axis.size) for axis in free))]
    if len(chosen) > most:
        left = "; ".join(f"{axis.name}: {axis.extent()}" for axis in free)
        many = f"{len(chosen)} {what} are too many (at most {most})"
        raise PlotError(f"{many}: choose with --select AXIS=VALUE; left over: {left}")
    return chosen


def some(
    free: tuple[FigureAxis, ...], most: int, what: str, partial: bool, largest: Callable[[Index], float] | None = None
) -> tuple[list[Index], str]:
    """The combinations and, where ``partial`` lets some of too many be left out, a sentence on those that are shown.

    largest: of what one combination shows: labels are told apart by it. Numbers are thinned out evenly.
    """
    count = int(np.prod([axis.size for axis in free], dtype=float))
    if not partial or count <= most:
        return combinations(free, most, what), ""
    if largest is not None and not any(axis.numeric for axis in free):
        every = combinations(free, count, what)
        sizes = np.nan_to_num([largest(index) for index in every], nan=-np.inf)
        kept = np.sort(np.argsort(-sizes, kind="stable")[:most])
        return [every[k] for k in kept], said(f"the {most} of {count} {what} with the largest values", free)
    ranges = thinned([axis.size for axis in free], most)
    names = [axis.name for axis in free]
    chosen = [dict(zip(names, index, strict=True)) for index in product(*ranges)]
    return chosen, said(f"{len(chosen)} of {count} {what}", free)


def said(shown: str, free: tuple[FigureAxis, ...]) -> str:
    """A sentence on what is shown and how to choose something else."""
    chosen = " ".join(f"--select {axis.name}=VALUE" for axis in free)
    return f"shows {shown}; choose with {chosen}"


def thinned(sizes: list[int], most: int) -> list[list[int]]:
    """Evenly spread indices on every axis, first and last included, ``most`` combinations of them at the most.

    The axis with the most left gives one up at a time.
    """
    left = list(sizes)
    while np.prod(left, dtype=float) > most:
        longest = left.index(max(left))
        left[longest] = min(left[longest] - 1, most)
    return [[round(i) for i in np.linspace(0, size - 1, kept)] for size, kept in zip(sizes, left, strict=True)]


def caption(free: tuple[FigureAxis, ...], chosen: Index) -> str:
    """Words that distinguish one combination from the others."""
    return ", ".join(axis.caption(chosen[axis.name]) for axis in free)


def arrangement(panels: Sequence[Index], wide: bool = True) -> tuple[int, int]:
    """(rows, columns) of the panels: values of the two axes left over if these are few, else about a square.

    In one column of a journal few stand over one another, and many in two columns.
    """
    if not wide:
        columns = 1 if len(panels) <= FEW else 2
        return ceil(len(panels) / columns), columns
    sizes = [len({panel[name] for panel in panels}) for name in panels[0]]
    count = len(panels)
    if len(sizes) == 2 and max(sizes) <= 4 and prod(sizes) == count:
        return sizes[0], sizes[1]
    columns = {1: 1, 2: 2, 3: 3, 4: 2}.get(count, 3 if count <= 9 else 4)
    return ceil(count / columns), columns
