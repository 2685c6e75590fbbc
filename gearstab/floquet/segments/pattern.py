"""From gear systems to segments of constant stiffness, grouped for the kernels.

A common period is cut at every jump of every mesh. What lies between two jumps is a *segment*; the stiffness
matrices that occur are the *states*, few and independent of the mesh frequency. Rows of the grid whose segments run
through the same states in the same order form a :class:`Pattern`, and a kernel treats a whole pattern at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.segments.reduction import Elastic, reduce
from gearstab.grouping import equal_rows
from gearstab.mesh import Mesh
from gearstab.modal import symmetric_eigen
from gearstab.propagation.schedule import Functions, sources
from gearstab.system import ONLY_MESHES, Array, GearSystem, require

SHORTEST = 2e-15
"""Segments shorter than this part of the common period are rounding errors of coinciding jumps; leaving one out
shifts the phases by w T 2e-15, as much as rounding the period does."""
PROBES = np.array([0.0711, 0.2713, 0.4913, 0.6581, 0.9421])
"""Where a function is looked at between two of its jumps and kinks, in parts of the distance: nowhere symmetric."""
CONSTANT = 1e-14
"""A function that varies by less than this part of its size there is constant but for rounding."""
MOST_BITS = 62
"""Most bits of the number of a state; its sign means that there is none."""


@dataclass(frozen=True)
class Succession:
    """A stack of r rows that share one sequence of S segments over D states.

    rows: ``(r,)``, positions in the flattened batch of the system.
    cycles: N; the common period is N 2 pi/Omega.
    fractions: ``(r, S)``, durations as parts of the common period; they add up to 1.
    start: ``(r,)``, where in the common period (in parts of it, t = 0 is 0) the first segment begins.
    states: ``(S,)``, which state each segment is in.
    """

    rows: Array
    cycles: float
    fractions: Array
    start: Array
    states: Array

    @cached_property
    def successions(self) -> tuple[Array, Array, Array]:
        """States s and what follows them, each pair once: (s + 1 ``(Q,)``, s ``(Q,)``, which pair each segment is).

        A common period may have thousands of segments, but of D states there are at most D^2 changes.
        """
        count, following = int(self.states.max()) + 1, np.roll(self.states, -1)
        if count == len(self.states):
            # Every segment has its own state, as Magnus steps have: nothing comes twice.
            return following, self.states, np.arange(count)
        pairs, index = np.unique(following * count + self.states, return_inverse=True)
        return pairs // count, pairs % count, index

    def pairs(self, inverse: Array, basis: Array) -> tuple[Array, Array]:
        """(distinct products B_{s+1}^-1 B_s ``(r, Q, m, m)``, which of them follows each segment ``(S,)``).

        inverse, basis: ``(r, D, m, m)``, of each state.
        """
        after, before, index = self.successions
        return inverse.take(after, axis=1) @ _of_states(basis, before), index

    def row(self, index: int) -> Self:
        """One of the rows, as a stack of its own."""
        return self.subset(np.array([index]))

    def subset(self, index: Array) -> Self:
        """Some of the rows, by position."""
        return replace(self, rows=self.rows[index], fractions=self.fractions[index], start=self.start[index])

    def durations(self, row: int, omega: Array) -> Array:
        """``(S, P)``, durations of a row's segments, units 1/rate, for mesh frequencies ``(P,)`` in units of rate."""
        return self.fractions[row][:, None] * (2 * np.pi * self.cycles) / omega


