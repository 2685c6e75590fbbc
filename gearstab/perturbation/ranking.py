"""Instability regions by what they do in a range of mesh frequencies after damping."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation.multiple_scales import first_order, modal_rows
from gearstab.perturbation.remedies import Resonance, resonance, strength
from gearstab.perturbation.tongues import Tongue, Tongues
from gearstab.support import whirls
from gearstab.system import Array, GearSystem

HIGHEST = 20
"""Harmonics that are looked at: the widths of regions of rectangular waves, which fall slowest, fall as s^-2."""
MOST_TONGUES, MOST_WHIRLING = 40_000, 1_000
"""Most tongues that are looked at; and of motions that are no real modes, each of which is an eigenproblem."""


@dataclass(frozen=True)
class RankedRegion:
    """A tongue that meets the range. lower, upper: its ends, of mesh frequency; inside: the width in the range.

    Where one mode of two is undamped first order has no ends: then they are those without damping, and ``endless``.
    threshold: factor on every epsilon at which it opens, 0 without damping. center, half_width: without damping, where
    its motions are real modes. root: that of motions which are none; amplitudes: in its middle, of real modes; each
    None of the others.
    """

    tongue: Tongue
    lower: float
    upper: float
    inside: float
    endless: bool
    threshold: float
    center: float
    half_width: float
    root: float | None
    amplitudes: Resonance | None


@dataclass(frozen=True)
class Ranking:
    """Effects of regions in a range of mesh frequencies.

    open: those that are open in the range, the widest there first; closest: those centred in the range that damping
    closes, the next to open first. opened, closed, quiet: how many tongues meet the range and are open, are centred in
    it and closed by damping, or not excited. harmonics: how many were looked at. real_modes: whether motions are real
    modes, by which rules and remedies go.
    """

    open: tuple[RankedRegion, ...]
    closest: tuple[RankedRegion, ...]
    opened: int
    closed: int
    quiet: int
    harmonics: int
    real_modes: bool


def rank(system: GearSystem, low: float, high: float, harmonics: int, most: int = 12, nearest: int = 3) -> Ranking:
    """Rank the first-order regions of a single system between two mesh frequencies, its periodic terms left out.

    harmonics: at least; more are looked at as far as MOST_TONGUES allows. most, nearest: lengths of the two lists.
    """
    whirling, system = whirls(system), replace(system, terms=())
    modal = None if whirling else modal_rows(system)
    modes = list(range(1, system.size + 1)) if whirling else _excited(system)
    pairs = max(len(modes) * (len(modes) + 1) // 2 * len(set(system.frequency_ratios)), 1)
    harmonics = max(harmonics, min(HIGHEST, (MOST_WHIRLING if whirling else MOST_TONGUES) // pairs))
    found = first_order(system, harmonics, modes)
    lower, upper, endless = _ends(system, found, harmonics)
    inside = np.clip(np.minimum(upper, high) - np.maximum(lower, low), 0.0, None)
    centred = (found.center_frequency >= low) & (found.center_frequency <= high)
    inside = np.nan_to_num(inside)
    closed = centred & (found.half_width == 0) & (found.threshold > 0) & np.isfinite(found.threshold)

    def region(k: int) -> RankedRegion:
        own = None if modal is None else resonance(system, found.index[k], modal)
        center, half = float(found.center_frequency[k]), float(found.half_width[k])
        if own is not None:
            ratio = found.index[k].frequency_ratio
            center, half = sum(own.frequencies) / ratio, strength(own.coupling) / ratio
        return RankedRegion(
            found.index[k], float(lower[k]), float(upper[k]), float(inside[k]), bool(endless[k]),
            float(found.threshold[k]), center, half, center if whirling else None, own,
        )  # fmt: skip

    def regions(order: Array, count: int) -> tuple[RankedRegion, ...]:
        return tuple(region(int(k)) for k in order[:count])

    opened, shut = np.flatnonzero(inside > 0), np.flatnonzero(closed)
    return Ranking(
        regions(opened[np.argsort(-inside[opened], kind="stable")], most),
        regions(shut[np.argsort(found.threshold[shut], kind="stable")], nearest),
        len(opened), len(shut), int(np.count_nonzero(centred & (inside == 0))) - len(shut), harmonics,
        not whirling,
    )  # fmt: skip


def _excited(system: GearSystem) -> list[int]:
    """Numbers (from 1) of the modes that a mesh can excite."""
    modes = mean_modes(system)
    deflects = np.any(significant_deflection(modes), axis=-1) & ~modes.rigid
    return [int(p) + 1 for p in np.flatnonzero(deflects)]


def _ends(system: GearSystem, found: Tongues, harmonics: int) -> tuple[Array, Array, Array]:
    """Lower and upper ends, those without damping where damping leaves none, and where that is."""
    endless = np.isinf(found.half_width)
    ends = found.boundary_frequency.copy()
    rooted = np.flatnonzero(endless & np.isfinite(found.center_frequency))
    if len(rooted):
        modes = sorted({mode for k in rooted for mode in (found.index[k].mode_p, found.index[k].mode_q)})
        free = first_order(replace(system, damping=None), harmonics, modes)
        known = dict(zip(free.index, free.boundary_frequency, strict=True))
        ends[rooted] = [known.get(found.index[k], ends[k]) for k in rooted]
    return ends[:, 0], ends[:, 1], endless
