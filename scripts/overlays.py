"""Figures that show several results in one frame, as papers compare formulations or designs.

An overlay belongs to the figure of its first curve and is made with it; the others are made before where they are out
of date.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import tau
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearstab.plots.drawing.heading import write_legend
from gearstab.plots.drawing.style import CASES, DASHES, new_figure, save, style
from gearstab.plots.view import Request

SMALLEST_LINE = 0.02
"""Of a spectrum, relative to its largest line."""
MARKERS = ("o", "s", "D")


@dataclass(frozen=True)
class Measure:
    """A variable of a response and how it is drawn.

    over: its coordinate; label, along: of the axes; factor, scale: of the variable and of the coordinate.
    panel: its other dimension, of which each panel shows one entry, "" for none. stems: whether as lines of a spectrum.
    """

    variable: str
    over: str
    label: str
    along: str
    factor: float = 1.0
    scale: float = 1.0
    panel: str = ""
    stems: bool = False


@dataclass(frozen=True)
class Overlay:
    """Curves in one frame, or in one for each panel.

    curves: figure -> its words in the legend. panels: entry of the measure's panel -> title.
    most: end of the horizontal axis.
    """

    title: str
    measure: Measure
    curves: Mapping[str, str]
    panels: Mapping[str, str] | None = None
    most: float = 1.0


ENERGY = Measure("energy", "time", "total energy $U$ (J)", "time $t$ (s)")
STRESS = Measure(
    "root_stress", "contact", "root stress (MPa)", "contact, from first to last point", 1e-6, panel="flank"
)
SPECTRUM = Measure(
    "mesh_deflection_amplitude", "frequency", "amplitude ($\\mu$m)", "frequency (Hz)", 1e6, 1 / tau, "mesh", True
)

KURIA = "kuria_kihiu_2008/designs/"
STAGE4 = {"gear7, mesh IV": "pinion", "gear8, mesh IV": "wheel"}
STAGES12 = {"I": "mesh I", "II": "mesh II"}
FIG3 = "oh_grosh_barber_2005/fig3"


def of_paper(title: str, number: int) -> str:
    """The title of a figure of Kuria & Kihiu."""
    return f"{title}\n(Kuria & Kihiu 2008, Fig. {number})"


OVERLAYS: dict[str, Overlay] = {
    f"{FIG3}_overlaid": Overlay(
        "Energy of a gear pair at 300 rpm", ENERGY,
        {FIG3: "energy conserving", f"{FIG3}_rigid_kinematic": "rigid kinematic"},
    ),
    f"{KURIA}fig9": Overlay(
        of_paper("Transmission error for three modules", 9), SPECTRUM,
        {f"{KURIA}stages12_m30": "3 mm", f"{KURIA}stages12_m25": "2.5 mm", f"{KURIA}stages12_m20": "2 mm"},
        STAGES12, 2200,
    ),
    f"{KURIA}fig10": Overlay(
        of_paper("Root stress in stage IV for three modules", 10), STRESS,
        {f"{KURIA}stage4_m30": "3 mm", f"{KURIA}stage4_m25": "2.5 mm", f"{KURIA}stage4_m20": "2 mm"}, STAGE4,
    ),
    f"{KURIA}fig11": Overlay(
        of_paper("Transmission error for two pressure angles", 11), SPECTRUM,
        {f"{KURIA}stages12_a25": "25 degrees", f"{KURIA}stages12_m30": "20 degrees"}, STAGES12, 2200,
    ),
    f"{KURIA}fig12": Overlay(
        of_paper("Root stress in stage IV for two pressure angles", 12), STRESS,
        {f"{KURIA}stage4_a25": "25 degrees", f"{KURIA}stage4_m30": "20 degrees"}, STAGE4,
    ),
    f"{KURIA}fig15": Overlay(
        of_paper("Root stress in stage IV, module 2 mm", 15), STRESS,
        {f"{KURIA}stage4_m20": "contact ratio 1.68", f"{KURIA}stage4_m20_long": "contact ratio 2.00"}, STAGE4,
    ),
    f"{KURIA}fig16": Overlay(
        of_paper("Root stress in stage IV, module 2.5 mm", 16), STRESS,
        {f"{KURIA}stage4_m25": "contact ratio 1.63", f"{KURIA}stage4_m25_long": "contact ratio 2.00"}, STAGE4,
    ),
    f"{KURIA}fig17": Overlay(
        of_paper("Root stress in stage IV, contact ratio 2", 17), STRESS,
        {f"{KURIA}stage4_m20_long": "module 2 mm", f"{KURIA}stage4_m25_long": "module 2.5 mm"}, STAGE4,
    ),
}  # fmt: skip
"""By the name of the picture."""


def of_figure(name: str) -> dict[str, Overlay]:
    """Return the overlays that belong to a figure, by the name of the picture."""
    return {picture: overlay for picture, overlay in OVERLAYS.items() if name == next(iter(overlay.curves))}


def draw(overlay: Overlay, results: Mapping[str, Path], path: Path) -> None:
    """Draw an overlay into a file. results: figure -> its result."""
    panels = overlay.panels or {"": ""}
    with style():
        figure = new_figure(Request(), 0.62 if len(panels) == 1 else 0.5 * len(panels) + 0.2)
        axes = np.ravel(figure.subplots(len(panels), 1, sharex=True, squeeze=False))
        for k, (name, words) in enumerate(overlay.curves.items()):
            with xr.open_datatree(results[name]) as tree:
                for ax, panel in zip(axes, panels, strict=True):
                    _curve(ax, tree["response"].to_dataset(), overlay, panel, k, words)
        for ax, words in zip(axes, panels.values(), strict=True):
            ax.set_title(words, fontsize="small")
            ax.set_ylabel(overlay.measure.label)
            ax.margins(x=0)
            if overlay.panels:
                ax.set(xlim=(0, overlay.most), ylim=(0, None))
        axes[-1].set_xlabel(overlay.measure.along)
        figure.suptitle(overlay.title)
        write_legend(figure, axes[0].get_lines())
        save(figure, path)


def _curve(ax: Axes, data: xr.Dataset, overlay: Overlay, panel: str, k: int, words: str) -> None:
    """Draw one curve of one panel: of a spectrum its lines from zero, but for the smallest."""
    measure = overlay.measure
    values = data[measure.variable].sel({measure.panel: panel}) if panel else data[measure.variable]
    x, y = measure.scale * data[measure.over].values, measure.factor * values.values
    if measure.stems:
        shown = (x > 0) & (y > SMALLEST_LINE * y[1:].max())
        ax.vlines(x[shown], 0, y[shown], color=CASES[k], linewidth=2.2 - 0.8 * k)
        ax.plot(x[shown], y[shown], MARKERS[k], markersize=3, color=CASES[k], label=words)
        return
    # In a long history dashes cannot be told from gaps.
    dashes, width = (DASHES[k], 0.9) if panel else ("-", 0.6)
    ax.plot(x, y, color=CASES[k], linestyle=dashes, linewidth=width, label=words, zorder=3 - 0.1 * k)
