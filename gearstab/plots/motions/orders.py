"""Harmonics of the forces of meshes, bearings and shafts over the speed: what an order analysis shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import axis_of, group_of
from gearstab.plots.drawing import names
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.levels import in_decibels, level_label, tall_enough
from gearstab.plots.drawing.style import CASES, DASHES, new_figure
from gearstab.plots.drawing.text import plain
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.motions.response import MOST_PANELS, fit_labels
from gearstab.plots.motions.waterfall import mesh_ratios, speed_label
from gearstab.plots.view import Request
from gearstab.results.display import CYCLES, FACTOR, FREQUENCY, SHOWN_SCALE, SPEEDS

Artists = dict[str, Any]
Array = np.ndarray

PARTS = {"mesh": "mesh force", "bearing": "bearing force", "shaft": "shaft torque"}
"""Dimensions of what carries a force, and what it is."""
MULTIPLES = ("harmonic", "mesh_order")
"""Dimensions of the multiples: of the frequency of the mesh itself, of the mesh frequency of the sweep."""
SHOWN = 4
"""Harmonics that are drawn."""


@dataclass(frozen=True)
class Orders:
    """Amplitudes ``(speed, multiple, part)``, and what the dimensions are."""

    data: xr.DataArray
    speed: str
    multiple: str
    part: str

    def shown(self) -> list[int]:
        """Positions of the multiples that are drawn: the first of each mesh, or the largest of those of all meshes."""
        count = self.data.sizes[self.multiple]
        if self.multiple == MULTIPLES[0] or count <= SHOWN:
            return list(range(min(SHOWN, count)))
        largest = np.nanmax(np.nan_to_num(self.data.values), axis=(0, 2))
        return sorted(np.argsort(-largest, kind="stable")[:SHOWN].tolist())

    def cycles(self, tree: xr.DataTree) -> float | None:
        """Cycles of the first mesh in a turn of the input shaft, None where no teeth are known."""
        known = self.data.coords[self.speed].attrs
        default = (
            None if self.speed == FREQUENCY or FACTOR not in known else known[FACTOR] / known.get(SHOWN_SCALE, 1.0)
        )
        found = known.get(CYCLES, group_of(tree, "response").attrs.get(CYCLES, default))
        return None if found is None else float(found)


def read_orders(tree: xr.DataTree, request: Request) -> Orders:
    """The amplitudes to draw. Raises PlotError where the result holds none, or several values of another axis."""
    dataset = group_of(tree, "response")
    known = [
        str(name) for name, data in dataset.data_vars.items()
        if set(MULTIPLES) & set(data.dims) and set(SPEEDS) & set(data.dims)
    ]  # fmt: skip
    if not known:
        raise PlotError(
            "this result holds no orders over the speed: give respond.ramp, and a run of more than a few cycles, "
            "or methods.response with bearings: true"
        )
    ranked = sorted(known, key=lambda name: [dim not in dataset[name].dims for dim in (*request.select, *PARTS)])
    wanted = request.variable or ranked[0]
    if wanted not in known:
        raise PlotError(f"no variable {wanted!r} with orders over the speed; there is {listed(known)}")
    data = _chosen(dataset[wanted], request)
    speed, multiple, part = (next(d for d in data.dims if d in names) for names in (SPEEDS, MULTIPLES, PARTS))
    if data.sizes[speed] < 2 or not np.isfinite(data.values).any():
        raise PlotError("this result holds no values over several speeds: there is nothing to draw")
    return Orders(data.transpose(speed, multiple, part), str(speed), str(multiple), str(part))


def _chosen(data: xr.DataArray, request: Request) -> xr.DataArray:
    """The variable at what is selected, axes of one value taken out. Raises PlotError where several are left."""
    axes = {str(dim): axis_of(data, str(dim), {}) for dim in data.dims}
    for name, text in request.select.items():
        if name in SPEEDS or name not in axes:
            others = listed(dim for dim in axes if dim not in SPEEDS)
            raise PlotError(f"no axis {name!r} to select in this figure; there is {others}")
        kept = [axes[name].find(text)]
        data = data.isel({name: kept})
    free = [dim for dim in axes if dim not in (*SPEEDS, *MULTIPLES, *PARTS)]
    several = [dim for dim in free if data.sizes[dim] > 1]
    if several:
        left = "; ".join(f"{dim}: {axes[dim].extent()}" for dim in several)
        raise PlotError(f"orders are drawn over the speed alone: choose with --select AXIS=VALUE; left over: {left}")
    return data.isel(dict.fromkeys(free, 0))


def largest_parts(orders: Orders, request: Request) -> tuple[list[int], str]:
    """Positions of what is drawn, a panel each, and a sentence where that is not all. Raises PlotError for too many."""
    count = orders.data.sizes[orders.part]
    if count <= MOST_PANELS:
        return list(range(count)), ""
    how = f"choose with --select {orders.part}=NAME"
    if not request.partial:
        raise PlotError(f"{count} panels are too many (at most {MOST_PANELS}): {how}")
    sizes = np.nanmax(np.nan_to_num(orders.data.values), axis=(0, 1))
    kept = sorted(np.argsort(-sizes, kind="stable")[:MOST_PANELS].tolist())
    return kept, f"shows the {MOST_PANELS} of {count} with the largest values; {how}"


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a panel per mesh, bearing or shaft: ``lines``. Raises PlotError without orders."""
    orders = read_orders(tree, request)
    data, speed = orders.data, orders.data.coords[orders.speed]
    chosen, note = largest_parts(orders, request)
    rising, cycles = np.argsort(speed.values), orders.cycles(tree)
    shown, multiples = orders.shown(), data.coords[orders.multiple].values
    figure = new_figure(request, (0.5 * len(chosen) + 0.15, 0.28 * len(chosen) + 0.12))
    axes = list(np.ravel(figure.subplots(len(chosen), 1, sharex=True, squeeze=False)))
    labels = [_label(orders, float(multiples[s]), cycles) for s in shown]
    ratios = mesh_ratios(tree, data.sizes[orders.part])
    lines = []
    for ax, k in zip(axes, chosen, strict=True):
        values = in_decibels(data.values[rising, :, k], data, request)
        for number, s in enumerate(shown):
            lines += ax.plot(
                speed.values[rising], values[:, s], color=CASES[number], linestyle=DASHES[number], linewidth=0.7,
                label=labels[number],
            )  # fmt: skip
        tall_enough(ax, values[:, shown], request)
        name = plain(str(data.coords[orders.part].values[k]))
        ax.set_ylabel(level_label(f"{PARTS[orders.part]}, {name}", data, request))
        if orders.multiple == MULTIPLES[0] and cycles is not None:
            each = ", ".join(f"{float(multiples[s]) * cycles * ratios[k]:.5g}" for s in shown)
            ax.set_ylim(top=ax.get_ylim()[1] + 0.12 * float(np.ptp(ax.get_ylim())))
            ax.text(
                0.99, 0.96, f"orders of the input shaft: {each}", transform=ax.transAxes, ha="right", va="top",
                fontsize=6,
            )  # fmt: skip
    axes[0].set_xlim(*speed.values[rising][[0, -1]])
    axes[-1].set_xlabel(speed_label(speed))
    write_legend(figure, lines[: len(shown)])
    write_title(figure, tree, request)
    figure.align_ylabels(axes)
    fit_labels(axes)
    names.freeze(figure, request)
    return figure, {"lines": lines, "left_out": note}


def _label(orders: Orders, multiple: float, cycles: float | None) -> str:
    """``harmonic 2`` of a mesh; ``order 46 (2 x mesh frequency)`` of the shaft, where teeth are known."""
    if orders.multiple == MULTIPLES[0]:
        return f"harmonic {multiple:.5g}"
    if cycles is None:
        return rf"{multiple:.5g}$\,\Omega$"
    return rf"order {multiple * cycles:.5g} ({multiple:.5g}$\,\Omega$)"


def _suits(contents: Contents) -> bool:
    """Suits a variable with orders over the speed that is asked for."""
    asked = contents.request.variable
    held = contents.tree["response"].data_vars if contents.holds("response") else {}
    return asked in held and bool(set(MULTIPLES) & set(map(str, held[asked].dims)))


KIND = Kind(
    "orders", "harmonics of the forces of meshes, bearings or shafts over the speed", draw, _suits, decibels=True
)
