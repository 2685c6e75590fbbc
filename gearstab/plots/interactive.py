"""A map as one self-contained page to look around in: zoom, values under the pointer, a slider over a third axis."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import to_hex

from gearstab.errors import PlotError
from gearstab.plots.axes import FigureAxis, distinct
from gearstab.plots.drawing.grid import MOST_CELLS, coarse
from gearstab.plots.drawing.style import FAILED, GROWTH, LINE, style
from gearstab.plots.drawing.tongues import SLIVER, exact_parts, parameter_axis, read_tongues
from gearstab.plots.kinds import GROWTH_RATE, colour_label, find_variable
from gearstab.plots.maps import stability_map
from gearstab.plots.view import MapView, Request, view_of
from gearstab.results.display import in_display_units
from gearstab.results.output import Content, write_bytes

Array = np.ndarray

LETTERS = {"Omega": "Ω", "varepsilon": "ε", "alpha": "α", "gamma": "γ", "zeta": "ζ", "max": "max"}  # noqa: RUF001
"""Letters of symbols; other commands of mathematics are left out."""
CHANGE = """
cells.data = {...cells.data, image: [images[slider.value]]};
regions.data = outlines[slider.value];
lines.data = edges[slider.value];
"""
GROWS = 'return value > 0 ? value.toPrecision(4) : value < 0 ? `stable, ${value.toPrecision(4)}` : "stable";'
INSIDE = """
// A point is inside a region if a ray from it crosses the outline an odd number of times.
const {x, y} = special_vars, {xs, ys, name} = regions.data;
const inside = (u, v) => u.reduce((odd, _, i) => {
  const j = i ? i - 1 : u.length - 1;
  return odd ^ ((v[i] > y) !== (v[j] > y) && x < u[i] + (y - v[i]) / (v[j] - v[i]) * (u[j] - u[i]));
}, 0);
const found = new Set(name.filter((_, k) => inside([...xs[k]], [...ys[k]])));
return found.size ? [...found].join(", ") : "none";
"""
"""Texts beside the pointer: the growth rate of a cell, and the regions there."""
TEMPLATE = """
{% block contents %}<noscript><img alt="Stability map" src="data:image/png;base64,{{ picture }}"></noscript>
{{ super() }}{% endblock %}
"""
"""Bokeh's page with a picture over its plots, which only readers without scripts see."""


def not_a_page(path: Path) -> str:
    """Return what a file is instead of a page, "" for one."""
    with open(path, "rb") as file:
        return "" if b"<html" in file.read(4096).lower() else "is no page"


PAGE = Content("a page", ".html", not_a_page, (), streams=True)


def reduced(values: Array, failed: Array) -> Array:
    """Return growth rates ``(rows, columns)``, masked where stable, as at most ``MOST_CELLS`` along each axis.

    Those of stable points are at most 0, those of ``failed`` ones NaN. Several cells together show the worst among
    them: the largest growth, then a failure, so that no unstable point is lost.
    """
    stable = np.ma.getmaskarray(values)
    worst = np.where(failed, -np.inf, np.where(stable, np.minimum(np.ma.getdata(values), 0.0), values))
    for axis, size in enumerate(worst.shape):
        if size > MOST_CELLS:
            starts = np.linspace(0, size, MOST_CELLS, endpoint=False).astype(int)
            worst = np.maximum.reduceat(worst, starts, axis=axis)
            failed = np.logical_or.reduceat(failed, starts, axis=axis)
    return np.where(failed & (worst <= 0), np.nan, worst).astype(np.float32)


def regions_of(tree: xr.DataTree, view: MapView) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """Return the exact regions of a slice, as ``xs`` and ``ys``: closed outlines with their names, each open range one,
    and the lines that a printed figure shows, with their colours.
    """
    axis = parameter_axis(view)
    found = read_tongues(tree, "boundaries", view, axis[0]) if axis else None
    outlines: dict[str, list[Any]] = {"xs": [], "ys": [], "name": []}
    lines: dict[str, list[Any]] = {"xs": [], "ys": [], "colour": []}
    if axis is None or found is None:
        return outlines, lines
    along_x, along_y = ("xs", "ys") if axis[1] else ("ys", "xs")
    for edges, label in zip(found.edges, found.labels, strict=True):
        where = np.flatnonzero(np.isfinite(edges).all(axis=0))
        for run in np.split(where, np.flatnonzero(np.diff(where) > 1) + 1):
            if run.size > 1:
                place = found.positions[run]
                outlines[along_x].append([*edges[0, run], *edges[1, run[::-1]]])
                outlines[along_y].append([*place, *place[::-1]])
                outlines["name"].append(label)
    speeds = (view.x if axis[1] else view.y).ascending
    for parts, colour in zip(exact_parts(found, speeds[-1] - speeds[0]), (LINE, to_hex(SLIVER)), strict=True):
        for part in parts:
            lines[along_x].append(part[:, 0].tolist())
            lines[along_y].append(part[:, 1].tolist())
            lines["colour"].append(colour)
    return outlines, lines


def unformatted(label: str) -> str:
    """Return the label of a figure as a page shows it, ``mesh frequency Ω (rad/s)``."""
    found = re.sub(r"\\([A-Za-z]+)", lambda sign: LETTERS.get(sign[1], ""), label)
    return re.sub(r"[${}\\]", "", found)


