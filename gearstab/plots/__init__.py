"""Figures from a result alone, their kinds in one table. Nothing is computed again, nothing shown on a screen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots import design, modes
from gearstab.plots.axes import distinct, refuse_empty
from gearstab.plots.drawing.style import style
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.maps import boundaries, campbell, curve, stability_map, surface
from gearstab.plots.motions import orders, phase_plane, response, spectrum, speeds
from gearstab.plots.motions.speeds import DECIBEL
from gearstab.plots.view import Request, nearest_values
from gearstab.results.display import in_display_units

KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        stability_map.KIND, stability_map.SLICES, curve.KIND, modes.KIND, boundaries.KIND, surface.KIND,
        stability_map.REQUIRED_DAMPING, stability_map.PROBABILITY, curve.PASSAGE, speeds.KIND, speeds.BRANCHES,
        curve.WORK_PRECISION, response.KIND, campbell.KIND, orders.WATERFALL, orders.KIND, phase_plane.PAIR,
        spectrum.KIND, spectrum.TEETH, phase_plane.KIND, design.CONTOUR, design.TORNADO, design.BEFORE_AFTER,
        design.PARETO,
    )
}  # fmt: skip
"""By name; of several kinds that suit a result the last is its default."""


def default_kind(tree: xr.DataTree, request: Request) -> str:
    """Return the kind that suits what the result holds and what is selected; modes where none does."""
    contents = Contents(tree, request)
    found = [name for name, kind in KINDS.items() if kind.suits(contents)]
    return found[-1] if found else "modes" if contents.holds("modes") else "curve"


def draw(
    tree: xr.DataTree, kind: str | None = None, request: Request | None = None, **options: Any
) -> tuple[Figure, dict[str, Any]]:
    """Draw a result.

    tree: as ``xarray.open_datatree`` reads it from a result file. kind: one of ``KINDS``, default by what the result
    holds. request: or its fields as ``options``, ``draw(tree, y="phasing", select={"epsilon": "0.3"})``.

    Axes are in the units in which they were typed, or in those of ``request.unit``.

    Returns the figure and its artists by name (see the kinds); ``nearest`` says where a selection is between two values
    of an axis. Without a kind a figure of too much shows a part of it:
    ``left_out`` among the artists says so. Raises PlotError for what the result cannot give.
    """
    wanted = request or Request(**options)
    if kind is None:
        wanted = replace(wanted, partial=True)
    if DECIBEL in wanted.unit:
        wanted = replace(wanted, unit=[unit for unit in wanted.unit if unit != DECIBEL], decibels=True)
    refuse_empty(tree)
    tree = in_display_units(distinct(tree), wanted.unit)
    name = kind or default_kind(tree, wanted)
    if name not in KINDS:
        raise PlotError(f"no kind {name!r}; the kinds: {listed(KINDS)}")
    if wanted.decibels and not KINDS[name].decibels:
        shown = listed(other for other, item in KINDS.items() if item.decibels)
        raise PlotError(f"--unit {DECIBEL}: the kind {name} shows no amplitudes as levels; --kind: {shown}")
    with style(wanted.style):
        figure, artists = KINDS[name].draw(tree, wanted)
    if wanted.marks and "marks" not in artists:
        raise PlotError(f"the kind {name} marks no points: leave --mark out, or choose --kind map or boundaries")
    return figure, artists | {"nearest": nearest_values(tree, wanted.select)}


__all__ = ["KINDS", "Kind", "default_kind", "draw"]
