"""Time histories: displacement of every coordinate and dynamic mesh forces (as in Lin & Parker 2002, Fig. 9)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import held, units_of
from gearstab.plots.drawing.style import CASES, WIDTHS, new_panels, write_title
from gearstab.plots.drawing.text import bracketed, fitted, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.view import Request

Array = np.ndarray
Artists = dict[str, Any]

PIECE = 5000
"""Samples drawn at once. Matplotlib splits longer lines itself and drops two segments wherever it does."""
MOST_VECTORS = 20_000
"""Lines of more samples are stored as pixels inside of a PDF or SVG file: as lines they would take megabytes."""


def draw_long_line(
    ax: Axes, x: np.ndarray, y: np.ndarray, colour: str, linewidth: float = 0.6
) -> Line2D | LineCollection:
    """Draw y over x, both of shape (samples,), as one line whatever its length."""
    if x.size <= PIECE:
        return ax.plot(x, y, color=colour, linewidth=linewidth)[0]
    points = np.column_stack([x, y])
    pieces = [points[k : k + PIECE + 1] for k in range(0, x.size - 1, PIECE)]
    line = LineCollection(pieces, colors=colour, linewidths=linewidth, rasterized=x.size > MOST_VECTORS)
    ax.add_collection(line)
    ax.autoscale_view()
    return line


MOST_PANELS = 12
LARGEST = 1e200
"""Largest value of a history, which ends at 1e155 where it grows: the limits of a panel, which lie beyond in decades,
are finite."""
GROWN = 1000
"""A history that outgrows its first twentieth by this factor is drawn over asinh, which shows its beginning too."""

TURNING = {"rad": "rotation", "rad/s": "angular velocity"}
"""Names of displacements and velocities by their units."""

NEAR = 1.0
"""A panel reaches to zero where a history comes as near to it as this part of its range."""

SWING = 0.3
"""Part of the range of a history: what turns back by less is no swing of it."""
SOLID = 160
"""A history that swings more often than this across a column would be a solid block: its envelopes are drawn."""
BINS = 100
"""Stretches of time at most over which an envelope is taken, of two cycles or more."""


def read_response(tree: xr.DataTree) -> xr.Dataset:
    """The group ``response``. Raises PlotError if the result holds none with histories over time."""
    dataset = held(tree, "response", "time response")
    if not any("time" in data.dims for data in dataset.data_vars.values()):
        there = listed(map(str, dataset.data_vars))
        raise PlotError(f"this response holds no histories over time; it holds {there}")
    refuse_a_moment(dataset)
    return dataset


def refuse_a_moment(dataset: xr.Dataset) -> None:
    """Raise PlotError for a response that ends as it begins: one sample is no history."""
    if dataset.sizes.get("time", 2) < 2:
        status = str(dataset.attrs.get("status", "")) or "complete"
        raise PlotError(f"this response ends as it begins ({status}): there is nothing to draw over time")


def histories(dataset: xr.Dataset, request: Request) -> tuple[list[tuple[str, xr.DataArray]], str]:
    """(label, history) of every panel: each coordinate's displacement (or --variable), then each mesh's force.

    Where these are too many and a part will do, it is the forces and the energy, then histories by their size; a
    sentence says so.

    Raises PlotError for a variable that is not over time and for a selection of anything but ``dof`` or ``mesh``.
    """
    shown = ("displacement", "mesh_force") if "displacement" in dataset else ("phi", "energy")
    names = [request.variable] if request.variable else list(shown)
    known = [str(name) for name, data in dataset.data_vars.items() if "time" in data.dims and data.dtype.kind in "fiu"]
    panels: list[tuple[str, xr.DataArray]] = []
    for name in names:
        if name in known:
            panels += columns(dataset[name], request)
        elif request.variable:
            raise PlotError(f"no variable {name!r} over time in this response; there is {listed(known)}")
    refuse_selections(request, [dataset[name] for name in names if name in known], "time")
    if not panels:
        raise PlotError(f"this response holds neither of {listed(names)}; --variable: {listed(known)}")
    if len(panels) > MOST_PANELS and request.partial:
        return some_histories(dataset, request, panels)
    if len(panels) > MOST_PANELS:
        many = f"{len(panels)} histories are too many (at most {MOST_PANELS})"
        raise PlotError(f"{many}: choose with --variable or --select dof=NAME")
    return panels, ""


def refuse_selections(request: Request, drawn: Sequence[xr.DataArray], along: str) -> None:
    """Raise PlotError where what is selected is the axis along which is drawn, or none of these variables' own."""
    for axis in request.select:
        if axis == along:
            raise PlotError(f"this figure is drawn over {along}: export --select {along}=VALUE gives the numbers")
        others = {str(dim) for data in drawn for dim in data.dims} - {along}
        if axis not in others:
            raise PlotError(f"no axis {axis!r} to select in this figure; there is {listed(sorted(others))}")


