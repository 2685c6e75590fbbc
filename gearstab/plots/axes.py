"""The axes of a result: what they are, what was selected, how their cells lie on paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from gearstab.errors import PlotError, listed
from gearstab.plots.drawing.text import (
    axis_label,
    bracketed,
    number_text,
    plain,
    short_label,
    tongue_label,
    unit_text,
)
from gearstab.results.display import FACTOR, FREQUENCY, OPERATING_RANGE, SHOWN_SCALE, SPEEDS, number_of

Array = np.ndarray


INNER = (
    "tongue", "side", "stretch", "piece", "entry", "exponent", "mesh", "parameter", "mode", "dof", "point",
    "multiplier", "branch", "bearing", "shaft", "mesh_order",
)  # fmt: skip
"""Dimensions of what was computed at a point, or of boundaries; they are no axes of the sweep."""


BESIDE = ("modes", "teeth", "bench", "design")
"""Groups that do not stand over the axes of a sweep; every other one is that of a method, or a response."""


LISTS = ("tongue", "stretch", "piece", "event", "cycle")
"""Dimensions of what was found, perhaps nothing: no region, no event. Every other one has a value at least."""


def refuse_empty(tree: xr.DataTree) -> None:
    """Raise PlotError for a result of which nothing is left along an axis, as after a cut with xarray."""
    sizes = {str(dim): size for node in tree.subtree for dim, size in node.sizes.items() if dim not in LISTS}
    cut = [dim for dim, size in sorted(sizes.items()) if size < (2 if dim in ("side", "bound") else 1)]
    if cut:
        raise PlotError(f"this result lacks values along {listed(cut)}: there is nothing to draw")


@dataclass(frozen=True)
class FigureAxis:
    """One axis of a sweep.

    values: ``(size,)`` floats, or the labels of an axis of cases. meshes: number of each mesh by name, for symbols.
    factor: mesh frequency over the values of an axis of SPEEDS; None where it is not known.
    ranges: ``(ranges, 2)``, the operating ranges along it.
    """

    name: str
    values: Array
    units: str = "1"
    long_name: str = ""
    meshes: Mapping[str, int] = field(default_factory=dict)
    factor: float | None = None
    ranges: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def size(self) -> int:
        return len(self.values)

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers; labels are drawn at 0, 1, 2, ..."""
        return self.values.dtype.kind in "fiu"

    @property
    def positions(self) -> Array:
        """``(size,)``: where the values lie along the axis."""
        return self.values.astype(float) if self.numeric else np.arange(self.size, dtype=float)

    @property
    def order(self) -> Array:
        """The indices that put the positions in ascending order."""
        return np.argsort(self.positions, kind="stable")

    @property
    def ascending(self) -> Array:
        """``(size,)``: the positions in ascending order."""
        return self.positions[self.order]

    @property
    def label(self) -> str:
        """Label of the axis."""
        return axis_label(self.name, self.long_name, self.units, self.meshes)

    @property
    def short_label(self) -> str:
        """Label of an axis without room: the symbol, or the name without one, and the unit."""
        return short_label(self.name, self.meshes) + bracketed(self.units)

    @property
    def logarithmic(self) -> bool:
        """Whether the values follow a geometric series (and not an arithmetic one)."""
        x = self.ascending
        if not self.numeric or self.size < 3 or x[0] <= 0 or self.uniform:
            return False
        steps = np.diff(np.log(x))
        return bool(np.ptp(steps) <= 1e-6 * steps.mean())

    @property
    def uniform(self) -> bool:
        """Whether the values follow an arithmetic series; 1e-6 of a step is far below what print shows."""
        steps = np.diff(self.ascending)
        return self.size < 3 or bool(np.ptp(steps) <= 1e-6 * steps.mean())

    def edges(self) -> Array:
        """``(size + 1,)`` ascending edges of the cells: half-way between the values, geometrically if logarithmic."""
        x = self.ascending
        if self.size == 1:
            half = 0.5 * abs(x[0]) * 0.1 or 0.5
            return np.array([x[0] - half, x[0] + half]) if self.numeric else np.array([-0.5, 0.5])
        if self.logarithmic:
            return np.exp(midpoints(np.log(x)))
        return midpoints(x)

    def text(self, index: int) -> str:
        """The value at ``index`` as plain text."""
        return number_text(float(self.values[index])) if self.numeric else str(self.values[index])

    def short_text(self, index: int) -> str:
        """Round the number at ``index`` to four digits, or more where two values of the axis would read alike."""
        printed = [f"{value:.4g}" for value in self.values]
        return number_text(float(printed[index])) if len(set(printed)) == self.size else self.text(index)

    def caption(self, index: int) -> str:
        r"""``$h$ = 0.4`` for panels and legends; the label alone for an axis of cases."""
        if self.name == "case":
            return plain(self.text(index))
        if self.name == "tongue":
            return tongue_label(self.text(index), self.meshes)
        unit = unit_text(self.units) if self.numeric else ""
        value = self.short_text(index) if self.numeric else self.text(index).replace("_", " ")
        return f"{short_label(self.name, self.meshes)} = {plain(value)}" + (f" {unit}" if unit else "")

    def find(self, text: str) -> int:
        """The index of a label, or of the number nearest to ``text``.

        Raises PlotError if there is no such label, or if the number lies outside the axis.
        """
        if not self.numeric:
            labels = [str(value) for value in self.values]
            if text not in labels:
                raise PlotError(f"{self.name} has no value {text!r}; its values: {listed(map(quoted, labels))}")
            return labels.index(text)
        wanted = self.number(text)
        low, high = self.edges()[[0, -1]]
        if not low <= wanted <= high:
            raise PlotError(f"{self.name} = {text} is outside the result; {self.extent()}")
        return int(np.argmin(np.abs(self.positions - wanted)))

    def number(self, text: str) -> float:
        """The number of a text in the unit of the axis. Raises PlotError for anything else."""
        try:
            return number_of(text, self.units)
        except ValueError:
            unit = "" if self.units == "1" else f" in {self.units}"
            raise PlotError(f"{self.name} is a number{unit}, not {text!r}; {self.extent()}") from None

    def extent(self) -> str:
        """The values in a few words, for messages."""
        unit = "" if self.units == "1" or not self.numeric else f" {self.units}"
        if not self.numeric or self.size <= 8:
            return "its values: " + listed(quoted(self.text(i)) for i in range(self.size)) + unit
        low, high = self.positions.min(), self.positions.max()
        return f"{self.size} values from {number_text(low)} to {number_text(high)}{unit}"


