"""When what changes: the intervals of a common period in which everything is smooth, and the functions that vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod

import numpy as np

from gearstab.mesh import PeriodicTerm
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Profile, Waveform

MERGED = 2e-15
"""Edges closer than this part of the common period are one edge but for rounding; what lies between is left out."""


@dataclass(frozen=True)
class Source:
    """A function of time: offset + scale profile(cycles tau - lag), of any batch.

    tau: the part of the common period that has passed, or of 2 pi/Omega where there is none. cycles: in that.
    """

    profile: Profile
    cycles: float
    lag: Array
    offset: Array
    scale: Array


def sources(system: GearSystem, counts: Sequence[float]) -> tuple[Source, ...]:
    """Coefficients that vary: the mesh stiffnesses, then all profiles of the terms.

    counts: how many cycles of each are in the unit of time.
    """
    meshes = len(system.meshes)
    found = []
    for mesh, count in zip(system.meshes, counts[:meshes], strict=True):
        lag, mean = np.asarray(mesh.lag), np.asarray(mesh.mean_stiffness)
        found.append(Source(mesh.waveform, count, lag, mean, 2 * mesh.amplitude))
    zero, one = np.zeros(()), np.ones(())
    for term, count in zip(system.terms, counts[meshes:], strict=True):
        found += [Source(profile, count, np.asarray(term.lag), zero, one) for profile in term.profiles]
    return tuple(found)


def acting(term: PeriodicTerm) -> list[tuple[bool, Profile]]:
    """Return the functions of a term in their order, each with whether it acts on velocities."""
    every = ((False, term.stiffness), (True, term.damping))
    return [(on_velocity, profile) for on_velocity, profile in every if profile is not None]


@dataclass(frozen=True)
class Functions:
    """The functions that vary, for all rows of a batch at any time."""

    found: tuple[Source, ...]
    batch: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Rows of the flattened batch."""
        return prod(self.batch)

    def flat(self, values: Array, core: int = 0) -> Array:
        """Return values ``(..., *core)`` of the batch as ``(rows, *core)``."""
        tail = values.shape[values.ndim - core :]
        return np.broadcast_to(values, (*self.batch, *tail)).reshape(self.rows, *tail)

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array]:
        """Offset, scale and lag of each function, ``(J, rows)``."""
        table = [(source.offset, source.scale, source.lag) for source in self.found]
        parts = (np.array([*map(self.flat, part)]) for part in zip(*table, strict=True))
        offset, scale, lag = parts
        return offset, scale, lag

    def jumps(self, index: int) -> Array:
        """``(rows, X)``: jumps and kinks of a function within the unit of time, in no order, modulo whole numbers."""
        source = self.found[index]
        at = self.flat(source.profile.breakpoints() + source.lag[..., None], 1)
        return np.asarray((at[:, :, None] + np.arange(source.cycles)) / source.cycles).reshape(self.rows, -1)

    def jumps_until(self, index: int, end: float) -> Array:
        """``(rows, X)``: those of a function from 0 to ``end``, where there is no common period, and some beyond."""
        source = self.found[index]
        at = self.flat(source.profile.breakpoints() + source.lag[..., None], 1)
        low, high = at.min(initial=np.inf), at.max(initial=-np.inf)
        turns = np.arange(np.floor(-high), np.ceil(source.cycles * end - low) + 1) if at.size else np.zeros(0)
        return np.asarray((at[:, :, None] + turns) / source.cycles).reshape(self.rows, -1)

    def varies(self, index: int) -> Array:
        """``(rows,)``: whether a function has any variation."""
        return np.asarray(self._rows[1][index] != 0)

    def offsets(self, rows: Array) -> Array:
        """``(r, J)``, what is added to the profiles: the means of the mesh stiffnesses."""
        return np.asarray(self._rows[0].T[rows])

    def lowest(self, rows: Array) -> Array:
        """``(r, J)``, the least values of waves."""
        least = []
        for source, offset, scale in zip(self.found, *self._rows[:2], strict=True):
            assert isinstance(source.profile, Waveform)
            least.append((offset + scale * self.flat(np.asarray(source.profile.extremes()[0])))[rows])
        return np.stack(least, axis=-1)

    def __call__(self, rows: Array, tau: Array) -> Array:
        """``(r, X, J)``: all functions of ``rows`` (r,) at the times ``(r, X)``, which should not be on a jump."""
        result = np.empty((*tau.shape, len(self.found)))
        alike = len(tau) == 1 or bool(np.all(tau == tau[:1]))
        known: dict[tuple[int, float, bytes], Array] = {}
        for j, (source, offset, scale, lags) in enumerate(zip(self.found, *self._rows, strict=True)):
            lag = lags[rows, None]
            # Planets in phase have one wave among them.
            key = id(source.profile), source.cycles, lag.tobytes()
            if key not in known:
                # Often the same times for all rows.
                once = alike and bool(np.all(lag == lag[0]))
                known[key] = self._profile(source.profile, rows, source.cycles * tau - lag, once)
            result[..., j] = offset[rows, None] + scale[rows, None] * known[key]
        return result

    def _profile(self, profile: Profile, rows: Array, phase: Array, alike: bool) -> Array:
        """``(r, X)``, a profile at the phases ``(r, X)``; ``(1, X)`` where rows are ``alike`` in these."""
        if profile.batch == ():
            return profile.value(phase[:1] if alike else phase)
        every = np.zeros((phase.shape[1], self.rows))
        every[:, rows] = phase.T
        every = profile.value(every.reshape(-1, *self.batch)).reshape(every.shape)
        return every[:, rows].T


@dataclass(frozen=True)
class Schedule:
    """The smooth intervals of rows: ``edges (r, S + 1)`` in parts of the common period, from 0 to 1.

    rows: ``(r,)``, positions in the flattened batch of the functions.
    """

    functions: Functions
    edges: Array
    rows: Array

    def subset(self, index: Array) -> Schedule:
        """Some of the rows, by position."""
        return replace(self, edges=self.edges[index], rows=self.rows[index])

    @property
    def lengths(self) -> Array:
        """``(r, S)``; 0 where edges coincide."""
        return np.diff(self.edges, axis=1)

    def values(self, tau: Array) -> Array:
        """``(r, X, J)``: all functions at the times ``tau (r, X)``, which should not be on an edge."""
        return self.functions(self.rows, tau)


def schedule(system: GearSystem) -> Schedule:
    """Cut the common period of every row at all jumps and kinks."""
    return divided(Functions(sources(system, system.common_period()[1]), system.batch))


def distinct(values: Array) -> tuple[Array, Array]:
    """Return the state of each interval ``(S,)``, and where each occurs first, from all functions ``(r, S, J)``."""
    table = np.moveaxis(values, 1, 0).reshape(values.shape[1], -1)
    _, first, states = np.unique(table, axis=0, return_index=True, return_inverse=True)
    return np.ravel(states), first


def divided(functions: Functions) -> Schedule:
    """Cut the common period at the jumps and kinks of any functions."""
    rows = functions.rows
    cuts = [np.zeros((rows, 1)), np.ones((rows, 1))]
    for index in range(len(functions.found)):
        at = functions.jumps(index)
        cuts.append(at - np.floor(at))
    edges = np.sort(np.concatenate(cuts, axis=1), axis=1)
    close = np.diff(edges, axis=1) < MERGED
    # An interval of no length rather than one edge less: all rows keep equally many.
    edges[:, 1:] = np.where(close, edges[:, :-1], edges[:, 1:])
    edges[:, -1] = 1.0
    return Schedule(functions, edges, np.arange(rows))
