"""Instability boundaries over the regions that Floquet theory finds (as in Lin & Parker 2002, Figs. 3, 5, 6 and 8)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.errors import PlotError
from gearstab.plots.axes import INNER, MapView, Request, sweep_axes, swept_groups, view_of
from gearstab.plots.cases import caption, some
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.heading import write_legend, write_title
from gearstab.plots.drawing.style import CASES, DASHES, LINE, SHADE, new_frame
from gearstab.plots.drawing.tongues import DrawnTongues
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps import proved
from gearstab.results.display import SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

DOTTED = (0, (1, 1.4))
CIRCLE: dict[str, Any] = {"marker": "o", "markerfacecolor": "white", "markeredgewidth": 0.4}

ROWS_WITH_MARKS = 24
"""Marks of the exact boundaries stand at about this many values of the parameter: more would be a thick line."""


def view_boundaries(tree: xr.DataTree, request: Request) -> MapView:
    """The view over the mesh frequency and one parameter. Raises PlotError if the result holds no boundaries."""
    groups = [tree[group] for group in swept_groups(tree)]
    dims = [str(dim) for group in groups for variable in group.data_vars.values() for dim in variable.dims]
    if "side" not in dims:
        raise PlotError("this result holds no boundaries (methods.perturbation, uncoupled or boundaries was not run)")
    speed = next(name for name in SPEEDS if name in sweep_axes(tree))
    kept = dict.fromkeys([speed, *(name for name in dims if name not in INNER)])
    view = view_of(tree, kept, request)
    if tongues.parameter_axis(view) is None:
        names = " and ".join(axis.name for axis in (view.x, view.y) if axis is not None)
        raise PlotError(f"boundaries are drawn over {speed} and one axis of numbers, not over {names}")
    return view


def draw_regions(tree: xr.DataTree, ax: Axes, view: MapView, colour: Any) -> object | None:
    """Fill the unstable points of the Floquet grid with one light colour; None without a grid."""
    dims = view.y.name, view.x.name
    if "floquet" not in tree.children or not set(dims) <= set(map(str, tree["floquet"].sizes)):
        return None
    dataset = tree["floquet"].to_dataset()
    if "stable" in dataset.data_vars:
        unstable = view.cut(dataset["stable"], *dims) == 0
    else:
        unstable = view.cut(dataset["growth_rate"], *dims) > 0
    cells = np.ma.masked_where(~unstable, np.ones(unstable.shape))
    return grid.draw_cells(ax, view.x, view.y, cells, ListedColormap([colour]), Normalize(0, 1))


def draw_marks(ax: Axes, exact: DrawnTongues, frequency_on_x: bool, colour: str) -> tuple[Line2D, Line2D]:
    """Small open circles on both exact boundaries, at every so many values of the parameter.

    Returns the circles and, in the middle of tongues whose two circles would lie on one another, the dots.
    """
    step = max(1, round(exact.positions.size / ROWS_WITH_MARKS))
    rows = np.arange(exact.positions.size - 1, -1, -step)
    edges = exact.edges[..., rows]
    limits = tongues.frequency_limits(ax, frequency_on_x)
    narrow = edges[:, 1:] - edges[:, :1] < tongues.INVISIBLE * (limits[1] - limits[0])
    circle = {**CIRCLE, "markersize": 1.7, "markeredgecolor": colour}
    dot = {"marker": ".", "markersize": 1.0, "color": colour, "markeredgewidth": 0}
    middle = np.where(narrow, edges.mean(axis=1, keepdims=True), np.nan)
    drawn = []
    for frequency, look in ((np.where(narrow, np.nan, edges), circle), (middle, dot)):
        along = np.broadcast_to(exact.positions[rows], frequency.shape)
        x, y = (frequency, along) if frequency_on_x else (along, frequency)
        drawn += ax.plot(x.ravel(), y.ravel(), linestyle="", zorder=2.6, **look)
    return drawn[0], drawn[1]


def draw_case(
    tree: xr.DataTree, ax: Axes, view: MapView, number: int = 0, fill: Any = SHADE, marks: bool = True
) -> Artists:
    """Draw one case into a frame: ``regions``, ``perturbation``, ``uncoupled``, ``boundaries``, ``thin`` (see
    :func:`draw_marks`) and ``proved``, None where the result does not hold them.

    number: which colour and line style; fill: the colour of the unstable regions; marks: whether the exact boundaries
    are marked even where the regions show them, and what is proved stable is tinted.
    """
    found = tongues.parameter_axis(view)
    assert found is not None
    parameter, frequency_on_x = found
    colour, dash = CASES[number], DASHES[number]
    regions = draw_regions(tree, ax, view, fill)
    grid.frame(ax, view.x, view.y)
    limits = tongues.frequency_limits(ax, frequency_on_x)
    artists: Artists = {"regions": regions, **dict.fromkeys(("perturbation", "uncoupled", "boundaries", "thin"))}
    artists["proved"] = proved.draw_proved(tree, ax, view, parameter, frequency_on_x) if marks else None
    for group, pattern in (("perturbation", dash), ("uncoupled", DOTTED)):
        lines = tongues.read_tongues(tree, group, view, parameter)
        if lines is not None:
            seen = tongues.widest(lines, *limits) > tongues.INVISIBLE
            look = {"colors": colour, "linestyles": [pattern], "linewidths": 0.75, "zorder": 2.4}
            artists[group] = tongues.boundary_lines(ax, lines, frequency_on_x, seen, **look)
    exact = tongues.read_tongues(tree, "boundaries", view, parameter)
    if exact is not None and (marks or regions is None):
        artists["boundaries"], artists["thin"] = draw_marks(ax, exact, frequency_on_x, colour)
    return artists


LEGEND = {
    "perturbation": "perturbation theory",
    "uncoupled": "uncoupled modes",
    "boundaries": "boundaries (Floquet)",
    "regions": "unstable (Floquet)",
}


def legend_handles(cases: list[Artists], captions: list[str]) -> list[Any]:
    """One entry per case if there are several, then one for each sort of line or fill that was drawn."""
    handles: list[Any] = []
    if len(cases) > 1:
        handles += [Line2D([], [], color=CASES[k], linestyle=DASHES[k], label=text) for k, text in enumerate(captions)]
    drawn = [name for name in LEGEND if cases[0][name] is not None]
    for name in drawn:
        if name == "perturbation" and len(cases) == 1:
            handles.append(Line2D([], [], color=LINE, label=LEGEND[name]))
        elif name == "uncoupled":
            handles.append(Line2D([], [], color=LINE, linestyle=DOTTED, label=LEGEND[name]))
        elif name == "boundaries":
            handles.append(Line2D([], [], color=LINE, linestyle="", markersize=2.2, label=LEGEND[name], **CIRCLE))
        elif name == "regions":
            handles.append(Patch(facecolor=SHADE if len(cases) == 1 else "#d9d9d9", label=LEGEND[name]))
    return [*handles, *proved.legend_of(cases[0]["proved"])]


def named_cases(tree: xr.DataTree, ax: Axes, views: list[MapView]) -> names.NamedTongues:
    """Name every tongue once, where it is widest among the cases."""
    axis = tongues.parameter_axis(views[0])
    assert axis is not None
    parameter, frequency_on_x = axis
    limits = tongues.frequency_limits(ax, frequency_on_x)
    groups = []
    for group in ("boundaries", "perturbation", "uncoupled"):
        found = [tongues.read_tongues(tree, group, view, parameter) for view in views]
        lines = [item for item in found if item is not None]
        if lines:
            best = np.argmax([tongues.widest(item, *limits) for item in lines], axis=0)
            edges = np.stack([item.edges for item in lines])[best, np.arange(best.size)]
            groups.append(DrawnTongues(edges, lines[0].labels, parameter))
    shown = names.merged(groups, *limits)
    return names.name_tongues(ax, shown, frequency_on_x) if shown is not None else names.NamedTongues()


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``cases`` (one mapping each, see :func:`draw_case`), ``names`` and ``legend``.

    Axes left over are overlaid in different line styles. Raises PlotError if they are more than the styles there are.
    """
    view = view_boundaries(tree, request)
    chosen, note = some(view.free, len(CASES), "overlaid cases", request.partial)
    views = [view.at(**case) for case in chosen]
    figure, ax = new_frame(request, (0.78, 0.5))
    tints = [SHADE] if len(views) == 1 else [to_rgba(CASES[k], 0.18) for k in range(len(views))]
    cases = [draw_case(tree, ax, item, k, tints[k], len(views) == 1) for k, item in enumerate(views)]
    points = grid.draw_points(ax, request.marks)
    handles = legend_handles(cases, [caption(view.free, case) for case in chosen])
    legend = write_legend(figure, handles, ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    named = named_cases(tree, ax, views)
    names.freeze(figure, request)
    return figure, {"cases": cases, "marks": points, "names": named, "legend": legend, "left_out": note}


def _suits(contents: Contents) -> bool:
    """Of boundaries alone, and of what they compare: uncoupled modes, or cases beside one axis of numbers."""
    numeric = [axis for axis in contents.parameters if axis.numeric]
    if not (contents.by_itself and contents.over_speed and numeric):
        return False
    if not contents.growth:
        return contents.drawn is None
    lines = any(contents.holds(group) for group in ("perturbation", "boundaries", "uncoupled"))
    return lines and len(numeric) == 1 and (contents.holds("uncoupled") or len(contents.parameters) == 2)


KIND = Kind("boundaries", "boundaries of several theories or cases over one parameter", draw, _suits)