def quoted(label: str) -> str:
    """A label for a list in a message: in quotes if it holds a comma itself."""
    return f"'{label}'" if "," in label else label


def midpoints(x: Array) -> Array:
    """``(n + 1,)``: midpoints of neighbours, and the ends continued by half a step."""
    inner = 0.5 * (x[1:] + x[:-1])
    return np.concatenate([[1.5 * x[0] - 0.5 * x[1]], inner, [1.5 * x[-1] - 0.5 * x[-2]]])


def mesh_numbers(tree: xr.DataTree) -> dict[str, int]:
    """Number (from 1) of each mesh by name, from the group ``modes``; empty if the result has none."""
    modes = tree.children.get("modes")
    if modes is None or "mesh" not in modes.coords or modes.coords["mesh"].dtype.kind not in "OUST":
        return {}
    return {str(name): number for number, name in enumerate(modes.coords["mesh"].values, start=1)}


def axis_of(data: xr.DataArray | xr.Dataset, name: str, meshes: Mapping[str, int]) -> FigureAxis:
    """The axis of a dimension; a tongue goes by its label, a dimension without coordinate by its index."""
    source = "label" if name == "tongue" and "label" in data.coords else name
    if source not in data.coords:
        return FigureAxis(name, np.arange(data.sizes[name]), long_name=name.replace("_", " "), meshes=meshes)
    coordinate = data.coords[source]
    values = coordinate.values
    if values.dtype.kind not in "fiu":
        values = np.array(texts(values), dtype=object)
    attributes = coordinate.attrs
    factor = attributes.get(FACTOR, 1.0 if name == FREQUENCY else None)
    ranges = np.reshape(attributes.get(OPERATING_RANGE, []), (-1, 2)) / attributes.get(SHOWN_SCALE, 1.0)
    long_name = str(attributes.get("long_name", ""))
    return FigureAxis(name, values, units_of(coordinate), long_name, meshes, factor, ranges)


def texts(values: Iterable[str | bytes]) -> list[str]:
    """Labels as text, whether the file gives them as text or as bytes."""
    return [v.decode() if isinstance(v, bytes) else str(v) for v in values]


def units_of(data: xr.DataArray) -> str:
    """The unit of a variable; of one coordinate's values where coordinates have different units."""
    units = str(data.attrs.get("units", "1"))
    if "dof_units" in data.coords and data.coords["dof_units"].ndim == 0:
        return str(data.attrs.get(f"units_of_{data.coords['dof_units'].item()}", units))
    return units


def held(tree: xr.DataTree, name: str, what: str) -> xr.Dataset:
    """A group of a result. Raises PlotError, in which it is called ``what``, for a result without it."""
    if name not in tree.children:
        raise PlotError(f"this result holds no {what}; it holds {listed(tree.children)}")
    return tree[name].to_dataset()


