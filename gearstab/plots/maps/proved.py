"""What is proved stable of a range of mesh frequencies, as a tint under the rest of a figure."""

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


def read_proved(tree: xr.DataTree, view: View, parameter: FigureAxis | None) -> Array | None:
    """``(stretch, 2, size)``: ends of what is proved, over ``parameter`` as it ascends or, without one, over one
    position; as :func:`gearstab.plots.drawing.tongues.read_tongues` says. None where nothing is, or the result does
    not tell.
    """
    if "boundaries" not in tree.children or "proved_frequency" not in tree["boundaries"].data_vars:
        return None
    data = tree["boundaries"].to_dataset()["proved_frequency"]
    own = () if parameter is None else (parameter.name,)
    if view.factor is None or not set(own) <= set(data.dims):
        return None
    ends = view.cut(data, "stretch", "side", *own) / view.factor
    ends = ends if own else ends[..., None]
    return ends if np.isfinite(ends).any() else None


def draw_proved(
    tree: xr.DataTree, ax: Axes, view: View, parameter: FigureAxis | None, frequency_on_x: bool = True
) -> PolyCollection | None:
    """Tint what is proved stable: bands across a curve, or the cells of a map's rows; None where nothing is."""
    ends = read_proved(tree, view, parameter) if view.speed is not None and view.speed.name in SPEEDS else None
    if ends is None:
        return None
    stretch, row = np.nonzero(np.isfinite(ends).all(axis=1))
    low, high = ends[stretch, 0, row], ends[stretch, 1, row]
    # Without a parameter the bands go from the bottom of the frame to its top.
    sides = np.array([0.0, 1.0]) if parameter is None else parameter.edges()
    near, far = sides[row], sides[row + 1]
    corners = np.stack([low, near, high, near, high, far, low, far], axis=-1).reshape(-1, 4, 2)
    if not frequency_on_x:
        corners = corners[..., ::-1]
    across = ax.transData if parameter is not None else ax.get_xaxis_transform()
    tint = PolyCollection(
        list(corners), facecolors=PROVED, linewidths=0, zorder=0.4, antialiaseds=False, transform=across
    )
    ax.add_collection(tint, autolim=False)
    return tint


def draw_over(tree: xr.DataTree, ax: Axes, view: View) -> PolyCollection | None:
    """Tint what is proved stable of a map over the mesh frequency and numbers; None where nothing is."""
    found = parameter_axis(view)
    return draw_proved(tree, ax, view, *found) if found is not None else None


def legend_of(tint: PolyCollection | None) -> list[Patch]:
    """Its entry in a legend; nothing without a tint."""
    return [] if tint is None else [Patch(facecolor=PROVED, label="proved stable")]
