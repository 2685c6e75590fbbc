"""Ranges, sweeps, modes of Table 1 and shape of the closed forms, shared by the statements of all sections."""

from __future__ import annotations

import numpy as np
import xarray as xr

from statements import Runs, edges, predicted

RANGE = [0.35, 7.0]
PRIMARY = ["2w1", "2w2", "2w3"]
COMBINATION = ["w1+w2", "w1+w3", "w2+w3"]
FIRST_ORDER = {"perturbation": {"order": 1, "harmonics": 4}}
BOTH = {"perturbation": {"order": 1, "harmonics": 2}, "boundaries": {}}


class Modes:
    """w_p, delta_ip and k_g of Table 1 as the formulas of the paper need them; modes from 1, meshes from 1."""

    def __init__(self, tree: xr.DataTree) -> None:
        modes = tree["modes"].to_dataset()
        self._frequency = modes["natural_frequency"].values
        self._deflection = modes["mesh_deflection"].values
        self.shapes = modes["mode_shape"].values

    def w(self, p: int) -> float:
        return float(self._frequency[p - 1])

    def d(self, mesh: int, p: int) -> float:
        return float(self._deflection[p - 1, mesh - 1])


def sinpi(x: xr.DataArray) -> xr.DataArray:
    """sin(pi x)."""
    return xr.apply_ufunc(np.sin, np.pi * x)


def cospi(x: xr.DataArray) -> xr.DataArray:
    """cos(pi x)."""
    return xr.apply_ufunc(np.cos, np.pi * x)


def interference(a: xr.DataArray, b: xr.DataArray, angle: xr.DataArray) -> xr.DataArray:
    """(a^2 + b^2 + 2 a b cos(angle pi))^1/2, what (21)-(23) and (32) have in common."""
    return (a**2 + b**2 + 2 * a * b * cospi(angle)).clip(min=0.0) ** 0.5


def axes(tree: xr.DataTree) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """c1, c2 and h of a sweep over them."""
    values = tree["perturbation"].to_dataset()
    return values["meshes.first.contact_ratio"], values["meshes.second.contact_ratio"], values["phasing"]


def grid(runs: Runs, config: str, c1: list[float], c2: list[float], h: list[float]) -> xr.DataTree:
    """First-order tongues over contact ratios and phasing, at epsilon = 1/100."""
    sweep = {
        "mesh_frequency": RANGE,
        "epsilon": [0.01],
        "meshes.first.contact_ratio": c1,
        "meshes.second.contact_ratio": c2,
        "phasing": h,
    }
    return runs.sweep(config, sweep=sweep, methods=FIRST_ORDER)


def coarse(runs: Runs, config: str = "lin_parker_2002/fig3") -> xr.DataTree:
    """A grid without special values, for identities."""
    return grid(
        runs, config, [1.07, 1.25, 1.43, 1.61, 1.88], [1.13, 1.34, 1.55, 1.72, 1.91], [0.0, 0.17, 0.4, 0.63, 0.85]
    )


def regular(runs: Runs, config: str = "lin_parker_2002/fig3") -> xr.DataTree:
    """A grid with all special values: twentieths."""
    c, h = np.linspace(1, 2, 21).round(2).tolist(), np.linspace(0, 0.95, 20).round(2).tolist()
    return grid(runs, config, c, c, h)


def distance(tree: xr.DataTree, labels: list[str]) -> xr.DataArray:
    """Largest distance of a first-order edge from the Floquet one, by ``label``."""
    return xr.concat([abs(predicted(tree, s) - edges(tree, s)).max("side") for s in labels], "label")
