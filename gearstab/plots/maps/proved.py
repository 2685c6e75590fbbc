"""Proved parts of a range of mesh frequencies: a tint under the rest of a figure, hatched where certificates are."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing.style import PROVED
from gearstab.plots.drawing.tongues import parameter_axis
from gearstab.plots.view import View
from gearstab.results.display import SPEEDS

Array = np.ndarray


CERTIFIED = "#9fc3a5"
"""Colour of the hatching."""


class ProvedTint(PolyCollection):
    """Ranges that are proved stable; ``certified``: share of the range with certificates, None without any."""

    certified: float | None = None


def read_proved(
    tree: xr.DataTree, view: View, parameter: FigureAxis | None, name: str = "proved_frequency"
) -> Array | None:
    """``(stretch, 2, size)``: ends of what is proved, or certified, over ``parameter`` as it ascends or, without one,
    over one position; as :func:`gearstab.plots.drawing.tongues.read_tongues` says. None where nothing is, or the result
    does not tell.
    """
    if "boundaries" not in tree.children or name not in tree["boundaries"].data_vars:
        return None
    data = tree["boundaries"].to_dataset()[name]
    own = () if parameter is None else (parameter.name,)
    if view.factor is None or not set(own) <= set(data.dims):
        return None
    ends = view.cut(data, str(data.dims[0]), "side", *own) / view.factor
    ends = ends if own else ends[..., None]
    return ends if np.isfinite(ends).any() else None


def draw_proved(
    tree: xr.DataTree, ax: Axes, view: View, parameter: FigureAxis | None, frequency_on_x: bool = True
) -> ProvedTint | None:
    """Tint what is proved stable: bands across a curve, or the cells of a map's rows, hatched where certificates are,
    of what is unstable too; None where nothing is.
    """
    if view.speed is None or view.speed.name not in SPEEDS:
        return None
    ends, pieces = (read_proved(tree, view, parameter, f"{name}_frequency") for name in ("proved", "certificate"))
    if ends is None and pieces is None:
        return None
    across = ax.transData if parameter is not None else ax.get_xaxis_transform()
    corners = [] if ends is None else _corners(ends, parameter, frequency_on_x)
    tint = ProvedTint(corners, facecolors=PROVED, linewidths=0, zorder=0.4, antialiaseds=False, transform=across)
    ax.add_collection(tint, autolim=False)
    if pieces is not None:
        hatched = _corners(_joined(pieces), parameter, frequency_on_x)
        ax.add_collection(
            PolyCollection(
                hatched,
                facecolors="none",
                edgecolors=CERTIFIED,
                hatch="////",
                linewidths=0,
                zorder=0.45,
                transform=across,
            ),
            autolim=False,
        )
        tint.certified = float(tree["boundaries"]["certified_share"].mean())
    return tint


def _joined(pieces: Array) -> Array:
    """Pieces ``(piece, 2, size)`` that follow one another at once as one."""
    low, high = pieces[:, 0].copy(), pieces[:, 1].copy()
    for k in range(len(low) - 1, 0, -1):
        follows = low[k] == high[k - 1]
        high[k - 1] = np.where(follows, high[k], high[k - 1])
        low[k] = np.where(follows, np.nan, low[k])
    return np.stack([low, high], axis=1)


def _corners(ends: Array, parameter: FigureAxis | None, frequency_on_x: bool) -> list[Array]:
    """The four corners of each stretch."""
    stretch, row = np.nonzero(np.isfinite(ends).all(axis=1))
    low, high = ends[stretch, 0, row], ends[stretch, 1, row]
    # Without a parameter the bands go from the bottom of the frame to its top.
    sides = np.array([0.0, 1.0]) if parameter is None else parameter.edges()
    near, far = sides[row], sides[row + 1]
    corners = np.stack([low, near, high, near, high, far, low, far], axis=-1).reshape(-1, 4, 2)
    if not frequency_on_x:
        corners = corners[..., ::-1]
    return list(corners)


def draw_over(tree: xr.DataTree, ax: Axes, view: View) -> ProvedTint | None:
    """Tint what is proved stable of a map over the mesh frequency and numbers; None where nothing is."""
    found = parameter_axis(view)
    return draw_proved(tree, ax, view, *found) if found is not None else None


def legend_of(tint: ProvedTint | None) -> list[Patch]:
    """Its entries in a legend; nothing without a tint."""
    if tint is None:
        return []
    stable = [Patch(facecolor=PROVED, label="proved stable")] if tint.get_paths() else []
    if tint.certified is None:
        return stable
    label = f"certified, {100 * tint.certified:.2f} % of the range"
    return [*stable, Patch(facecolor="none", edgecolor=CERTIFIED, hatch="////", linewidth=0, label=label)]
