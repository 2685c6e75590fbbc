"""Natural frequencies over the speed, the orders of the meshes that meet them, and what grows there.

A Campbell diagram for parametric excitation. The harmonic s of a mesh, s Omega_i, forces vibrations of its own
frequency, which are large where it is a natural frequency; it makes vibrations of *half* of its frequency grow where
s Omega_i = 2 w_p, and two of frequencies w_p and w_q that are half of it on average where s Omega_i = w_p + w_q. So the
lines are orders and half orders of the meshes, and a region of instability lies on the natural frequencies of its
modes.
"""

from __future__ import annotations

import re
from math import pi
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.errors import PlotError
from gearstab.plots.axes import INNER, FigureAxis, group_of, mesh_numbers, sweep_axes, swept_groups, units_of
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import (
    CASES,
    LINE,
    SHADE,
    UNSTABLE,
    label_columns,
    new_frame,
    new_panels,
    write_legend,
    write_title,
)
from gearstab.plots.drawing.text import bracketed, plain, tongue_label
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps import branches
from gearstab.plots.maps.branches import Region
from gearstab.plots.view import MOST_PANELS, TALL, Request, View, arrangement, caption, some, view_along
from gearstab.results.display import RATIOS, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

ORDERS = 6
"""Half orders of a mesh that are drawn at the most: 0.5, 1, ... 3 times its frequency."""
AIR = 1.22
"""The frame over the highest natural frequency that an order reaches."""
GREY = "#5f5f5f"
MOST_CLOSED = 60
"""Closed regions of two modes are not marked where there are more of them."""
TOGETHER = 1e-6, 0.005, 0.01, 0.02, 0.04
"""Natural frequencies closer than this part of the frame have one name: the first with which all names find room."""
KILOHERTZ = 2000.0
"""Frames that reach this frequency, Hz, are drawn in kHz."""
EN_DASH = "\N{EN DASH}"
NAMED = 12
"""Regions that are named at the most, the widest."""


def view_campbell(tree: xr.DataTree, request: Request) -> tuple[View, FigureAxis | None]:
    """The view over the speed, or over the axis asked for, and the axis of the speed if there is any.

    Raises PlotError for an axis without numbers.
    """
    axes = sweep_axes(tree)
    groups = [tree[group] for group in swept_groups(tree) if group in (branches.MODES, *tongues.THEORIES)]
    dims = [str(dim) for group in groups for variable in group.data_vars.values() for dim in variable.dims]
    known = any(name in node.coords for node in tree.subtree for name in SPEEDS) or "side" in dims
    speed = next((axes[name] for name in SPEEDS if known and name in axes), None)
    over_speed = speed is not None and request.x in (None, *SPEEDS)
    kept = dict.fromkeys([*([speed.name] if speed and over_speed else []), *(d for d in dims if d not in INNER)])
    view = view_along(tree, kept, request, xr.Dataset())
    if not view.x.numeric:
        raise PlotError(f"natural frequencies are drawn over numbers, and {view.x.name} has labels: choose --x")
    if view.speed is not None and view.factor is None:
        raise PlotError("the teeth differ over the axes, so that no one mesh frequency belongs to a speed of the input")
    return view, speed


def frequency_unit(tree: xr.DataTree, speed: FigureAxis | None, top: float) -> tuple[str, float]:
    """Return the unit of frequencies and its size in rad/s: that of the mesh frequency, and Hz or kHz beside rpm.

    top: the highest frequency of the frame, rad/s.
    """
    own = units_of(group_of(tree, "modes")["natural_frequency"]) if "modes" in tree.children else "rad/s"
    if own == "1" or speed is None or speed.units in ("rad/s", "1"):
        return own, 1.0
    return ("kHz", 2000 * pi) if top >= KILOHERTZ * 2 * pi or speed.units == "kHz" else ("Hz", 2 * pi)


