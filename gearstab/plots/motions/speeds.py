"""Response curves: measures of the steady state over the mesh frequency, unstable ranges shaded; amplitudes in dB.

Of motions with backlash there are branches: unstable parts dashed, folds and doublings marked, jumps as arrows.

With ``--unit dB`` what is drawn over the speed is a level,

    L = 20 lg(|F|/F_0),

F_0 as ISO 1683:2015 has it: 1 uN of forces, 1 pm of displacements, 1 nm/s of velocities; 1 uN m of torques, for which
there is none; 1 of what has no unit.
"""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import INNER, held, sweep_axes, units_of
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import CASES, DASHES, SHADE, new_frame, write_legend, write_title
from gearstab.plots.drawing.text import axis_label, bracketed
from gearstab.plots.kinds import Contents, Kind, colour_label, find_variable
from gearstab.plots.maps import curve, overlays
from gearstab.plots.view import Request, View, caption, some, view_along
from gearstab.results.display import SHOWN_SCALE, SPEEDS
from gearstab.results.read import branches_of

Array = np.ndarray
Artists = dict[str, Any]

DECIBEL = "dB"
REFERENCES = {
    "N": (1e-6, r"1 $\mathrm{\mu N}$"), "N m": (1e-6, r"1 $\mathrm{\mu N\,m}$"), "m": (1e-12, "1 pm"),
    "m/s": (1e-9, "1 nm/s"), "rad": (1e-12, "1 prad"),
}  # fmt: skip
"""By unit: the reference value, and how it is written."""
SPAN = 80.0
"""dB that an axis shows at most: what lies further below the largest level is numerical noise."""


def in_decibels(values: Array, data: xr.DataArray, request: Request) -> Array:
    """Return values as they are, or as levels where these are asked for; NaN of 0."""
    if not request.decibels:
        return np.asarray(values, dtype=float)
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(values) / REFERENCES.get(units_of(data), (1.0, ""))[0])
    return np.where(np.isfinite(level), level, np.nan)


def level_label(words: str, data: xr.DataArray, request: Request) -> str:
    """Label of an axis, with the unit, or with what a level refers to."""
    units = units_of(data)
    if not request.decibels:
        return words + bracketed(units)
    reference = REFERENCES.get(units, (1.0, "1" + (f" {units}" if units not in ("", "1") else "")))[1]
    return f"{words} ({DECIBEL} re {reference})"


def tall_enough(ax: Axes, values: Array, request: Request) -> None:
    """Begin an axis of amplitudes at zero, and one of levels at most SPAN below the largest."""
    if not request.decibels:
        ax.set_ylim(bottom=0.0)
        return
    top = float(np.nanmax(values, initial=-np.inf))
    low = float(np.nanmin(values, initial=np.inf))
    if np.isfinite(top):
        air = 0.06 * (min(SPAN, top - low) or 1.0)
        ax.set_ylim(max(low - air, top - SPAN), top + air)


MEASURES = ("dynamic_load_factor", "mesh_force_peak", "transmission_error_peak_to_peak")
"""Variables drawn without --variable: the first of these that has values."""
DECADES = 1.5
"""A curve that spans more decades than this is drawn over a logarithmic axis."""


def read_speeds(tree: xr.DataTree) -> xr.Dataset:
    """The group ``response`` of a sweep. Raises PlotError if the result holds none."""
    dataset = held(tree, "response", "responses over speed")
    if "mesh_force_peak" not in dataset.data_vars:
        raise PlotError("this response is a history, not one over speed; use --kind response")
    return dataset


def measure(dataset: xr.Dataset, wanted: str | None) -> str:
    """The variable to draw."""
    found = (name for name in MEASURES if name in dataset and np.isfinite(dataset[name].values).any())
    return wanted or next(found, MEASURES[0])


