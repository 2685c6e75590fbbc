"""Instability regions by what they do in a range of mesh frequencies after damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation.multiple_scales import first_order, modal_rows
from gearstab.perturbation.remedies import Resonance, resonance
from gearstab.perturbation.tongues import Tongue, Tongues
from gearstab.system import Array, GearSystem

HIGHEST = 20
"""Harmonics that are looked at: the widths of regions of rectangular waves, which fall slowest, fall as s^-2."""
MOST_TONGUES = 40_000
"""Most tongues that are looked at."""


@dataclass(frozen=True)
class RankedRegion:
    """A tongue that meets the range. lower, upper: its ends, of mesh frequency; inside: the width in the range.

    Where one mode of two is undamped first order has no ends: then they are those without damping, and ``endless``.
    threshold: factor on every epsilon at which it opens, 0 without damping. amplitudes: in its middle.
    """

    tongue: Tongue
    lower: float
    upper: float
    inside: float
    endless: bool
    threshold: float
    amplitudes: Resonance


@dataclass(frozen=True)
class Ranking:
    """Effects of regions in a range of mesh frequencies.

    open: those that are open in the range, the widest there first; closest: those centred in the range that damping
    closes, the next to open first. opened, closed, quiet: how many tongues meet the range and are open, are centred in
    it and closed by damping, or not excited. harmonics: how many were looked at.
    """

    open: tuple[RankedRegion, ...]
    closest: tuple[RankedRegion, ...]
    opened: int
    closed: int
    quiet: int
    harmonics: int


def rank(system: GearSystem, low: float, high: float, harmonics: int, most: int = 12, nearest: int = 3) -> Ranking:
    """Rank the first-order regions of a single system between two mesh frequencies, its periodic terms left out.

    harmonics: at least; more are looked at as far as MOST_TONGUES allows. most, nearest: lengths of the two lists.
    """
    system = replace(system, terms=())
    modes = _excited(system)
    pairs = max(len(modes) * (len(modes) + 1) // 2 * len(set(system.frequency_ratios)), 1)
    harmonics = max(harmonics, min(HIGHEST, MOST_TONGUES // pairs))
    found = first_order(system, harmonics, modes)
    lower, upper, endless = _ends(system, found, harmonics, modes)
    inside = np.clip(np.minimum(upper, high) - np.maximum(lower, low), 0.0, None)
    centred = (found.center_frequency >= low) & (found.center_frequency <= high)
    inside = np.nan_to_num(inside)
    closed = centred & (found.half_width == 0) & (found.threshold > 0) & np.isfinite(found.threshold)
    modal = modal_rows(system)

    def regions(order: Array, count: int) -> tuple[RankedRegion, ...]:
        return tuple(
            RankedRegion(
                found.index[k], float(lower[k]), float(upper[k]), float(inside[k]), bool(endless[k]),
                float(found.threshold[k]), resonance(system, found.index[k], modal),
            )
            for k in order[:count]
        )  # fmt: skip

    opened, shut = np.flatnonzero(inside > 0), np.flatnonzero(closed)
    return Ranking(
        regions(opened[np.argsort(-inside[opened], kind="stable")], most),
        regions(shut[np.argsort(found.threshold[shut], kind="stable")], nearest),
        len(opened), len(shut), int(np.count_nonzero(centred & (inside == 0))) - len(shut), harmonics,
    )  # fmt: skip


def _excited(system: GearSystem) -> list[int]:
    """Numbers (from 1) of the modes that a mesh can excite."""
    modes = mean_modes(system)
    deflects = np.any(significant_deflection(modes), axis=-1) & ~modes.rigid
    return [int(p) + 1 for p in np.flatnonzero(deflects)]


def _ends(system: GearSystem, found: Tongues, harmonics: int, modes: Sequence[int]) -> tuple[Array, Array, Array]:
    """Lower and upper ends, those without damping where damping leaves none, and where that is."""
    endless = np.isinf(found.half_width)
    lower, upper = np.moveaxis(found.boundary_frequency, 1, 0)
    if endless.any():
        free = first_order(replace(system, damping=None), harmonics, modes).boundary_frequency
        lower, upper = (np.where(endless, free[:, side], end) for side, end in ((0, lower), (1, upper)))
    return lower, upper, endless
