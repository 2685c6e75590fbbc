"""Harmonics of forces over the speed: what an order analysis shows, and the spectrogram of a run-up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import axis_of, group_of, units_of
from gearstab.plots.drawing import names
from gearstab.plots.drawing.style import CASES, DASHES, GROWTH, LINE, new_panels, write_legend, write_title
from gearstab.plots.drawing.text import bracketed, plain
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.motions.response import MOST_PANELS, fit_labels, refuse_selections
from gearstab.plots.motions.speeds import in_decibels, level_label, tall_enough
from gearstab.plots.view import Request
from gearstab.results.display import CYCLES, FACTOR, FREQUENCY, SHOWN_SCALE, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

VARIABLE = "mesh_force_spectrogram"
DECADES = 3.0
"""Amplitudes below this many decades under the largest one stay white."""
HEARD = 3e-2
"""The frequency axis ends where nothing above this part of the largest amplitude follows."""
MOST_LINES = 12
"""Harmonics of a mesh that are drawn."""
ROOM = 0.07
"""Numbers of harmonics are no nearer to each other than this part of the width."""


def read_ramp(tree: xr.DataTree, variable: str) -> tuple[xr.DataArray, str]:
    """A variable over the speed of a run-up, and the name of that axis. Raises PlotError if the result has none."""
    dataset = group_of(tree, "response")
    if variable not in dataset:
        raise PlotError("this result holds no run-up: give respond.ramp, and a run of more than a few cycles")
    data = dataset[variable]
    axis = next(str(dim) for dim in data.dims if dim in SPEEDS)
    if data.sizes[axis] < 2 or data.sizes.get("frequency", 2) < 2 or not np.isfinite(data.values).any():
        raise PlotError("this run-up holds no values over several speeds and frequencies: there is nothing to draw")
    return data, axis


def speed_label(speed: xr.DataArray) -> str:
    """``mesh frequency (rad/s)`` or ``input speed (rpm)``."""
    return str(speed.name).replace("_", " ") + bracketed(units_of(speed))


def chosen_meshes(data: xr.DataArray, request: Request) -> list[int]:
    """Positions of the meshes to draw. Raises PlotError for a selection of anything else."""
    wanted = request.select.get("mesh")
    refuse_selections(request, [data.isel({d: 0 for d in data.dims if d != "mesh"})], "time")
    meshes = [str(name) for name in data.coords["mesh"].values]
    if wanted is not None and wanted not in meshes:
        raise PlotError(f"mesh has no value {wanted!r}; its values: {', '.join(meshes)}")
    return list(range(len(meshes))) if wanted is None else [meshes.index(wanted)]


def mesh_ratios(tree: xr.DataTree, count: int) -> Array:
    """Frequency of each mesh over that of the first one."""
    ratios = group_of(tree, "response").attrs.get("frequency_ratios", np.ones(count))
    return np.atleast_1d(np.asarray(ratios, dtype=float))


def draw_orders(ax: Axes, speeds: Array, factor: float, end: float) -> list[Any]:
    """Lines along the harmonics of a mesh, numbered where they leave the frame.

    speeds: both ends of the axis. factor: frequency of the mesh, in units of the frequency axis, over the speed.
    """
    low, high = speeds
    lines, last = [], -np.inf
    for s in range(1, MOST_LINES + 1):
        if s * factor * low >= end:
            break
        lines += ax.plot([s * factor * low, s * factor * high], [low, high], color=LINE, linewidth=0.35, alpha=0.6)
        x, y = min(s * factor * high, end), min(high, end / (s * factor))
        if y == high and x - last < ROOM * end:
            continue
        last = x
        above = y == high
        ax.annotate(
            f"{s}", (x, y), xytext=(0, 2) if above else (2, 0), textcoords="offset points", fontsize=6.5,
            ha="center" if above else "left", va="bottom" if above else "center", annotation_clip=False,
        )  # fmt: skip
    return lines


def draw_modes(tree: xr.DataTree, axes: list[Axes], end: float, unit: float) -> list[Any]:
    """Dotted lines at the natural frequencies of the mean system; unit: of the frequency axis, in rad/s."""
    frequencies = group_of(tree, "modes")["natural_frequency"].values / unit
    inside = frequencies[(frequencies > 0) & (frequencies < end)]
    return [ax.axvline(w, color=LINE, linewidth=0.5, linestyle=(0, (1, 2))) for ax in axes for w in inside]


def draw_waterfall(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a map per mesh: ``cells``, ``orders`` and ``modes``. Raises PlotError without a run-up."""
    data, axis = read_ramp(tree, VARIABLE)
    chosen, speed, frequency = chosen_meshes(data, request), data.coords[axis], data.coords["frequency"]
    values = [np.asarray(data.isel(mesh=k).transpose(axis, "frequency").values, dtype=float) for k in chosen]
    largest = max(float(v.max()) for v in values) or 1.0
    heard = np.flatnonzero(np.max([v.max(axis=0) for v in values], axis=0) >= HEARD * largest)
    last = min(int(heard.max(initial=1)) + 1, frequency.size - 1)
    end, unit = float(frequency.values[last]), float(frequency.attrs.get(SHOWN_SCALE, 1.0))
    aspects = 0.62 * len(chosen) + 0.2, 0.36 * len(chosen) + 0.12
    figure, axes = new_panels(request, aspects, len(chosen), sharex=True)
    norm, rising = LogNorm(largest * 10**-DECADES, largest), np.argsort(speed.values)
    colours = GROWTH.with_extremes(under="white")
    ratios = mesh_ratios(tree, data.sizes["mesh"])
    cells, lines = [], []
    for ax, k, own in zip(axes, chosen, values, strict=True):
        x, y = frequency.values[: last + 1], speed.values[rising]
        shown = own[rising][:, : last + 1]
        cells.append(ax.pcolormesh(x, y, shown, norm=norm, cmap=colours, shading="nearest", rasterized=True))
        ends = y[[0, -1]]
        lines += draw_orders(ax, ends, float(ratios[k]) * float(speed.attrs.get(FACTOR, 1.0)) / unit, end)
        ax.set(xlim=(0.0, end), ylim=tuple(ends))
        ax.set_ylabel(speed_label(speed))
        name = plain(str(data.coords["mesh"].values[k]))
        ax.text(0.98, 0.03, name, transform=ax.transAxes, ha="right", va="bottom")
    marks = draw_modes(tree, axes, end, unit)
    axes[-1].set_xlabel(r"frequency $\omega$" + bracketed(units_of(frequency)))
    bar = figure.colorbar(cells[0], ax=axes, extend="min")
    bar.set_label("amplitude of the mesh force" + bracketed(units_of(data)))
    bar.outline.set_linewidth(0.5)
    for line, words in ((lines[:1], "harmonics of the mesh, numbered"), (marks[:1], "natural frequencies")):
        for one in line:
            one.set_label(words)
    write_legend(figure, [*lines[:1], *marks[:1]])
    write_title(figure, tree, request)
    return figure, {"cells": cells, "orders": lines, "modes": marks, "colour_bar": bar}


WATERFALL = Kind(
    "waterfall", "spectrogram of a run-up over frequency and speed", draw_waterfall,
    lambda c: not c.axes and c.holds("response") and VARIABLE in c.tree["response"].data_vars,
)  # fmt: skip


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
    aspects = 0.5 * len(chosen) + 0.15, 0.28 * len(chosen) + 0.12
    figure, axes = new_panels(request, aspects, len(chosen), sharex=True)
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
                0.97, 0.94, f"orders of the input shaft: {each}", transform=ax.transAxes, ha="right", va="top",
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
