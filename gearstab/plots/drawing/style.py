"""Look of every figure: one journal column or two, Times-like mathematics, a title above, a legend below.

The fonts (STIX) come with matplotlib, the user's own matplotlibrc is set aside, and files carry no time stamp, so
that the same result gives the same bytes everywhere.
"""

from __future__ import annotations

import io
import logging
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from math import ceil
from pathlib import Path
from shutil import which
from typing import Any, Literal

import matplotlib as mpl
import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend

from gearstab.errors import PlotError, listed
from gearstab.plots.drawing.text import fitted, plain
from gearstab.plots.view import Request, View
from gearstab.results.output import Content, write_bytes

WIDTHS = {"single": 3.46, "double": 7.09}
"""Width in inches of one column (88 mm) and of two (180 mm)."""

EXTENSIONS = (".png", ".pdf", ".svg")

RESOLUTION = 300
"""Dots per inch of a PNG file and of the rasterised parts of a PDF or SVG file."""

LINE, LIGHT = "#1a1a1a", "#f7f3ea"
"""Lines on light and on dark colours."""
FAILED = "#b9b9b9"
SHADE = "#d3dbe6"
PROVED = "#e4f1e6"
"""Lighter than anything that means instability."""
UNSTABLE = "#d5634a"
"""Unstable points of a map of two colours."""
CASES = ("#1a1a1a", "#c1440e", "#0b6fa4", "#7a3b8f", "#00755e", "#a0761a")
"""Colours of overlaid cases; they differ in lightness too, and every case has a line style of its own."""
DASHES: tuple[Any, ...] = ("-", *((0, p) for p in ((5, 1.6), (5, 1.5, 1, 1.5), (1.2, 1.2), (8, 2), (3, 1, 1, 1, 1, 1))))

# Lightness falls steadily from 86 to 17, hue from straw through red to violet-black: the least growth is told from the
# white of the stable regions, the order survives grey printing, and no step relies on telling red from green.
GROWTH = LinearSegmentedColormap.from_list(
    "growth", ["#f6d68a", "#f3b35f", "#e98a4b", "#d5634a", "#b64354", "#8d2d5c", "#61215a", "#381848", "#1c0f2e"]
)

RC: dict[str, Any] = {
    # The second one for letters of titles and names that the first one lacks.
    "font.family": ["STIXGeneral", "DejaVu Sans"],
    "mathtext.fontset": "stix",
    "font.size": 8,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8,
    "figure.titlesize": 9,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "axes.linewidth": 0.6,
    "axes.labelpad": 3,
    "axes.axisbelow": False,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
    "lines.linewidth": 0.8,
    "hatch.linewidth": 0.4,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "xtick.major.size": 3.2,
    "ytick.major.size": 3.2,
    "xtick.minor.size": 1.7,
    "ytick.minor.size": 1.7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "figure.dpi": RESOLUTION,
    "savefig.dpi": RESOLUTION,
    "savefig.facecolor": "white",
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "gearstab",
    "agg.path.chunksize": 10000,
}


PREAMBLE = r"\usepackage{amsmath}"
PROGRAMS = ("latex", "dvipng")
"""Programs that matplotlib runs to draw text by LaTeX."""
LATEX = "latex"
"""The style whose text LaTeX sets, in its own fonts."""


@contextmanager
def style(name: str = "") -> Iterator[None]:
    """Matplotlib's defaults plus ``RC`` and a style; the parameters found on entry come back on exit.

    name: "latex", one of matplotlib's styles or the path of a style sheet. A letter that no font has is drawn as a box,
    without a warning. Raises PlotError for an unknown style, and where LaTeX is asked for and not installed or fails.
    """
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from", category=UserWarning)
        mpl.rcdefaults()
        mpl.rcParams.update(RC)  # type: ignore[arg-type]  # the stubs want the keys as literals
        if name == LATEX:
            mpl.rcParams.update({"text.usetex": True, "font.family": ["serif"], "text.latex.preamble": PREAMBLE})
        elif name:
            _use_sheet(name)
        if mpl.rcParams["text.usetex"] and not all(map(which, PROGRAMS)):
            raise PlotError(f"--style {name}: text by LaTeX needs the programs {listed(PROGRAMS)}; install them")
        try:
            yield
        except RuntimeError as error:
            if not mpl.rcParams["text.usetex"]:
                raise
            why = next((line for line in str(error).splitlines() if line.startswith("!")), "it stopped with an error")
            raise PlotError(f"--style {name}: LaTeX cannot set the text of this figure: {why.lstrip('! ')}") from error


def _use_sheet(name: str) -> None:
    """Use a style sheet. Raises PlotError for an unknown one, and for all that matplotlib would warn of in one."""
    log, mistakes = logging.getLogger("matplotlib"), BufferingHandler(sys.maxsize)
    propagate, log.propagate = log.propagate, False
    log.addHandler(mistakes)
    try:
        mpl.style.use(name)
    except UnicodeDecodeError:
        raise PlotError(f"--style {name}: is not a text file") from None
    except OSError:
        known = listed([LATEX, *(known for known in mpl.style.available if not known.startswith("_"))])
        raise PlotError(f"--style {name}: no style sheet of this name; use a file, or {known}") from None
    finally:
        log.removeHandler(mistakes)
        log.propagate = propagate
    if mistakes.buffer:
        first_lines = [record.getMessage().strip().splitlines()[0] for record in mistakes.buffer]
        raise PlotError("\n".join(f"--style: {line}; mend the line or remove it" for line in first_lines))


