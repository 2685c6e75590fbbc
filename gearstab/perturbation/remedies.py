"""Growth in the middle of a region, and which contact ratio, phasing, damping or tooth number closes it.

In the middle of a tongue, nu = w_P + w_Q, the largest growth rate is the largest eigenvalue of the Hermitian matrix

    H = [[-D_P, (i/2) G], [-(i/2) G^H, -D_Q]]        (:mod:`gearstab.perturbation.damped`, sigma = 0)

where the meshes that share nu add up to G = sum_i G_i. Three rules of first order follow:

* *contact ratio*: the harmonic s of a wave that is stiff for the fraction c - floor(c) has the size sin(pi s c)/(pi s)
  and vanishes where s c is an integer;
* *phasing*: a lag of x periods more turns G_i by exp(-2 pi i s x). Where the others add up to the opposite of it, the
  sum is least, and zero where both are of one size;
* *damping*: a modal damping ratio zeta of all modes closes it from zeta = sigma_max(G)/(2 sqrt(w_P w_Q)) on.

A planetary gear follows the existence rule besides (:func:`gearstab.symmetry.can_couple`).

Source: Lin & Parker 2002, (20)-(22) and below (31); Parker 2009, conclusion 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np

from gearstab.mesh import Mesh
from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation.damped import growth
from gearstab.perturbation.multiple_scales import ModalQuantities, block, first_order, group_of, modal_rows
from gearstab.perturbation.tongues import ParametricExcitation, Tongue, Tongues, sharing
from gearstab.system import Array, GearSystem, whirls

VANISHING = 1e-9
"""A harmonic below this part of the present one has vanished but for rounding."""
NEGLIGIBLE = 0.01
"""A rest of a coupling below this part is smaller than the errors of first order in epsilon, and counts as none."""
MOST_TOGETHER = 4
"""Meshes whose contact ratios are changed together."""
HIGHEST = 20
"""Harmonics that are looked at: the widths of regions of rectangular waves, which fall slowest, fall as s^-2."""
MOST_TONGUES, MOST_WHIRLING = 40_000, 1_000
"""Most tongues that are looked at; and of motions that are no real modes, each of which is an eigenproblem."""


@dataclass(frozen=True)
class Phasing:
    """A lag of a mesh that weakens a region most. mesh: its number from 0; shift: lag to add, in periods of its own.

    left: the coupling that remains, over the present one; closes: whether that leaves the region closed.
    """

    mesh: int
    shift: float
    left: float
    closes: bool


@dataclass(frozen=True)
class Resonance:
    """The amplitude equations in the middle of one tongue of a single system.

    parts: G_i by mesh number, ``(P, Q)``; harmonics: s_i of the same. damping: D_P and D_Q. frequencies: w_P, w_Q.
    """

    parts: dict[int, Array]
    harmonics: dict[int, int]
    damping: tuple[Array, Array]
    frequencies: tuple[float, float]

    @property
    def coupling(self) -> Array:
        """G ``(P, Q)``."""
        return np.sum(list(self.parts.values()), axis=0)

    @property
    def growth_rate(self) -> float:
        """The largest growth rate in the region, 1/time; negative where damping closes it."""
        return self.growth_with(self.coupling)

    @property
    def damping_ratio(self) -> float:
        """The modal damping ratio of all modes from which on the region is closed."""
        return strength(self.coupling) / (2 * float(np.sqrt(np.prod(self.frequencies))))

    def growth_with(self, coupling: Array) -> float:
        """The same growth rate for another G."""
        damping_p, damping_q = self.damping
        return float(growth(np.zeros(1), coupling[None], damping_p[None], damping_q[None])[0])

    def closed_with(self, coupling: Array) -> bool:
        """Whether the region is closed for another G, or all but closed."""
        return strength(coupling) <= NEGLIGIBLE * strength(self.coupling) or self.growth_with(coupling) <= 0


def strength(coupling: Array) -> float:
    """sigma_max(G): half of the undamped width in nu, and twice the undamped growth rate."""
    return float(np.linalg.svd(coupling, compute_uv=False)[0])


def resonance(system: GearSystem, tongue: Tongue, modal: ModalQuantities | None = None) -> Resonance:
    """Return the amplitude equations of a tongue of a single system. modal: of the system, if it is known."""
    modal = modal or modal_rows(system)
    p, q = (group_of(modal, mode - 1) for mode in (tongue.mode_p, tongue.mode_q))
    w_p, w_q = (float(modal.frequency[0, group].mean()) for group in (p, q))
    ratio, shared = _excitation(system, tongue)
    parts = {i: block(modal, system, ParametricExcitation(ratio, ((i, s),)), p, q)[0] for i, s in shared}
    damping = modal.damping[0]
    blocks = damping[np.ix_(p, p)], damping[np.ix_(q, q)]
    return Resonance(parts, dict(shared), blocks, (w_p, w_q))


def _excitation(system: GearSystem, tongue: Tongue) -> tuple[Fraction | float, tuple[tuple[int, int], ...]]:
    """The exact frequency ratio of a tongue, which itself has it as a float, and the meshes that share it."""
    for mesh in system.meshes:
        ratio = tongue.harmonic * mesh.frequency_ratio
        shared = sharing(system, ratio)
        if shared and "+".join(system.meshes[i].name for i, _ in shared) == tongue.mesh:
            return ratio, shared
    raise ValueError(f"no mesh excites {tongue.label}")


def contact_ratios(system: GearSystem, found: Resonance, alike: Sequence[Sequence[int]]) -> dict[int, float]:
    """Return the contact ratios nearest to the present ones that close a region, of as few meshes as do.

    alike: numbers of the meshes that have one contact ratio in common, all meshes in all.
    Returns the ratio by the first of such meshes; empty where none closes it: a wave has no contact ratio, say.
    """
    sharing_it = [[i for i in group if i in found.parts and np.any(found.parts[i])] for group in alike]
    nearest = {g[0]: _vanishing(system.meshes[g[0]], found.harmonics[g[0]]) for g in sharing_it if g}
    usable = [group for group in sharing_it if group and nearest[group[0]] is not None]
    for count in range(1, min(len(usable), MOST_TOGETHER) + 1):
        for some in combinations(usable, count):
            left = found.coupling - sum(found.parts[i] for group in some for i in group)
            if found.closed_with(left):
                return {group[0]: float(nearest[group[0]] or 0) for group in some}
    return {}


def _vanishing(mesh: Mesh, harmonic: int) -> Fraction | None:
    """The contact ratio next to that of a mesh at which its harmonic vanishes; None where there is none."""
    if not mesh.waveform.has_contact_ratio:
        return None
    given: Any = mesh.waveform
    ratio = max(Fraction(round(harmonic * float(given.contact_ratio)), harmonic), Fraction(1))
    other = replace(given, contact_ratio=np.asarray(float(ratio)))
    before, after = (abs(complex(*map(float, wave.fourier(harmonic)))) for wave in (given, other))
    return ratio if after <= VANISHING * max(before, VANISHING) else None


def phasing(found: Resonance) -> Phasing | None:
    """Return the lag of one mesh but the first that weakens a region most, None where one mesh alone excites it."""
    whole = strength(found.coupling)
    best: Phasing | None = None
    for i in list(found.parts)[1:]:
        rest, own = found.coupling - found.parts[i], found.parts[i]
        for shift in _opposing(rest, own, found.harmonics[i]):
            turned = rest + own * np.exp(-2j * np.pi * found.harmonics[i] * shift)
            left = strength(turned) / whole
            if best is None or left < best.left:
                best = Phasing(i, shift, left, found.closed_with(turned))
    return best


def _opposing(rest: Array, own: Array, harmonic: int) -> Sequence[float]:
    """Lags that turn an entry of ``own`` against that of ``rest``, at most half a period of the harmonic away."""
    both = (rest != 0) & (own != 0)
    turns = (np.angle(own[both]) - np.angle(rest[both]) - np.pi) / (2 * np.pi)
    return [float(turn - np.round(turn)) / harmonic for turn in turns]


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