def mesh_ratios(tree: xr.DataTree, regions: list[Region]) -> dict[float, list[str]]:
    """Frequency over the mesh frequency -> names of the meshes that have it."""
    modes, found = group_of(tree, "modes"), dict[float, list[str]]()
    ratios = np.atleast_1d(modes.attrs.get(RATIOS, [r.ratio / r.harmonic for r in regions if r.harmonic][:1] or 1.0))
    known = list(mesh_numbers(tree))
    for k, ratio in enumerate(ratios):
        found.setdefault(float(ratio), []).append(known[k] if k < len(known) else str(k + 1))
    return found


def said(meshes: list[str]) -> str:
    """Meshes of one frequency by name, those of a planetary set by that of the set."""
    return plain(", ".join(dict.fromkeys(re.sub(r"\.(sun|ring)\.\d+$", "", mesh) for mesh in meshes)))


class Panel:
    """One frame: what is read from the result at the view's indices. Frequencies are in rad per unit time."""

    def __init__(self, tree: xr.DataTree, view: View, speed: FigureAxis | None) -> None:
        self.tree, self.view = tree, view
        self.parameter = None if view.speed is not None else view.x
        self.whirl = branches.WhirlCurves.read(tree, view, speed)
        if self.whirl is not None:
            self.modes = self.whirl.frequency
            self.branches = np.tile(np.arange(self.modes.shape[1]), (len(self.modes), 1))
            self.regions = []
        else:
            self.modes = branches.read_frequencies(tree, view, self.parameter)
            self.branches = branches.read_branches(tree, view, self.parameter, self.modes.shape[1])
            self.regions = branches.read_regions(tree, view, self.parameter)
        self.ratios = mesh_ratios(tree, self.regions)
        self.at: float | None = None
        """The mesh frequency that was selected beside another axis."""
        if speed is not None and speed.name in view.fixed and speed.factor:
            self.at = float(speed.positions[view.fixed[speed.name]] * speed.factor)
        factor = (speed.factor or 1.0) if speed is not None else None
        ends = grid.limits(view.x) if self.parameter is None else grid.limits(speed) if speed is not None else None
        self.span = None if ends is None or factor is None else (ends[0] * factor, ends[1] * factor)
        if self.at is not None:
            self.span = (self.at, self.at)

    @property
    def theory(self) -> str:
        """Words on what the regions are of, where they are not exact."""
        if "boundaries" in self.tree.children or "perturbation" not in self.tree.children:
            return ""
        return f", {tongues.LOOKS[tongues.theory(self.tree, 'perturbation')][1]}"

    @property
    def orders(self) -> int:
        """Half orders that are drawn: all, or as many as harmonics count by the list of regions."""
        return min(max((region.harmonic for region in self.regions), default=ORDERS), ORDERS)

    def within(self, region: Region) -> Array:
        """``(size,)``: whether a region is open and reaches into the speeds that are shown."""
        assert self.span is not None
        with np.errstate(invalid="ignore"):
            return np.asarray(region.open & (region.low <= self.span[1]) & (region.high >= self.span[0]))

    def top(self) -> float:
        """Where the frame ends: above the highest natural frequency that an order or an open region reaches."""
        positive = np.where(np.isfinite(self.modes), self.modes, 0.0)
        if self.span is None:
            return AIR * float(positive.max()) or 1.0
        reach = 0.5 * self.orders * max(self.ratios) * self.span[1]
        highest = positive.max(axis=0)
        shown = {int(k) for k in np.flatnonzero(positive.min(axis=0) <= reach) if highest[k] > 0}
        shown |= {k for region in self.regions if self.within(region).any() for k in (region.p, region.q)}
        return AIR * float(max((highest[k] for k in shown), default=highest.max())) or 1.0


def draw_panel(ax: Axes, panel: Panel, top: float, unit: float) -> Artists:
    """Draw one frame: ``modes`` and ``orders`` (lines), ``regions`` and ``closed`` (marks, by sort: of ``one`` mode or
    of ``two``) and ``bands`` (of unstable speeds), None where there is none.
    """
    x = panel.view.x
    ax.set_xscale("log" if x.logarithmic else "linear")
    ax.set_xlim(*grid.limits(x))
    ax.set_ylim(0.0, top / unit)
    grid.number(ax.xaxis, x)
    grid.draw_ranges(ax, x, True)
    along = panel.parameter is not None
    artists: Artists = {"modes": draw_modes(ax, panel, unit), "orders": draw_orders(ax, panel, unit)}
    draw = draw_segments if along else draw_crossings
    return artists | (draw(ax, panel, unit) if panel.span is not None and (panel.at or not along) else NOTHING)


