"""Modes as the formulas need them, and the gear in chosen modes alone, shared by the statements."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
import xarray as xr

from statements import Runs

Array = np.ndarray

PRINTED = [0.9184, 0.9184, 1.113, 2.438, 2.733, 2.733, 2.896, 4.756, 5.045]
TYPES = ["T", "T", "R", "P", "T", "T", "R", "PR", "P"]
DIGITS = [4, 4, 3, 3, 3, 3, 3, 3, 3]
"""Table 1: natural frequencies, types of the modes, and to how many decimals the frequencies are printed."""

WORDS = {"translational": "T", "rotational": "R", "planet": "P", "purely ring": "PR"}

SEQUENTIAL = [0.0, 0.25, 0.5, 0.75]
CONTACT_RATIOS = {"sun": 1.4, "ring": 1.6}
GAMMA_SR = 0.5
NONE = 1e-9
"""A first-order half-width per epsilon below this is zero but for rounding."""


@dataclass(frozen=True)
class Gear:
    """Natural frequencies and modal mesh deflections of a result, from its group ``modes``."""

    frequency: Array
    kinds: list[str]
    sun: Array
    ring: Array

    @property
    def planets(self) -> int:
        """N."""
        return self.sun.shape[1]

    @cached_property
    def nature(self) -> list[int | None]:
        """T of every mode: mesh deflections go as cos T psi_n and sin T psi_n; None without deflection."""
        found: list[int | None] = []
        largest = max(np.abs(self.sun).max(), np.abs(self.ring).max())
        for rows in zip(self.sun, self.ring, strict=True):
            power = np.sum(np.abs(np.fft.fft(rows)[:, : self.planets // 2 + 1]) ** 2, axis=0)
            found.append(None if power.max() < (1e-8 * largest) ** 2 else int(np.argmax(power)))
        return found

    def impurity(self, p: int) -> float:
        """Rest that (29) leaves of the mesh deflections of mode p (from 1), as a part of the largest one."""
        left = 0.0
        for row in (self.sun[p - 1], self.ring[p - 1]):
            spectrum = np.fft.fft(row)
            kind = self.nature[p - 1] or 0
            spectrum[[kind, -kind % self.planets]] = 0
            left = max(left, float(np.abs(np.fft.ifft(spectrum)).max()))
        return left / float(max(np.abs(self.sun[p - 1]).max(), np.abs(self.ring[p - 1]).max()))


def gear(tree: xr.DataTree) -> Gear:
    """The modes of a result; its meshes go by sun or ring and the number of the planet."""
    modes = tree["modes"].to_dataset()
    deflection = {}
    for kind in ("sun", "ring"):
        at = {}
        for i, name in enumerate(modes["mesh"].values.astype(str)):
            match = re.fullmatch(r"(\w+?)[^a-z0-9]*(\d+)", name)
            if match and match[1] == kind:
                at[int(match[2])] = i
        deflection[kind] = modes["mesh_deflection"].transpose("mode", "mesh").values[:, [at[n] for n in sorted(at)]]
    kinds = [str(kind) for kind in modes["mode_type"].values.astype(str)]
    return Gear(modes["natural_frequency"].values, kinds, deflection["sun"], deflection["ring"])


def table_1(runs: Runs) -> xr.DataTree:
    """The gear of Table 1 with k_cu = 1e11 N/m."""
    return runs.sweep("parker_2009/table1")


def restricted(
    runs: Runs, found: Gear, modes: list[int], phases: list[float], sweep: Mapping[str, object],
    methods: Mapping[str, object], contact_ratios: Mapping[str, float] | None = None,
) -> xr.DataTree:  # fmt: skip
    """A sweep of the gear in some of its modes (from 1) alone: M = I, and mesh deflections as direction vectors.

    phases: gamma_sn. Modes that are not excited with them change nothing; the others are left out.
    """
    index = np.array(modes) - 1
    ratios = contact_ratios or CONTACT_RATIOS
    rows = {"sun": found.sun[index].T, "ring": found.ring[index].T}
    stiffness = np.diag(found.frequency[index] ** 2) - sum(g.T @ g for g in rows.values())
    meshes = [
        {
            "name": f"{kind}{n + 1}", "direction": row.tolist(), "mean_stiffness": 1.0, "epsilon": 0.1,
            "contact_ratio": ratios[kind], "lag": (phases[n] + (GAMMA_SR if kind == "ring" else 0.0)) % 1.0,
        }
        for kind, g in rows.items()
        for n, row in enumerate(g)
    ]  # fmt: skip
    system = {
        "kind": "matrices", "mass": np.eye(index.size).tolist(),
        "stiffness": (0.5 * (stiffness + stiffness.T)).tolist(), "meshes": meshes,
    }  # fmt: skip
    document = {"title": "chosen modes", "system": system, "sweep": sweep, "methods": methods}
    return runs.sweep(runs.config(json.dumps(document)))


def pair_label(p: int, q: int, harmonic: int) -> str:
    """Label of the tongue of two modes."""
    if p != q:
        return f"w{p}+w{q}" if harmonic == 1 else f"(w{p}+w{q})/{harmonic}"
    factor = Fraction(2, harmonic)
    times = f"{factor.numerator}w{p}" if factor.numerator > 1 else f"w{p}"
    return times if factor.denominator == 1 else f"{times}/{factor.denominator}"