@dataclass(frozen=True)
class Pattern(Succession):
    """A succession of segments of n elastic coordinates.

    levels: ``(r, D, meshes)``, the mesh stiffnesses of each state, in the system's own units.
    elastic: the reduced coordinates, in which M = I and time is in units of 1/``elastic.rate``.
    stiffness: ``(r, D, n, n)``, K of each state in these coordinates and units.
    closed: whether the segments make up a period; else the first does not follow the last.
    """

    levels: Array
    elastic: Elastic
    stiffness: Array
    closed: bool = True

    @property
    def size(self) -> int:
        """n, the number of elastic coordinates."""
        return int(self.stiffness.shape[-1])

    @property
    def constant(self) -> bool:
        """Whether there is a single state."""
        return self.stiffness.shape[1] == 1

    @cached_property
    def _eigen(self) -> tuple[Array, Array]:
        return symmetric_eigen(self.stiffness)

    @property
    def squared_frequency(self) -> Array:
        """``(r, D, n)``, eigenvalues of the states' stiffness; negative where a state is unstable by itself."""
        return self._eigen[0]

    @property
    def modes(self) -> Array:
        """``(r, D, n, n)``, orthonormal modes V_d of the states."""
        return self._eigen[1]

    @property
    def stiffness_below_zero(self) -> Array:
        """``(r, D, n)``, which modes of which states are unstable by themselves (before any uniform damping)."""
        return self.squared_frequency + self.elastic.shift[:, None, None] ** 2 < 0

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        after, before, index = self.successions
        # A transposed view is multiplied faster than a transposed copy is made.
        transposed = np.swapaxes(self.modes.take(after, axis=1), -1, -2)
        return transposed @ _of_states(self.modes, before), index

    def change(self, segment: int) -> Array:
        """``(r, n, n)``, V_{s+1}^T V_s: from the modes of a segment to those of the next (of the last to the first)."""
        distinct, index = self._turns
        return distinct[:, index[segment]]

    def changes(self, rows: slice | Array = slice(None)) -> Array:
        """``(r, S, n, n)``, :meth:`change` of all segments, for some of the rows."""
        distinct, index = self._turns
        if np.array_equal(index, np.arange(distinct.shape[1])):
            return distinct[rows]
        return distinct[rows].take(index, axis=1)

    def subset(self, index: Array) -> Self:
        """Some of the rows, by position; eigenproblems that were solved stay so."""
        levels, stiffness = self.levels[index], self.stiffness[index]
        part = replace(super().subset(index), levels=levels, stiffness=stiffness, elastic=self.elastic.subset(index))
        if "_eigen" in vars(self):
            vars(part)["_eigen"] = tuple(values[index] for values in self._eigen)
        return part

    def without_damping(self) -> Pattern:
        """The same rows and coordinates without any damping."""
        free = self.elastic.without_damping()
        return replace(self, elastic=free, stiffness=free.stiffness_of(self.levels))

    def unshifted(self) -> Pattern:
        """The same rows and coordinates with uniform damping as a matrix like any other."""
        own = self.elastic.unshifted()
        stiffness = own.stiffness_of(self.levels) if self.elastic.shift.any() else self.stiffness
        return replace(self, elastic=own, stiffness=stiffness)


def _of_states(values: Array, states: Array) -> Array:
    """``(r, len(states), ...)`` of ``(r, D, ...)``, without a copy where these are all states in order."""
    whole = len(states) == values.shape[1] and np.array_equal(states, np.arange(len(states)))
    return values if whole else values.take(states, axis=1)


def prepare(system: GearSystem) -> list[Pattern]:
    """All rows of a (batched) system over a common period as patterns; every row occurs exactly once.

    Raises ValueError for a system that has no segments of constant, symmetric stiffness.
    """
    _check(system)
    cycles, counts = system.common_period()
    levels = _levels(system)
    edges, bits = _segments_of_rows(system, counts, levels)
    return _patterns(system, float(cycles), edges, bits, levels)


def _check(system: GearSystem) -> None:
    require(system, ONLY_MESHES, "theory in modes")
    smooth = [mesh.name for mesh in system.meshes if not mesh.waveform.piecewise_constant]
    if smooth:
        names = ", ".join(f"'{name}'" for name in smooth)
        raise ValueError(f"waves that are not piecewise constant are not supported here: mesh {names}")


def window(system: GearSystem, cycles: float) -> list[Pattern]:
    """All rows over the first ``cycles`` periods 2 pi/Omega from t = 0, whatever the ratios of the mesh frequencies."""
    _check(system)
    functions = Functions(sources(system, [float(ratio) for ratio in system.frequency_ratios]), system.batch)
    jumps = [functions.jumps_until(k, cycles) for k in range(len(functions.found))]
    edges = [np.zeros((system.rows, 1)), *jumps]
    found = np.sort(np.clip(np.concatenate(edges, axis=1), 0.0, cycles), axis=1)
    middle = found + 0.5 * np.diff(found, axis=1, append=cycles)
    levels = _levels(system)
    bits = _bits(system, levels, [float(mesh.frequency_ratio) for mesh in system.meshes], middle)
    return _patterns(system, cycles, found / cycles, bits, levels, closed=False)


def _patterns(
    system: GearSystem, cycles: float, edges: Array, bits: Array, levels: _Levels, closed: bool = True
) -> list[Pattern]:
    """Rows grouped by their sequence of states: ``edges`` (rows, S) in parts of ``cycles`` and what follows each."""
    count = len(edges)
    lengths = np.diff(edges, axis=1, append=edges[:, :1] + 1 if closed else np.ones((count, 1)))
    signature = np.where(lengths > SHORTEST, bits, -1)
    patterns = []
    for elastic in reduce(system):
        for index, key in equal_rows(signature[elastic.rows]):
            members = elastic.rows[index]
            states, fractions, start = merged(key, lengths[members], edges[members], closed)
            unique, state = np.unique(states, return_inverse=True)
            at = _levels_of(unique, levels.widths)
            chosen = levels.table[members[:, None, None], np.arange(at.shape[1]), at]
            part = elastic.subset(index)
            stiffness = part.stiffness_of(chosen)
            patterns.append(Pattern(members, cycles, fractions, start, state, chosen, part, stiffness, closed))
    return patterns


