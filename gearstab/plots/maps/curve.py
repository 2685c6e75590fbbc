"""Curves: a variable over one axis (or the one left), such as the growth rate over the mesh frequency.

Two have figures of their own: e-folds of a run-up or coast-down over its rate, exactly and by the growth rates along
the way; and the work-precision diagram of ``/bench``, time per point against true error, one line per method.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.errors import PlotError
from gearstab.plots.axes import FigureAxis, held
from gearstab.plots.drawing import grid, names, tongues
from gearstab.plots.drawing.style import CASES, DASHES, SHADE, new_figure, new_frame, write_legend, write_title
from gearstab.plots.drawing.text import fitted, number_text, unit_text
from gearstab.plots.kinds import GROWTH_RATE, Contents, Kind, colour_label, default_variable, find_variable
from gearstab.plots.maps import overlays
from gearstab.plots.view import Index, Request, View, caption, some, view_along
from gearstab.results.display import SHOWN_SCALE, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]


def draw_curve(ax: Axes, data: xr.DataArray, view: View, number: int, label: str) -> Line2D:
    """One line over x; gaps where there is no value."""
    (line,) = ax.plot(
        view.x.ascending, view.cut(data, view.x.name), color=CASES[number], linestyle=DASHES[number],
        label=label, marker="o" if view.x.size == 1 else "", markersize=2.5,
    )  # fmt: skip
    return line


def peak(values: Array) -> float:
    """The largest magnitude; NaN where there is none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else float("nan")


def draw_bands(tree: xr.DataTree, ax: Axes, view: View) -> tuple[tongues.DrawnTongues | None, object | None]:
    """Shade the unstable mesh frequencies, between exact boundaries or else as perturbation theory predicts them.

    Returns the tongues and the bands.
    """
    groups = ("boundaries", "perturbation") if view.x.name in SPEEDS else ()
    known = (tongues.read_tongues(tree, group, view, None) for group in groups)
    lines = next((found for found in known if found is not None), None)
    if lines is None:
        return None, None
    edges = lines.open_ranges()
    if not len(edges):
        return lines, None
    return lines, ax.broken_barh(
        list(zip(edges[:, 0], edges[:, 1] - edges[:, 0], strict=True)), (0, 1), transform=ax.get_xaxis_transform(),
        facecolors=SHADE, linewidth=0, zorder=0.5,
    )  # fmt: skip


def legend_of_bands(tree: xr.DataTree, bands: object | None) -> list[Patch]:
    """Return the handle of the bands of unstable speeds; none without them."""
    if bands is None:
        return []
    exact = "boundaries" in tree.children
    words = "unstable" if exact else f"unstable, {tongues.LOOKS[tongues.theory(tree, 'perturbation')][1]}"
    return [Patch(facecolor=SHADE, label=words)]


def chosen_curves(view: View, data: xr.DataArray, request: Request) -> tuple[list[Index], str]:
    """Return the meaning of each curve over x; of too many those with the largest values, and a sentence that says
    so.
    """
    return some(view.free, len(CASES), "curves", request.partial, lambda c: peak(view.at(**c).cut(data, view.x.name)))


def draw_doubts(
    tree: xr.DataTree, ax: Axes, dataset: xr.Dataset, view: View, cases: list[Index], lines: list[Line2D]
) -> list[str]:
    """Draw halos behind what is in doubt of each case's line; what the legend is to say of them."""
    words = []
    for line, case in zip(lines, cases, strict=True):
        words += overlays.halo(ax, line, overlays.doubtful(tree, dataset, view.at(**case), view.x.name))
    return words


