"""Figures that show several results together, as papers do: curves in one frame, and frames in one figure.

An overlay belongs to the figure of its first curve and is made with it; the others are made before where they are out
of date.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import tau
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearstab.config import load
from gearstab.plots.drawing.style import CASES, DASHES, new_figure, save, style, write_legend
from gearstab.plots.view import Request
from gearstab.systems.gearbox.train import Train

CONFIGS = Path(__file__).parent.parent / "configs"
SMALLEST_LINE = 0.02
"""Smallest line of a spectrum that counts, relative to its largest line."""
MARKERS = ("o", "s", "D")


@dataclass(frozen=True)
class Measure:
    """A variable of a response and how it is drawn.

    over: its coordinate; label, along: of the axes; factor, scale: of the variable and of the coordinate.
    panel: its other dimension, "" for none. stems: whether as lines of a spectrum. log: 0, or the decades of a
    logarithmic axis.
    """

    variable: str
    over: str
    label: str
    along: str
    factor: float = 1.0
    scale: float = 1.0
    panel: str = ""
    stems: bool = False
    log: float = 0.0


@dataclass(frozen=True)
class Frame:
    """One frame of a figure.

    curves: figure -> its words in the legend, "" for none. title: over the frame. entry: of the measure's panel.
    ends: of the horizontal axis. less: a figure whose curve is subtracted. pitch: whether a line marks the pitch point.
    """

    measure: Measure
    curves: Mapping[str, str]
    title: str = ""
    entry: str = ""
    ends: tuple[float, float] | None = None
    less: str = ""
    pitch: bool = False


@dataclass(frozen=True)
class Overlay:
    """A figure of several frames, in rows of so many columns. dashes: of the curves."""

    title: str
    frames: Sequence[Frame]
    columns: int = 1
    dashes: Sequence[Any] = DASHES

    @property
    def results(self) -> list[str]:
        """The figures whose results it shows, the one that it belongs to first."""
        return list(dict.fromkeys(name for f in self.frames for name in (*f.curves, *filter(None, [f.less]))))


ENERGY = Measure("energy", "time", "total energy $U$ (J)", "time $t$ (s)")
STRESS = Measure(
    "root_stress", "contact", "root stress (MPa)", "contact, from first to last point", 1e-6, panel="flank"
)
SPECTRUM = Measure(
    "mesh_deflection_amplitude", "frequency", "amplitude ($\\mu$m)", "frequency (Hz)", 1e6, 1 / tau, "mesh", True
)
DEFLECTION = Measure("mesh_deflection", "time", "deflection ($\\mu$m)", "time (ms)", 1e6, 1e3, "mesh")
DENSITY = Measure(
    "power_spectral_density", "normalised_frequency", "power spectral density", "$\\omega/\\omega_d$", log=14
)

KURIA = "kuria_kihiu_2008/"
DESIGNS = f"{KURIA}designs/"
STAGE4 = {"gear7, mesh IV": "pinion", "gear8, mesh IV": "wheel"}
STAGES12 = {"I": "mesh I", "II": "mesh II"}
MESH_HZ = {"I": 350.0, "II": 350 * 7 / 17, "IV": 350 * 147 / 2720}
"""Mesh frequencies at 1500 rpm."""
OH = "oh_grosh_barber_2005/"


def of_paper(title: str, number: str) -> str:
    """The title of a figure of Kuria & Kihiu."""
    return f"{title}\n(Kuria & Kihiu 2008, Fig. {number})"


def panels(
    measure: Measure, curves: Mapping[str, str], entries: Mapping[str, str], end: float = 1.0
) -> tuple[Frame, ...]:
    """A frame for each entry of the measure's panel, with the same curves."""
    return tuple(Frame(measure, curves, words, entry, (0, end)) for entry, words in entries.items())


