"""Which figure suits a result: one that can be drawn of whatever a sweep or a response left."""

from __future__ import annotations

from math import prod

import xarray as xr

from gearstab.plots.axes import SPEEDS, Axis, Request, find_axis, sweep_axes
from gearstab.plots.drawing.style import CASES
from gearstab.plots.maps.stability_map import find_variable

LONG = 6
"""A surface wants more values than this on both of its axes."""
INNER = ("tongue", "side", "stretch", "exponent", "mesh")
"""Dimensions of what was computed at a point, or of boundaries; they are no axes of the sweep."""


def default_kind(tree: xr.DataTree, request: Request) -> str:
    """The kind that suits what the result holds and what is selected.

    Time histories: response, of a gear pair: pair; benchmarks: work-precision; neither, and no axes: modes. A variable:
    by its own axes. Required damping without growth rates: that. Uncoupled modes or a third axis of labels: boundaries,
    which compare. Growth rates over one axis: curve, over two: map, over more: slices. Steady states over speed:
    speeds, as long as there are few curves. Boundaries alone: surface over two long axes, else boundaries. Modes where
    a single point, or boundaries without a parameter, give nothing else to draw.
    """
    axes = sweep_axes(tree)
    if not axes and "response" in tree.children:
        chosen = request.variable is not None or request.select
        return "pair" if "phi" in tree["response"].data_vars and not chosen else "response"
    if not axes and "bench" in tree.children:
        return "work-precision"
    if not axes and "modes" in tree.children:
        return "modes"
    fixed = {find_axis(axes, name).name for name in request.select}
    if request.variable is not None:
        dims = [axes[str(dim)] for dim in find_variable(tree, request.variable)[1].dims]
        return by_number([axis for axis in dims if axis.name not in fixed])
    free = [axis for axis in axes.values() if axis.size > 1 and axis.name not in {*fixed, *INNER}]
    found = of_a_sweep(tree, free, axes["mesh"] if "mesh" in axes and "mesh" not in fixed else None)
    idle = found == "" or (not free and not request.select)
    return "modes" if idle and "modes" in tree.children else found or "curve"


def of_a_sweep(tree: xr.DataTree, free: list[Axis], mesh: Axis | None) -> str:
    """The kind for the axes left free; empty where there is none."""
    held = set(tree.children)
    names = {axis.name for axis in free}
    growth = "floquet" in held and "growth_rate" in tree["floquet"].data_vars
    over_speed = any(axis.name in SPEEDS for axis in free)
    parameters = [axis for axis in free if axis.name not in SPEEDS]
    numeric = [axis for axis in parameters if axis.numeric]
    if "response" in held and any(name in SPEEDS for name in names.intersection(map(str, tree["response"].sizes))):
        curves = prod(axis.size for axis in parameters) * (mesh.size if mesh is not None else 1)
        if not parameters or (not growth and curves <= len(CASES)):
            return "speeds"
    if "response" in held and not growth:
        own = names.intersection(map(str, tree["response"].sizes))
        return by_number([*(axis for axis in free if axis.name in own), *([mesh] if mesh is not None else [])])
    if not growth and "required_damping" in held:
        own = names.intersection(map(str, tree["required_damping"].sizes))
        return "required-damping" if len(own) == 2 else by_number([axis for axis in free if axis.name in own])
    if not growth:
        surface = len(numeric) == len(parameters) == 2 and min(axis.size for axis in numeric) > LONG
        return "surface" if surface else "boundaries" if numeric and over_speed else ""
    lines = held & {"perturbation", "boundaries", "uncoupled"}
    compares = lines and len(numeric) == 1 and ("uncoupled" in held or len(parameters) == 2)
    own = names.intersection(map(str, tree["floquet"]["growth_rate"].dims))
    return "boundaries" if compares and over_speed else by_number([axis for axis in free if axis.name in own])


def by_number(free: list[Axis]) -> str:
    """The kind for a variable over so many axes with several values."""
    return {0: "curve", 1: "curve", 2: "map"}.get(sum(axis.size > 1 for axis in free), "slices")
