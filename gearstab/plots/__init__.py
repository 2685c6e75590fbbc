"""Figures from a result alone: one kind a file, one table. Nothing is computed again, no figure is shown on a screen.

A kind is a module with ``draw(tree, request) -> (figure, artists)``; it is imported when it is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from gearstab.plots.axes import Request


@dataclass(frozen=True)
class Kind:
    """One kind of figure: the module that draws it and what it shows."""

    module: str
    summary: str


KINDS: dict[str, Kind] = {
    "map": Kind(
        "gearstab.plots.maps.stability_map", "growth rate over two axes with boundaries and names of the tongues"
    ),
    "boundaries": Kind("gearstab.plots.maps.boundaries", "boundaries of several theories or cases over one parameter"),
    "required-damping": Kind(
        "gearstab.plots.maps.required_damping", "damping that suppresses instability, over two axes"
    ),
    "slices": Kind("gearstab.plots.maps.slices", "maps over a third axis, one panel a value"),
    "curve": Kind("gearstab.plots.maps.curve", "growth rate over one axis"),
    "surface": Kind("gearstab.plots.maps.surface", "boundaries of one tongue over two amplitudes"),
    "modes": Kind("gearstab.plots.modes", "modes: bodies of a planetary gear displaced, charts of other systems"),
    "speeds": Kind(
        "gearstab.plots.motions.speeds", "load factor or mesh force of the steady state over the mesh frequency"
    ),
    "spectrum": Kind("gearstab.plots.motions.spectrum", "spectra of a response"),
    "pair": Kind("gearstab.plots.motions.pair", "deflection, energy and spectrum of a gear pair given by its gears"),
    "teeth": Kind(
        "gearstab.plots.motions.teeth", "load or root stress of teeth along their contact, static and dynamic"
    ),
    "response": Kind("gearstab.plots.motions.response", "displacements and mesh forces over time"),
    "phase-plane": Kind(
        "gearstab.plots.motions.phase_plane", "mesh deflections with backlash, over time and as orbits"
    ),
    "work-precision": Kind("gearstab.plots.work_precision", "time against error of the methods of a benchmark"),
}


def default_kind(tree: xr.DataTree, request: Request) -> str:
    """The kind that suits what the result holds and what is selected, see :mod:`gearstab.plots.choice`."""
    from gearstab.plots import choice

    return choice.default_kind(tree, request)


def draw(
    tree: xr.DataTree, kind: str | None = None, request: Request | None = None, **options: Any
) -> tuple[Figure, dict[str, Any]]:
    """Draw a result.

    tree: as ``xarray.open_datatree`` reads it from a result file. kind: one of ``KINDS``, default by what the result
    holds. request: or its fields as ``options``, ``draw(tree, y="phasing", select={"epsilon": "0.3"})``.

    Returns the figure and its artists by name (see the kinds). Without a kind a figure of too much shows a part of it:
    ``left_out`` among the artists says so. Raises PlotError for what the result cannot give.
    """
    from gearstab.plots.axes import Request, distinct
    from gearstab.plots.drawing.style import style
    from gearstab.plots.errors import PlotError, listed

    wanted = request or Request(**options)
    if kind is None:
        wanted = replace(wanted, partial=True)
    tree = distinct(tree)
    name = kind or default_kind(tree, wanted)
    if name not in KINDS:
        raise PlotError(f"no kind {name!r}; the kinds: {listed(KINDS)}")
    with style():
        return import_module(KINDS[name].module).draw(tree, wanted)


__all__ = ["KINDS", "Kind", "default_kind", "draw"]