NOTHING: Artists = {"regions": {}, "closed": {}, "bands": None}


def draw_modes(ax: Axes, panel: Panel, unit: float) -> list[Line2D]:
    """The natural frequencies above zero: level over the speed, else a colour for each branch."""
    lines: list[Line2D] = []
    if panel.whirl is not None:
        return panel.whirl.draw(ax, unit, panel.view.factor or 1.0)
    for k in range(panel.modes.shape[1]):
        own = panel.modes[np.arange(len(panel.modes)), panel.branches[:, k]] / unit
        if not np.nanmax(own, initial=0.0) > 0:
            continue
        if panel.parameter is None:
            lines.append(ax.axhline(own[0], color=LINE, linewidth=0.9, zorder=2))
        else:
            colour = CASES[len(lines) % len(CASES)]
            lines += ax.plot(panel.parameter.ascending, own, color=colour, linewidth=1.0, zorder=2)
    return lines


def draw_orders(ax: Axes, panel: Panel, unit: float) -> list[Line2D]:
    """Orders (solid) and half orders (dashed) of every mesh frequency."""
    if panel.span is None or (panel.parameter is not None and panel.at is None):
        return []
    found = []
    for n, ratio in enumerate(panel.ratios):
        over_speed = panel.parameter is None
        colour = branches.order_colour(n, len(panel.ratios)) if over_speed else GREY
        mesh = "" if over_speed or len(panel.ratios) == 1 else f" {said(panel.ratios[ratio])}"
        for half in range(1, panel.orders + 1):
            size = 0.5 * half * ratio / unit
            slope, level = (size * (panel.view.factor or 1.0), 0.0) if over_speed else (0.0, size * (panel.at or 0.0))
            found.append(branches.draw_order(ax, slope, level, half, colour, mesh))
    return [order for order in found if order is not None]


def draw_crossings(ax: Axes, panel: Panel, unit: float) -> Artists:
    """Draw the regions over the speed: a bar from edge to edge of each open one on the natural frequencies of its
    modes, and a mark where a drawn order passes their mean, faint where the region is closed.
    """
    factor, (low, high) = panel.view.factor or 1.0, ax.get_xlim()
    w, marks, closed = panel.modes[0] / unit, branches.Marks(), branches.Marks()
    bars: list[Any] = []
    for region in panel.regions:
        own = w[[region.p, region.q]]
        centre = own.sum() * unit / region.ratio / factor
        if not (own > 0).all():
            continue
        if region.open[0]:
            ends = np.clip([region.low[0] / factor, region.high[0] / factor], low, high)
            if ends[0] < ends[1]:
                bars += [[(ends[0], y), (ends[1], y)] for y in np.unique(own)]
            if low <= centre <= high and region.harmonic <= panel.orders:
                marks.add(region, centre, own, (ends[1] - ends[0]) / (high - low))
        elif 0 < region.harmonic <= panel.orders and low <= centre <= high:
            closed.add(region, centre, own, 0.5 * branches.WIDE)
    if len(closed.two) > MOST_CLOSED:
        closed.two.clear()
    ax.add_collection(LineCollection(bars, colors=UNSTABLE, linewidths=2.6, zorder=2.5), autolim=False)
    edges = [(a[0], b[0] - a[0]) for a, b in bars] if panel.whirl is None else panel.whirl.bands()
    look: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "facecolors": SHADE, "linewidth": 0, "zorder": 0.5}
    bands = ax.broken_barh(edges, (0, 1), **look) if edges else None
    return NOTHING | {"regions": marks.draw(ax, False), "closed": closed.draw(ax, True), "bands": bands}