def stage(mesh: str) -> tuple[Frame, Frame]:
    """Deflection of a mesh over three of its cycles, and its spectrum up to the fifth harmonic.

    The common period of all meshes has more lines up to there than are stored, that of stages I and II has not.
    """
    hertz = MESH_HZ[mesh]
    return (
        Frame(DEFLECTION, {f"{KURIA}steady": ""}, "(a)", mesh, (0, 3e3 / hertz)),
        Frame(SPECTRUM, {f"{DESIGNS}stages12_m30": ""}, "(b) stages I and II alone", mesh, (0, 5.5 * hertz)),
    )


def designs(stem: str, names: Mapping[str, str]) -> dict[str, str]:
    """Designs and their words in the legend."""
    return {f"{DESIGNS}{stem}_{name}": words for name, words in names.items()}


MODULES = {"m30": "3 mm", "m25": "2.5 mm", "m20": "2 mm"}
ANGLES = {"a25": "25 degrees", "m30": "20 degrees"}
RATIOS = {m: {m: f"contact ratio {c}", f"{m}_long": "contact ratio 2.00"} for m, c in (("m20", 1.68), ("m25", 1.63))}
LONG = {"m20_long": "module 2 mm", "m25_long": "module 2.5 mm"}
FRICTION = {f"{KURIA}friction": "with friction", f"{KURIA}friction_none": "without"}

OVERLAYS: dict[str, Overlay] = {
    f"{OH}fig3_overlaid": Overlay(
        "Energy of a gear pair at 300 rpm",
        [Frame(ENERGY, {f"{OH}fig3": "energy conserving", f"{OH}fig3_rigid_kinematic": "rigid kinematic"})],
        dashes=("-", (0, (1, 1))),
    ),
    f"{OH}fig4": Overlay(
        "Spectra of the deflection at 600 rpm (left) and 4500 rpm (right)",
        [
            Frame(DENSITY, {f"{OH}fig4{part}": ""}, f"({part}) {words}", ends=(0, 7))
            for parts, words in (("ad", "energy conserving"), ("be", "rigid kinematic"), ("cf", "classical"))
            for part in parts
        ],
        columns=2,
    ),
    f"{KURIA}fig4": Overlay(of_paper("Transmission error of stage I", "4"), stage("I")),
    f"{KURIA}fig5": Overlay(of_paper("Transmission error of stage II", "5"), stage("II")),
    f"{KURIA}fig4a_friction": Overlay(
        "Transmission error of stage I with friction",
        [
            Frame(DEFLECTION, FRICTION, entry="I", pitch=True),
            Frame(
                replace(DEFLECTION, label="difference ($\\mu$m)"), {f"{KURIA}friction": ""}, entry="I",
                less=f"{KURIA}friction_none", pitch=True,
            ),
        ],
    ),
    f"{DESIGNS}fig9": Overlay(
        of_paper("Transmission error for three modules", "9"),
        panels(SPECTRUM, designs("stages12", MODULES), STAGES12, 2200),
    ),
    f"{DESIGNS}fig10": Overlay(
        of_paper("Root stress in stage IV for three modules", "10"), panels(STRESS, designs("stage4", MODULES), STAGE4)
    ),
    f"{DESIGNS}fig11": Overlay(
        of_paper("Transmission error for two pressure angles", "11"),
        panels(SPECTRUM, designs("stages12", ANGLES), STAGES12, 2200),
    ),
    f"{DESIGNS}fig12": Overlay(
        of_paper("Root stress in stage IV for two pressure angles", "12"),
        panels(STRESS, designs("stage4", ANGLES), STAGE4),
    ),
    **{
        f"{DESIGNS}fig{number}": Overlay(
            of_paper(f"Transmission error of stage IV, module {words}", str(number)),
            panels(SPECTRUM, designs("stage4", RATIOS[m]), {"IV": ""}, 5.5 * MESH_HZ["IV"] * teeth / 14),
        )
        for number, m, words, teeth in ((13, "m20", "2 mm", 21), (14, "m25", "2.5 mm", 17))
    },
    **{
        f"{DESIGNS}fig{number}": Overlay(
            of_paper(f"Root stress in stage IV, {words}", str(number)),
            panels(STRESS, designs("stage4", names), STAGE4),
        )
        for number, names, words in (
            (15, RATIOS["m20"], "module 2 mm"), (16, RATIOS["m25"], "module 2.5 mm"), (17, LONG, "contact ratio 2"),
        )
    },
}  # fmt: skip
"""By the name of the picture."""


