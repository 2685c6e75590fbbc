"""Instability boundaries of a result as lines: exact ones solid, first order dashed, second order dash-dotted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from scipy import ndimage

from gearstab.perturbation.tongues import label_of
from gearstab.plots.axes import FigureAxis, texts
from gearstab.plots.drawing.style import GROWTH, LINE
from gearstab.plots.view import View
from gearstab.results.display import SPEEDS

Array = np.ndarray

THEORIES = ("boundaries", "perturbation", "uncoupled")
"""The groups with edges of regions, the exact ones first."""
LOOKS: dict[str, tuple[Any, str]] = {
    "boundaries": ("-", "exact boundaries"),
    "neutral": ("-", "no growth (Floquet)"),
    "first": ((0, (4, 2)), "first order"),
    "second": ((0, (6, 1.5, 1, 1.5)), "second order"),
    "uncoupled": ((0, (1, 1.4)), "uncoupled modes"),
}
"""Line style and entry in a legend of each theory, the same in every figure."""
THIN = "exact, narrow"
"""Entry in a legend of regions that :func:`exact_lines` draws as one line."""
ALONE = "unstable, narrower than a line"
"""The same where no theory is drawn beside exact boundaries."""
SLIVER = GROWTH(0.15)
"""A tongue thinner than a line is a sliver of the lightest growth colours, as it would be among the cells."""

HARMONICS = 6
"""Harmonics of regions that are named by where they lie."""

ONE_LINE = 0.002
"""Two edges nearer than this part of the frame print as one line."""

INVISIBLE = 0.004
"""A tongue nowhere wider than this part of the frame is about as thin as its own two lines: it gets no name."""


@dataclass(frozen=True)
class DrawnTongues:
    """Boundaries over one axis of parameters.

    edges: ``(tongue, 2, size)``, lower and upper mesh frequency, or the speed that gives it where the figure shows
        that, NaN where a tongue is closed.
    """

    edges: Array
    labels: tuple[str, ...]
    parameter: FigureAxis

    @property
    def positions(self) -> Array:
        """``(size,)``, ascending."""
        return self.parameter.ascending

    def inside(self, low: float, high: float) -> Array:
        """``(tongue, 2, size)``: the part of the frame, from 0 to 1, between the edges; NaN where there is none."""
        part = np.clip((self.edges - low) / (high - low), 0.0, 1.0)
        return np.where(part[:, 1:] > part[:, :1], part, np.nan)

    def open_ranges(self) -> Array:
        """``(ranges, 2)``, lower and upper edge of the tongues that are open at the first position."""
        edges = self.edges[..., 0]
        return edges[np.isfinite(edges).all(axis=1) & (edges[:, 1] > edges[:, 0])]


def frequency_limits(ax: Axes, frequency_on_x: bool) -> tuple[float, float]:
    """Where the frame begins and ends along the axis of the mesh frequency."""
    return ax.get_xlim() if frequency_on_x else ax.get_ylim()


def read_tongues(tree: xr.DataTree, group: str, view: View, parameter: FigureAxis | None) -> DrawnTongues | None:
    """The boundaries of a group over ``parameter`` at the view's indices; None if the result does not hold them.

    Without a parameter (a figure over the mesh frequency alone) the tongues have one row, at position 0.
    """
    if group not in tree.children or "boundary_frequency" not in tree[group].data_vars:
        return None
    data = tree[group].to_dataset()["boundary_frequency"]
    own = () if parameter is None else (parameter.name,)
    if not {"tongue", "side", *own} <= set(data.dims):
        return None
    if view.factor is None:
        return None
    edges = view.cut(data, "tongue", "side", *own) / view.factor
    if parameter is None:
        edges, parameter = edges[..., None], FigureAxis("", np.zeros(1), meshes=view.x.meshes)
    if edges.shape[0] == 0:
        return None
    raw = data.coords["label"].values if "label" in data.coords else [""] * edges.shape[0]
    labels = texts(raw)
    kept = [i for i, label in enumerate(labels) if view.tongue in (None, label)]
    return DrawnTongues(edges[kept], tuple(labels[i] for i in kept), parameter)


def regions_of_one_mode(tree: xr.DataTree, view: View, parameter: FigureAxis) -> DrawnTongues | None:
    """The regions of a grid of stability around 2 w/s, s = 1, 2, ..., of a system with one elastic mode.

    None for other systems. A region counts where that frequency lies inside it at every value of the parameter: the
    natural frequency is that of the base system, and may be another where the parameter changes the mean stiffness.
    """
    speed = view.speed
    base = tree["modes"].to_dataset() if "modes" in tree.children else xr.Dataset()
    modes = np.ravel(base["natural_frequency"].values) if "natural_frequency" in base else np.zeros(0)
    grid = tree["floquet"].data_vars.get("stable") if "floquet" in tree.children else None
    if speed is None or view.factor is None or (modes > 0).sum() != 1:
        return None
    if grid is None or not {parameter.name, speed.name} <= set(grid.dims):
        return None
    found, _ = ndimage.label(view.cut(grid, parameter.name, speed.name) == 0)
    cells, mode = speed.edges(), int(np.argmax(modes > 0))
    edges, labels = [], []
    for harmonic in range(1, HARMONICS + 1):
        at = int(np.searchsorted(cells, 2 * modes[mode] / harmonic / view.factor)) - 1
        if not 0 <= at < speed.size or not found[:, at].any():
            continue
        inside = found == found[:, at].max()
        rows = inside.any(axis=1)
        if inside[rows, at].all():
            ends = cells[np.argmax(inside, axis=1)], cells[speed.size - np.argmax(inside[:, ::-1], axis=1)]
            edges.append(np.where(rows, ends, np.nan))
            labels.append(label_of(mode + 1, mode + 1, harmonic))
    return DrawnTongues(np.stack(edges), tuple(labels), parameter) if edges else None


def widest(tongues: DrawnTongues, low: float, high: float) -> Array:
    """``(tongue,)``: the greatest width inside the frame, as a part of it; 0 for one that is never seen."""
    part = tongues.inside(low, high)
    width = np.nan_to_num(part[:, 1] - part[:, 0])
    return width.max(axis=-1)


def draw_theories(
    tree: xr.DataTree, ax: Axes, view: View, groups: Iterable[str] = THEORIES, colour: str = LINE, thin: Any = SLIVER
) -> dict[str, Any]:
    """Draw the edges of regions of each group into a frame whose limits are set.

    colour: of the lines; thin: of regions that exact boundaries show as one light line. Returns the lines by group and
    ``thin``, None where the result does not hold them or the view is not over the mesh frequency and numbers.
    """
    artists: dict[str, Any] = dict.fromkeys((*THEORIES, "thin"))
    found = parameter_axis(view)
    if found is None:
        return artists
    parameter, frequency_on_x = found
    limits = frequency_limits(ax, frequency_on_x)
    for group in groups:
        lines = read_tongues(tree, group, view, parameter)
        if lines is None:
            continue
        if group == "boundaries":
            artists[group], artists["thin"] = exact_lines(ax, lines, frequency_on_x, colour, thin)
        else:
            artists[group] = boundary_lines(
                ax, lines, frequency_on_x, widest(lines, *limits) > INVISIBLE,
                colors=colour, linestyles=[LOOKS[theory(tree, group)][0]], linewidths=0.6, zorder=2.4,
            )  # fmt: skip
    return artists


def theory(tree: xr.DataTree, group: str) -> str:
    """The key in LOOKS of what computed a group of the result."""
    if group != "perturbation":
        return group
    return "second" if int(tree[group].attrs.get("order", 1)) == 2 else "first"


def legend_of(tree: xr.DataTree, artists: Mapping[str, Any], colour: str = LINE) -> list[Line2D]:
    """Legend entries of the sorts of lines that were drawn: where all are exact, of light lines alone."""
    lines = {group: artists.get(group) for group in THEORIES}
    drawn = [theory(tree, group) for group, found in lines.items() if found is not None and found.get_segments()]
    thin = artists.get("thin")
    light = [] if thin is None or not thin.get_segments() else [thin.get_color()[0]]
    if drawn in ([], ["boundaries"]):
        return [Line2D([], [], color=own, linewidth=0.75, label=ALONE) for own in light]
    if artists.get("neutral") is not None:
        drawn = ["neutral", *drawn]
    looks = [LOOKS[key] for key in drawn]
    handles = [Line2D([], [], color=colour, linewidth=0.75, linestyle=dash, label=words) for dash, words in looks]
    return [*handles, *(Line2D([], [], color=own, linewidth=0.75, label=THIN) for own in light)]


def boundary_lines(ax: Axes, tongues: DrawnTongues, frequency_on_x: bool, chosen: Array, **line: Any) -> LineCollection:
    """Draw both edges of the ``chosen`` tongues (a mask) as thin lines."""
    edges = tongues.edges[chosen]
    along = np.broadcast_to(tongues.positions, edges.shape)
    points = np.stack([edges, along] if frequency_on_x else [along, edges], axis=-1)
    segments = list(points.reshape(-1, *points.shape[-2:]))
    lines = LineCollection(segments, capstyle="round", joinstyle="round", **line)
    ax.add_collection(lines, autolim=False)
    return lines


def exact_lines(
    ax: Axes, tongues: DrawnTongues, frequency_on_x: bool, colour: str = LINE, thin: Any = SLIVER
) -> tuple[LineCollection, LineCollection]:
    """Draw exact boundaries, see :func:`exact_parts`; returns the edges and the light lines."""
    low, high = frequency_limits(ax, frequency_on_x)
    looks: tuple[dict[str, Any], ...] = (
        {"colors": colour, "linewidths": 0.45, "zorder": 2.2},
        {"colors": [thin], "linewidths": 0.4, "zorder": 2.1},
    )
    drawn = []
    for parts, look in zip(exact_parts(tongues, high - low), looks, strict=True):
        drawn.append(LineCollection([p if frequency_on_x else p[:, ::-1] for p in parts], **look))
        ax.add_collection(drawn[-1], autolim=False)
    return drawn[0], drawn[1]


def exact_parts(tongues: DrawnTongues, span: float) -> tuple[list[Array], list[Array]]:
    """Return lines ``(points, 2)`` of (frequency, position) in a frame of a ``span`` of frequencies: both edges of
    tongues where they are wide enough to see, and one line for all of a tongue where it is not.

    A line is broken where an edge leaps, as it does where regions merge and where a name passes to another region.
    """
    edges = tongues.edges
    narrow = ~(edges[:, 1] - edges[:, 0] >= ONE_LINE * span)
    wide = np.where((narrow & beside(narrow))[:, None], np.nan, edges)
    middle = np.where((~narrow & beside(~narrow)), np.nan, edges.mean(axis=1))
    both = [part for line in wide.reshape(-1, edges.shape[-1]) for part in pieces(line, tongues.positions, span)]
    light = [part for line in middle for part in pieces(line, tongues.positions, span)]
    return both + joints(both, span), light


def beside(rows: Array) -> Array:
    """Whether both neighbours of a row hold too: what is cut there overlaps by a row with what goes on."""
    padded = np.pad(rows, ((0, 0), (1, 1)), constant_values=True)
    return padded[:, :-2] & padded[:, 2:]


def pieces(frequency: Array, positions: Array, span: float) -> list[Array]:
    """The unbroken parts ``(points, 2)`` of an edge, cut at NaN and where it leaps.

    A leap is far beyond the edge's usual step (an edge of parabolic shape stays below twice the median), or more than a
    twentieth of the frame. Steps of zero, as of an edge held at the end of the range, are not usual ones.
    """
    leaps = np.abs(np.diff(frequency))
    usual = float(np.median(leaps[leaps > 0])) if np.any(leaps > 0) else 0.0
    cuts = np.flatnonzero(~(leaps <= min(INVISIBLE * span + 5 * usual, 0.05 * span))) + 1
    parts = np.split(np.stack([frequency, positions], axis=-1), cuts)
    return [part for part in parts if len(part) > 1 and np.isfinite(part).all()]


def joints(parts: Sequence[Array], span: float) -> list[Array]:
    """The steps ``(2, 2)`` from a part of an edge that ends to one that begins a row further, beside it.

    Where regions merge, the edge of one goes on as an edge of the other: without a step there would be a gap of a row.
    """
    found = []
    for ending in parts:
        step = ending[-1, 1] - ending[-2, 1]
        starts = [p[0] for p in parts if 0 < (p[0, 1] - ending[-1, 1]) / step < 1.5]
        near = min(starts, key=lambda start: abs(start[0] - ending[-1, 0]), default=None)
        usual = abs(ending[-1, 0] - ending[-2, 0])
        if near is not None and abs(near[0] - ending[-1, 0]) < 2 * (usual + INVISIBLE * span):
            found.append(np.stack([ending[-1], near]))
    return found


def parameter_axis(view: View) -> tuple[FigureAxis, bool] | None:
    """(the axis across the mesh frequency, whether the frequency is on x); None if the frequency is on neither."""
    if view.y is None:
        return None
    for frequency, parameter in ((view.x, view.y), (view.y, view.x)):
        if frequency.name in SPEEDS and parameter.numeric:
            return parameter, frequency is view.x
    return None