def unstable_ranges(tree: xr.DataTree, view: View) -> Array:
    """``(ranges, 2)``, mesh frequencies between which the view's system is unstable.

    From exact boundaries, else from Floquet's grid, else from the flags of the response itself (then half-way to the
    stable neighbours).
    """
    exact = tongues.read_tongues(tree, "boundaries", view, None)
    if exact is not None:
        return exact.open_ranges()
    if "floquet" in tree.children and "stable" in tree["floquet"].data_vars:
        unstable = view.cut(tree["floquet"].to_dataset()["stable"], view.x.name) == 0
    else:
        unstable = view.cut(tree["response"].to_dataset()["status"], view.x.name).astype(int) & 1 != 0
    edges = view.x.edges()
    change = np.diff(np.concatenate([[0], unstable.astype(int), [0]]))
    return np.stack([edges[:-1][change[:-1] == 1], edges[1:][change[1:] == -1]], axis=-1)


def shade(ax: Axes, ranges: Array, unit: float) -> Any:
    """One band for each range; those narrower than a line keep a line's width, ``unit`` of the frequency."""
    middle, half = ranges.mean(axis=1), np.maximum(np.diff(ranges, axis=1)[:, 0] / 2, 0.5 * unit)
    spans = list(zip(middle - half, 2 * half, strict=True))
    return ax.broken_barh(spans, (0, 1), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0.5)


