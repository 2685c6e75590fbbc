"""Instability boundaries over the regions that Floquet theory finds (as in Lin & Parker 2002, Figs. 3, 5, 6 and 8)."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from gearstab.errors import PlotError
from gearstab.plots.axes import INNER, sweep_axes, swept_groups
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import CASES, LINE, SHADE, new_frame, write_legend, write_title
from gearstab.plots.drawing.tongues import DrawnTongues
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps import overlays
from gearstab.plots.view import MapView, Request, caption, some, view_of
from gearstab.results.display import SPEEDS

Array = np.ndarray
Artists = dict[str, Any]


TINT = 0.18
"""Opacity of the regions of one of several cases."""


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


def draw_case(
    tree: xr.DataTree, ax: Axes, view: MapView, number: int = 0, fill: Any = SHADE, alone: bool = True
) -> Artists:
    """Draw one case into a frame: ``regions``, the lines of :func:`gearstab.plots.drawing.tongues.draw_theories` and
    ``proved``, None where the result does not hold them.

    number: which colour; fill: that of the unstable regions; alone: whether exact boundaries are drawn even where the
    regions show them, and what is proved stable is tinted.
    """
    regions = draw_regions(tree, ax, view, fill)
    grid.frame(ax, view.x, view.y)
    tint = overlays.draw_over(tree, ax, view) if alone else None
    groups = tongues.THEORIES if alone or regions is None else tongues.THEORIES[1:]
    colour = CASES[number]
    lines = tongues.draw_theories(tree, ax, view, groups, colour, to_rgba(colour, 0.4))
    return {"regions": regions, **lines, "proved": tint}


def legend_handles(tree: xr.DataTree, cases: list[Artists], captions: list[str]) -> list[Any]:
    """One entry per case if there are several, then one for each sort of line or fill that was drawn."""
    several = len(cases) > 1
    handles: list[Any] = []
    if several:
        handles += [
            Patch(facecolor=to_rgba(CASES[k], TINT), edgecolor=CASES[k], label=text) for k, text in enumerate(captions)
        ]
    handles += tongues.legend_of(tree, cases[0], "#6e6e6e" if several else LINE)
    if cases[0]["regions"] is not None:
        handles.append(Patch(facecolor="#d9d9d9" if several else SHADE, label="unstable (Floquet)"))
    return [*handles, *overlays.legend_of_proved(cases[0]["proved"])]


def named_cases(tree: xr.DataTree, ax: Axes, views: list[MapView]) -> names.NamedTongues:
    """Name every tongue once, where it is widest among the cases."""
    axis = tongues.parameter_axis(views[0])
    assert axis is not None
    parameter, frequency_on_x = axis
    limits = tongues.frequency_limits(ax, frequency_on_x)
    groups = []
    for group in tongues.THEORIES:
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

    Axes left over are overlaid in different colours. Raises PlotError if they are more than the colours there are.
    """
    view = view_boundaries(tree, request)
    chosen, note = some(view.free, len(CASES), "overlaid cases", request.partial)
    views = [view.at(**case) for case in chosen]
    figure, ax = new_frame(request, (0.78, 0.5))
    tints = [SHADE] if len(views) == 1 else [to_rgba(CASES[k], TINT) for k in range(len(views))]
    cases = [draw_case(tree, ax, item, k, tints[k], len(views) == 1) for k, item in enumerate(views)]
    points = grid.draw_points(ax, request.marks)
    handles = legend_handles(tree, cases, [caption(view.free, case) for case in chosen])
    legend = write_legend(figure, handles, ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    named = named_cases(tree, ax, views)
    names.freeze(figure, request)
    return figure, {"cases": cases, "marks": points, "names": named, "legend": legend, "left_out": note}


def _suits(contents: Contents) -> bool:
    """Suits boundaries alone, and comparisons: uncoupled modes, or cases beside one axis of numbers."""
    numeric = [axis for axis in contents.parameters if axis.numeric]
    if not (contents.by_itself and contents.over_speed and numeric):
        return False
    if not contents.growth:
        return contents.drawn is None
    lines = any(contents.holds(group) for group in ("perturbation", "boundaries", "uncoupled"))
    return lines and len(numeric) == 1 and (contents.holds("uncoupled") or len(contents.parameters) == 2)


KIND = Kind("boundaries", "boundaries of several theories or cases over one parameter", draw, _suits)