def group_of(tree: xr.DataTree, name: str) -> xr.Dataset:
    """A group of the result, empty where it has none of that name."""
    return tree[name].to_dataset() if name in tree.children else xr.Dataset()


def sweep_axes(tree: xr.DataTree) -> dict[str, FigureAxis]:
    """All axes of the groups of a sweep, in the order in which the result names them."""
    meshes, axes = mesh_numbers(tree), dict[str, FigureAxis]()
    for dataset in datasets(tree):
        for variable in dataset.data_vars.values():
            for dim in variable.dims:
                axis = axis_of(dataset, str(dim), meshes)
                axes[axis.name] = joined(axes[axis.name], axis) if axis.name in axes else axis
    root = tree.to_dataset()
    for name in map(str, root.coords):
        # Over which branches are followed: no variable stands over it.
        if axes and root[name].dims == (name,) and name not in {*axes, *SPEEDS}:
            axes[name] = axis_of(root, name, meshes)
    if axes and not any(name in axes for name in SPEEDS):
        spanned = spanned_frequency(tree, meshes)
        axes[spanned.name] = spanned
    return axes


def distinct(tree: xr.DataTree) -> xr.DataTree:
    """The result with the first of points of equal value along each axis: a figure has one place for all of them."""
    firsts = {
        str(name): np.sort(np.unique(axis.values, return_index=True)[1])
        for dataset in (tree.to_dataset(), *datasets(tree))
        for name, axis in dataset.coords.items()
        if axis.dims == (name,) and axis.dtype.kind in "fiu"
    }
    sizes = {name: size for node in tree.subtree for name, size in node.sizes.items()}
    repeated = {name: first for name, first in firsts.items() if len(first) < sizes[name]}
    return tree.isel(repeated) if repeated else tree


def joined(axis: FigureAxis, other: FigureAxis) -> FigureAxis:
    """The axis of two groups: the same in both, but for the tongues, of which the exact boundaries know more."""
    if axis.name != "tongue" or axis.numeric or other.numeric:
        return axis
    labels = dict.fromkeys([*axis.values, *other.values])
    return replace(axis, values=np.array(list(labels), dtype=object))


def datasets(tree: xr.DataTree) -> list[xr.Dataset]:
    """The groups of a sweep that the result holds."""
    return [tree[group].to_dataset() for group in swept_groups(tree)]


def swept_groups(tree: xr.DataTree) -> list[str]:
    """Their names, Floquet's first; a response from ``gearstab respond`` stands over time."""
    held = [str(group) for group in tree.children if group not in BESIDE and "time" not in tree[group].dims]
    return sorted(held, key=lambda group: group != "floquet")


def spanned_frequency(tree: xr.DataTree, meshes: Mapping[str, int]) -> FigureAxis:
    """The mesh frequency of a result of boundaries alone: its axis if stored, else what they span, with some air.

    A single value is none: boundaries stand for the whole range, however few points the sweep put on it.
    """
    for dataset in (tree.to_dataset(), *datasets(tree)):
        for name in SPEEDS:
            if name in dataset.coords and dataset.coords[name].ndim == 1 and dataset.coords[name].size > 1:
                stored = axis_of(dataset, name, meshes)
                between = filled(stored.positions.min(), stored.positions.max())
                return replace(stored, values=np.union1d(between, stored.positions))
    edges = [data["boundary_frequency"] for data in datasets(tree) if "boundary_frequency" in data.data_vars]
    values = np.concatenate([np.ravel(edge.values) for edge in edges] or [np.zeros(0)])
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if values.size else (0.0, 1.0)
    air = 0.03 * (high - low) or 0.05 * abs(high) or 0.5
    units = units_of(edges[0]) if edges else "1"
    return FigureAxis(FREQUENCY, filled(max(low - air, 0.0), high + air), units, "mesh frequency", meshes, 1.0)


def filled(low: float, high: float) -> Array:
    """Many values from end to end: the cells of two alone would reach half-way beyond both."""
    return np.linspace(low, high, 257)


def find_axis(axes: Mapping[str, FigureAxis], name: str) -> FigureAxis:
    """An axis by its name or by the only dotted path that ends with it. Raises PlotError naming the axes."""
    if name in axes:
        return axes[name]
    endings = [axis for axis in axes if axis.endswith("." + name)]
    if len(endings) == 1:
        return axes[endings[0]]
    raise PlotError(f"no axis {name!r} in this result; its axes: {listed(axes)}")


def axes_text(axes: Mapping[str, FigureAxis]) -> str:
    """Names and sizes of the axes, for messages."""
    return f"there is {listed(f'{axis.name} ({axis.size})' for axis in axes.values())}"