def of_figure(name: str) -> dict[str, Overlay]:
    """Return the overlays that belong to a figure, by the name of the picture."""
    return {picture: overlay for picture, overlay in OVERLAYS.items() if name == overlay.results[0]}


def draw(overlay: Overlay, results: Mapping[str, Path], path: Path) -> None:
    """Draw an overlay into a file. results: figure -> its result."""
    rows = -(-len(overlay.frames) // overlay.columns)
    with style():
        height = 0.62 if rows == 1 else 0.5 * rows + 0.2
        figure = new_figure(Request(size="double" if overlay.columns > 1 else "single"), height / overlay.columns)
        alike = len({(frame.measure.over, frame.ends) for frame in overlay.frames}) == 1
        axes = np.ravel(figure.subplots(rows, overlay.columns, sharex=alike, sharey=overlay.columns > 1, squeeze=False))
        for ax, frame in zip(axes, overlay.frames, strict=True):
            _frame(ax, frame, results, overlay.dashes)
            if not alike or ax in axes[-overlay.columns :]:
                ax.set_xlabel(frame.measure.along)
            if ax in axes[:: overlay.columns]:
                ax.set_ylabel(frame.measure.label)
        if decades := overlay.frames[0].measure.log:
            top = 3 * max(np.max(line.get_ydata()) for ax in axes for line in ax.get_lines())
            axes[0].set_ylim(top / 10**decades, top)
        figure.suptitle(overlay.title)
        if any(words for frame in overlay.frames for words in frame.curves.values()):
            write_legend(figure, axes[0].get_lines()[: len(overlay.frames[0].curves)])
        save(figure, path)


def _frame(ax: Axes, frame: Frame, results: Mapping[str, Path], dashes: Sequence[Any]) -> None:
    """Draw the curves of one frame."""
    for k, (name, words) in enumerate(frame.curves.items()):
        x, y = _values(results[name], frame)
        if frame.less:
            y = y - _values(results[frame.less], frame)[1]
        _curve(ax, x, y, frame.measure, k, words, dashes[k])
    ax.set_title(frame.title, fontsize="small")
    ax.margins(x=0)
    if frame.ends:
        ax.set_xlim(frame.ends)
    if frame.measure.panel and frame.measure.over != "time":
        ax.set_ylim(0, None)
    if frame.pitch:
        name = next(iter(frame.curves))
        pair = Train(load(CONFIGS / f"{name}.yaml").system).pair_teeth[0].pairs[0]
        at = pair.pitch_phase * 1e3 / MESH_HZ[frame.entry]
        ax.axvline(at, color="#8a8a8a", linewidth=0.6, linestyle=(0, (1, 2)))
        ax.annotate("P", (at, 1), (2, -8), xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=8)


def _values(result: Path, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """The coordinate and the variable of a result, as they are drawn."""
    measure = frame.measure
    with xr.open_datatree(result) as tree:
        data = tree["response"].to_dataset()
        values = data[measure.variable].sel({measure.panel: frame.entry}) if measure.panel else data[measure.variable]
        return measure.scale * data[measure.over].values, measure.factor * values.values


def _curve(ax: Axes, x: np.ndarray, y: np.ndarray, measure: Measure, k: int, words: str, dashes: Any) -> None:
    """Draw one curve: of a spectrum its lines from zero, but for the smallest."""
    if measure.stems:
        shown = (x > 0) & (y > SMALLEST_LINE * y[1:].max())
        ax.vlines(x[shown], 0, y[shown], color=CASES[k], linewidth=2.2 - 0.8 * k)
        ax.plot(x[shown], y[shown], MARKERS[k], markersize=3, color=CASES[k], label=words)
        return
    width = 0.9 if measure.panel else 0.8
    if measure.log:
        ax.set_yscale("log")
    ax.plot(x, y, color=CASES[k], linestyle=dashes, linewidth=width, label=words, zorder=3 - 0.1 * k)
