"""Spectra of a response, a panel for each mesh, and loads or root stresses of teeth along their contact.

The latter as in Kuria & Kihiu 2008, Figs. 6 to 8.
"""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearstab.errors import PlotError, listed
from gearstab.plots.axes import group_of, units_of
from gearstab.plots.drawing.style import CASES, label_columns, new_panels, write_legend, write_title
from gearstab.plots.drawing.text import bracketed, plain
from gearstab.plots.kinds import Kind
from gearstab.plots.motions.response import (
    MOST_PANELS,
    columns,
    draw_long_line,
    fit_labels,
    read_response,
    refuse_selections,
)
from gearstab.plots.view import Request
from gearstab.results.display import ORDER, SHOWN_SCALE, SPEEDS

Array = np.ndarray
Artists = dict[str, Any]

FIRST = ("mesh_force_amplitude", "mesh_force_density", "power_spectral_density")
"""Variables drawn without --variable."""
FLOOR = 1e-7
"""A density below this part of the largest one, an amplitude below its square root, is not shown."""
SHOWN = 1e-4
"""The frequency axis ends where nothing above this part of the largest density follows."""

NUMBERED = 6
"""Sidebands that are numbered; others stand beside these."""
APART = 0.07
"""Part of the axis that lies between two numbers."""


def read_spectra(tree: xr.DataTree, wanted: str | None) -> xr.DataArray:
    """The variable over the frequency. Raises PlotError if the result holds none, or not that one."""
    dataset = group_of(tree, "response")
    known = [
        str(name) for name, data in dataset.data_vars.items()
        if "frequency" in data.dims and not set(SPEEDS) & set(map(str, data.dims))
    ]  # fmt: skip
    if not known or dataset.sizes["frequency"] < 2:
        raise PlotError("this result holds no spectra of a response")
    if wanted is not None and wanted not in known:
        raise PlotError(f"no variable {wanted!r} over the frequency in this response; there is {listed(known)}")
    return dataset[wanted or next((name for name in FIRST if name in known), known[0])]


def horizontal(data: xr.DataArray) -> tuple[Array, str]:
    """Frequencies and the label of their axis: over w_d where the response knows it and no unit was asked for."""
    frequency = data.coords["frequency"]
    if "normalised_frequency" in data.coords and SHOWN_SCALE not in frequency.attrs:
        return data.coords["normalised_frequency"].values, r"frequency over $\omega_d$"
    if units_of(frequency) == ORDER:
        return frequency.values, "order of the input shaft"
    return frequency.values, r"frequency $\omega$" + bracketed(units_of(frequency))


def draw_spectrum(ax: Axes, x: Array, values: Array, harmonics: bool) -> Any:
    """A line, or a stem for each harmonic but the mean, over a logarithmic axis."""
    floor = largest(values[x > 0]) * (FLOOR**0.5 if harmonics else FLOOR)
    ax.set_yscale("log")
    ax.set_ylim(floor, 3 * largest(values[x > 0]))
    if not harmonics:
        return draw_long_line(ax, x, np.maximum(values, 0.1 * floor), CASES[0])
    shown = (values > floor) & (x > 0)
    ax.vlines(x[shown], floor, values[shown], color=CASES[0], linewidth=0.7)
    return ax.plot(x[shown], values[shown], color=CASES[0], linestyle="", marker="o", markersize=2.2)[0]


def largest(values: Array) -> float:
    """The greatest value, 1 where there is none above zero."""
    positive = values[np.isfinite(values) & (values > 0)]
    return float(positive.max()) if positive.size else 1.0