def slices(tree: xr.DataTree, request: Request) -> tuple[FigureAxis | None, list[MapView]]:
    """Return the axis of the slider and a view for each of its values. Raises PlotError for what a page cannot show."""
    dataset, data = find_variable(tree, GROWTH_RATE)
    view = view_of(tree, map(str, data.dims), request, dataset)
    if len(view.free) > 1:
        raise PlotError(f"the page has one slider: --select all but one of {', '.join(a.name for a in view.free)}")
    if not (view.x.uniform and view.y.uniform and view.x.numeric and view.y.numeric):
        raise PlotError("a page needs evenly spaced numbers along both axes: draw a .png, or choose others by --x, --y")
    if not view.free:
        return None, [view]
    axis = view.free[0]
    return axis, [view.at(**{axis.name: index}) for index in range(axis.size)]


def picture(tree: xr.DataTree, request: Request, axis: FigureAxis | None) -> str:
    """Return the first slice as a PNG file in base 64."""
    first = {} if axis is None else {axis.name: axis.text(0)}
    with style(request.style):
        figure, _ = stability_map.draw(tree, replace(request, select={**request.select, **first}, size="double"))
        data = io.BytesIO()
        figure.savefig(data, format="png", dpi=150, metadata={"Software": "gearstab"})
    return base64.b64encode(data.getvalue()).decode()


def page(tree: xr.DataTree, request: Request, title: str) -> str:
    """Return the page of a map of growth rates. Raises PlotError without Bokeh, or for what a page cannot show."""
    try:
        from bokeh.embed import file_html
        from bokeh.layouts import column
        from bokeh.models import (
            ColorBar,
            ColumnDataSource,
            CustomJS,
            CustomJSHover,
            CustomJSTickFormatter,
            HoverTool,
            LinearColorMapper,
            Slider,
        )
        from bokeh.plotting import figure
        from bokeh.resources import INLINE
    except ImportError:
        raise PlotError("pages need the package bokeh: pip install 'gearstab[html]'") from None
    tree = in_display_units(distinct(tree), request.unit)
    axis, views = slices(tree, request)
    shown = [coarse(tree, view, GROWTH_RATE) for view in views]
    images = [reduced(*stability_map.read_cells(*item, GROWTH_RATE)) for item in shown]
    outlines, edges = zip(*(regions_of(tree, view) for view in views), strict=True)
    x, y = views[0].x, views[0].y
    left, right, bottom, top = (float(edge) for edge in (*x.edges()[[0, -1]], *y.edges()[[0, -1]]))
    largest = max(float(np.nanmax(image, initial=0.0)) for image in images) or 1.0
    colours = LinearColorMapper(
        palette=[to_hex(GROWTH(n)) for n in range(256)], low=1e-9 * largest, high=largest, low_color="#ffffff00",
        nan_color=FAILED,
    )  # fmt: skip
    names = [unformatted(a.label) for a in (x, y)]
    growth = unformatted(colour_label(tree, GROWTH_RATE))
    plot = figure(
        title=",  ".join([title, *views[0].chosen]) if request.title else None, x_axis_label=names[0],
        y_axis_label=names[1], height=560, x_range=(left, right), y_range=(bottom, top), sizing_mode="stretch_width",
        tools="pan,wheel_zoom,box_zoom,reset,save", active_scroll="wheel_zoom",
    )  # fmt: skip
    cells, regions = ColumnDataSource({"image": [images[0]], "region": [""]}), ColumnDataSource(outlines[0])
    lines = ColumnDataSource(edges[0])
    map_ = plot.image("image", source=cells, x=left, y=bottom, dw=right - left, dh=top - bottom, color_mapper=colours)
    plot.multi_line("xs", "ys", source=lines, line_color="colour", line_width=1)
    rows = [(names[0], "$x{0.0000}"), (names[1], "$y{0.0000}"), (growth, "@image{custom}")]
    formatters = {"@image": CustomJSHover(code=GROWS)}
    if any(found["name"] for found in outlines):
        rows.append(("region", "@region{custom}"))
        formatters["@region"] = CustomJSHover(args={"regions": regions}, code=INSIDE)
    plot.add_tools(HoverTool(renderers=[map_], tooltips=rows, formatters=formatters))
    plot.add_layout(ColorBar(color_mapper=colours, title=growth), "right")
    parts: list[Any] = [plot]
    if axis is not None:
        unit = "" if axis.units == "1" else f" {axis.units}"
        texts = [f"{axis.text(index)}{unit}" for index in range(axis.size)]
        said = CustomJSTickFormatter(args={"texts": texts}, code="return texts[tick];")
        name = unformatted(replace(axis, units="1").label)
        slider = Slider(start=0, end=axis.size - 1, value=0, step=1, title=name, format=said)
        known = {"cells": cells, "regions": regions, "images": images, "outlines": outlines, "lines": lines}
        slider.js_on_change("value", CustomJS(args=known | {"edges": edges, "slider": slider}, code=CHANGE))
        parts.insert(0, slider)
    layout = column(*parts, sizing_mode="stretch_width", margin=(10, 30, 10, 30))
    first = {"picture": picture(tree, request, axis)}
    return file_html(layout, INLINE, title or "gearstab", template=TEMPLATE, template_variables=first)


def save_page(tree: xr.DataTree, request: Request, path: Path, title: str) -> None:
    """Write the page, whole or not at all. Raises as :func:`page`, and OutputError where ``path`` is something else."""
    write_bytes(path, memoryview(page(tree, request, title).encode()), PAGE.refuse)
