"""When what changes: the intervals of a common period in which everything is smooth, and their division into steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import prod

import numpy as np

from gearstab.system import Array, GearSystem
from gearstab.waveforms import Profile

MERGED = 2e-15
"""Edges closer than this part of the common period are one edge but for rounding; what lies between is left out."""


@dataclass(frozen=True)
class Source:
    """A function of time: profile(cycles tau - lag), tau being the part of the common period that has passed.

    profile and lag of any batch; ``scale`` and ``offset``: what is added to the generator is offset + scale profile.
    """

    profile: Profile
    cycles: int
    lag: Array
    offset: Array
    scale: Array


def sources(system: GearSystem, counts: tuple[int, ...]) -> list[Source]:
    """What varies: the mesh stiffnesses, then all profiles of the terms.

    counts: how many cycles of each are in the common period.
    """
    meshes = len(system.meshes)
    found = []
    for mesh, count in zip(system.meshes, counts[:meshes], strict=True):
        lag, mean = np.asarray(mesh.lag), np.asarray(mesh.mean_stiffness)
        found.append(Source(mesh.waveform, count, lag, mean, 2 * mesh.amplitude))
    zero, one = np.zeros(()), np.ones(())
    for term, count in zip(system.terms, counts[meshes:], strict=True):
        found += [Source(profile, count, np.asarray(term.lag), zero, one) for profile in term.profiles]
    return found


@dataclass(frozen=True)
class Schedule:
    """The smooth intervals of rows: ``edges (rows, S + 1)`` in parts of the common period, from 0 to 1.

    found: the functions, of the whole batch. rows: positions in the flattened batch; None: all, in their order.
    """

    found: list[Source]
    batch: tuple[int, ...]
    edges: Array
    rows: Array | None = None

    def subset(self, index: Array) -> Schedule:
        """Some of the rows, by position."""
        return replace(self, edges=self.edges[index], rows=index if self.rows is None else self.rows[index])

    @property
    def lengths(self) -> Array:
        """``(rows, S)``; 0 where edges coincide."""
        return np.diff(self.edges, axis=1)

    def values(self, tau: Array) -> Array:
        """``(rows, X, J)``: all functions at the times ``tau (rows, X)``, which should not be on an edge."""
        if self.rows is not None:
            every = np.zeros((prod(self.batch), tau.shape[1]))
            every[self.rows] = tau
            return replace(self, rows=None).values(every)[self.rows]
        rows, count = tau.shape
        result = np.empty((rows, count, len(self.found)))
        shaped = np.moveaxis(tau.reshape(*self.batch, count), -1, 0)
        for j, source in enumerate(self.found):
            f = source.offset + source.scale * source.profile.value(source.cycles * shaped - source.lag)
            f = np.broadcast_to(f, (count, *self.batch))
            result[:, :, j] = np.moveaxis(f, 0, -1).reshape(rows, count)
        return result


def schedule(system: GearSystem) -> Schedule:
    """Cut the common period of every row at all jumps and kinks."""
    return divided(system, sources(system, system.common_period()[1]))


def divided(system: GearSystem, found: list[Source]) -> Schedule:
    """Cut the common period at the jumps and kinks of any functions of the system's batch."""
    rows = system.rows
    cuts = [np.zeros((rows, 1)), np.ones((rows, 1))]
    for source in found:
        at = system.flat(source.profile.breakpoints() + source.lag[..., None], 1)
        at = ((at[:, :, None] + np.arange(source.cycles)) / source.cycles).reshape(rows, -1)
        cuts.append(at - np.floor(at))
    edges = np.sort(np.concatenate(cuts, axis=1), axis=1)
    close = np.diff(edges, axis=1) < MERGED
    # An interval of no length rather than one edge less: all rows keep equally many.
    edges[:, 1:] = np.where(close, edges[:, :-1], edges[:, 1:])
    edges[:, -1] = 1.0
    return Schedule(found, system.batch, edges)
