"""Instability regions of a batch: ragged as found, and as one array over tongues and rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.perturbation.tongues import Tongue
from gearstab.system import Array

BOUNDARY_FLAGS = {
    "open": 1, "merged": 2, "absorbed": 4, "cut_below": 8, "cut_above": 16, "split": 32, "sampled": 64, "coarse": 128,
}  # fmt: skip
"""Bits of the flags of a tongue: it has a region; that region holds other tongues too; it lies in the region of
another tongue (its own edges are NaN); the region goes on below the lowest, above the highest mesh frequency (its
edge is that of the range); the tongue has several regions, told apart by their occurrence; of stable mesh frequencies
of the row some are neither proved nor counted, but sampled about all meetings of multipliers; or in equal steps only,
so that regions and stable gaps narrower than these may be missing. Neither open nor absorbed: closed, or narrower than
the width floor."""


ROUNDING = 1e-9
"""Rounding error of a share of the range."""


def sampled(step: float, coarse: int, systems: int) -> str:
    """Return how mesh frequencies were searched that are neither proved stable nor counted.

    step: of the samples, relative. coarse: how many of the systems were sampled in equal steps only.
    """
    words = f"sampled where two multipliers meet, to a step of {step:.2g} of them"
    if not coarse:
        return words
    where = "" if coarse == systems == 1 else f" of {coarse:,} of {systems:,} systems"
    return f"{words}; those{where} in equal steps only, so that narrower regions and stable gaps may be missing"


@dataclass(frozen=True)
class Boundaries:
    """All instability regions of ``rows`` rows within the limits [start, stop], ordered by row and mesh frequency.

    row ``(regions,)``; lower, upper ``(regions,)``: edges in the mesh frequency Omega of the first mesh, rad per unit
    time. tolerance ``(regions,)``: half of the larger of the two brackets that enclose the edges, relative to Omega.
    cut ``(regions, 2)`` bool: whether the lower, upper edge is that of the range and not of the region.
    tongues: all that occur. owner, member ``(entries,)``: which region, ascending, has which of them; of a region the
        one that accounts for most of the growing motion comes first; there are more where tongues have merged.
    contacts ``(rows,)``: collisions of multipliers that open no region as wide as ``width_floor`` (relative to Omega).
    evaluations ``(rows,)``: monodromy matrices computed, and proofs tried.
    proved: of each row, ``(K, 2)`` stretches of Omega, disjoint and ascending, that are proved stable (in floating
        point, see :mod:`gearstab.floquet.kernel.c_points`). counted: those stable ones that are not, but where a count
        of collisions, or a scan with the step that damping sets, has found nothing.
    sampled_step: ``(rows,)``, the largest distance of the samples in the rest, relative to Omega; 0 where there is no
        rest. coarse ``(rows,)``: whether only these were looked at, and not all meetings of multipliers between them.
    """

    rows: int
    row: Array
    lower: Array
    upper: Array
    tolerance: Array
    cut: Array
    tongues: tuple[Tongue, ...]
    owner: Array
    member: Array
    contacts: Array
    evaluations: Array
    width_floor: float
    proved: tuple[Array, ...]
    counted: tuple[Array, ...]
    sampled_step: Array
    coarse: Array
    limits: tuple[float, float]

    @cached_property
    def members(self) -> tuple[tuple[Tongue, ...], ...]:
        """The tongues of each region."""
        found: list[tuple[Tongue, ...]] = [()] * len(self.row)
        for region, k in zip(self.owner.tolist(), self.member.tolist(), strict=True):
            found[region] = (*found[region], self.tongues[k])
        return tuple(found)

    def edges_of(self, row: int) -> Array:
        """Return all edges of a row within the limits, ascending."""
        own = self.row == row
        edges = np.stack([self.lower, self.upper], axis=1)[own][~self.cut[own]]
        return np.sort(edges[(edges > self.limits[0]) & (edges < self.limits[1])])

    def stable_share(self, stretches: tuple[Array, ...]) -> Array:
        """``(rows,)``: which part of the stable mesh frequencies these stretches make up; NaN where none is stable."""
        length = np.array([np.ptp(parts, axis=1).sum() for parts in stretches])
        start, stop = self.limits
        stable = stop - start - np.bincount(self.row, self.upper - self.lower, minlength=self.rows)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(stable > ROUNDING * stop, length / stable, np.nan)
        return np.where(np.abs(share - 1) < ROUNDING, 1.0, share)

    def uncovered(self) -> str | None:
        """Return one line on what is neither proved nor counted, None where there is nothing, or nothing stable."""
        known = self.stable_share(self.proved) + self.stable_share(self.counted)
        rest = (self.sampled_step > 0) & np.isfinite(known)
        if not rest.any():
            return None
        share = float(np.where(rest, 1 - known, 0.0)[np.isfinite(known)].mean())
        words = f"{100 * max(share, 0.0):.3g} % of the stable mesh frequencies are neither proved nor counted"
        return f"{words}: {sampled(self.sampled_step.max(), self.coarse.sum(), self.rows)}"

    def stretches(self, parts: tuple[Array, ...]) -> Array:
        """``(K, 2, rows)``: stretches of all rows, NaN where a row has fewer; gaps below the width floor bridged."""
        bridged = [_bridged(own, self.width_floor) for own in parts]
        result = np.full((max((len(own) for own in bridged), default=0), 2, self.rows), np.nan)
        for row, own in enumerate(bridged):
            result[: len(own), :, row] = own
        return result

    def labels(self) -> list[str]:
        """Return the label of each region; the tongues of a merged one are joined by " & "."""
        return [" & ".join(t.label for t in members) for members in self.members]

    def arranged(self) -> Edges:
        """One array over all tongues that occur in any row."""
        keys, which = self._occurrences()
        order = sorted(range(len(keys)), key=lambda k: _order(keys[k]))
        place = np.argsort(order).astype(np.int32)[which]
        index = tuple(keys[k] for k in order)
        row, leading = self.row[self.owner], np.searchsorted(self.owner, self.owner)
        first = leading == np.arange(len(leading))
        edges = np.full((len(index), 2, self.rows), np.nan)
        tolerance = np.full((len(index), self.rows), np.nan)
        flags = np.zeros((len(index), self.rows), dtype=np.int16)
        holder = np.full((len(index), self.rows), -1, dtype=np.int32)
        holder[place, row] = place[leading]
        flags[place[~first], row[~first]] = BOUNDARY_FLAGS["absorbed"]
        there = place[first], self.row
        edges[there[0], 0, there[1]], edges[there[0], 1, there[1]] = self.lower, self.upper
        tolerance[there], flags[there] = self.tolerance, self._flags()
        tongues: dict[Tongue, list[int]] = {}
        for k, (named, _) in enumerate(index):
            tongues.setdefault(named, []).append(k)
        for same in tongues.values():
            several = np.sum(flags[same] & BOUNDARY_FLAGS["open"] > 0, axis=0) > 1
            flags[same] |= np.where((flags[same] > 0) & several, BOUNDARY_FLAGS["split"], 0).astype(np.int16)
        rest = np.where(self.coarse, BOUNDARY_FLAGS["coarse"], BOUNDARY_FLAGS["sampled"])
        flags |= np.where(self.sampled_step > 0, rest, 0).astype(np.int16)
        return Edges(index, edges, tolerance, flags, holder)

    def leading(self) -> list[tuple[Tongue, int]]:
        """Return under which (tongue, occurrence) each region stands."""
        keys, which = self._occurrences()
        return [keys[k] for k in which[np.searchsorted(self.owner, np.arange(len(self.row)))]]

    def _occurrences(self) -> tuple[list[tuple[Tongue, int]], Array]:
        """All (tongue, occurrence), and which of them each member of each region is."""
        group = self.row[self.owner] * len(self.tongues) + self.member
        order = np.argsort(group, kind="stable")
        begin = np.searchsorted(group[order], group[order])
        occurrence = np.empty_like(group)
        occurrence[order] = np.arange(len(group)) - begin
        most = int(occurrence.max(initial=0)) + 1
        pairs, which = np.unique(self.member * most + occurrence, return_inverse=True)
        return [(self.tongues[k // most], k % most) for k in pairs.tolist()], which

    def _flags(self) -> Array:
        """Return the flags of the tongue to which each region belongs."""
        merged = np.bincount(self.owner, minlength=len(self.row)) > 1
        found = np.full(len(self.row), BOUNDARY_FLAGS["open"])
        for name, where in zip(("merged", "cut_below", "cut_above"), (merged, *self.cut.T), strict=True):
            found[where] |= BOUNDARY_FLAGS[name]
        return found


def _bridged(parts: Array, floor: float) -> Array:
    """Ascending disjoint stretches ``(K, 2)``, neighbours joined over gaps narrower than ``floor``, relative."""
    if len(parts) < 2:
        return parts
    apart = parts[1:, 0] > parts[:-1, 1] * (1 + floor)
    return np.stack([parts[np.append(True, apart), 0], parts[np.append(apart, True), 1]], axis=1)


@dataclass(frozen=True)
class Edges:
    """Instability regions over (tongue, rows), every region once: under the first of its tongues.

    index: (tongue, occurrence); the occurrence counts, from 0 and by ascending mesh frequency, the regions of one row
    with the same tongue. boundary_frequency ``(tongue, 2, rows)``: lower and upper edge in Omega; NaN where the
    tongue is closed or absorbed. tolerance ``(tongue, rows)``; flags ``(tongue, rows)``: bits of BOUNDARY_FLAGS.
    holder ``(tongue, rows)``: position in ``index`` of the tongue under which the region stands; -1 where there is
    none.
    """

    index: tuple[tuple[Tongue, int], ...]
    boundary_frequency: Array
    tolerance: Array
    flags: Array
    holder: Array


def union(indices: Iterable[Sequence[tuple[Tongue, int]]]) -> tuple[tuple[Tongue, int], ...]:
    """All (tongue, occurrence) of several lists, each once, in the order of :class:`Edges`."""
    return tuple(sorted({key for index in indices for key in index}, key=_order))


def _order(key: tuple[Tongue, int]) -> tuple[float, int, int, int]:
    member, occurrence = key
    return member.frequency_ratio, member.mode_p, member.mode_q, occurrence