def _segments_of_rows(system: GearSystem, counts: tuple[int, ...], levels: _Levels) -> tuple[Array, Array]:
    """Jumps ``(rows, S)`` in [0, 1), ascending, and the levels of all meshes after each, as bits ``(rows, S)``."""
    functions = Functions(sources(system, counts), system.batch)
    edges = [functions.jumps(k) for k in range(len(system.meshes))] or [np.zeros((system.rows, 1))]
    found = np.concatenate(edges, axis=1)
    found = np.sort(found - np.floor(found), axis=1)
    found = np.where(found >= 1.0, 0.0, found)
    found.sort(axis=1)
    middle = found + 0.5 * np.diff(found, axis=1, append=found[:, :1] + 1)
    return found, _bits(system, levels, counts, middle)


def _level_at(system: GearSystem, mesh: Mesh, phase: Array) -> Array:
    """Which level the mesh has at the given phases (rows, S); the first where its stiffness does not vary."""
    x = (phase - system.flat(mesh.lag)[:, None]).T
    level = mesh.waveform.level_at(x.reshape(-1, *system.batch)).reshape(x.shape).T
    return np.where(system.flat(mesh.epsilon)[:, None] != 0, level, 0)


@dataclass(frozen=True)
class _Levels:
    """The levels of the mesh stiffnesses, ``table`` (rows, meshes, L), and how many bits number those of a mesh."""

    table: Array
    widths: tuple[int, ...]


def _levels(system: GearSystem) -> _Levels:
    """The levels of each mesh, the softer and the stiffer one of most; all the mean where it does not vary."""
    waves = [mesh.waveform.levels() for mesh in system.meshes]
    counts = [wave.shape[-1] for wave in waves]
    table = np.zeros((system.rows, len(waves), max(counts, default=1)))
    for i, (mesh, wave) in enumerate(zip(system.meshes, waves, strict=True)):
        own = np.asarray(mesh.mean_stiffness)[..., None] + 2 * np.asarray(mesh.amplitude)[..., None] * wave
        table[:, i, : counts[i]] = system.flat(own, 1)
    return _Levels(table, tuple(max(1, (count - 1).bit_length()) for count in counts))


def _bits(system: GearSystem, levels: _Levels, counts: Sequence[float], place: Array) -> Array:
    """The levels of all meshes as bits ``(rows, S)``, at places ``(rows, S)`` in which they have so many cycles."""
    bits = np.zeros(place.shape, dtype=np.int64)
    for shift, mesh, n in zip(_shifts(levels.widths), system.meshes, counts, strict=True):
        bits |= _level_at(system, mesh, n * place) << shift
    return bits


def _shifts(widths: Sequence[int]) -> list[int]:
    """Where the bits of each mesh begin. Raises NotPossible for more of them than a number has."""
    if sum(widths) > MOST_BITS:
        raise NotPossible("the meshes have too many levels of stiffness", "give fewer faults, or fewer meshes")
    return [sum(widths[:i]) for i in range(len(widths))]


def _levels_of(bits: Array, widths: Sequence[int]) -> Array:
    """The level of each mesh ``(D, meshes)`` from the bits of the states ``(D,)``."""
    return (bits[:, None] >> np.array(_shifts(widths), dtype=int)) & ((1 << np.array(widths, dtype=int)) - 1)


def merged(key: Array, lengths: Array, edges: Array, closed: bool = True) -> tuple[Array, Array, Array]:
    """Leave out segments of state -1 in ``key`` (S,), join neighbours in the same state; (states, fractions, start).

    closed: whether the first segment follows the last.
    """
    kept = np.flatnonzero(key >= 0)
    states = key[kept]
    changed = states != np.roll(states, 1)
    changed[0] |= not closed
    first = np.flatnonzero(changed)
    if len(first) == 0:
        return states[:1], np.ones((len(lengths), 1)), edges[:, kept[0]]
    owner = (np.cumsum(changed) - 1) % len(first)
    fractions = np.zeros((len(first), len(lengths)))
    np.add.at(fractions, owner, lengths[:, kept].T)
    return states[first], np.ascontiguousarray(fractions.T), edges[:, kept[first[0]]]
