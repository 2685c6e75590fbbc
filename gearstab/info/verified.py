"""Exact regions near a tongue, and what a remedy leaves of them: first-order advice is tried before it is given."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearstab.config import Config
from gearstab.config.model import replaced
from gearstab.errors import NotPossible
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.dispatch import in_modes
from gearstab.floquet.frequencies import common_period
from gearstab.floquet.general.mean import frequencies_beyond_modes
from gearstab.modal import modal_damping_matrix, modal_damping_ratios
from gearstab.perturbation.tongues import Tongue
from gearstab.symmetry import natural_modes
from gearstab.system import Array, GearSystem

AFFORDABLE = 2e7
"""Multiplications of a monodromy matrix, segments times (2 n)^3, up to which regions are decided: a search takes some
hundred of them, a tenth of a second."""
CHEAP = 1e5
"""The same up to which remedies are tried for all regions of a list, else for the first FEW."""
FEW = 4
BUDGET = 1e9
"""Multiplications for the proof of a damped system."""
TOLERANCE, FLOOR = 1e-7, 1e-5
"""Tolerance of edges and widths, relative to the mesh frequency."""
GAP = 2e-4
"""Width of stable speeds, relative to the mesh frequency, that may be neither proved nor counted: next to an edge,
where decay is slow, some never are."""
SPEEDS, INSIDE = 1001, 33
"""Speeds of the range, and within a region, at which growth rates are computed."""
LONGER = (1.0, 1.02, 1.1, 1.3, 2.0)
"""Factors on the estimate of a damping ratio that are tried."""
WIDENINGS = 4
"""How often the mesh frequencies between which a region is looked for are moved apart at most."""
MOST_SHIFT = 0.3
"""Part of its frequency within which a tongue is looked for at most."""


@dataclass(frozen=True)
class OpenRegion:
    """An exact region. tongues: its members, the leading one first."""

    lower: float
    upper: float
    tongues: tuple[Tongue, ...]

    @property
    def width(self) -> float:
        """Width in the mesh frequency."""
        return self.upper - self.lower


def effort(system: GearSystem) -> float:
    """Return the multiplications of a monodromy matrix; infinite without a common period."""
    period = common_period(system)
    return np.inf if period is None else float(period.segments * (2 * system.size) ** 3)


def window(system: GearSystem, tongue: Tongue, half_width: float, center: float | None = None) -> tuple[float, float]:
    """Return the mesh frequencies within which the region of a tongue is looked for.

    half_width: of first order without damping. center: its root, given where its motions are no real modes. The second
    order moves a tongue by up to about epsilon^2/4 of its frequency, and the means of periodic terms by what they do to
    the frequencies of its modes.
    """
    modes = [tongue.mode_p - 1, tongue.mode_q - 1]
    natural = natural_modes(system).natural_frequency[modes]
    total = natural[1] - natural[0] if tongue.difference else natural.sum()
    at = float(total) / tongue.frequency_ratio if center is None else center
    epsilon = max(float(mesh.epsilon) for mesh in system.meshes)
    moved = 0.25 * epsilon**2 * at + 2 * half_width
    if center is None and not in_modes(system):
        whole = frequencies_beyond_modes(system)
        moved += float(np.abs(whole[0, modes] - natural).sum()) / tongue.frequency_ratio
    moved = min(moved, MOST_SHIFT * at)
    return at - moved, at + moved


def regions(system: GearSystem, low: float, high: float) -> list[OpenRegion] | None:
    """Return the exact regions between two mesh frequencies; None where some stable stretch is not decided."""
    found, undecided = _search(system, low, high)
    return found if undecided <= GAP * high else None


def whole_regions(system: GearSystem, tongue: Tongue, low: float, high: float) -> list[OpenRegion] | None:
    """Return the same, between mesh frequencies moved apart until they cut no region of a tongue, WIDENINGS times."""
    for _ in range(WIDENINGS):
        found, away = regions(system, low, high), 0.5 * (high - low)
        own = [item for item in found or () if any(same(t, tongue) for t in item.tongues)]
        below, above = any(item.lower <= low for item in own), any(item.upper >= high for item in own)
        if not (below or above):
            break
        low, high = max(low - below * away, 0.5 * low), high + above * away
    return found


def _search(system: GearSystem, low: float, high: float) -> tuple[list[OpenRegion], float]:
    """The exact regions between two mesh frequencies that a search finds, and the width of what it leaves undecided."""
    found = boundaries(system, low, high, TOLERANCE, FLOOR, budget=BUDGET)
    ends = zip(found.lower.tolist(), found.upper.tolist(), found.members, strict=True)
    known = sum(float(np.ptp(part, axis=1).sum()) for part in (*found.proved, *found.counted))
    return [OpenRegion(*own) for own in ends], high - low - known - float((found.upper - found.lower).sum())


def peak(system: GearSystem, region: OpenRegion) -> float:
    """Return the largest growth rate at INSIDE speeds of a region, 1/time."""
    return float(np.nanmax(solve(system, np.linspace(region.lower, region.upper, INSIDE)).growth_rate))


def same(one: Tongue, other: Tongue) -> bool:
    """Return whether two tongues have the same modes and the same excitation frequency."""
    a, b = ((t.mode_p, t.mode_q, t.frequency_ratio, t.difference) for t in (one, other))
    return a == b


@dataclass(frozen=True)
class SpeedScan:
    """Stability at SPEEDS mesh frequencies of a range, by exact Floquet analysis."""

    omega: Array
    unstable: Array


def scan(system: GearSystem, low: float, high: float) -> SpeedScan:
    """Return the stability at equally spaced mesh frequencies from low to high."""
    omega = np.linspace(low, high, SPEEDS)
    return SpeedScan(omega, solve(system, omega).stable[0] == 0)


def unlisted(system: GearSystem, looked: SpeedScan, known: Sequence[OpenRegion], most: int) -> Iterator[OpenRegion]:
    """Yield the exact regions around unstable points of a scan that no known region holds.

    most: number of stretches of such points, the longest ones, that are looked into.
    """
    omega, unstable = looked.omega, looked.unstable.copy()
    low, high = omega[[0, -1]]
    for region in known:
        unstable &= (omega < region.lower) | (omega > region.upper)
    padded = np.concatenate([[False], unstable, [False]]).astype(int)
    begin, end = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1) - 1
    step = omega[1] - omega[0]
    longest = np.argsort(begin - end, kind="stable")[:most]
    for a, b in zip(omega[begin[longest]], omega[end[longest]], strict=True):
        # A region that goes on beyond the range is shown up to its ends.
        for region in _search(system, a if a == low else a - step, b if b == high else b + step)[0]:
            if region.lower <= b and region.upper >= a:
                yield region


@dataclass(frozen=True)
class Trial:
    """An exact region of a configuration's system, and what changes of the configuration do to it."""

    config: Config
    system: GearSystem
    region: OpenRegion
    growth_rate: float
    tongue: Tongue
    low: float
    high: float

    def left(self, changed: GearSystem) -> float | None:
        """Return the part of the region's width that another system leaves; None where that is not decided.

        What is named after the tongue counts, wherever it has moved, and whatever else makes the same speeds unstable.
        """
        found = regions(changed, self.low, self.high)
        if found is None:
            return None
        width = 0.0
        for item in found:
            inside = min(item.upper, self.region.upper) - max(item.lower, self.region.lower)
            width += item.width if any(same(t, self.tongue) for t in item.tongues) else max(inside, 0.0)
        return width / self.region.width

    def damping_ratio(self) -> float | None:
        """Return a modal damping ratio of all modes that closes the region, near the least; None where none does.

        To first order a ratio that exceeds those of the modes by growth rate/sqrt(w_p w_q) does. Raises NotPossible
        where a mode has no natural frequency, as without a mean stiffness: it has no damping ratio.
        """
        own, modes = self.system, natural_modes(self.system)
        pair = [self.tongue.mode_p - 1, self.tongue.mode_q - 1]
        mean = float(np.sqrt(np.prod(modes.natural_frequency[pair])))
        if not mean > 0:
            raise NotPossible("a mode without a mean stiffness has no damping ratio")
        start = self.growth_rate / mean + float(modal_damping_ratios(own, modes)[pair].mean())
        stiffness = own.mean_stiffness_matrix()
        for factor in LONGER:
            ratio = _rounded_up(factor * start)
            if self.left(replace(own, damping=modal_damping_matrix(own.mass, stiffness, np.asarray(ratio)))) == 0:
                return ratio
        return None

    def contact_ratios(self, ratios: dict[int, float]) -> float | None:
        """Return what contact ratios of meshes, by their numbers, leave."""

        def changed(i: int, mesh: Any) -> Any:
            wave = replace(mesh.waveform, contact_ratio=np.asarray(ratios[i])) if i in ratios else mesh.waveform
            return replace(mesh, waveform=wave)

        return self.left(self._with_meshes(changed))

    def lags(self, more: Array) -> float | None:
        """Return what further lags of the meshes leave."""
        return self.left(self._with_meshes(lambda i, mesh: replace(mesh, lag=np.asarray(mesh.lag) + more[i])))

    def phasing(self, mesh: int, key: str, value: float) -> float | None:
        """Return what another phase in the configuration leaves: the key of a mesh set to a value."""
        return self.left(replaced(self.config.system, ("meshes", mesh, key), value).build())

    def _with_meshes(self, change: Callable[[int, Any], Any]) -> GearSystem:
        return replace(self.system, meshes=tuple(change(i, mesh) for i, mesh in enumerate(self.system.meshes)))


def _rounded_up(number: float) -> float:
    """Three significant digits, as they are printed, not below the number."""
    text = f"{number:.3g}"
    unit = 10.0 ** (np.floor(np.log10(number)) - 2)
    return float(text) if float(text) >= number else float(f"{number + 0.5 * unit:.3g}")
