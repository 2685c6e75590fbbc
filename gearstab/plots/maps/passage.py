"""E-folds of a run-up or coast-down over its rate: exactly, and by the growth rates along the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearstab.errors import PlotError
from gearstab.plots.drawing.style import CASES, new_figure, write_legend, write_title
from gearstab.plots.drawing.text import number_text, unit_text
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.view import Request, caption, some, view_along
from gearstab.results.display import SHOWN_SCALE, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

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


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
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


def _suits(contents: Contents) -> bool:
    other = contents.growth or contents.holds("response") or contents.holds("tolerance")
    return contents.by_itself and contents.holds(GROUP) and not other


KIND = Kind("passage", "e-folds of a run-up or coast-down over its rate, exactly and by growth rates", draw, _suits)