def some_histories(
    dataset: xr.Dataset, request: Request, panels: list[tuple[str, xr.DataArray]]
) -> tuple[list[tuple[str, xr.DataArray]], str]:
    """At most MOST_PANELS of the histories, and which."""
    how = "choose with --variable NAME and --select dof=NAME or mesh=NAME"
    forces = [panel for panel in panels if panel[1].name == "mesh_force"]
    if not request.variable and forces and len(forces) < MOST_PANELS and "energy" in dataset:
        kept = forces + columns(dataset["energy"], request)
        return kept, f"shows the mesh forces and the energy, not the {len(panels) - len(forces)} displacements; {how}"
    among = forces or panels
    sizes = [float(np.nanmax(np.abs(data.values), initial=0.0)) for _, data in among]
    largest = np.sort(np.argsort([-size for size in sizes], kind="stable")[:MOST_PANELS])
    return [among[k] for k in largest], f"shows the {MOST_PANELS} largest of {len(panels)} histories; {how}"


def columns(data: xr.DataArray, request: Request, along: str = "time") -> list[tuple[str, xr.DataArray]]:
    """A variable's histories or spectra, one for each coordinate or mesh (or the one selected), with their labels."""
    across = [str(dim) for dim in data.dims if dim != along]
    if not across:
        return [(label_of(data, ""), data)]
    dim = across[0]
    labels = [str(v) for v in (data.coords[dim].values if dim in data.coords else range(1, data.sizes[dim] + 1))]
    wanted = request.select.get(dim)
    if wanted is not None and wanted not in labels:
        raise PlotError(f"{dim} has no value {wanted!r}; its values: {listed(labels)}")
    chosen = range(len(labels)) if wanted is None else [labels.index(wanted)]
    parts = [(labels[i], data.isel({dim: i})) for i in chosen]
    return [(label_of(part, label), part) for label, part in parts]


def label_of(data: xr.DataArray, element: str) -> str:
    r"""``$x_1$ (m)``, ``mesh force first (N)``: a coordinate by its symbol, anything else by name."""
    units = units_of(data)
    letters, digits = element.rstrip("0123456789"), element[len(element.rstrip("0123456789")) :]
    if data.name == "displacement" and len(letters) == 1 and digits:
        words = f"${letters}_{{{digits}}}$"
    else:
        name = TURNING.get(units) if data.name in ("displacement", "velocity") else None
        # What the energy consists of would be too long beside a panel.
        name = name or (data.attrs.get("long_name") if data.name != "energy" else None)
        name = name or str(data.name).replace("_", " ")
        words = plain(f"{name}{', ' if element else ''}{element}")
    return words + bracketed(units)


def draw_history(ax: Axes, label: str, data: xr.DataArray, colour: str) -> Any:
    """One history over time with a thin line at zero, unless all of it lies far from there. Raises PlotError."""
    time = data.coords["time"].values if "time" in data.coords else np.arange(data.sizes["time"])
    values = np.asarray(data.values, dtype=float)
    if not np.isfinite(values).any():
        raise PlotError(f"{data.name} has no values: there is nothing to draw")
    if (np.abs(values) > LARGEST).any():
        raise PlotError(f"{data.name} has values beyond {LARGEST:g}, which no figure can show")
    low, high = np.nanmin(values), np.nanmax(values)
    if np.nanmin(np.abs(values)) <= NEAR * (high - low):
        ax.axhline(0.0, color="#8a8a8a", linewidth=0.4, zorder=0.5)
    line = draw_line(ax, time, values, colour)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylabel(label, linespacing=0.95)
    ax.margins(y=0.08)
    show_growth(ax, data.values)
    return line


