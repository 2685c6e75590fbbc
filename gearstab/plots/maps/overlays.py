"""Marks over the cells of a map or behind a curve: points in doubt, and what is proved stable.

Points are in doubt where teeth would part, samples are too few, and the like. What is proved is tinted, and hatched
where certificates are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing import grid
from gearstab.plots.drawing.style import FAILED, LINE, PROVED
from gearstab.plots.drawing.text import plain
from gearstab.plots.drawing.tongues import parameter_axis
from gearstab.plots.view import MapView, View
from gearstab.results.display import SPEEDS
from gearstab.results.variables import Flags

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
HALO: dict[str, Any] = {"linewidth": 3.6, "alpha": 0.28, "solid_capstyle": "butt", "zorder": 1.2}


def doubtful(tree: xr.DataTree, dataset: xr.Dataset, view: View, *dims: str) -> dict[tuple[str, str], Array]:
    """Where a view of a variable of ``dataset`` is in doubt: masks over ``dims``, by words and hatching.

    Without backlash only: where teeth part and meet again as they do, nothing is in doubt.
    """
    linear = "contact_loss_ratio" not in dataset.data_vars
    known = {name: text for name, text in FLAGS.items() if linear or name != "separation"}
    found = _masks(dataset.data_vars.get("status"), known, view, dims)
    if "teeth" in tree.children:
        from gearstab.systems.gearbox.feasibility import NOTICES

        notices = tree["teeth"].to_dataset().data_vars.get("notices")
        shown = {name: (words.short, ("-" if name == "undercut" else "|") * 4) for name, words in NOTICES.items()}
        known = {name: words for name, words in shown.items() if words[0]}
        for words, mask in _masks(notices, known, view, dims).items():
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


CERTIFIED = "#9fc3a5"
"""Colour of the hatching."""


class ProvedTint(PolyCollection):
    """Ranges that are proved stable, ``ends``, as :func:`read_proved` has them; None where certificates stand alone.

    certified: share of the range with certificates, None without any. gaps: whether other cells of a map are stable
    too, which stay white.
    """

    ends: Array | None = None
    certified: float | None = None
    gaps: bool = False


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
    tint.ends = ends
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


def draw_over(tree: xr.DataTree, ax: Axes, view: View, stable: Array | None = None) -> ProvedTint | None:
    """Tint what is proved stable of a map over the mesh frequency and numbers; None where nothing is.

    stable: the cells over (y, x) that are stable, proved or not; None where none are drawn.
    """
    found = parameter_axis(view)
    tint = draw_proved(tree, ax, view, *found) if found is not None else None
    if tint is None or found is None or stable is None or tint.ends is None or view.speed is None:
        return tint
    # Within a stretch one more has begun than has ended; NaN of missing stretches sort behind all speeds.
    speeds, begun, ended = view.speed.ascending, np.sort(tint.ends[:, 0].T), np.sort(tint.ends[:, 1].T)
    rows = zip(begun, ended, strict=True)
    proved = np.array([np.searchsorted(a, speeds, "right") > np.searchsorted(b, speeds, "left") for a, b in rows])
    tint.gaps = bool(np.any(stable & ~(proved if found[1] else proved.T)))
    return tint


def legend_of_proved(tint: ProvedTint | None) -> list[Patch]:
    """Its entries in a legend; nothing without a tint."""
    if tint is None:
        return []
    stable = [Patch(facecolor=PROVED, label="proved stable")] if tint.get_paths() else []
    if tint.gaps:
        stable.append(Patch(facecolor="white", edgecolor="#b0b0b0", linewidth=0.4, label="stable, not proved"))
    if tint.certified is None:
        return stable
    label = plain(f"certified, {100 * tint.certified:.2f} % of the range")
    return [*stable, Patch(facecolor="none", edgecolor=CERTIFIED, hatch="////", linewidth=0, label=label)]
