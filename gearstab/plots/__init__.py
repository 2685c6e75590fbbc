"""Figures from a result alone: one kind a file, one table. Nothing is computed again, no figure is shown on a screen.

A kind is a module with ``draw(tree, request) -> (figure, artists)``; it is imported when it is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
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
    "map": Kind("gearstab.plots.stability_map", "growth rate over two axes with boundaries and names of the tongues"),
    "boundaries": Kind("gearstab.plots.boundaries", "boundaries of several theories or cases over one parameter"),
    "required-damping": Kind("gearstab.plots.required_damping", "damping that suppresses instability, over two axes"),
    "slices": Kind("gearstab.plots.slices", "maps over a third axis, one panel a value"),
    "curve": Kind("gearstab.plots.curve", "growth rate over one axis"),
    "surface": Kind("gearstab.plots.surface", "boundaries of one tongue over two amplitudes"),
    "modes": Kind("gearstab.plots.modes", "modes: bodies of a planetary gear displaced, charts of other systems"),
    "speeds": Kind("gearstab.plots.speeds", "load factor or mesh force of the steady state over the mesh frequency"),
    "spectrum": Kind("gearstab.plots.spectrum", "spectra of a response"),
    "pair": Kind("gearstab.plots.pair", "deflection, energy and spectrum of a gear pair given by its gears"),
    "teeth": Kind("gearstab.plots.teeth", "load or root stress of teeth along their contact, static and dynamic"),
    "response": Kind("gearstab.plots.response", "displacements and mesh forces over time"),
    "phase-plane": Kind("gearstab.plots.phase_plane", "mesh deflections with backlash, over time and as orbits"),
    "work-precision": Kind("gearstab.plots.work_precision", "time against error of the methods of a benchmark"),
}


def default_kind(tree: xr.DataTree, request: Request) -> str:
    """The kind that suits what the result holds and what is selected.

    Time histories: response, of a gear pair: pair; benchmarks: work-precision; neither, and no axes: modes. Required
    damping without growth rates: that. Uncoupled modes or a third axis of labels: boundaries, which compare. Growth
    rates over one axis: curve, over two: map, over more: slices. Boundaries alone: surface over two long axes, else
    boundaries.
    """
    from gearstab.plots.axes import SPEEDS, find_axis, sweep_axes

    axes = sweep_axes(tree)
    if not axes and "response" in tree.children:
        chosen = request.variable is not None or request.select
        return "pair" if "phi" in tree["response"].data_vars and not chosen else "response"
    if not axes and "bench" in tree.children:
        return "work-precision"
    if not axes and "modes" in tree.children:
        return "modes"
    held = set(tree.children)
    growth = "floquet" in held and "growth_rate" in tree["floquet"].data_vars
    lines = bool(held & {"perturbation", "boundaries", "uncoupled"})
    fixed = {find_axis(axes, name).name for name in request.select}
    free = [a for a in axes.values() if a.size > 1 and a.name not in {*fixed, "tongue", "side", "exponent", "mesh"}]
    parameters = [axis for axis in free if axis.name not in SPEEDS]
    if "response" in held and request.variable is None and not parameters and not fixed.intersection(SPEEDS):
        return "speeds"
    numeric = [axis for axis in parameters if axis.numeric]
    if "required_damping" in held and not growth and request.variable is None:
        return "required-damping"
    if request.variable is not None or (growth and not lines):
        return {0: "curve", 1: "curve", 2: "map"}.get(len(free), "slices")
    if "response" in held and not growth:
        return "map"
    if not growth:
        return "surface" if len(numeric) == len(parameters) == 2 and min(a.size for a in numeric) > 6 else "boundaries"
    compares = len(numeric) == 1 and ("uncoupled" in held or len(parameters) == 2)
    if compares and not fixed.intersection(SPEEDS):
        return "boundaries"
    return {0: "curve", 1: "curve", 2: "map"}.get(len(free), "slices")


def draw(
    tree: xr.DataTree, kind: str | None = None, request: Request | None = None, **options: Any
) -> tuple[Figure, dict[str, Any]]:
    """Draw a result.

    tree: as ``xarray.open_datatree`` reads it from a result file. kind: one of ``KINDS``, default by what the result
    holds. request: or its fields as ``options``, ``draw(tree, y="phasing", select={"epsilon": "0.3"})``.

    Returns the figure and its artists by name (see the kinds). Raises PlotError for what the result cannot give.
    """
    from gearstab.plots.axes import Request
    from gearstab.plots.errors import PlotError, listed
    from gearstab.plots.style import style

    wanted = request or Request(**options)
    name = kind or default_kind(tree, wanted)
    if name not in KINDS:
        raise PlotError(f"no kind {name!r}; the kinds: {listed(KINDS)}")
    with style():
        return import_module(KINDS[name].module).draw(tree, wanted)


__all__ = ["KINDS", "Kind", "default_kind", "draw"]
