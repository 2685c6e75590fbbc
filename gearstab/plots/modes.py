"""The modes of the base system: a picture of every mode of a planetary gear, a chart of the entries of any other."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import texts, units_of
from gearstab.plots.drawing import gear_bodies
from gearstab.plots.drawing.style import CASES, LINE, WIDTHS, new_panels, write_title
from gearstab.plots.drawing.text import bracketed, fitted, number_text, plain, unit_text
from gearstab.plots.kinds import Contents, Kind
from gearstab.plots.view import Request

Array = np.ndarray
Artists = dict[str, Any]

MOST = 12
"""More panels than this are too small to read on a page; without a selection the figure shows the first ones."""
ACROSS = 4
"""Pictures side by side on two columns of a journal."""


def read_modes(tree: xr.DataTree) -> xr.Dataset:
    """The group ``modes``. Raises PlotError if the result holds no mode shapes."""
    if "modes" not in tree.children or not {"mode_shape", "mesh_deflection"} <= set(tree["modes"].data_vars):
        raise PlotError(f"this result holds no mode shapes; it holds {listed(tree.children)}")
    return tree["modes"].to_dataset()


def chosen_modes(modes: xr.Dataset, request: Request) -> list[int]:
    """Positions of the modes to draw: those of ``mode=1,5-7`` and ``mode_type=planet``, else the first ones.

    Raises PlotError for other axes, for modes that do not exist, for ``--x`` and ``--y`` and for too many.
    """
    for name in request.select:
        if name not in ("mode", "mode_type"):
            raise PlotError(f"no axis {name!r} to select in a figure of modes; use mode or mode_type")
    if request.x or request.y or request.variable:
        raise PlotError("a figure of modes has no --x, --y or --variable; choose with --select mode=1-9")
    count, kept = modes.sizes["mode"], list(range(modes.sizes["mode"]))
    if "mode" in request.select:
        kept = [number - 1 for number in numbers(request.select["mode"], count)]
    if "mode_type" in request.select:
        kinds = [kind_of(modes, p) for p in range(count)]
        wanted = request.select["mode_type"]
        if wanted not in kinds:
            raise PlotError(f"no mode is of type {wanted!r}; their types: {listed(dict.fromkeys(kinds))}")
        kept = [p for p in kept if kinds[p] == wanted]
        if not kept:
            raise PlotError(f"none of the modes selected is of type {wanted!r}")
    if not request.select:
        return kept[:MOST]
    if len(kept) > MOST:
        raise PlotError(f"{len(kept)} modes are too many (at most {MOST}): choose with --select mode=1-{MOST}")
    return kept


def numbers(text: str, count: int) -> list[int]:
    """``1,5-7`` as 1, 5, 6, 7. Raises PlotError for anything else and for numbers outside 1 to ``count``."""
    found: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)(?:\s*-\s*(\d+))?\s*", part)
        if not match:
            raise PlotError(f"mode {text!r}: write numbers and ranges, for instance mode=1,5-7")
        found += range(int(match[1]), int(match[2] or match[1]) + 1)
    outside = [number for number in found if not 1 <= number <= count]
    if outside or not found:
        raise PlotError(f"no mode {listed(map(str, outside))}; the result has modes 1 to {count}")
    return list(dict.fromkeys(found))


def kind_of(modes: xr.Dataset, p: int) -> str:
    """The type of a mode; empty if the result does not say."""
    if "mode_type" not in modes.data_vars:
        return ""
    return texts(modes["mode_type"].values)[p]


def heading(modes: xr.Dataset, p: int) -> str:
    """Natural frequency, type and, where meshes deflect as cos T psi_n, that T."""
    data = modes["natural_frequency"]
    unit, value = unit_text(units_of(data)), float(data.values[p])
    size = number_text(float(f"{value:.4g}")) if np.isfinite(value) else "imaginary"
    text = rf"$\omega_{{{p + 1}}}$ = {size}" + (f" {unit}" if unit and np.isfinite(value) else "")
    kind = plain(kind_of(modes, p))
    if "mesh_deflection_type" in modes.data_vars and int(modes["mesh_deflection_type"].values[p]) >= 0:
        kind += f", $T$ = {int(modes['mesh_deflection_type'].values[p])}"
    return f"{text}\n{kind}" if kind else text


def arrangement(count: int, columns: int) -> tuple[int, int]:
    """(rows, columns) of ``count`` panels with at most ``columns`` side by side, the last row as full as possible."""
    rows = ceil(count / columns)
    return rows, ceil(count / rows)


def label_of(name: str) -> str:
    r"""A coordinate beside its entry: ``x1`` to $x_1$, anything else by name."""
    match = re.fullmatch(r"([A-Za-z])(\d+)", name)
    return f"${match[1]}_{{{match[2]}}}$" if match else plain(name.replace("_", " "))


def stems(ax: Axes, where: Array, values: Array, colour: str, marker: str) -> Line2D:
    """Entries as stems from zero, which lies in the middle."""
    largest = np.abs(values).max(initial=0.0)
    ax.vlines(where, 0.0, values, color=colour, linewidth=1.1)
    (line,) = ax.plot(where, values, marker, color=colour, markersize=3.2)
    ax.set_ylim(-1.15 * (largest or 1.0), 1.15 * (largest or 1.0))
    if largest == 0:
        ax.set_yticks([0.0])
        ax.minorticks_off()
    return line


def draw_chart(ax: Axes, modes: xr.Dataset, p: int) -> tuple[Line2D, Line2D]:
    """Entries of the mode shape on the left scale and, beyond a line, mesh deflections on the right one."""
    shape, deflection = modes["mode_shape"].values[p], gear_bodies.mesh_deflection(modes)[p]
    other = ax.twinx()
    for side, right in ((ax, False), (other, True)):
        side.tick_params(axis="y", which="both", left=not right, right=right)
        side.tick_params(axis="x", which="both", top=False)
        side.tick_params(axis="x", which="minor", bottom=False)
    other.tick_params(axis="y", which="both", colors=CASES[1])
    ax.axhline(0.0, color=LINE, linewidth=0.4, zorder=0.5)
    ax.axvline(shape.size, color="#8a8a8a", linewidth=0.4, linestyle=(0, (3, 2)), zorder=0.5)
    places = np.concatenate([np.arange(shape.size), shape.size + 1 + np.arange(deflection.size)])
    lines = (
        stems(ax, places[: shape.size], shape, CASES[0], "o"),
        stems(other, places[shape.size :], deflection, CASES[1], "s"),
    )
    ax.set_xticks(places, [label_of(str(name)) for name in (*modes["dof"].values, *modes["mesh"].values)])
    ax.set_xlim(-0.7, places[-1] + 0.7)
    return lines


def draw_charts(tree: xr.DataTree, modes: xr.Dataset, kept: list[int], request: Request) -> tuple[Figure, Artists]:
    """One chart per mode, one over the other; the lowest has the names."""
    names = [*modes["dof"].values, *modes["mesh"].values]
    size = request.size or ("single" if len(names) <= 24 else "double")
    wide, room = WIDTHS.get(size, 1.0), max(len(str(name)) for name in names)
    upright = 0.05 * room * len(names) > 0.8 * wide
    below = (0.05 * room if upright else 0.15) + 0.75
    figure, axes = new_panels(request, (1.0 * len(kept) + below) / wide, len(kept), default=size, sharex=True)
    drawn = []
    for ax, p in zip(axes, kept, strict=True):
        drawn.append(draw_chart(ax, modes, p))
        ax.set_title(heading(modes, p).replace("\n", ",  "), loc="left", pad=3)
        ax.label_outer()
    if upright:
        axes[-1].tick_params(axis="x", labelrotation=90, labelsize=6 if len(names) < 50 else 4)
    text = "entry of the normalised mode" + units_of_entries(modes["mode_shape"].attrs)
    figure.supylabel(fitted(text, 0.8 * len(kept), 8.5), fontsize=8.5, linespacing=0.95)
    handles = [
        Line2D([], [], color=CASES[0], marker="o", markersize=3.2, label="coordinate"),
        Line2D([], [], color=CASES[1], marker="s", markersize=3.2, label="mesh deflection (right scale)"),
    ]
    note = left_out(modes, kept, request).strip() or None
    figure.legend(handles=handles, loc="outside lower center", ncols=2, title=note, title_fontsize=7.5)
    write_title(figure, tree, request)
    return figure, {"shapes": [a for a, _ in drawn], "deflections": [b for _, b in drawn], "axes": list(axes)}


def units_of_entries(attributes: Mapping[str, Any]) -> str:
    """The unit in brackets; both where some coordinates are rotations and others displacements."""
    if "units_of_rad" in attributes:
        turned, moved = (unit_text(str(attributes[f"units_of_{unit}"])) for unit in ("rad", "m"))
        return f" (rotations: {turned}, displacements: {moved})"
    return bracketed(str(attributes.get("units", "1")))


def left_out(modes: xr.Dataset, kept: list[int], request: Request) -> str:
    """A sentence on the modes that are not shown because there are many; empty if there are none."""
    if request.select or len(kept) == modes.sizes["mode"]:
        return ""
    return f" Modes 1 to {len(kept)} of {modes.sizes['mode']}."


def draw_pictures(tree: xr.DataTree, modes: xr.Dataset, kept: list[int], request: Request) -> tuple[Figure, Artists]:
    """One picture per mode, all bodies displaced over where they rest."""
    size = request.size or ("double" if len(kept) > 2 else "single")
    rows, columns = arrangement(len(kept), ACROSS if size == "double" else 2)
    wide = WIDTHS.get(size, 1.0)  # new_figure says what is wrong with another size
    panel = wide / columns
    figure, grid = new_panels(request, (rows * (panel + 0.22) + 0.75) / wide, len(kept), columns, size)
    pictures = []
    for ax, p in zip(grid, kept, strict=True):
        pictures.append(gear_bodies.draw_mode(ax, modes, p))
        ax.set_title(heading(modes, p), pad=2, linespacing=1.15)
    handles = gear_bodies.legend(pictures[0])
    note = f"Displacements are exaggerated, in every mode to the same largest one.{left_out(modes, kept, request)}"
    figure.legend(
        handles=handles, loc="outside lower center", ncols=len(handles) if size == "double" else 3,
        title=fitted(note, wide, 7.5), title_fontsize=7.5, alignment="center", columnspacing=1.4, handlelength=1.8,
    )  # fmt: skip
    write_title(figure, tree, request)
    return figure, {"pictures": pictures, "axes": grid}


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure.

    Artists: ``pictures``, one per mode (see ``gear_bodies.draw_mode``), for a planetary gear; else ``shapes`` and
    ``deflections``, lines of one chart per mode. Raises PlotError without mode shapes or for what cannot be selected.
    """
    modes = read_modes(tree)
    kept = chosen_modes(modes, request)
    drawn = draw_pictures if gear_bodies.is_planetary(modes) else draw_charts
    return drawn(tree, modes, kept, request)


def _suits(contents: Contents) -> bool:
    """Suits modes alone, and a single point of a sweep, which gives nothing else to draw."""
    idle = contents.by_itself and not contents.free and not contents.request.select
    return contents.holds("modes") and (idle or not contents.axes)


KIND = Kind("modes", "modes: bodies of a planetary gear displaced, charts of other systems", draw, _suits)