def draw_line(ax: Axes, time: Array, values: Array, colour: str) -> Any:
    """A history as a line, or between its envelopes where it turns so often that the line would fill a block."""
    ends = values[np.flatnonzero(np.diff(np.sign(np.diff(values)))) + 1]
    turns = int(np.count_nonzero(np.abs(np.diff(ends)) > SWING * np.ptp(values)))
    figure = ax.get_figure(root=True)
    assert figure is not None
    if turns < SOLID * figure.get_figwidth() / WIDTHS["single"]:
        return draw_long_line(ax, time, values, colour)
    starts = np.unique(np.linspace(0, values.size, min(BINS, turns // 4), endpoint=False).astype(int))
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    middle = time[np.minimum(starts + (starts[1] - starts[0]) // 2, time.size - 1)]
    return ax.fill_between(middle, low, high, facecolor=to_rgba(colour, 0.25), edgecolor=colour, linewidth=0.5)


def show_growth(ax: Axes, values: Array) -> None:
    """Draw a history that outgrows its beginning over asinh: linear up to the beginning's size, then by decades."""
    start, peak = np.abs(values[: max(values.size // 20, 2)]).max(), np.abs(values).max()
    if not 0 < GROWN * start < peak < np.inf:
        return
    ax.set_yscale("asinh", linear_width=start)
    last = int(np.floor(np.log10(peak)))
    step = max(1, round((last - np.log10(start)) / 2))
    sizes = [10.0**power for power in range(last, int(np.ceil(np.log10(start))), -step)]
    ticks = [*(-size for size in sizes), 0.0, *reversed(sizes)]
    ax.set_yticks(ticks, [tick_text(tick) for tick in ticks])
    ax.yaxis.set_minor_locator(NullLocator())


def tick_text(value: float) -> str:
    """A signed power of ten, or 0."""
    sign = "-" if value < 0 else ""
    return f"${sign}10^{{{round(np.log10(abs(value)))}}}$" if value else "0"


def fit_labels(axes: Sequence[Axes]) -> None:
    """Break the labels at the left of panels over one another so that none is longer than its panel is high.

    A label of a word that is longer still is written smaller, as far as it can be read.
    """
    figure = axes[0].get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    for ax in axes:
        ax.set_ylabel(fitted(ax.get_ylabel(), 0.95 * ax.get_window_extent().height / figure.dpi, 8.5))
    for size in (8.5, 7.5, 6.5, 5.5, 4.5):
        figure.draw_without_rendering()
        long = [ax for ax in axes if ax.yaxis.label.get_window_extent().height > ax.get_window_extent().height]
        for ax in long:
            ax.yaxis.label.set_fontsize(size - 1)
        if not long:
            break


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, panels over one another on a common time axis; its artists are ``lines``."""
    panels, note = histories(read_response(tree), request)
    aspects = 0.28 * len(panels) + 0.2, 0.14 * len(panels) + 0.1
    figure, axes = new_panels(request, aspects, len(panels), sharex=True)
    lines = []
    for ax, (label, data) in zip(axes, panels, strict=True):
        lines.append(draw_history(ax, label, data, CASES[2] if data.name == "mesh_force" else CASES[0]))
    time = panels[0][1].coords.get("time")
    axes[-1].set_xlabel("time $t$" + (bracketed(units_of(time)) if time is not None else ""))
    figure.align_ylabels(axes)
    write_title(figure, tree, request)
    fit_labels(axes)
    return figure, {"lines": lines, "left_out": note}


KIND = Kind("response", "displacements and mesh forces over time", draw, lambda c: not c.axes and c.holds("response"))