def dress(ax: Axes, x: FigureAxis, label: str) -> None:
    """Scale and labels of a figure of curves over ``x``; ``label``: what they are."""
    ax.set_xscale("log" if x.logarithmic else "linear")
    grid.number(ax.xaxis, x)
    grid.draw_ranges(ax, x, True, 0.97)
    ax.set_xlabel(x.label)
    ax.set_ylabel(fitted(label, 1.8, 8.5), linespacing=0.95)


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure: ``lines``, and for one case over the mesh frequency ``bands`` and ``names`` of the tongues,
    and ``proved``, what is proved stable.
    """
    variable = request.variable or default_variable(tree)
    dataset, data = find_variable(tree, variable)
    view = view_along(tree, map(str, data.dims), request, dataset)
    cases, note = chosen_curves(view, data, request)
    figure, ax = new_frame(request, (0.72, 0.5))
    lines = [draw_curve(ax, data, view.at(**c), k, caption(view.free, c)) for k, c in enumerate(cases)]
    doubted = draw_doubts(tree, ax, dataset, view, cases, lines)
    low, high = grid.limits(view.x) if view.x.size == 1 else view.x.ascending[[0, -1]]
    ax.set_xlim(low, high)
    dress(ax, view.x, colour_label(tree, variable))
    if variable == GROWTH_RATE:
        ax.axhline(0.0, color="#8a8a8a", linewidth=0.4, zorder=0.8)
    found, bands = draw_bands(tree, ax, view) if len(cases) == 1 else (None, None)
    tint = overlays.draw_proved(tree, ax, view, None) if len(cases) == 1 else None
    handles = [
        *(lines if len(cases) > 1 else []),
        *legend_of_bands(tree, bands),
        *overlays.legend_of_proved(tint),
        *overlays.legend_of_curves(doubted),
    ]
    write_legend(figure, handles, ax=request.ax)
    write_title(figure, tree, request, view)
    names.settle(figure)
    named = names.name_tongues(ax, found, True) if found is not None else None
    names.freeze(figure, request)
    return figure, {"lines": lines, "bands": bands, "proved": tint, "names": named, "left_out": note}


KIND = Kind("curve", "growth rate over one axis", draw, lambda c: c.dimensions is not None and c.dimensions < 2)


GROUP, RATE = "passage", "rate"
EXACT, ADIABATIC = "growth_exact", "growth"
GREY = "#6e6e6e"
LEAST = 0.05
"""E-folds that are shown: 5 %."""
MARK: dict[str, Any] = {"markersize": 3.2, "markerfacecolor": "none"}
LOOKS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "exact": ({"linestyle": "-"}, {"linestyle": "none", "marker": "v"}),
    "adiabatic": ({"linestyle": (0, (4, 1.6))}, {"linestyle": "none", "marker": "x"}),
}
"""Markers of runs upwards and downwards."""


def draw_passage(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """Draw curves over the rate, one colour for each value of another axis, up to six.

    The artists: ``exact`` and ``adiabatic``, lines by case, upwards solid and dashed, downwards triangles and crosses;
    ``admitted``, the line of the amplification that the slowest rate admits; ``left_out``. Raises PlotError without a
    passage, and for more curves than can be told apart.
    """
    if GROUP not in tree.children:
        raise PlotError("this result holds no passage (methods.passage was not run)")
    dataset = tree[GROUP].to_dataset()
    view = view_along(tree, map(str, dataset[EXACT].dims), replace(request, x=RATE), dataset)

    def largest(case: dict[str, int]) -> float:
        values = view.at(**case).cut(dataset[ADIABATIC], RATE)
        return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")

    cases, left_out = some(view.free, len(CASES), "curves", request.partial, largest)
    figure = new_figure(request, (0.78, 0.52))
    ax = figure.add_subplot()
    scale, unit = _unit(tree, view.x.units, dataset[RATE].attrs)
    rates = view.x.positions[view.x.order] / scale
    artists: Artists = {"exact": [], "adiabatic": [], "left_out": left_out}
    for number, case in enumerate(cases):
        own = view.at(**case)
        for key, name in (("exact", EXACT), ("adiabatic", ADIABATIC)):
            values = own.cut(dataset[name], RATE)
            # Where nothing grows there is no logarithm, and no line that falls to the frame.
            values = np.where(values > 0, values, np.nan)
            for side, look in zip((rates > 0, rates < 0), LOOKS[key], strict=True):
                if side.any():
                    artists[key] += ax.plot(np.abs(rates[side]), values[side], color=CASES[number], **MARK, **look)
    admitted = float(dataset.attrs["amplification"])
    artists["admitted"] = ax.axhline(
        np.log(admitted), color=GREY, linewidth=0.5, linestyle=(0, (1, 2)), zorder=0.5,
        label=f"{number_text(admitted)} times the amplitude",
    )  # fmt: skip
    # Also where no run grows, and there is no line.
    ax.update_datalim([(abs(rate), np.log(admitted)) for rate in rates])
    ax.set_xscale("log")
    # Growth goes as the inverse rate.
    ax.set_yscale("log")
    ax.set_ylim(LEAST, max(2 * np.log(admitted), 1.5 * _top(dataset)))
    speed = "input speed" if "input_speed" in tree.coords else "mesh frequency"
    ax.set_xlabel(f"rate of change of the {speed}{f' ({unit})' if unit else ''}")
    ax.set_ylabel("e-folds of the amplitude")
    write_legend(figure, [*_legend(cases, view, rates), artists["admitted"]])
    write_title(figure, tree, request, view)
    return figure, artists


def _unit(tree: xr.DataTree, own: str, attributes: Mapping[str, Any]) -> tuple[float, str]:
    """The unit of rates, that of the speed in a second where the speed has one of its own, and how large it is."""
    said = next((tree[name].attrs for name in SPEEDS if name in tree.coords), {})
    if SHOWN_SCALE in said and SHOWN_SCALE not in attributes:
        return float(said[SHOWN_SCALE]), unit_text(f"{said['units']}/s")
    return 1.0, unit_text(own)


def _top(dataset: xr.Dataset) -> float:
    values = np.concatenate([np.ravel(dataset[name].values) for name in (EXACT, ADIABATIC)])
    return float(np.max(values[np.isfinite(values)], initial=0.0))


def _legend(cases: list[dict[str, int]], view: Any, rates: Array) -> list[Line2D]:
    """Legend of colours, lines and marks."""
    handles = []
    if len(cases) > 1:
        handles = [Line2D([], [], color=CASES[k], label=caption(view.free, case)) for k, case in enumerate(cases)]
    for side, way in ((rates > 0, ""), (rates < 0, "downwards, ")):
        if side.any():
            looks = [LOOKS[key][way != ""] for key in ("exact", "adiabatic")]
            texts = ("exactly", "by growth rates")
            handles += [
                Line2D([], [], color=GREY, label=way + text, **MARK, **look)
                for look, text in zip(looks, texts, strict=True)
            ]
    return handles


def _suits_passage(contents: Contents) -> bool:
    other = contents.growth or contents.holds("response") or contents.holds("tolerance")
    return contents.by_itself and contents.holds(GROUP) and not other


PASSAGE = Kind(
    "passage",
    "e-folds of a run-up or coast-down over its rate, exactly and by growth rates",
    draw_passage,
    _suits_passage,
)


FLOOR = 1e-17
"""Errors that came out as exactly zero are drawn here, below the rounding error of the growth."""
MARKERS = "ospDv^<>X"


def draw_work_precision(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure; its artists are ``lines``, one per method. Raises PlotError without benchmark results."""
    dataset = held(tree, "bench", "benchmark")
    if not (np.isfinite(dataset["error"]) & np.isfinite(dataset["seconds"])).any():
        raise PlotError("no method of this benchmark has an error and a time: there is nothing to draw")
    figure, ax = new_frame(request, (0.95, 0.6))
    lines = draw_methods(ax, dataset)
    write_legend(figure, lines, ax=request.ax)
    write_title(figure, tree, request)
    return figure, {"lines": lines}


def draw_methods(ax: Axes, dataset: xr.Dataset) -> list[Any]:
    """Exact methods as single large marks, integrators as lines through their tolerances."""
    lines = []
    methods = dataset["method"].values.astype(str)
    for k, name in enumerate(dict.fromkeys(methods)):
        part = dataset.isel(setting=np.flatnonzero(methods == name))
        exact = part.sizes["setting"] == 1
        (line,) = ax.plot(
            np.maximum(part["error"].values, FLOOR),
            part["seconds"].values,
            color=CASES[k % len(CASES)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=6 if exact else 3,
            linestyle="none" if exact else ("-" if "unbroken" not in name else "--"),
            label=name,
        )
        lines.append(line)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.invert_xaxis()
    ax.set_xlabel("largest error of the growth in one period")
    ax.set_ylabel("time per point (s)")
    ax.grid(True, which="major", linewidth=0.3, color="#c8c8c8")
    return lines


WORK_PRECISION = Kind(
    "work-precision",
    "time against error of the methods of a benchmark",
    draw_work_precision,
    lambda c: not c.axes and c.holds("bench"),
)