def draw_segments(ax: Axes, panel: Panel, unit: float) -> Artists:
    """Over another axis, at one speed: where the order passes the natural frequencies, or their mean, of an open
    region, and the parts of them that lie in it.
    """
    assert panel.parameter is not None
    assert panel.at is not None
    x, marks, segments = panel.parameter.ascending, branches.Marks(), list[Line2D]()
    for region in panel.regions:
        grows, off = panel.within(region), panel.modes[:, [region.p, region.q]].sum(axis=1) - region.ratio * panel.at
        for mode in dict.fromkeys((region.p, region.q)) if grows.any() else ():
            own = np.where(grows, panel.modes[:, mode] / unit, np.nan)
            segments += ax.plot(x, own, color=UNSTABLE, linewidth=2.6, zorder=1.9)
        for k in np.flatnonzero((off[:-1] * off[1:] <= 0) & region.open[:-1] & region.open[1:] & (off[:-1] != off[1:])):
            part = off[k] / (off[k] - off[k + 1])
            between = (1 - part) * panel.modes[k] + part * panel.modes[k + 1]
            marks.add(region, (1 - part) * x[k] + part * x[k + 1], between[[region.p, region.q]] / unit, branches.WIDE)
    return NOTHING | {"regions": marks.draw(ax, False), "segments": segments}


CLOSED = {"one": "one mode, closed", "two": "two modes, closed"}


def name_modes(ax: Axes, panel: Panel, unit: float) -> names.NamedTongues:
    """Name natural frequencies beside the frame, neighbours together where there is no room for each."""
    top = ax.get_ylim()[1]
    last = panel.modes[-1, panel.branches[-1]] / unit
    shown = [k for k in np.argsort(last, kind="stable") if 0 < last[k] <= top]
    for near in TOGETHER:
        alike = np.split(shown, np.flatnonzero(np.diff(last[shown]) > near * top) + 1) if shown else []
        words = [rf"$\omega_{{{numbers_of(group)}}}$" for group in alike]
        middle = np.array([last[group].mean() for group in alike])
        found = names.name_places(ax, words, middle / top, -middle, False)
        if len(found.texts) == len(words) or near == TOGETHER[-1]:
            break
        found.remove()
    return found


def numbers_of(group: Array) -> str:
    """Write the numbers, from 1, of modes from 0: ``3``, ``3,4``, or ``3-7`` of more in a row."""
    own = sorted(int(k) + 1 for k in group)
    if len(own) > 2 and own[-1] - own[0] == len(own) - 1:
        return rf"{own[0]}\text{{{EN_DASH}}}{own[-1]}"
    return ",".join(map(str, own))


def name_regions(ax: Axes, panel: Panel, rows: int) -> names.NamedTongues | None:
    """Name open regions above the frame, whose width must have settled; None where it is not over the speed."""
    if panel.parameter is not None:
        return None
    factor, limits = panel.view.factor or 1.0, ax.get_xlim()
    found = [region for region in panel.regions if panel.within(region)[0]]
    edges = np.clip([(r.low[0] / factor, r.high[0] / factor) for r in found], *limits).reshape(-1, 2)
    width = edges[:, 1] - edges[:, 0]
    widest = np.argsort(-width, kind="stable")[:NAMED]
    across = (ax.transData + ax.transAxes.inverted()).transform(np.column_stack([edges.mean(axis=1), width]))[:, 0]
    words = [tongue_label(found[k].label, mesh_numbers(panel.tree)) for k in widest]
    return names.name_places(ax, words, across[widest], width[widest], True, rows)


