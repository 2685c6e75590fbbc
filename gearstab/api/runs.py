"""Whole runs in memory, with the layout of the files that commands write, and their figures."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearstab.api import Source, as_config
from gearstab.sweep import Reporter

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from gearstab.config import Config


def sweep(
    config: Source, jobs: int | None = None, *, progress: bool | None = None, confirmed: bool = False
) -> xr.DataTree:
    """Compute the grid of a configuration with all its methods; returns what a result file holds, in memory.

    Parameters
    ----------
    config: as in :func:`gearstab.load`, with the sections ``sweep`` and ``methods``.
    jobs: threads or processes, default one per processor.
    progress: whether to show a bar; default: in a notebook and on a terminal.
    confirmed: True to begin a sweep of very many points, hours or gigabytes.

    Finished blocks of a long sweep wait in a temporary folder, which is removed at the end. An interrupt (Ctrl-C, the
    stop button of a notebook) ends all processes and raises KeyboardInterrupt; nothing is kept.

    Raises ConfigError for a wrong configuration, RequestError for a large sweep that is not confirmed, and SweepError
    where it could not be finished.
    """
    from gearstab.results.read import from_bytes
    from gearstab.sweep import forecast, plan, run_in_memory

    planned = plan(as_config(config, "sweep", "methods"))
    folder = Path(tempfile.gettempdir()) / "result.h5"
    found = forecast.refuse(planned, folder, jobs, confirmed, "pass confirmed=True to begin it")
    return from_bytes(run_in_memory(planned, jobs, reporter(progress), said_of(planned.config), found))


def said_of(config: Config) -> dict[str, str]:
    """Return what a result says of its origin; the file of a configuration is relative to the current folder."""
    from gearstab.sweep.storage.previous import origin

    said = origin(config, Path("result.h5"))
    return said if config.source.is_file() else {"config_overrides": said["config_overrides"]}


def respond(config: Source) -> xr.DataTree:
    """Compute the time response of a configuration; returns what ``gearstab respond`` writes, in memory.

    config: as in :func:`gearstab.load`, with the section ``respond``. Raises ConfigError.
    """
    from gearstab.response.command import computed
    from gearstab.results.read import from_bytes
    from gearstab.results.write import image

    return from_bytes(image(computed(as_config(config, "respond"))[1]))


def design(config: Source, *, progress: bool | None = None) -> xr.DataTree:
    """Find the design that suppresses instability best; returns what ``gearstab design`` writes, in memory.

    config: as in :func:`gearstab.load`, with the section ``design``. progress: as in :func:`sweep`. The answer in words
    is the attribute ``answer`` of the group ``design``. Raises ConfigError and NotPossible.
    """
    from gearstab.design import check
    from gearstab.design import design as find
    from gearstab.results.read import from_bytes
    from gearstab.results.write import image

    loaded = as_config(config, "design")
    check(loaded)
    return from_bytes(image(find(loaded, reporter(progress).message)))


def save(result: xr.DataTree, path: str | Path) -> None:
    """Write a result in memory to a file that every command reads, whole or not at all.

    Parameters
    ----------
    result: what :func:`sweep`, :func:`respond` or :func:`design` returned, or a part of it.
    path: ends in ``.h5``; a result of the same command there is replaced, nothing else.

    Raises ResultError for a tree that is no result, and OutputError where something else is at the path.
    """
    import os

    from gearstab.results.write import result_tree, write_result

    out, tree = Path(path), result_tree(result)
    attributes = dict(tree.root.attributes)
    if attributes.get("config_file"):
        # Relative to the file that the result was read from, of one in memory to the current folder.
        folder = Path(str(result.encoding.get("source") or "result.h5")).parent
        moved = os.path.relpath(folder / str(attributes["config_file"]), out.resolve().parent)
        attributes["config_file"] = Path(moved).as_posix()
    write_result(out, replace(tree, root=replace(tree.root, attributes=attributes)))


def plot(
    result: xr.DataTree | str | Path,
    kind: str | None = None,
    ax: Axes | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    select: Mapping[str, Any] | None = None,
    variable: str | None = None,
    size: str | None = None,
    title: bool = True,
    dpi: int | None = None,
    style: str = "",
) -> Figure:
    """Draw a figure from a result alone.

    Parameters
    ----------
    result: what :func:`sweep` or :func:`respond` returned, or the path of a result file.
    kind: what to draw, as ``gearstab plot --kind``; default by what the result holds.
    ax: the frame to draw into, for kinds of one frame; it gets no title. Default: a new figure.
    x, y: axes along the sides. select: axis -> value (the nearest one is taken) or label, to fix further axes.
    variable: the variable of a map or curve. size: "single" or "double" column. title: whether to write it over the
        figure. dpi: resolution. style: one of matplotlib's, a style sheet, or "latex".

    Returns the figure, which ``savefig`` writes. Raises PlotError for what the result cannot give, ResultError for a
    file that is no result.
    """
    from gearstab.plots import draw
    from gearstab.plots.view import Request
    from gearstab.results.read import reading

    chosen = {name: str(value) for name, value in (select or {}).items()}
    request = Request(x, y, chosen, variable, size, title, dpi, ax=ax, style=style)
    if isinstance(result, str | Path):
        with reading(result) as tree:
            return draw(tree, kind, request)[0]
    return draw(result, kind, request)[0]


NOTEBOOK = "ipykernel"
"""A module that is there in a notebook."""


def reporter(wanted: bool | None) -> Reporter:
    """Return a bar if someone can see it; rich draws it in a notebook as well as on a terminal.

    wanted: True or False decides; None: in a notebook and on a terminal.
    """
    seen = NOTEBOOK in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
    if not (seen if wanted is None else wanted):
        return Reporter()
    from gearstab.sweep.progress import Bar

    return Bar(lambda text: print(text, file=sys.stderr))  # noqa: T201
