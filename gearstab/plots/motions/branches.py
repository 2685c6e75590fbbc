"""Resonance curves of motions with backlash: unstable parts dashed, folds and doublings marked, jumps as arrows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import INNER, sweep_axes, units_of
from gearstab.plots.drawing import names
from gearstab.plots.drawing.style import CASES, new_frame, write_legend, write_title
from gearstab.plots.drawing.text import axis_label
from gearstab.plots.kinds import Kind
from gearstab.plots.maps import curve
from gearstab.plots.motions.speeds import scale
from gearstab.plots.view import Request, View, caption, some, view_along
from gearstab.results.display import SHOWN_SCALE, SPEEDS
from gearstab.results.read import branches_of

Array = np.ndarray
Artists = dict[str, Any]

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


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
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
    write_legend(figure, [*handles, *_legend(artists)], ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    names.freeze(figure, request)
    return figure, artists | {"left_out": note}


def _legend(artists: Artists) -> list[Line2D]:
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


KIND = Kind(
    "branches",
    "resonance curves with backlash, unstable parts dashed, with folds, doublings and jumps",
    draw,
    lambda contents: contents.by_itself and contents.holds("branches"),
)