def legend_handles(panels: list[Panel], drawn: list[Artists]) -> list[Any]:
    """One entry for each sort of line and mark that was drawn."""
    ratios, over_speed = panels[0].ratios, panels[0].parameter is None
    handles: list[Any] = []
    damped, whirl = branches.damped(panels[0].tree), panels[0].whirl
    if whirl is not None:
        handles += whirl.handles()
    elif over_speed or damped:
        words = "damped natural frequencies" if damped else "natural frequencies"
        handles.append(Line2D([], [], color=LINE, linewidth=0.9 if over_speed else 0.0, label=words))
    if any(artists["orders"] for artists in drawn):
        numbers = mesh_numbers(panels[0].tree)
        for n, meshes in enumerate(ratios.values() if over_speed else [[]]):
            words = "mesh orders" if len(ratios) == 1 or not meshes else f"orders of {said(meshes)}"
            if n and (number := numbers.get(meshes[0])):
                words += rf", $\Omega_{{{number}}}$"
            colour = branches.order_colour(n, len(ratios)) if over_speed else GREY
            handles.append(Line2D([], [], color=colour, linewidth=0.6, label=words))
        colour = colour if len(ratios) == 1 else branches.FAINT
        handles.append(Line2D([], [], color=colour, linewidth=0.6, linestyle=(0, (4, 2)), label="half orders"))
    for sort, words in (("one", "instability of one mode"), ("two", "instability of two modes")):
        if any(sort in artists["regions"] for artists in drawn):
            handles.append(branches.spot(sort, False, words))
    closed = {sort for artists in drawn for sort in artists["closed"]}
    handles += [branches.spot(sort, True, CLOSED[sort]) for sort in branches.MARKERS if sort in closed]
    if any(artists["bands"] is not None for artists in drawn):
        handles.append(Patch(facecolor=SHADE, label=f"unstable speeds{panels[0].theory}"))
    if any(artists.get("segments") for artists in drawn):
        handles.append(Line2D([], [], color=UNSTABLE, linewidth=2.6, label="unstable at this speed"))
    return handles


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, a panel for each value of the axes left over: ``panels``, see :func:`draw_panel`.

    Raises PlotError without natural frequencies, and where there would be too many panels.
    """
    view, speed = view_campbell(tree, request)
    chosen, note = some(view.free, MOST_PANELS, "panels", request.partial)
    views = [view.at(**index) for index in chosen]
    panels = [Panel(tree, item, speed) for item in views]
    top = max(panel.top() for panel in panels)
    words, unit = frequency_unit(tree, speed, top)
    wide = request.wide("double" if len(panels) > 1 else "single")
    if len(panels) == 1:
        figure, ax = new_frame(request, (1.0, 0.55))
        axes = [ax]
        columns = 1
    else:
        rows, columns = arrangement(chosen, wide)
        aspect = min(1.25 if wide else TALL, 0.12 + (0.88 if wide else 0.72) * rows / columns)
        figure, axes = new_panels(request, aspect, len(panels), columns, "double", sharex=True, sharey=True)
    drawn = [draw_panel(ax, panel, top, unit) for ax, panel in zip(axes, panels, strict=True)]
    for number, (ax, index) in enumerate(zip(axes, chosen, strict=True)):
        ax.set_ylabel("frequency" + bracketed(words))
        if len(panels) > 1:
            room = 18 if panels[0].regions else None
            ax.set_title(f"({chr(97 + number)})  {caption(view.free, index)}", loc="left", pad=room)
            ax.label_outer()
    label_columns(figure, axes, columns, view.x.label)
    legend = write_legend(figure, legend_handles(panels, drawn), ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    for ax, panel, artists in zip(axes, panels, drawn, strict=True):
        artists["mode_names"] = name_modes(ax, panel, unit)
    names.settle(figure)
    for ax, panel, artists in zip(axes, panels, drawn, strict=True):
        artists["names"] = name_regions(ax, panel, 3 if len(panels) == 1 else 1)
    names.freeze(figure, request)
    for ax, artists in zip(axes, drawn, strict=True):
        marks = [mark for sort in ("regions", "closed") for mark in artists[sort].values()]
        branches.number_orders(ax, artists["orders"], artists["modes"], marks)
    return figure, {"panels": drawn, "legend": legend, "left_out": note}


def _suits(contents: Contents) -> bool:
    """Suits natural frequencies alone."""
    regions = any(contents.holds(group) for group in tongues.THEORIES)
    return contents.by_itself and contents.holds(branches.MODES) and contents.drawn is None and not regions


KIND = Kind(
    "campbell", "natural frequencies over the speed, mesh orders and the instabilities where they meet", draw, _suits
)