def draw_case(ax: Axes, x: Array, values: Array, ranges: Array, number: int, label: str) -> Any:
    """One curve: solid where the steady state attracts, thin and faint where it repels."""
    inside = np.any((x[:, None] >= ranges[:, 0]) & (x[:, None] <= ranges[:, 1]), axis=1)
    if inside.any():
        ax.plot(x, values, color=CASES[number], linewidth=0.4, alpha=0.45, zorder=1.5)
    steady = np.where(inside, np.nan, values)
    (line,) = ax.plot(x, steady, color=CASES[number], linestyle=DASHES[number], label=label, zorder=2)
    return line


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``lines``, and ``bands`` of the unstable ranges where all curves belong to one system."""
    dataset = read_speeds(tree)
    variable = measure(dataset, request.variable)
    own, data = find_variable(tree, variable)
    view = view_along(tree, map(str, data.dims), request, own)
    if view.x.name not in SPEEDS:
        raise PlotError(f"response curves are drawn over {SPEEDS[0]}, not over {view.x.name}; use --kind curve")
    cases, note = curve.chosen_curves(view, data, request)
    figure, ax = new_frame(request, (0.66, 0.4))
    x = view.x.ascending
    others = [axis for axis in view.free if axis.name not in INNER]
    ranges = [unstable_ranges(tree, view.at(**case)) for case in cases]
    # Motions with backlash are those that are seen, whatever the linear system does.
    attracts = "contact_loss_ratio" in dataset
    lines = []
    for k, case in enumerate(cases):
        values = in_decibels(view.at(**case).cut(data, view.x.name).astype(float), data, request)
        repelling = np.zeros((0, 2)) if attracts else ranges[k]
        lines.append(draw_case(ax, x, values, repelling, k, caption(view.free, case)))
    doubted = curve.draw_doubts(tree, ax, own, view, cases, lines)
    low, high = grid.limits(view.x)
    ax.set_xlim(low, high)
    curves = [np.asarray(line.get_ydata(), dtype=float) for line in lines]
    if request.decibels:
        tall_enough(ax, np.array(curves), request)
    else:
        scale(ax, curves)
    bands = shade(ax, ranges[0], (high - low) / 900) if not others and len(ranges[0]) else None
    words = level_label(str(data.attrs.get("long_name", variable)), data, request)
    curve.dress(ax, view.x, words if request.decibels else colour_label(tree, variable))
    handles = lines if len(cases) > 1 else []
    if bands is not None:
        handles = [*handles, Patch(facecolor=SHADE, label="unstable")]
    write_legend(figure, [*handles, *overlays.legend_of_curves(doubted)], ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    names.freeze(figure, request)
    return figure, {"lines": lines, "bands": bands, "left_out": note}


def scale(ax: Axes, curves: list[Array]) -> None:
    """A logarithmic axis where the stable parts span decades; limits from them, with some air."""
    values = np.concatenate([curve[np.isfinite(curve)] for curve in curves]) if curves else np.zeros(0)
    if not values.size:
        return
    low, high = float(values.min()), float(values.max())
    if low > 0 and np.log10(high / low) > DECADES:
        ax.set_yscale("log")
        air = (high / low) ** 0.06
        ax.set_ylim(low / air, high * air)
        grid.number_decades(ax.yaxis)
    elif high > low:
        ax.set_ylim(max(low - 0.06 * (high - low), 0.0 if low >= 0 else -np.inf), high + 0.08 * (high - low))


def _suits(contents: Contents) -> bool:
    """Suits responses over speed, as long as there are few curves."""
    over = contents.by_itself and contents.holds("response")
    if not over or not any(axis.name in SPEEDS for axis in contents.own("response")):
        return False
    curves = prod(axis.size for axis in (*contents.parameters, *contents.mesh))
    return not contents.parameters or (not contents.growth and curves <= len(CASES))


KIND = Kind(
    "speeds", "load factor, or forces of meshes, bearings and shafts, of the steady state over the mesh frequency",
    draw, _suits, decibels=True,
)  # fmt: skip


MEASURE = "amplitude_rms"
"""Variables drawn without --variable."""
WORDS = {
    "amplitude_rms": "transmission error, rms",
    "amplitude_peak": "transmission error, peak",
    "transmission_error_rms": "transmission error, rms",
    "transmission_error_peak_to_peak": "transmission error, peak to peak",
}
"""Names that fit beside the axis."""
VALUE = "branch_value"
"""The variable that holds the value of the axis, of branches along another one than the mesh frequency."""
MARKS = {
    1: ("fold", "o"), 2: ("period doubling", "D"), 3: ("Neimark-Sacker", "s"),
    4: ("grazing", "x"), 5: ("branch point", "^"),
}  # fmt: skip
"""Kinds of points that are marked: what they are called, and how they look."""
GRAZING = 4
"""The kind at which stability need not change."""
DASHED = (0, (3, 1.6))


def read_branches(tree: xr.DataTree, variable: str) -> xr.Dataset:
    """The group ``branches`` of a sweep. Raises PlotError if the result holds none, or not the variable."""
    if "branches" not in tree.children:
        raise PlotError(f"this result holds no branches (methods.branches); it holds {listed(tree.children)}")
    dataset = branches_of(tree)
    of_meshes = [str(name) for name, item in dataset.data_vars.items() if {"point", "mesh"} <= set(map(str, item.dims))]
    known = ["amplitude_rms", "amplitude_peak", *of_meshes]
    if variable not in known:
        raise PlotError(f"no variable {variable!r} along branches; --variable: {listed(known)}")
    return dataset


class Curves:
    """The branches of one system over what is drawn: x, in units of it, y, and what is known of every point."""

    def __init__(self, dataset: xr.Dataset, view: View, variable: str, unit: float) -> None:
        def values(name: str) -> Array:
            return np.ravel(view.cut(dataset[name], "branch", "point"))

        self.x = values(VALUE if VALUE in dataset else "mesh_frequency") / unit
        self.y, points = values(variable).astype(float), dataset.sizes["point"]
        self.branch = np.where(np.isnan(self.x), -1, np.arange(len(self.x)) // points)
        self.stable, self.kind, self.jump = values("stable") == 1, values("event"), values("jump")
        there = values("landing_branch")
        self.landing = np.where(there < 0, -1, there * points + values("landing_point"))

    def pieces(self) -> list[tuple[Array, bool]]:
        """Points of every stretch of a branch that is stable, or not; both ends belong to both sides."""
        found = []
        for number in range(int(self.branch.max(initial=-1)) + 1):
            own = np.flatnonzero(self.branch == number)
            # A stretch between two points is stable where both are, or one is and the other is where stability changes.
            settled = self.stable[own] | np.isin(self.kind[own], [kind for kind in MARKS if kind != GRAZING])
            between = settled[:-1] & settled[1:] & (self.stable[own][:-1] | self.stable[own][1:])
            for part in np.split(np.arange(len(between)), np.flatnonzero(np.diff(between)) + 1):
                if len(part):
                    found.append((own[part[0] : part[-1] + 2], bool(between[part[0]])))
        return found


def draw_curves(ax: Axes, curves: Curves, colour: str) -> tuple[list[Line2D], list[Line2D], list[Any]]:
    """Lines, marks and arrows."""
    lines = [
        ax.plot(curves.x[part], curves.y[part], color=colour, linewidth=0.9 if stable else 0.7,
                linestyle="-" if stable else DASHED, zorder=2)[0]
        for part, stable in curves.pieces()
    ]  # fmt: skip
    marks = []
    for kind, (_, marker) in MARKS.items():
        at = curves.kind == kind
        if at.any():
            style: dict[str, Any] = {"linestyle": "none", "marker": marker, "markersize": 3, "markerfacecolor": "white"}
            marks += ax.plot(curves.x[at], curves.y[at], color=colour, markeredgewidth=0.7, zorder=3, **style)
    arrows = []
    for k in np.flatnonzero((curves.jump != 0) & (curves.landing >= 0)):
        end = curves.x[k], curves.y[curves.landing[k]]
        how = {"arrowstyle": "-|>,head_width=0.15,head_length=0.35", "color": colour, "linewidth": 0.6}
        arrows.append(ax.annotate("", end, (curves.x[k], curves.y[k]), arrowprops=how | {"shrinkA": 0, "shrinkB": 0}))
    return lines, marks, arrows


def draw_branches(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``lines``, ``marks`` and ``arrows``, of one system or a few."""
    variable = request.variable or MEASURE
    dataset = read_branches(tree, variable)
    axes = sweep_axes(tree)
    along = str(dataset.attrs["over"]) if VALUE in dataset else next(name for name in SPEEDS if name in axes)
    of_data = [str(dim) for dim in dataset[variable].dims]
    dims = dict.fromkeys([along, *(dim for dim in of_data if dim not in INNER), *({"mesh"} & {*of_data})])
    view = view_along(tree, dims, replace(request, x=request.x or along), dataset)
    if view.x.name != along:
        raise PlotError(f"branches are drawn over {along}, not over {view.x.name}")
    unit = float(tree[along].attrs.get(SHOWN_SCALE, 1.0)) if VALUE in dataset else view.factor or 1.0
    cases, note = some(view.free, len(CASES), "curves", request.partial)
    figure, ax = new_frame(request, (0.74, 0.44))
    artists: Artists = {"lines": [], "marks": [], "arrows": []}
    handles = []
    for number, case in enumerate(cases):
        drawn = draw_curves(ax, Curves(dataset, view.at(**case), variable, unit), CASES[number])
        for name, found in zip(artists, drawn, strict=True):
            artists[name] += found
        if len(cases) > 1:
            handles.append(Line2D([], [], color=CASES[number], label=caption(view.free, case)))
    ax.set_xlim(*view.x.ascending[[0, -1]])
    scale(ax, [np.asarray(line.get_ydata(), dtype=float) for line in artists["lines"]])
    data = dataset[variable]
    curve.dress(ax, view.x, axis_label(variable, WORDS.get(variable, str(data.attrs["long_name"])), units_of(data)))
    write_legend(figure, [*handles, *_legend_of_branches(artists)], ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    names.freeze(figure, request)
    return figure, artists | {"left_out": note}


def _legend_of_branches(artists: Artists) -> list[Line2D]:
    """Legend of the marks and dashes that occur."""
    there = {line.get_marker() for line in artists["marks"]}
    style: dict[str, Any] = {"linestyle": "none", "markersize": 3, "markerfacecolor": "white"}
    marks = [
        Line2D([], [], color=CASES[0], marker=marker, label=name, **style)
        for name, marker in MARKS.values()
        if marker in there
    ]
    if artists["arrows"]:
        marks.append(Line2D([], [], color=CASES[0], marker=r"$\uparrow$", linestyle="none", markersize=6, label="jump"))
    if any(line.get_linestyle() == "--" for line in artists["lines"]):
        marks.append(Line2D([], [], color=CASES[0], linestyle=DASHED, label="unstable"))
    return marks


BRANCHES = Kind(
    "branches",
    "resonance curves with backlash, unstable parts dashed, with folds, doublings and jumps",
    draw_branches,
    lambda contents: contents.by_itself and contents.holds("branches"),
)
