"""Natural frequencies in a Campbell diagram, the instability regions rooted at their sums, their marks, and
numbered orders.

Frequencies are followed by their shapes over a parameter, or by the sense of their orbits over the speed of rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from scipy.optimize import linear_sum_assignment

from gearstab.errors import PlotError
from gearstab.perturbation.tongues import DIFFERENCES
from gearstab.plots.axes import FigureAxis, group_of, texts
from gearstab.plots.drawing.style import CASES, LINE, UNSTABLE
from gearstab.plots.view import View
from gearstab.results.display import SPEED_RATIOS

Array = np.ndarray

MODES = "natural_frequencies"
"""The group of natural frequencies over the axes of a sweep."""
SYMMETRIC = "symmetric_frequency"
"""Frequencies of the symmetric mean system, at whose sums theory roots regions, of a system with terms."""
OPEN = 1e-9
"""Two edges closer than this, relative to them, are the rounding error of a region without width."""
SAME = 1e-6
"""Natural frequencies that agree to this are those of the base system; rounding stays far below, print above."""


def followed(shapes: Array) -> Array:
    """Return for every row which of its modes belongs to each branch, ``(rows, modes)``; branches as in the first row.

    shapes: ``(rows, modes, coordinates)``, normalised by the mass matrix, modes by ascending natural frequency. From
    row to row modes are assigned so that the sum of their assurance criteria (phi^T M psi)^2 is greatest; as
    Phi^T M = Phi^-1, the shapes alone give it. Source: Allemang 2003, The modal assurance criterion; with the mass
    matrix as weight. Where shapes change much within a step, as between two branches that veer apart, a finer axis
    tells which mode is which.
    """
    order = np.tile(np.arange(shapes.shape[1]), (len(shapes), 1))
    for row in range(1, len(shapes)):
        criterion = np.linalg.solve(shapes[row - 1].T, shapes[row].T) ** 2
        order[row] = linear_sum_assignment(criterion, maximize=True)[1][order[row - 1]]
    return order


@dataclass(frozen=True)
class Region:
    """An instability region where ``ratio`` Omega is near w_p + w_q.

    p, q: positions among the modes. low, high: ``(size,)``, edges in the mesh frequency, rad per unit time; NaN where
    it is closed, infinite where it has none.
    """

    label: str
    p: int
    q: int
    ratio: float
    harmonic: int
    low: Array
    high: Array

    @property
    def open(self) -> Array:
        """``(size,)`` bool."""
        with np.errstate(invalid="ignore"):
            return np.isinf(self.high) | (self.high - self.low > OPEN * np.abs(self.high))


def read_frequencies(
    tree: xr.DataTree, view: View, parameter: FigureAxis | None, name: str = "natural_frequency"
) -> Array:
    """Natural frequencies ``(size, modes)``: over a parameter as it ascends, or one row.

    Raises PlotError where the result does not hold them.
    """
    own: tuple[str, ...] = () if parameter is None else (parameter.name,)
    data = group_of(tree, MODES)
    if not data and own:
        raise PlotError(f"this result holds no natural frequencies over {own[0]}: {REMEDY}")
    if not data:
        if "natural_frequency" not in group_of(tree, "modes"):
            raise PlotError(f"this result holds no natural frequencies: {REMEDY}")
        return np.atleast_2d(group_of(tree, "modes")[name].values)
    if not set(own) <= set(map(str, data.sizes)):
        raise PlotError(f"natural frequencies do not stand over {own[0]}")
    return np.atleast_2d(view.cut(data[name], *own, "mode"))


def read_branches(tree: xr.DataTree, view: View, parameter: FigureAxis | None, modes: int) -> Array:
    """The modes of every branch ``(size, modes)``, followed by their shapes over a parameter; or one row."""
    if parameter is None:
        return np.atleast_2d(np.arange(modes))
    return followed(view.cut(group_of(tree, MODES)["mode_shape"], parameter.name, "mode", "dof"))


def damped(tree: xr.DataTree) -> bool:
    """Return whether natural frequencies are those of a whole mean system, which differ from those of its shapes."""
    return SYMMETRIC in group_of(tree, "modes")


REMEDY = "add natural_frequencies: {} to methods and run the sweep again"


def read_regions(tree: xr.DataTree, view: View, parameter: FigureAxis | None) -> list[Region]:
    """The regions of exact boundaries, then those that only perturbation theory knows, closed beside exact ones.

    Raises PlotError where they are not those of the natural frequencies of the result.
    """
    modes = read_frequencies(tree, view, parameter, SYMMETRIC if damped(tree) else "natural_frequency")
    own: tuple[str, ...] = () if parameter is None else (parameter.name,)
    found, known, exact = list[Region](), set[str](), False
    for group in ("boundaries", "perturbation"):
        data = group_of(tree, group)
        if not {"mode_p", "mode_q", "frequency_ratio", "harmonic", "label", "kind"} <= set(data.coords):
            continue
        if not {"boundary_frequency", *own} <= {*data.data_vars, *map(str, data.sizes)}:
            continue
        edges = view.cut(data["boundary_frequency"], "tongue", "side", *own)
        edges = edges.reshape(data.sizes["tongue"], 2, len(modes))
        merged: Array = np.full((len(edges), 1), -1)
        if "holder" in data:
            merged = view.cut(data["holder"], "tongue", *own).reshape(len(edges), len(modes))
        if exact:
            # What exact boundaries do not have is narrower than their floor.
            edges = np.full(edges.shape, np.nan)
        elif "half_width" in data:
            endless = np.isinf(view.cut(data["half_width"], "tongue", *own).reshape(len(edges), len(modes)))
            edges = np.where(endless[:, None], np.array([-np.inf, np.inf])[:, None], edges)
        labels, kinds = (texts(data.coords[name].values) for name in ("label", "kind"))
        for k, label in enumerate(labels):
            ratio, harmonic = float(data["frequency_ratio"].values[k]), int(data["harmonic"].values[k])
            hidden = np.any(merged[k] >= 0) and not np.isfinite(edges[k]).any()
            # At a difference of frequencies an order of a mesh passes neither mode's.
            hidden |= kinds[k] in DIFFERENCES
            if ratio > 0 and label not in known and view.tongue in (None, label) and not hidden:
                p, q = (int(data[name].values[k]) - 1 for name in ("mode_p", "mode_q"))
                found.append(Region(label, p, q, ratio, harmonic, edges[k, 0], edges[k, 1]))
        if "center_frequency" in data:
            centres = view.cut(data["center_frequency"], "tongue", *own).reshape(len(edges), len(modes))
            _check(data, centres, modes)
        known, exact = known | set(labels), True
    return found


def _check(data: xr.Dataset, centres: Array, modes: Array) -> None:
    """Raise PlotError where regions are not rooted at sums or differences of these natural frequencies."""
    p, q = (data[name].values.astype(int) - 1 for name in ("mode_p", "mode_q"))
    sign = np.where([kind in DIFFERENCES for kind in texts(data.coords["kind"].values)], -1.0, 1.0)
    sums, own = (sign * modes[:, p] + modes[:, q]).T, centres * data["frequency_ratio"].values[:, None]
    if np.any(np.abs(sums - own) > SAME * np.abs(own)):
        raise PlotError(
            f"natural frequencies change over the axes, and this result holds those of one system: {REMEDY}"
        )


LOOKS: dict[int, tuple[str, Any, str]] = {
    1: (CASES[1], "-", "forward"),
    -1: (CASES[3], (0, (5, 1.5)), "backward"),
    0: (LINE, "-", "neither"),
}
"""By the sense of the orbits: colour, line, words."""
TURNING: dict[str, Any] = {"color": "#6e6e6e", "linestyle": ":", "linewidth": 1.0}
"""Look of lines at the speeds of rotation."""


@dataclass(frozen=True)
class WhirlCurves:
    """Curves over a speed, ``(P, n)`` each; speed: ``(P,)``, ascending. unstable: ``(P,)``, by Floquet analysis, and
    None where the result does not hold it. ratios: of the speeds of rotation to the mesh frequency.
    """

    speed: Array
    frequency: Array
    growth: Array
    whirl: Array
    veering: Array
    unstable: Array | None
    ratios: tuple[float, ...]

    @classmethod
    def read(cls, tree: xr.DataTree, view: View, speed: FigureAxis | None) -> WhirlCurves | None:
        """Return those of a result over the speed that is drawn, None where there are none."""
        data = group_of(tree, "natural_frequencies")
        if "whirl" not in data or speed is None or view.x.name != speed.name:
            return None
        names = ("natural_frequency", "growth_rate", "whirl", "veering")
        frequency, growth, whirl, veering = (view.cut(data[name], speed.name, "mode") for name in names)
        floquet, unstable = group_of(tree, "floquet"), None
        if "stable" in floquet and set(map(str, floquet["stable"].dims)) <= {speed.name, *view.fixed}:
            unstable = view.cut(floquet["stable"], speed.name) == 0
        ratios = tuple(np.atleast_1d(data.attrs[SPEED_RATIOS]).tolist())
        return cls(speed.ascending, frequency, growth, whirl, veering, unstable, ratios)

    def draw(self, ax: Axes, unit: float, factor: float) -> list[Line2D]:
        """Draw the curves, what grows by itself, where motions veer, and lines at the speeds of rotation."""
        lines: list[Line2D] = []
        for own, growth, sense, near in zip(
            self.frequency.T / unit, self.growth.T, self.whirl.T, self.veering.T, strict=True
        ):
            drawn = np.where(own > 0, own, np.nan)
            for value, (colour, look, _) in LOOKS.items():
                part = sense == value
                # A stretch goes on to the next speed, so that no gap is left where the sense changes.
                part[1:] |= part[:-1]
                if np.isfinite(drawn[part]).any():
                    y = np.where(part, drawn, np.nan)
                    lines += ax.plot(self.speed, y, color=colour, linestyle=look, linewidth=1.0, zorder=2)
            if (growth > 0).any():
                y = np.where(growth > 0, own, np.nan)
                ax.plot(self.speed, y, color=UNSTABLE, linewidth=2.6, alpha=0.8, zorder=1.9)
            at = np.flatnonzero(near)
            ax.plot(self.speed[at], drawn[at], "o", markersize=4.5, color=LINE, fillstyle="none", zorder=3)
        for ratio in sorted({abs(ratio) for ratio in self.ratios if ratio}):
            y = ratio * factor * self.speed / unit
            ax.plot(self.speed, y, **TURNING, zorder=1.6)
        return lines

    def bands(self) -> list[tuple[float, float]]:
        """Return where the speeds of unstable points begin and how wide they are, each half way to the next."""
        if self.unstable is None or len(self.speed) < 2:
            return []
        middle = 0.5 * (self.speed[1:] + self.speed[:-1])
        edges = np.concatenate([self.speed[:1], middle, self.speed[-1:]])
        change = np.flatnonzero(np.diff(np.concatenate([[False], self.unstable, [False]]).astype(int)))
        return [(float(edges[a]), float(edges[b] - edges[a])) for a, b in change.reshape(-1, 2)]

    def handles(self) -> list[Any]:
        """Return the entries of a legend."""
        found: list[Any] = [
            Line2D([], [], color=colour, linestyle=look, linewidth=1.0, label=f"whirl {words}")
            if value
            else Line2D([], [], color=colour, linewidth=1.0, label="other natural frequencies")
            for value, (colour, look, words) in LOOKS.items()
            if ((self.whirl == value) & (self.frequency > 0)).any()
        ]
        if self.veering.any():
            mark: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.5, "fillstyle": "none"}
            found.append(Line2D([], [], color=LINE, label="veering", **mark))
        if ((self.growth > 0) & (self.frequency > 0)).any():
            found.append(Line2D([], [], color=UNSTABLE, linewidth=2.6, alpha=0.8, label="grows by itself"))
        if any(self.ratios):
            found.append(Line2D([], [], **TURNING, label="speed of rotation"))
        return found


SIZE = 6.5
"""Points of a number."""
HALO = [withStroke(linewidth=2.0, foreground="white")]
ACROSS = 257
"""Points of a line at which it is looked for others."""
CROWD = 1000
"""Points of lines that a mark, or another number, counts as under a number."""
CLEAR = 0.5
"""Points around a number that are kept clear."""
TIMES = r"$\times$"
"""Between the number of an order and its mesh."""


def order_colour(number: int, count: int) -> str:
    """The colour of the orders of a mesh frequency: blue where there is one alone, never that of the natural ones."""
    return CASES[2] if count == 1 else (CASES[2], CASES[3], CASES[4], CASES[5])[number % 4]


def draw_order(ax: Axes, slope: float, level: float, half: int, colour: str, mesh: str) -> Line2D | None:
    """Draw frequencies slope x + level, of half the harmonics ``half``; None where they lie above the frame.

    Its label is its number, with the mesh behind it.
    """
    x = np.linspace(*ax.get_xlim(), 2)
    y = slope * x + level
    if y.min() > ax.get_ylim()[1]:
        return None
    look = "-" if half % 2 == 0 else (0, (4, 2))
    (line,) = ax.plot(x, y, color=colour, linestyle=look, linewidth=0.6, alpha=0.85, zorder=1.5)
    line.set_label(f"{0.5 * half:g}{TIMES}{mesh}")
    return line


def number_orders(
    ax: Axes, orders: Sequence[Line2D], curves: Sequence[Line2D], marks: Sequence[PathCollection]
) -> None:
    """Write on every line its number, as far to the right as nothing else lies there; the frame must have settled.

    Where something lies everywhere it is where least does. Lines of one mesh along the edge of the frame, where their
    numbers do not fit, share one beside it. curves, marks: what else is drawn.
    """
    frame = ax.get_window_extent()
    columns = np.linspace(frame.x0, frame.x1, ACROSS)
    heights = [_heights(line, columns) for line in [*orders, *curves]]
    points = [ax.transData.transform(np.asarray(mark.get_offsets())) for mark in marks]
    crowd = np.concatenate(points) if points else np.zeros((0, 2))
    left: dict[str, list[int]] = {}
    for k, order in enumerate(orders):
        others = [*heights[:k], *heights[k + 1 :]]
        taken = _number(ax, str(order.get_label()), order, columns, heights[k], others, crowd)
        crowd = np.concatenate([crowd, taken])
        if not len(taken):
            left.setdefault(str(order.get_color()), []).append(k)
    for own in left.values():
        numbers, mesh = zip(*(str(orders[k].get_label()).split(TIMES, 1) for k in own), strict=True)
        words, others = ", ".join(numbers) + TIMES + mesh[0], [h for k, h in enumerate(heights) if k not in own]
        taken = _number(ax, words, orders[own[-1]], columns, heights[own[-1]], others, crowd, beside=True)
        crowd = np.concatenate([crowd, taken])


def _number(
    ax: Axes, words: str, order: Line2D, columns: Array, height: Array, others: Sequence[Array], crowd: Array,
    beside: bool = False,
) -> Array:  # fmt: skip
    """Write words on a line; returns points of the room they take, none where there is none.

    height, others: of the line and of all others over ``columns``, in pixels. beside: move words that do not fit into
    the frame, however near its edge the line is.
    """
    frame = ax.get_window_extent()
    text = ax.text(0.0, 0.0, words, ha="center", va="center", fontsize=SIZE, color=order.get_color())
    text.set(path_effects=HALO, zorder=4)
    box = text.get_window_extent()
    half = 0.5 * np.array([box.width, box.height]) + CLEAR * ax.figure.dpi / 72
    middle = np.column_stack([columns, height])
    inside = np.all((middle - half >= frame.min) & (middle + half <= frame.max), axis=1)
    if beside:
        inside = (height >= frame.y0) & (height <= frame.y1)
        middle = np.clip(middle, frame.min + half, frame.max - half)
    if not inside.any():
        text.remove()
        return np.zeros((0, 2))
    cost = CROWD * np.sum(np.all(np.abs(middle[:, None] - crowd) < half, axis=-1), axis=-1)
    near = np.abs(middle[:, :1] - columns) < half[0]
    for other in others:
        with np.errstate(invalid="ignore"):
            cost += np.sum(near & (np.abs(middle[:, None, 1] - other) < half[1]), axis=1)
    best = ACROSS - 1 - int(np.argmin(np.where(inside, cost, np.iinfo(int).max)[::-1]))
    x, y = ax.transData.inverted().transform(middle[best])
    text.set_position((float(x), float(y)))
    return _corners(middle[best], half)


def _heights(line: Line2D, columns: Array) -> Array:
    """The line in pixels over columns of pixels, NaN where there is none."""
    x, y = line.get_transform().transform(line.get_xydata()).T
    return np.asarray(np.interp(columns, x, y, left=np.nan, right=np.nan))


def _corners(middle: Array, half: Array) -> Array:
    """Nine points of a box, so that one of its own size that meets it holds one of them."""
    ways = np.array([-1.0, 0.0, 1.0])
    return np.asarray(middle + half * np.stack(np.meshgrid(ways, ways), axis=-1).reshape(-1, 2))


FAINT = "#a0a0a0"
SIZES = (2.2, 4.0)
"""Size of a mark, in points: for a line, and for a region from WIDE of the frame on."""
WIDE = 0.03


class Marks:
    """Places of regions of one mode and of two, ``(x, y, size)``, and lines that join the frequencies of two."""

    def __init__(self) -> None:
        self.one: list[tuple[float, float, float]] = []
        self.two: list[tuple[float, float, float]] = []
        self.joints: list[Any] = []

    def add(self, region: Region, x: float, y: Array, width: float) -> None:
        """Mark a region at the mean of its two natural frequencies y; width: its part of the frame."""
        size = SIZES[0] + (SIZES[1] - SIZES[0]) * min(max(width, 0.0) / WIDE, 1.0)
        (self.one if region.p == region.q else self.two).append((x, float(y.mean()), size))
        if y[0] != y[-1]:
            self.joints.append([(x, y[0]), (x, y[-1])])

    def draw(self, ax: Axes, faint: bool) -> dict[str, PathCollection]:
        """Draw them; by sort, none of a sort that there is none of."""
        if not faint:
            lines = LineCollection(self.joints, colors=UNSTABLE, linewidths=0.5, linestyles=":", zorder=1.7)
            ax.add_collection(lines, autolim=False)
        drawn = {}
        for sort, places in (("one", self.one), ("two", self.two)):
            if places:
                x, y, size = np.transpose(places)
                face, edge = ("white", FAINT) if faint else (UNSTABLE, LINE)
                drawn[sort] = ax.scatter(
                    x, y, (0.8 if faint else 1.0) * size**2, marker=MARKERS[sort], facecolor=face, edgecolor=edge,
                    linewidth=0.5 if faint else 0.3, zorder=1.8 if faint else 3,
                )  # fmt: skip
        return drawn


MARKERS = {"one": "o", "two": "D"}


def spot(sort: str, faint: bool, words: str) -> Line2D:
    """The entry of a mark in a legend."""
    face, edge = ("white", FAINT) if faint else (UNSTABLE, LINE)
    # The frequencies of two modes are joined by dots.
    return Line2D(
        [], [], color=UNSTABLE, linestyle=":" if sort == "two" and not faint else "none", linewidth=0.5,
        marker=MARKERS[sort], markersize=SIZES[1], markerfacecolor=face, markeredgecolor=edge, markeredgewidth=0.5,
        label=words,
    )  # fmt: skip
