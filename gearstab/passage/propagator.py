"""The motion while the mesh frequency changes, exactly: from jump to jump of the mesh stiffness.

The state x = (w u, u', b') is that of :mod:`gearstab.linear.first_order`: |x|^2 is twice the energy of the elastic
vibration, with the mean mesh stiffness, in units of the modes. A mesh has the stiffness of its phase, r theta(t)/2 pi -
lag, so that the instants of jumps follow from the phase theta(t); between them the propagator is the exponential of a
constant matrix, or Magnus steps of sixth order where a wave is smooth.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil

import numpy as np

from gearstab.linear import magnus
from gearstab.linear.eigen import Eigen, diagonalised
from gearstab.linear.first_order import Basis, bases
from gearstab.linear.path import Path
from gearstab.linear.schedule import Schedule, schedule
from gearstab.system import Array, GearSystem

MOST = 4_000_000
"""Segments of a ramp that are followed."""
ENTRIES = 1 << 20
"""Of the matrices of segments that are treated together."""
MOMENTS = 256
"""Between which growth is looked for first, about."""
FINE = 64
"""Moments from each of these to the next that are looked at around the best ones."""
REACH = 0.25
"""Magnus steps are as short as that over the largest rate of change of the state: their error is some 1e-9 then."""


@dataclass(frozen=True)
class Chunk:
    """The propagator exp(scale) matrix ``(m, m)`` of a stretch of time, which ends at ``moment``."""

    moment: float
    matrix: Array
    scale: float

    def after(self, before: Chunk | None) -> Chunk:
        """Return the propagator over the stretch before and this one; None: nothing before."""
        if before is None:
            return self
        matrix, more = scaled(self.matrix @ before.matrix)
        return Chunk(self.moment, matrix, self.scale + before.scale + more)

    @property
    def norm(self) -> float:
        """ln |Phi|, the e-folds of the motion that grows most."""
        return self.scale + float(np.log(np.linalg.norm(self.matrix, 2)))


@dataclass(frozen=True)
class States:
    """Generators ``(r, m, m)`` that occur again and again, which of them each interval has, and their eigenvectors."""

    of: Array
    generators: Array
    eigen: Eigen | None

    def exponentials(self, state: int, durations: Array) -> Array:
        """Return exp(A t) ``(S, m, m)`` of one generator for many t.

        Of two conjugate eigenvalues one is enough: 2 Re(v exp(l t) w) = 2 [Re v e, -Im v e] [Re w; Im w].
        """
        if self.eigen is None:
            return magnus.expm(self.generators[state] * durations[:, None, None])
        values, vectors, inverse = (part[state] for part in (self.eigen.values, self.eigen.vectors, self.eigen.inverse))
        own = values.imag >= 0
        right = inverse[own] * np.where(values.imag[own] > 0, 2.0, 1.0)[:, None]
        left = vectors[:, own] * np.exp(durations[:, None] * values[own])[:, None, :]
        real = np.concatenate([left.real, -left.imag], axis=-1).reshape(len(durations) * len(vectors), -1)
        return (real @ np.concatenate([right.real, right.imag])).reshape(-1, *vectors.shape)


@dataclass(frozen=True)
class Motion:
    """One row of a system along a path.

    basis: of one row. schedule: its smooth intervals in a common period. period: of it, in turns of the first mesh
    (N of :meth:`~gearstab.system.GearSystem.common_period`).
    """

    basis: Basis
    schedule: Schedule
    row: int
    period: float
    constant: bool

    @property
    def elastic(self) -> int:
        """Number of elastic modes of the state, positions and velocities of each."""
        moving = np.abs(self.basis.outlet[0]).max(axis=0) > 0
        return int(np.count_nonzero(moving))

    def segments(self, path: Path) -> float:
        """Return about how many segments the path has."""
        turns = float(path.phase[-1]) / (2 * np.pi * self.period)
        return turns * self._parts().size * (1 if self.constant else 8)

    def _parts(self) -> Array:
        """Lengths of the intervals that there are, in parts of the common period."""
        lengths = self.schedule.lengths[self.row]
        return np.asarray(lengths[lengths > 0])

    def count(self, path: Path) -> int:
        """Return how many segments the path has, between neighbouring edges of the schedule."""
        turns = float(path.phase[-1]) / (2 * np.pi * self.period)
        return ceil(turns * (1 - 1e-14)) * self._parts().size

    def chunks(self, path: Path, step: int, first: int = 0, last: int | None = None) -> Iterator[Chunk]:
        """Yield the propagators over ``step`` segments each, from the segment ``first`` to the one before ``last``."""
        last = self.count(path) if last is None else last
        most = max(1, ENTRIES // self.basis.size**2)
        if step > most:
            for begin in range(first, last, step):
                whole = joined(self.chunks(path, most, begin, min(begin + step, last)))
                assert whole is not None
                yield whole
            return
        some = most // step * step
        for begin in range(first, last, some):
            end = min(begin + some, last)
            phase, found = self._propagators(path, begin, end)
            # The last chunk may be shorter: what it lacks is at rest.
            lacking = -len(found) % step
            found = np.concatenate([found, np.broadcast_to(np.eye(self.basis.size), (lacking, *found.shape[1:]))])
            products, scales = product(found.reshape(-1, step, *found.shape[1:]))
            moments = path.moment(phase[np.minimum(np.arange(1, len(products) + 1) * step, end - begin)])
            for moment, matrix, scale in zip(moments, products, scales, strict=True):
                matrix, more = scaled(matrix)
                yield Chunk(float(moment), matrix, float(scale) + more)

    def _propagators(self, path: Path, first: int, last: int) -> tuple[Array, Array]:
        """``(S + 1,)`` and ``(S, m, m)``: the phases between segments and their propagators."""
        edges, rate = self._edges, float(self.basis.rate[0])
        each, turn = len(edges) - 1, 2 * np.pi * self.period
        number = np.arange(first, last + 1)
        phase = np.minimum((number // each + edges[number % each]) * turn, path.phase[-1])
        inner = number[:-1] % each
        lengths = (edges[inner + 1] - edges[inner]) * turn
        lengths = np.where(np.diff(phase) < (1 - 1e-6) * lengths, np.diff(phase), lengths)
        if self.constant:
            return phase, self._constant(path.durations(phase, lengths) * rate, self._states.of[inner])
        return phase, self._smooth(path, path.moment(phase) * rate, phase)

    @cached_property
    def _edges(self) -> Array:
        """Of the intervals that there are, from 0 to 1."""
        edges = self.schedule.edges[self.row]
        return np.append(edges[:-1][np.diff(edges) > 0], 1.0)

    def values(self, tau: Array) -> Array:
        """``(X, J)``, the varying functions at parts of the common period."""
        every = np.zeros((len(self.schedule.edges), len(tau)))
        every[self.row] = tau
        return self.schedule.values(every)[self.row]

    @cached_property
    def _states(self) -> States:
        """The stiffnesses that occur, of intervals in which they are constant."""
        edges = self._edges
        values, of = np.unique(self.values(0.5 * (edges[1:] + edges[:-1])), axis=0, return_inverse=True)
        generators = self.basis.generator(values[:, None, :])[:, 0]
        return States(np.ravel(of), generators, diagonalised(generators))

    def _constant(self, durations: Array, of: Array) -> Array:
        result = np.empty((len(durations), self.basis.size, self.basis.size))
        for state in np.unique(of):
            members = np.flatnonzero(of == state)
            result[members] = self._states.exponentials(int(state), durations[members])
        return result

    def _smooth(self, path: Path, moments: Array, phase: Array) -> Array:
        """Products of Magnus steps, segment by segment."""
        turn, rate = 2 * np.pi * self.period, float(self.basis.rate[0])
        generator = self.basis.generator(self.values(np.linspace(0.0, 1.0, 33)[:-1] + 1 / 64)[:, None, :])[:, 0]
        largest = np.abs(generator).sum(axis=-1).max()
        # The state changes by itself, the waves with the phase.
        speed = largest + 4 * self._fastest() * path.range[1] / rate
        result = np.empty((len(moments) - 1, self.basis.size, self.basis.size))
        for k, (begin, end) in enumerate(pairwise(moments)):
            steps = max(1, ceil((end - begin) * speed / REACH))
            width = (end - begin) / steps
            nodes = begin + (np.arange(steps)[:, None] + magnus.NODES) * width
            at = np.clip(path.phase_at(nodes / rate), phase[k], phase[k + 1]) / turn
            # Within the interval, so that values on its ends are those of its inside.
            inside = np.floor(0.5 * (phase[k] + phase[k + 1]) / turn)
            values = self.values(np.clip(at - inside, 0.0, 1.0).ravel())
            a = self.basis.generator(values[:, None, :])[:, 0].reshape(steps, 3, self.basis.size, self.basis.size)
            coefficients = magnus.polynomial(a)
            powers = width ** np.arange(1, 6)
            found, scale = product(magnus.expm(np.einsum("p,spij->sij", powers, coefficients)))
            result[k] = np.exp(scale) * found
        return result

    def _fastest(self) -> float:
        """Cycles of the fastest wave in a turn of the first mesh."""
        return max(source.cycles for source in self.schedule.found) / self.period


def motions(system: GearSystem) -> list[Motion]:
    """Return the motions of all rows of the flattened batch."""
    cuts, period = schedule(system), float(system.common_period()[0])
    found: dict[int, Motion] = {}
    for basis in bases(system):
        for k, row in enumerate(basis.rows):
            own = Basis(**{name: values[k : k + 1] for name, values in vars(basis).items()})
            found[int(row)] = Motion(own, cuts, int(row), period, system.piecewise_constant)
    return [found[row] for row in sorted(found)]


def motion(system: GearSystem) -> Motion:
    """Return the motion of a single system."""
    return motions(system)[0]


def swing(motion: Motion) -> float:
    """Return by how many e-folds the energy norm changes with the mesh stiffness: 1/2 ln of the largest ratio.

    Of the eigenvalues of the stiffness matrices of all moments, relative to that of the mean mesh stiffness.
    """
    edges = motion.schedule.edges[motion.row]
    middles = (0.5 * (edges[1:] + edges[:-1]))[np.diff(edges) > 0]
    tau = np.unique(np.concatenate([middles, [] if motion.constant else np.linspace(0.0, 1.0, 65)[:-1] + 1 / 128]))
    generator = motion.basis.generator(motion.values(tau)[:, None, :])[:, 0]
    # The state is (w u, u', b'), and (w u)' = w u'.
    count = motion.elastic
    weight = np.diagonal(generator[0, :count, count : 2 * count])
    ratio = -generator[:, count : 2 * count, :count] / weight[:, None]
    values = np.linalg.eigvals(ratio).real if count else np.ones((1, 1))
    least, most = float(values.min()), float(values.max())
    return 0.5 * float(np.log(most / least)) if least > 0 else np.inf


def product(matrices: Array) -> tuple[Array, Array]:
    """Return P ``(..., m, m)`` and s ``(...)``: exp(s) P is the last of ``(..., S, m, m)`` times .. times the first."""
    scale = np.zeros(matrices.shape[:-3])
    while matrices.shape[-3] > 1:
        even = matrices.shape[-3] // 2 * 2
        pairs = matrices[..., 1:even:2, :, :] @ matrices[..., 0:even:2, :, :]
        matrices = np.concatenate([pairs, matrices[..., even:, :, :]], axis=-3)
        size = np.abs(matrices).max(axis=(-2, -1), initial=1e-300)
        if size.max() > 1e60 or size.min() < 1e-60:
            matrices = matrices / size[..., None, None]
            scale = scale + np.log(size).sum(axis=-1)
    return matrices[..., 0, :, :], scale


def scaled(matrix: Array) -> tuple[Array, float]:
    """Return a matrix over its largest entry, and the logarithm of that."""
    size = float(np.abs(matrix).max(initial=0.0))
    return (matrix / size, float(np.log(size))) if size > 0 else (matrix, 0.0)


@dataclass(frozen=True)
class Growth:
    """E-folds of the amplitude, ln |Phi(b, a)|: largest between any two moments a < b, and over the whole path.

    The norm is the largest ratio of sqrt(energy) at b and a, over all motions.
    """

    largest: float
    through: float


def growth(motion: Motion, path: Path) -> Growth:
    """Find the largest growth between two moments: of some hundred evenly spread ones, then of all around the best."""
    count = motion.count(path)
    step = max(1, ceil(count / MOMENTS))
    chunks = list(motion.chunks(path, step))
    largest, begin, end, through = best_pair(chunks)
    if step == 1 or end == 0:
        return Growth(largest, through)
    fine = max(1, step // FINE)
    # All moments between those before and behind the beginning, up to the latter.
    border = begin + 1
    before = list(motion.chunks(path, fine, max(begin - 1, 0) * step, border * step))
    rest = joined(chunks[border:end])
    starts: list[Chunk] = []
    for chunk in reversed(before):
        starts.append(chunk if not starts else starts[-1].after(chunk))
    whole = [start if rest is None else rest.after(start) for start in starts]
    chosen = int(np.argmax([one.norm for one in whole]))
    largest = max(largest, whole[chosen].norm)
    if end - 1 < border:
        return Growth(largest, through)
    # The same around the end.
    total = starts[chosen]
    ahead = joined(chunks[border : end - 1])
    total = total if ahead is None else ahead.after(total)
    for chunk in motion.chunks(path, fine, (end - 1) * step, min((end + 1) * step, count)):
        total = chunk.after(total)
        largest = max(largest, total.norm)
    return Growth(largest, through)


def joined(chunks: Iterable[Chunk]) -> Chunk | None:
    """Return the propagator over all of them; None: none."""
    total = None
    for chunk in chunks:
        total = chunk.after(total)
    return total


def best_pair(chunks: list[Chunk]) -> tuple[float, int, int, float]:
    """Return the largest ln |Phi| over stretches of chunks, from which to before which it goes, and that of all."""
    products, scales = np.empty((0, 0, 0)), np.empty(0)
    best, begin, end = 0.0, 0, 0
    for j, chunk in enumerate(chunks, start=1):
        # From every moment before to this one.
        longer = chunk.matrix @ products if len(products) else np.empty((0, *chunk.matrix.shape))
        products = np.concatenate([longer, chunk.matrix[None]])
        size = np.sqrt(np.sum(products**2, axis=(1, 2)))
        products, scales = products / size[:, None, None], np.append(scales, 0.0) + chunk.scale + np.log(size)
        # The Frobenius norm is no less than the spectral one, of which few are needed.
        longest = np.flatnonzero(scales > best)
        values = scales[longest] + np.log(np.linalg.svd(products[longest], compute_uv=False)[:, 0])
        if values.max(initial=best) > best:
            best, begin, end = float(values.max()), int(longest[values.argmax()]), j
    return best, begin, end, float(scales[0] + np.log(np.linalg.norm(products[0], 2)))
