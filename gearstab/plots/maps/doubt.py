"""Points whose answers do not hold as they stand, marked in figures: teeth would part, samples are too few, ..."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.plots.drawing import grid
from gearstab.plots.drawing.style import FAILED, LINE
from gearstab.plots.view import MapView, View
from gearstab.results.variables.flags import Flags

Array = np.ndarray

PARTED = "teeth part: not linear"
FLAGS = {
    "separation": (PARTED, "\\" * 5),
    "unresolved": ("unresolved", "." * 5),
    "not_converged": ("not converged", "." * 5),
    "undecided": ("undecided", "." * 5),
}
"""By flag of ``status``: what the legend says, and the hatching."""
REASONS = {"no_periodic_orbit": ("no periodic orbit", "")}
"""By flag of points without a value."""
NOTICES = {
    "undercut": ("undercut", "-" * 4), "interference": ("interference", "|" * 4),
    "contact_ratio": ("contact breaks off", "|" * 4), "trochoid_interference": ("interference", "|" * 4),
}  # fmt: skip
"""By notice of the teeth."""

HALO: dict[str, Any] = {"linewidth": 3.6, "alpha": 0.28, "solid_capstyle": "butt", "zorder": 1.2}


def doubtful(tree: xr.DataTree, dataset: xr.Dataset, view: View, *dims: str) -> dict[tuple[str, str], Array]:
    """Where a view of a variable of ``dataset`` is in doubt: masks over ``dims``, by words and hatching.

    Without backlash only: where teeth part and meet again as they do, nothing is in doubt.
    """
    linear = "contact_loss_ratio" not in dataset.data_vars
    known = {name: text for name, text in FLAGS.items() if linear or name != "separation"}
    found = _masks(dataset.data_vars.get("status"), known, view, dims)
    if "teeth" in tree.children:
        notices = tree["teeth"].to_dataset().data_vars.get("notices")
        for words, mask in _masks(notices, NOTICES, view, dims).items():
            found[words] = found[words] | mask if words in found else mask
    return found


def _masks(
    status: xr.DataArray | None, known: Mapping[str, tuple[str, str]], view: View, dims: tuple[str, ...]
) -> dict[tuple[str, str], Array]:
    if status is None:
        return {}
    bits = Flags.of(status.attrs)
    # What is not drawn of a large result is not read.
    status = status.isel({name: k for name, k in view.fixed.items() if name in status.dims and name not in dims})
    # Of all meshes that are not drawn one by one.
    left = [dim for dim in map(str, status.dims) if dim not in dims]
    found: dict[tuple[str, str], Array] = {}
    for name, words in known.items():
        if name not in bits:
            continue
        mask = ((status.astype(int) & bits[name]) != 0).any(left)
        missing = [dim for dim in dims if dim not in mask.dims]
        sizes = {axis.name: axis.size for axis in (view.x, view.y) if axis is not None}
        values = view.cut(mask.expand_dims({dim: sizes[dim] for dim in missing}), *dims)
        if values.any():
            found[words] = found[words] | values if words in found else values
    return found


def hatch(ax: Axes, view: MapView, masks: Mapping[tuple[str, str], Array]) -> dict[str, PolyCollection]:
    """Hatch the cells of a map, ``masks`` over (y, x); the artists by their words."""
    found = {}
    for (words, pattern), mask in masks.items():
        patches = grid.runs(view.x, view.y, mask)
        patches.set(facecolor="none", edgecolor=EDGE, linewidth=0, hatch=pattern, zorder=1.6, rasterized=True)
        ax.add_collection(patches, autolim=False)
        found[words] = patches
    return found


EDGE = "#2f4f6f"


def halo(ax: Axes, line: Line2D, masks: Mapping[tuple[str, str], Array]) -> list[str]:
    """Draw a halo behind the parts of a curve that are in doubt; what the legend is to say of them."""
    if not masks:
        return []
    x, values = (np.asarray(data, dtype=float) for data in line.get_data())
    inside = np.any(list(masks.values()), axis=0)
    # A single point is no line, and gets those to its neighbours.
    single = inside & (np.convolve(inside, [1, 1, 1], mode="same") == 1)
    wide = inside | (np.convolve(single, [1, 1, 1], mode="same") > 0)
    ax.plot(x, np.where(wide, values, np.nan), color=line.get_color(), **HALO)
    return [words for words, _ in masks]


def reason(dataset: xr.Dataset, view: MapView, failed: Array) -> str:
    """Why cells, a mask over (y, x), have no value."""
    masks = _masks(dataset.data_vars.get("status"), REASONS, view, (view.y.name, view.x.name)) if failed.any() else {}
    return next((words for (words, _), mask in masks.items() if mask[failed].all()), "no value")


def legend_of_failed(artists: Mapping[str, Any]) -> list[Patch]:
    """Return the handle of the cells of a map without a value; none where all have one."""
    if artists.get("failed") is None:
        return []
    look: dict[str, Any] = {"facecolor": FAILED, "edgecolor": "#707070", "linewidth": 0}
    return [Patch(hatch=artists["failed"].get_hatch(), label=artists.get("reason", "no value"), **look)]


def legend_of_map(words: Mapping[str, PolyCollection]) -> list[Patch]:
    """Return handles for the hatchings of a map."""
    return [
        Patch(facecolor="none", edgecolor=EDGE, linewidth=0, hatch=patches.get_hatch(), label=text)
        for text, patches in words.items()
    ]


def legend_of_curves(words: Sequence[str]) -> list[Line2D]:
    """Return the handle for the halos of curves; none without."""
    text = ", ".join(dict.fromkeys(words))
    return [Line2D([], [], color=LINE, label=text, **HALO)] if words else []
