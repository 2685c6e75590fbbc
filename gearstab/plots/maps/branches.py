"""Natural frequencies of a result, followed by their shapes, and the instability regions rooted at their sums."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.optimize import linear_sum_assignment

from gearstab.errors import PlotError
from gearstab.perturbation.tongues import DIFFERENCES
from gearstab.plots.axes import FigureAxis, group_of, texts
from gearstab.plots.view import View

Array = np.ndarray

MODES = "natural_frequencies"
"""The group of natural frequencies over the axes of a sweep."""
SYMMETRIC = "symmetric_frequency"
"""Frequencies of the symmetric mean system, at whose sums theory roots regions, of a system with terms."""
OPEN = 1e-9
"""Two edges closer than this, relative to them, are the rounding error of a region without width."""
SAME = 1e-6
"""Natural frequencies that agree to this are those of the base system; rounding stays far below, print above."""


def followed(shapes: Array) -> Array:
    """Return for every row which of its modes belongs to each branch, ``(rows, modes)``; branches as in the first row.

    shapes: ``(rows, modes, coordinates)``, normalised by the mass matrix, modes by ascending natural frequency. From
    row to row modes are assigned so that the sum of their assurance criteria (phi^T M psi)^2 is greatest; as
    Phi^T M = Phi^-1, the shapes alone give it. Source: Allemang 2003, The modal assurance criterion; with the mass
    matrix as weight. Where shapes change much within a step, as between two branches that veer apart, a finer axis
    tells which mode is which.
    """
    order = np.tile(np.arange(shapes.shape[1]), (len(shapes), 1))
    for row in range(1, len(shapes)):
        criterion = np.linalg.solve(shapes[row - 1].T, shapes[row].T) ** 2
        order[row] = linear_sum_assignment(criterion, maximize=True)[1][order[row - 1]]
    return order


@dataclass(frozen=True)
class Region:
    """An instability region where ``ratio`` Omega is near w_p + w_q.

    p, q: positions among the modes. low, high: ``(size,)``, edges in the mesh frequency, rad per unit time; NaN where
    it is closed, infinite where it has none.
    """

    label: str
    p: int
    q: int
    ratio: float
    harmonic: int
    low: Array
    high: Array

    @property
    def open(self) -> Array:
        """``(size,)`` bool."""
        with np.errstate(invalid="ignore"):
            return np.isinf(self.high) | (self.high - self.low > OPEN * np.abs(self.high))


def read_frequencies(
    tree: xr.DataTree, view: View, parameter: FigureAxis | None, name: str = "natural_frequency"
) -> Array:
    """Natural frequencies ``(size, modes)``: over a parameter as it ascends, or one row.

    Raises PlotError where the result does not hold them.
    """
    own: tuple[str, ...] = () if parameter is None else (parameter.name,)
    data = group_of(tree, MODES)
    if not data and own:
        raise PlotError(f"this result holds no natural frequencies over {own[0]}: {REMEDY}")
    if not data:
        if "natural_frequency" not in group_of(tree, "modes"):
            raise PlotError(f"this result holds no natural frequencies: {REMEDY}")
        return np.atleast_2d(group_of(tree, "modes")[name].values)
    if not set(own) <= set(map(str, data.sizes)):
        raise PlotError(f"natural frequencies do not stand over {own[0]}")
    return np.atleast_2d(view.cut(data[name], *own, "mode"))


def read_branches(tree: xr.DataTree, view: View, parameter: FigureAxis | None, modes: int) -> Array:
    """The modes of every branch ``(size, modes)``, followed by their shapes over a parameter; or one row."""
    if parameter is None:
        return np.atleast_2d(np.arange(modes))
    return followed(view.cut(group_of(tree, MODES)["mode_shape"], parameter.name, "mode", "dof"))


def damped(tree: xr.DataTree) -> bool:
    """Return whether natural frequencies are those of a whole mean system, which differ from those of its shapes."""
    return SYMMETRIC in group_of(tree, "modes")


REMEDY = "add natural_frequencies: {} to methods and run the sweep again"


def read_regions(tree: xr.DataTree, view: View, parameter: FigureAxis | None) -> list[Region]:
    """The regions of exact boundaries, then those that only perturbation theory knows, closed beside exact ones.

    Raises PlotError where they are not those of the natural frequencies of the result.
    """
    modes = read_frequencies(tree, view, parameter, SYMMETRIC if damped(tree) else "natural_frequency")
    own: tuple[str, ...] = () if parameter is None else (parameter.name,)
    found, known, exact = list[Region](), set[str](), False
    for group in ("boundaries", "perturbation"):
        data = group_of(tree, group)
        if not {"mode_p", "mode_q", "frequency_ratio", "harmonic", "label", "kind"} <= set(data.coords):
            continue
        if not {"boundary_frequency", *own} <= {*data.data_vars, *map(str, data.sizes)}:
            continue
        edges = view.cut(data["boundary_frequency"], "tongue", "side", *own)
        edges = edges.reshape(data.sizes["tongue"], 2, len(modes))
        merged: Array = np.full((len(edges), 1), -1)
        if "holder" in data:
            merged = view.cut(data["holder"], "tongue", *own).reshape(len(edges), len(modes))
        if exact:
            # What exact boundaries do not have is narrower than their floor.
            edges = np.full(edges.shape, np.nan)
        elif "half_width" in data:
            endless = np.isinf(view.cut(data["half_width"], "tongue", *own).reshape(len(edges), len(modes)))
            edges = np.where(endless[:, None], np.array([-np.inf, np.inf])[:, None], edges)
        labels, kinds = (texts(data.coords[name].values) for name in ("label", "kind"))
        for k, label in enumerate(labels):
            ratio, harmonic = float(data["frequency_ratio"].values[k]), int(data["harmonic"].values[k])
            hidden = np.any(merged[k] >= 0) and not np.isfinite(edges[k]).any()
            # At a difference of frequencies an order of a mesh passes neither mode's.
            hidden |= kinds[k] in DIFFERENCES
            if ratio > 0 and label not in known and view.tongue in (None, label) and not hidden:
                p, q = (int(data[name].values[k]) - 1 for name in ("mode_p", "mode_q"))
                found.append(Region(label, p, q, ratio, harmonic, edges[k, 0], edges[k, 1]))
        if "center_frequency" in data:
            centres = view.cut(data["center_frequency"], "tongue", *own).reshape(len(edges), len(modes))
            _check(data, centres, modes)
        known, exact = known | set(labels), True
    return found


def _check(data: xr.Dataset, centres: Array, modes: Array) -> None:
    """Raise PlotError where regions are not rooted at sums or differences of these natural frequencies."""
    p, q = (data[name].values.astype(int) - 1 for name in ("mode_p", "mode_q"))
    sign = np.where([kind in DIFFERENCES for kind in texts(data.coords["kind"].values)], -1.0, 1.0)
    sums, own = (sign * modes[:, p] + modes[:, q]).T, centres * data["frequency_ratio"].values[:, None]
    if np.any(np.abs(sums - own) > SAME * np.abs(own)):
        raise PlotError(
            f"natural frequencies change over the axes, and this result holds those of one system: {REMEDY}"
        )