def new_figure(request: Request, aspect: float | tuple[float, float], default: str = "single") -> Figure:
    """An empty figure of the size asked for, on a canvas that can measure text.

    aspect: height over width, or one for a column and one for two of them. Raises PlotError for an unknown size.
    """
    if request.ax is not None:
        raise PlotError("this kind of figure has frames of its own; leave ax out")
    size = request.size or default
    if size not in WIDTHS:
        raise PlotError(f"size {size!r} is not known; use {listed(WIDTHS)}")
    width = WIDTHS[size]
    aspect = aspect[size == "double"] if isinstance(aspect, tuple) else aspect
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03, wspace=0.03, hspace=0.03)
    figure = Figure(figsize=(width, aspect * width), layout=layout, dpi=request.dpi or RESOLUTION)
    FigureCanvasAgg(figure)
    return figure


def new_panels(
    request: Request, aspect: float | tuple[float, float], count: int, columns: int = 1, default: str = "single",
    **options: Any,
) -> tuple[Figure, list[Axes]]:  # fmt: skip
    """A figure as :func:`new_figure` makes it, and its frames, row by row. options: of matplotlib's ``subplots``."""
    figure = new_figure(request, aspect, default)
    axes = list(np.ravel(figure.subplots(ceil(count / columns), columns, squeeze=False, **options)))
    for ax in axes[count:]:
        ax.remove()
    return figure, axes[:count]


def label_columns(figure: Figure, axes: Sequence[Axes], columns: int, label: str) -> None:
    """Number and label the lowest panel of each column, whether or not that ends above the others."""
    for ax in axes[-columns:]:
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(fitted(label, 0.85 * figure.get_figwidth() / columns, 8.5))


def new_frame(request: Request, aspect: float | tuple[float, float], default: str = "single") -> tuple[Figure, Axes]:
    """The frame that the user gave and its figure, or the one frame of a figure as :func:`new_figure` makes it."""
    if request.ax is not None:
        figure = request.ax.get_figure(root=True)
        if figure is None:
            raise PlotError("ax belongs to no figure any more")
        return figure, request.ax
    figure = new_figure(request, aspect, default)
    return figure, figure.add_subplot()


def metadata(extension: str, title: str) -> dict[str, Any]:
    """Metadata of a file: never the time, so that two runs give the same bytes."""
    if extension == ".png":
        return {"Software": "gearstab", "Title": title}
    if extension == ".pdf":
        return {"Creator": "gearstab", "Producer": "gearstab", "CreationDate": None, "Title": title}
    return {"Creator": "gearstab", "Date": None, "Title": title}


def checked_extension(path: Path) -> str:
    """The extension of a figure file. Raises PlotError if it is none of ``EXTENSIONS``."""
    extension = path.suffix.lower()
    if extension not in EXTENSIONS:
        wrong = f"the ending {extension} is not known" if extension else "the name of a figure needs an ending"
        raise PlotError(f"{path}: {wrong}; use {listed(EXTENSIONS)} or .html")
    return extension


def save(figure: Figure, path: Path, title: str = "", sheet: str = "") -> None:
    """Write a figure, whole or not at all; sheet: its style, see :func:`style`.

    Raises PlotError for an unknown extension, OutputError where ``path`` is no figure to replace, and OSError where it
    cannot be written.
    """
    extension = checked_extension(path)
    data = io.BytesIO()
    with style(sheet):
        figure.savefig(data, format=extension[1:], dpi=figure.dpi, metadata=metadata(extension, title))
    write_bytes(path, data.getbuffer(), FIGURE.refuse)


def no_figure(path: Path) -> str:
    """Return what a file is instead of a figure of any kind, "" for one."""
    with open(path, "rb") as file:
        head = file.read(4096)
    return "" if head.startswith((b"\x89PNG", b"%PDF-")) or b"<svg" in head else "is no figure"


FIGURE = Content("a figure", "/".join(EXTENSIONS), no_figure, (), streams=True)


def title_of(tree: xr.DataTree) -> str:
    """The title of the result, empty if it has none."""
    return str(tree.attrs.get("title", "") or "")


def write_title(figure: Figure, tree: xr.DataTree, request: Request, view: View | None = None) -> None:
    """Write the result's title or the one asked for, and what was selected, over the figure.

    Nothing if the user wants no title, or gave a frame, over which stand the names of the tongues.
    """
    if not request.title or request.ax is not None:
        return
    title = fitted(plain(request.title if isinstance(request.title, str) else title_of(tree)), figure.get_figwidth(), 9)
    lines = [title] if title else []
    if view is not None and view.chosen:
        lines.append(",  ".join(view.chosen))
    if lines:
        figure.suptitle("\n".join(lines), linespacing=1.1)


Place = Literal["outside lower center", "outside lower right"]


def write_legend(
    figure: Figure, handles: Sequence[Any], place: Place = "outside lower center", ax: Axes | None = None
) -> Legend | None:
    """A legend under the figure with as many columns as its width holds, the rows about equally full.

    None without handles. ax: the frame that it goes into instead, in a figure that the user made.
    """
    if not handles:
        return None
    if ax is not None:
        return ax.legend(handles=list(handles))
    count = len(handles)
    for rows in range(1, count + 1):
        legend = figure.legend(handles=list(handles), loc=place, ncols=ceil(count / rows))
        if rows == count or legend.get_window_extent().width <= figure.bbox.width:
            return legend
        legend.remove()
    return None
