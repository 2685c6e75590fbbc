"""One tongue's boundaries as surfaces over two amplitudes (as in Lin & Parker 2002, Fig. 7(b))."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]

from gearstab.errors import PlotError
from gearstab.plots.axes import FigureAxis, axis_of, mesh_numbers, sweep_axes
from gearstab.plots.drawing.style import LINE, new_figure, write_title
from gearstab.plots.drawing.text import tongue_label
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.view import MapView, Request, view_of
from gearstab.results.display import SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

FACETS = 26
"""Facets along each axis: as many as a printed column shows with their edges apart."""

CLOSED = 1e-4
"""A tongue vanishes where its least half-width along a line is below this part of the greatest: above rounding and
the error of the parabola through a grid of thirty values, far below what print shows."""

ELEVATION, AZIMUTH = 22, -125
"""Seen from beyond the origin, where tongues are thin: they open away from the eye and hide little of each other."""

UPPER, LOWER, EDGE = "#b9cce4", "#f2d3ad", "#3d3d3d"


def read_surface(tree: xr.DataTree, view: MapView, tongue: int) -> Array:
    """``(2, y.size, x.size)``: lower and upper boundary of a tongue, NaN where it is closed."""
    data = boundary_data(tree)
    return view.at(tongue=tongue).cut(data, "side", view.y.name, view.x.name)


def boundary_data(tree: xr.DataTree) -> xr.DataArray:
    """The boundaries of perturbation theory, or else the exact ones. Raises PlotError if there are none."""
    for group in ("perturbation", "boundaries"):
        if group in tree.children and "boundary_frequency" in tree[group].data_vars:
            return tree[group].to_dataset()["boundary_frequency"]
    raise PlotError("this result holds no boundaries (neither methods.perturbation nor methods.boundaries was run)")


def vertices_of_parabolas(x: Array, values: Array) -> tuple[Array, Array]:
    """Positions and values of the local minima of ``(size,)`` samples, from the parabola through three neighbours."""
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    places, least = [], []
    for i in inner:
        a, b, c = np.polyfit(x[i - 1 : i + 2] - x[i], values[i - 1 : i + 2], 2)
        shift = -b / (2 * a) if a > 0 else 0.0
        places.append(x[i] + shift)
        least.append(c + shift * (b + a * shift))
    return np.array(places), np.array(least)


def vanishing_points(x: Array, y: Array, lower: Array, upper: Array) -> Array:
    """``(points, 3)``: (x, y, Omega) where the tongue vanishes, searched along every grid line, ascending in x + y.

    To first order in the amplitudes the squared width is a quadratic form of them, so that the parabola through three
    grid values finds its zero exactly.
    """
    squared = (0.5 * (upper - lower)) ** 2
    middle = 0.5 * (upper + lower)
    limit = CLOSED**2 * np.nanmax(squared)
    points = []
    for j in range(y.size):
        where, least = vertices_of_parabolas(x, squared[j])
        points += [(u, y[j], np.interp(u, x, middle[j])) for u in where[np.abs(least) <= limit]]
    for i in range(x.size):
        where, least = vertices_of_parabolas(y, squared[:, i])
        points += [(x[i], v, np.interp(v, y, middle[:, i])) for v in where[np.abs(least) <= limit]]
    corner = [(x[i], y[j], middle[j, i]) for i in (0, -1) for j in (0, -1) if squared[j, i] <= limit]
    found = np.array(points + corner if points else []).reshape(-1, 3)
    return found[np.argsort(found[:, 0] / np.ptp(x) + found[:, 1] / np.ptp(y))]


def chosen_tongue(tree: xr.DataTree, view: MapView) -> int:
    """The tongue to draw: the one selected; else the widest that vanishes inside the range; else the widest."""
    if "tongue" in view.fixed:
        return view.fixed["tongue"]
    count = boundary_data(tree).sizes["tongue"]
    if not count:
        raise PlotError("this result holds no instability region: there is no surface to draw")
    x, y = view.x.ascending, view.y.ascending
    width, vanishes = np.zeros(count), np.zeros(count, dtype=bool)
    for tongue in range(count):
        lower, upper = read_surface(tree, view, tongue)
        if np.isfinite(upper - lower).any():
            width[tongue] = np.nanmax(upper - lower)
            vanishes[tongue] = len(vanishing_points(x, y, lower, upper)) > 2
    # One that hardly opens at all is not worth a figure, wherever it vanishes.
    seen = vanishes & (width > 1e-3 * width.max())
    return int(np.argmax(np.where(seen, width, 0.0) if seen.any() else width))


def facets(x: Array, y: Array, z: Array) -> Array:
    """``(facets, 4, 3)``: the quadrilaterals of a surface that have all their corners."""
    grid = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), z], axis=-1)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    return quads[np.isfinite(quads).all(axis=(1, 2))]


def thinned(axis: FigureAxis) -> Array:
    """Indices (into ascending order) of at most ``FACETS`` + 1 evenly spaced values, both ends included.

    Where no such step exists the last facet is the smaller one.
    """
    last = axis.size - 1
    step = max(1, ceil(last / FACETS))
    even = [s for s in range(step, 2 * step + 1) if last % s == 0]
    return np.unique([*range(0, last, even[0] if even else step), last])


def draw_surface(ax: Axes3D, view: MapView, lower: Array, upper: Array) -> Artists:
    """Draw both boundaries with hidden lines removed, and the line where the tongue vanishes.

    Returns ``surfaces`` (one collection, so that its facets are sorted by depth together) and ``vanishing`` (None if
    there is no such line).
    """
    x, y = view.x.ascending, view.y.ascending
    i, j = thinned(view.x), thinned(view.y)
    sheets = [facets(x[i], y[j], z[np.ix_(j, i)]) for z in (lower, upper)]
    colours = [LOWER] * len(sheets[0]) + [UPPER] * len(sheets[1])
    surfaces = Poly3DCollection(np.concatenate(sheets), facecolors=colours, edgecolors=EDGE, linewidths=0.22, zorder=1)
    ax.add_collection3d(surfaces)
    line = None
    points = vanishing_points(x, y, lower, upper)
    if len(points) > 1:
        line = Line3DCollection([points], colors=LINE, linewidths=1.6, zorder=2)
        ax.add_collection3d(line)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), zlim=(np.nanmin(lower), np.nanmax(upper)))
    return {"surfaces": surfaces, "vanishing": line}


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are those of :func:`draw_surface`. ``--select tongue=LABEL`` chooses the tongue.

    Raises PlotError if there are no two axes of numbers besides the mesh frequency, or if further ones are left over.
    """
    data = boundary_data(tree)
    dims = [str(name) for name in data.dims if name not in ("tongue", "side")]
    view = view_of(tree, dims, request, data.to_dataset())
    if view.free or not view.x.numeric or not view.y.numeric:
        left = "; ".join(f"{axis.name}: {axis.extent()}" for axis in view.free)
        needed = "a surface needs exactly two axes of numbers besides mesh_frequency"
        raise PlotError(f"{needed}; left over: {left}" if left else needed)
    tongue = chosen_tongue(tree, view)
    speed = next(axis for name, axis in sweep_axes(tree).items() if name in SPEEDS)
    lower, upper = (edge / (speed.factor or 1.0) for edge in read_surface(tree, view, tongue))
    if not np.isfinite(upper - lower).any():
        raise PlotError("this tongue is closed everywhere in the result: nothing to draw")
    figure = new_figure(request, (0.9, 0.62))
    figure.set_layout_engine("none")
    # The grid of such axes has no other public handle, and keeps what holds when they are made.
    with rc_context({"grid.color": "#cccccc", "grid.linewidth": 0.3}):
        ax: Axes3D = figure.add_axes((0.0, 0.07, 0.95, 0.85), projection="3d", computed_zorder=False)
    artists = draw_surface(ax, view, lower, upper)
    dress(ax, view, speed)
    label = axis_of(data, "tongue", mesh_numbers(tree)).text(tongue)
    write_title(figure, tree, request, view)
    handles: list[Any] = [
        Patch(facecolor=UPPER, label="upper boundary"),
        Patch(facecolor=LOWER, label="lower boundary"),
    ]
    if artists["vanishing"] is not None:
        handles.append(Line2D([], [], color=LINE, linewidth=1.6, label="closed"))
    figure.legend(handles=handles, loc="lower center", ncols=len(handles))
    artists["name"] = ax.text2D(0.05, 0.92, tongue_label(label, view.x.meshes), transform=ax.transAxes, fontsize=9)
    return figure, artists


def dress(ax: Axes3D, view: MapView, speed: FigureAxis) -> None:
    """Labels, a view from above, white panes and a light grid."""
    ax.set_xlabel(view.x.short_label, labelpad=-4)
    ax.set_ylabel(view.y.short_label, labelpad=-4)
    ax.set_zlabel(speed.label, labelpad=-2, rotation=90)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_rotate_label(False)
    ax.view_init(elev=ELEVATION, azim=AZIMUTH)
    ax.set_box_aspect((1, 1, 0.8), zoom=0.92)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1, 1, 1, 0))
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10], prune="lower" if axis is ax.yaxis else None))
        axis.set_minor_locator(NullLocator())
    ax.tick_params(pad=-2)


LONG = 6
"""A surface wants more values than this on both of its axes."""


def _suits(contents: Contents) -> bool:
    axes = contents.parameters
    alone = contents.by_itself and contents.drawn is None
    return alone and len(axes) == 2 and all(axis.numeric and axis.size > LONG for axis in axes)


KIND = Kind("surface", "boundaries of one tongue over two amplitudes", draw, _suits)
