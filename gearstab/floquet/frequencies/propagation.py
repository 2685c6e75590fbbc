"""Vectors carried along a window of time: the growth of solutions of a block of coordinates, recorded again and again.

The order of the segments does not depend on the mesh frequency, so that all mesh frequencies go through them side by
side, each with its own durations.

Stiffness that is not piecewise constant is cut into Magnus steps first. Each is a product of a few exponentials, which
are segments of constant stiffness (:mod:`~gearstab.floquet.smooth.steps`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.kernel import damped
from gearstab.floquet.kernel.factors import rotation
from gearstab.floquet.segments.pattern import CONSTANT, PROBES, SHORTEST, Pattern
from gearstab.floquet.segments.reduction import Elastic, reduce
from gearstab.floquet.smooth.steps import CF6_5, exponentials, in_steps
from gearstab.propagation.schedule import Functions, sources
from gearstab.system import Array, GearSystem

SOFTEST = 1e-6
"""Stiffness below this part of the largest counts as this in the size of a state, which must be a norm."""
VECTORS = 8
"""Solutions carried side by side."""
ADMIXTURE = 0.01
"""Part of random vectors in the start."""


class Conservative:
    """Vectors in the coordinates of one state after another: rotations in the modes of each."""

    def __init__(self, pattern: Pattern, omega: Array, start: Array) -> None:
        self._pattern, self._inverse = pattern, pattern.cycles / omega
        n = pattern.size
        modes = pattern.modes[0, pattern.states[0]]
        self._x = np.repeat((modes.T @ start.reshape(2, n, -1))[..., None], len(omega), axis=-1)

    def step(self, segment: int) -> Array:
        """Go through a segment, into the coordinates of the next; the logarithm ``(P,)`` of what was taken out."""
        pattern, x = self._pattern, self._x
        squared = pattern.squared_frequency[0, pattern.states[segment]]
        terms, growth = rotation(squared, pattern.fractions[0, segment], self._inverse)
        cosine, over, times = terms[:, :, None, :]
        moved = np.empty_like(x)
        moved[0] = cosine * x[0] + over * x[1]
        moved[1] = times * x[0] + cosine * x[1]
        if segment + 1 < len(pattern.states):
            moved = np.matmul(pattern.change(segment)[0], moved.reshape(*x.shape[:2], -1)).reshape(x.shape)
        self._x = moved
        return growth

    def state(self, segment: int) -> Array:
        """``(m, k, P)``, (u, u', ...) in the elastic coordinates, given the segment whose coordinates are in use."""
        modes = self._pattern.modes[0, self._pattern.states[segment]]
        x = self._x
        return np.matmul(modes, x.reshape(*x.shape[:2], -1)).reshape(-1, *x.shape[2:])

    def set(self, vectors: Array, segment: int) -> None:
        """Go on with other vectors ``(m, k, P)``, as :meth:`state` gives them."""
        modes, shape = self._pattern.modes[0, self._pattern.states[segment]], self._x.shape
        self._x = np.matmul(modes.T, vectors.reshape(*shape[:2], -1)).reshape(shape)


class Damped:
    """The same of a damped system: damped rotations in the real modal coordinates of each state."""

    def __init__(self, pattern: Pattern, omega: Array, start: Array) -> None:
        self._pattern = pattern
        self._omega = omega
        self._generator = damped.generators(pattern)
        self._modal = bool(self._generator.well_conditioned[0])
        self._z = np.repeat(start[..., None], len(omega), axis=-1)
        if self._modal:
            self._values, self._basis, self._inverse = (part[0] for part in self._generator.real_modes)
            partner = np.arange(self._values.shape[-1]) + np.sign(self._values.imag).astype(int)
            self._partner = partner
            self._distinct, self._index = pattern.pairs(self._inverse[None], self._basis[None])
            self._z = np.tensordot(self._inverse[pattern.states[0]], self._z, axes=1)

    def step(self, segment: int) -> Array:
        pattern = self._pattern
        state = int(pattern.states[segment])
        duration = pattern.fractions[0, segment] * 2 * np.pi * pattern.cycles / self._omega
        if not self._modal:
            factor = damped.exponential(self._generator, 0, state, duration)
            self._z = np.einsum("pij,jkp->ikp", factor, self._z)
            return self._generator.eigen[0][0, state].real.max() * duration
        values, z = self._values[state], self._z
        fastest = values.real.max()
        decay = np.exp((values.real - fastest)[:, None] * duration)[:, None]
        angle = (values.imag[:, None] * duration)[:, None]
        z = decay * (np.cos(angle) * z + np.sin(angle) * z[self._partner[state]])
        if segment + 1 < len(pattern.states):
            z = np.matmul(self._distinct[0, self._index[segment]], z.reshape(len(z), -1)).reshape(z.shape)
        self._z = z
        return fastest * duration

    def state(self, segment: int) -> Array:
        return np.tensordot(self._basis[self._pattern.states[segment]], self._z, axes=1) if self._modal else self._z

    def set(self, vectors: Array, segment: int) -> None:
        inverse = self._inverse[self._pattern.states[segment]] if self._modal else None
        self._z = vectors if inverse is None else np.tensordot(inverse, vectors, axes=1)


def weights(pattern: Pattern) -> Array:
    """``(m,)``, W: |W x| is the square root of twice the energy of x in the springs of the mean state, about."""
    stiffness = np.abs(np.einsum("dii->di", pattern.stiffness[0])).mean(axis=0)
    result = np.ones(pattern.elastic.state_size)
    result[: pattern.size] = np.sqrt(np.maximum(stiffness, SOFTEST * max(float(np.abs(stiffness).max()), 1e-300)))
    return result


def frame(pattern: Pattern, seed: int) -> Array:
    """``(m, k)``: where the vectors start, orthonormal in the norm |W x|.

    Of a damped system they are the slowest to decay with constant mean stiffness: two vectors of which one decays a
    little faster than the other would take long to tell apart. ADMIXTURE makes sure that no solution is left out.
    """
    w, size = weights(pattern)[:, None], pattern.elastic.state_size
    random = np.random.default_rng(seed).standard_normal((size, min(size, VECTORS)))
    if not pattern.elastic.conservative and size > VECTORS:
        mean = np.einsum("s,sij->ij", pattern.fractions[0], pattern.stiffness[0, pattern.states])
        still = replace(pattern, stiffness=mean[None, None])
        values, vectors, _ = (part[0, 0] for part in damped.generators(still).eigen)
        order = np.argsort(-values.real)
        chosen = [k for k in order if values[k].imag >= 0][:VECTORS]
        parts = [part for k in chosen for part in (vectors[:, k].real, vectors[:, k].imag)[: 1 + (values[k].imag > 0)]]
        slowest = w * np.stack(parts[:VECTORS], axis=-1)
        random = slowest / np.linalg.norm(slowest, axis=0) + ADMIXTURE * random / np.sqrt(size)
    return np.linalg.qr(random)[0] / w


def growths(pattern: Pattern, omega: Array, records: int, seed: int) -> tuple[Array, Array]:
    """(parts of the window ``(R + 1,)``, ln of the growth up to there ``(R + 1, k + 1, P)``) of a pattern of one row.

    The frame is carried along and made orthonormal again at each record, X = Q R: the growth in the direction i, which
    is orthogonal to all before it, is |R_ii|. The last growth is the largest of all solutions that start in the frame,
    the norm of R ... R. It finds a strong growth at once, but takes a solution that has grown for a while and now
    decays faster for the largest too long; the directions tell these apart, but take time to turn towards the growth.
    """
    w = weights(pattern)[:, None, None]
    start = frame(pattern, seed)
    moving = (Conservative if pattern.elastic.conservative else Damped)(pattern, omega, start)
    count = len(pattern.states)
    ends = np.unique(np.linspace(0, count, min(records, count) + 1).astype(int))[1:]
    times = np.concatenate([[0.0], np.cumsum(pattern.fractions[0])[ends - 1]])
    vectors = start.shape[1]
    logs = np.zeros((len(times), vectors + 1, len(omega)))
    product = np.broadcast_to(np.eye(vectors), (len(omega), vectors, vectors))
    for r, (first, last) in enumerate(zip([0, *ends[:-1]], ends, strict=True)):
        taken = np.zeros(len(omega))
        for segment in range(first, last):
            taken += moving.step(segment)
        segment = min(last, count - 1)
        basis, triangle = np.linalg.qr(np.moveaxis(w * moving.state(segment), -1, 0))
        moving.set(np.moveaxis(basis, 0, -1) / w, segment)
        product = triangle @ product
        largest = np.sqrt(np.linalg.eigvalsh(np.swapaxes(product, -1, -2) @ product)[:, -1])
        product = product / largest[:, None, None]
        size = np.concatenate([np.abs(np.diagonal(triangle, axis1=-2, axis2=-1)), largest[:, None]], axis=1).T
        logs[r + 1] = logs[r] + taken + np.log(np.maximum(size, np.finfo(float).tiny))
    return times, logs


@dataclass(frozen=True)
class Window:
    """One row of a system over ``cycles`` periods 2 pi/Omega from t = 0.

    row: position in the flattened batch. elastic: its reduced coordinates. start, length ``(Q,)``: of the pieces, in
    periods 2 pi/Omega. constant ``(Q,)`` bool.
    """

    functions: Functions
    row: int
    elastic: Elastic
    cycles: float
    start: Array
    length: Array
    constant: Array

    def pattern(self, steps: int) -> Pattern:
        """Return the pattern with about so many steps per period of the fastest mesh."""
        density = steps * max(source.cycles for source in self.functions.found)
        counts = np.where(self.constant, 1, np.ceil(density * self.length)).astype(int)
        start, length, piece = in_steps(self.start[None], self.length[None], counts)
        row = np.array([self.row])
        durations, levels = exponentials(self.functions, row, start, length, self.constant[piece], CF6_5)
        fractions, every = durations / self.cycles, self.elastic.stiffness_of(levels)
        states, begin = np.arange(fractions.shape[1]), np.zeros(1)
        return Pattern(row, self.cycles, fractions, begin, states, levels, self.elastic, every, closed=False)


def windows(system: GearSystem, cycles: float) -> Iterator[Window]:
    """Every row once."""
    functions = Functions(sources(system, [float(ratio) for ratio in system.frequency_ratios]), system.batch)
    ends = np.broadcast_to([0.0, cycles], (system.rows, 2))
    jumps = [
        np.where(functions.varies(k)[:, None], functions.jumps_until(k, cycles), 0.0)
        for k in range(len(functions.found))
    ]
    every = np.clip(np.concatenate([ends, *jumps], axis=1), 0.0, cycles)
    for elastic in reduce(system):
        for k, row in enumerate(elastic.rows):
            edges = np.unique(every[row])
            length = np.diff(edges)
            start, length = edges[:-1][length > SHORTEST * cycles], length[length > SHORTEST * cycles]
            place = start[:, None] + length[:, None] * PROBES
            known = functions(np.array([row]), place.reshape(1, -1)).reshape(*place.shape, -1)
            constant = np.all(np.ptp(known, axis=1) <= CONSTANT * np.abs(known).max(axis=1), axis=-1)
            yield Window(functions, int(row), elastic.subset(np.array([k])), cycles, start, length, constant)