def reach(x: Array, columns: list[Array], harmonics: bool) -> float:
    """Where the frequency axis ends."""
    part = SHOWN**0.5 if harmonics else SHOWN
    last = max(int(np.flatnonzero(values >= part * largest(values)).max(initial=1)) for values in columns)
    return float(x[min(last + max(1, last // 20), len(x) - 1)])


def mark_modes(tree: xr.DataTree, axes: list[Axes], end: float, unit: float) -> list[Any]:
    """Dotted lines at the natural frequencies of the mean system, named over the first panel.

    unit: how many of their unit one of the frequency axis is.
    """
    if "modes" not in tree.children or "natural_frequency" not in tree["modes"].data_vars:
        return []
    found, last = [], -np.inf
    frequencies = tree["modes"].to_dataset()["natural_frequency"].values / unit
    for number, frequency in enumerate(frequencies, start=1):
        if not 0 < frequency < end:
            continue
        for ax in axes:
            found.append(ax.axvline(frequency, color="#8a8a8a", linewidth=0.5, linestyle=(0, (1, 2)), zorder=0.5))
        if frequency - last > 0.05 * end:
            axes[0].annotate(
                rf"$\omega_{{{number}}}$", (frequency, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2),
                textcoords="offset points", ha="center", fontsize=7,
            )  # fmt: skip
            last = frequency
    return found


def sidebands(tree: xr.DataTree, panel: xr.DataArray, x: Array, ax: Axes, unit: float) -> list[Any]:
    """Number the largest lines that are no harmonics of the mesh by their order of the shaft with the weak tooth."""
    known = tree["response"].attrs
    mesh, meshes = str(panel.coords["mesh"].values), str(known.get("weak_meshes", "")).split("\n")
    if mesh not in meshes:
        return []
    of = meshes.index(mesh)
    shaft = float(np.ravel(known["weak_ratios"])[of]) * float(known["mesh_frequency"]) / unit
    order, teeth = np.rint(x / shaft).astype(int), int(np.ravel(known["weak_counts"])[of])
    end = ax.get_xlim()[1]
    height = np.asarray(panel.values, dtype=float)
    side = (np.abs(x - order * shaft) < 1e-6 * shaft) & (order % teeth != 0)
    chosen: list[int] = []
    for k in np.argsort(-np.where(side, height, 0.0), kind="stable"):
        if len(chosen) == NUMBERED or not side[k] or not height[k] > ax.get_ylim()[0]:
            break
        if x[k] < end and all(abs(x[k] - x[other]) > APART * end for other in chosen):
            chosen.append(int(k))
    ax.text(
        0.99, 0.96, f"numbers: orders of the shaft of {plain(str(known['weak_teeth']).split(chr(10))[of])}",
        transform=ax.transAxes, ha="right", va="top", fontsize=6,
    )  # fmt: skip
    return [
        ax.annotate(str(order[k]), (x[k], height[k]), xytext=(0, 2), textcoords="offset points", ha="center",
                    fontsize=6)
        for k in chosen
    ]  # fmt: skip


def draw(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """The whole figure, panels over one another: ``lines``, ``modes``, and ``sidebands``: the numbers of orders."""
    data = read_spectra(tree, request.variable)
    refuse_selections(request, [data], "frequency")
    panels = columns(data, request, along="frequency")
    if len(panels) > MOST_PANELS:
        raise PlotError(f"{len(panels)} spectra are too many (at most {MOST_PANELS}): choose with --select mesh=NAME")
    x, label = horizontal(data)
    harmonics = str(data.name).endswith("amplitude")
    values = [np.asarray(panel.values, dtype=float) for _, panel in panels]
    end = reach(x, values, harmonics)
    height = {1: 0.62}.get(len(panels), 0.4 * len(panels) + 0.15)
    figure, axes = new_panels(request, (height, 0.55 * height), len(panels), sharex=True)
    lines = []
    for ax, (name, _), part in zip(axes, panels, values, strict=True):
        lines.append(draw_spectrum(ax, x, part, harmonics))
        ax.set_ylabel(name, linespacing=0.95)
    axes[0].set_xlim(0.0, 1.015 * end if harmonics else end)
    unit = float(data.coords["frequency"].attrs.get(SHOWN_SCALE, 1.0))
    numbers = [
        text
        for ax, (_, panel) in zip(axes, panels, strict=True)
        if harmonics and "mesh" in panel.coords
        for text in sidebands(tree, panel, x, ax, unit)
    ]
    modes = mark_modes(tree, axes, end, unit) if "normalised_frequency" not in data.coords else []
    axes[-1].set_xlabel(label)
    figure.align_ylabels(axes)
    write_title(figure, tree, request)
    fit_labels(axes)
    return figure, {"lines": lines, "modes": modes, "sidebands": numbers}


KIND = Kind("spectrum", "spectra of a response", draw)


DYNAMIC = ("tooth_load", "root_stress")
"""Variables that can be drawn; the static one has ``static_`` before its name."""


MOST_IN_A_COLUMN = 5
"""Panels that stand over one another in one column of a journal."""


def draw_teeth(tree: xr.DataTree, request: Request) -> tuple[Figure, Artists]:
    """One panel per mesh (or a gear, of ``--variable root_stress``); its artists are ``lines`` and ``static``."""
    dataset = read_response(tree)
    name = request.variable or DYNAMIC[0]
    if name not in DYNAMIC:
        raise PlotError(f"no variable {name!r} along the contact of teeth; there is {listed(DYNAMIC)}")
    if name not in dataset:
        raise PlotError("this response holds no loads of teeth: they come with steady states of kind gearbox")
    refuse_selections(request, [dataset[name]], "contact")
    both = [columns(dataset[which], request, "contact") for which in (name, f"static_{name}")]
    panels = [(label, data, rest) for (label, data), (_, rest) in zip(*both, strict=True) if not data.isnull().all()]
    if not panels:
        raise PlotError(f"{name} has no values: there is nothing to draw")
    if len(panels) > MOST_PANELS:
        raise PlotError(f"{len(panels)} panels are too many (at most {MOST_PANELS}): choose with --select")
    stress = name == "root_stress"
    wide = request.wide("double")
    across = 2 if len(panels) > 1 and (wide or len(panels) > MOST_IN_A_COLUMN) else 1
    aspect = (0.28 if wide else 0.42) * ceil(len(panels) / across) + 0.12
    figure, axes = new_panels(request, aspect, len(panels), across, "double", sharex=True)
    lines, still = [], []
    for ax, (label, data, rest) in zip(axes, panels, strict=True):
        scale = 1e-6 if stress else 1.0
        where = dataset["contact"].values
        still += ax.plot(where, scale * rest.values, color="#8a8a8a", linewidth=0.9, label="static")
        lines += ax.plot(where, scale * data.values, color=CASES[0], linewidth=0.9, label="dynamic, largest")
        words = label.split(", ", 1)[1].rsplit(" (", 1)[0]
        ax.set_title(plain(words if stress else f"mesh {words}"), fontsize="small")
        ax.set_ylabel("root stress (MPa)" if stress else "load (N)")
        ax.set_ylim(bottom=0)
        ax.set_xlim(0, 1)
    label_columns(figure, axes, across, "contact, from first to last point")
    write_legend(figure, [still[0], lines[0]])
    write_title(figure, tree, request)
    return figure, {"lines": lines, "static": still}


TEETH = Kind("teeth", "load or root stress of teeth along their contact, static and dynamic", draw_teeth)
