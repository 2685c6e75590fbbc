"""The motion while the mesh frequency changes, exactly: from jump to jump of the mesh stiffness.

The state x = (w u, u', b') is that of :mod:`gearstab.propagation.first_order`: |x|^2 is twice the energy of the elastic
vibration, with the mean mesh stiffness, in units of the modes. A mesh has the stiffness of its phase, r theta(t)/2 pi -
lag, so that the instants of jumps follow from the phase theta(t); between them the propagator is the exponential of a
constant matrix, or Magnus steps of sixth order where a wave is smooth.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from gearstab.propagation.equation import excitation
from gearstab.propagation.first_order import bases
from gearstab.propagation.magnus import product, scaled
from gearstab.propagation.path import Path
from gearstab.propagation.phase import PROBES, PhaseEquation, divided
from gearstab.system import Array, GearSystem

MOST = 4_000_000
"""Segments of a ramp that are followed."""
ENTRIES = 1 << 20
"""Size of the matrices of segments that are treated together."""
MOMENTS = 256
"""Between which growth is looked for first, about."""
FINE = 64
"""Moments from each of these to the next that are looked at around the best ones."""


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
class FreeMotion(PhaseEquation):
    """The free motion of one row of a system along any path, exactly from edge to edge of what varies."""

    def segments(self, path: Path) -> float:
        """Return about how many segments the path has."""
        turns = float(path.phase[-1]) / self.period
        return turns * self._each * (1 if self.exact else 8)

    @property
    def _each(self) -> int:
        """Segments of a common period."""
        return len(self.borders) - 1

    def count(self, path: Path) -> int:
        """Return how many segments the path has, between neighbouring edges of the schedule."""
        return ceil(float(path.phase[-1]) / self.period * (1 - 1e-14)) * self._each

    def chunks(self, path: Path, step: int, first: int = 0, last: int | None = None) -> Iterator[Chunk]:
        """Yield the propagators over ``step`` segments each, from the segment ``first`` to the one before ``last``."""
        last, size = self.count(path) if last is None else last, self.form.size
        most = max(1, ENTRIES // size**2)
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
            found = np.concatenate([found, np.broadcast_to(np.eye(size), (lacking, size, size))])
            products, scales = product(found.reshape(-1, step, size, size))
            moments = path.moment(phase[np.minimum(np.arange(1, len(products) + 1) * step, end - begin)])
            for moment, matrix, scale in zip(moments, products, scales, strict=True):
                matrix, more = scaled(matrix)
                yield Chunk(float(moment), matrix, float(scale) + more)

    def _propagators(self, path: Path, first: int, last: int) -> tuple[Array, Array]:
        """``(S + 1,)`` and ``(S, m, m)``: the phases between segments and their propagators."""
        turn = self.period
        edges, number = self.borders, np.arange(first, last + 1)
        phase = np.minimum((number // self._each + edges[number % self._each]) * turn, path.phase[-1])
        inner = number[:-1] % self._each
        if self.exact:
            lengths = (edges[inner + 1] - edges[inner]) * turn
            lengths = np.where(np.diff(phase) < (1 - 1e-6) * lengths, np.diff(phase), lengths)
            durations = path.durations(phase, lengths) * self.rate
            return phase, self.states.exponentials(self.states.of[self.occupied[inner]], durations)
        moments = path.moment(phase)
        knots = np.concatenate([moments, path.knots(moments[0], moments[-1])])
        order = np.argsort(knots, kind="stable")
        begin, duration, stops = divided(knots[order], self.longest_step(path))
        ends = stops.copy()
        ends[stops] = order[1:] < len(moments)
        middle = path.phase_at(begin + 0.5 * duration) / turn
        found = np.empty((last - first, self.form.size, self.form.size))
        segment, whole = 0, np.eye(self.form.size)
        maps = self.magnus_maps(path, begin, duration, middle - np.floor(middle))
        for (matrix, _), end in zip(maps, ends, strict=True):
            whole = matrix @ whole
            if end:
                found[segment] = whole
                segment, whole = segment + 1, np.eye(len(whole))
        return phase, found


def motions(system: GearSystem) -> list[FreeMotion]:
    """Return the motions of all rows of the flattened batch."""
    drive = excitation(system.undriven())
    found: dict[int, FreeMotion] = {}
    for form in bases(system):
        for k, row in enumerate(form.rows):
            found[int(row)] = FreeMotion(form.subset(np.array([k])), drive.subset(np.array([row])))
    return [found[row] for row in sorted(found)]


def motion(system: GearSystem) -> FreeMotion:
    """Return the motion of a single system."""
    return motions(system)[0]


def swing(motion: FreeMotion, path: Path) -> float:
    """Return by how many e-folds the energy norm changes with the stiffness: 1/2 ln of the largest ratio.

    Of the eigenvalues of the stiffness matrices of all moments and both ends of the path's range, relative to that of
    the mean mesh stiffness at rest.
    """
    edges, more = motion.borders, PROBES[:0] if motion.drive.exact else PROBES
    part = np.unique(np.concatenate([0.5 * (edges[1:] + edges[:-1]), more]))
    speed = np.repeat(path.range, len(part))
    generator = motion.generators(motion.along(np.tile(part, 2)), speed)
    # The state is (w u, u', b'), and (w u)' = w u'.
    count = motion.form.elastic
    weight = np.diagonal(generator[0, :count, count : 2 * count])
    ratio = -generator[:, count : 2 * count, :count] / weight[:, None]
    values = np.linalg.eigvals(ratio).real if count else np.ones((1, 1))
    least, most = float(values.min()), float(values.max())
    return 0.5 * float(np.log(most / least)) if least > 0 else np.inf


@dataclass(frozen=True)
class Growth:
    """E-folds of the amplitude, ln |Phi(b, a)|: largest between any two moments a < b, and over the whole path.

    The norm is the largest ratio of sqrt(energy) at b and a, over all motions.
    """

    largest: float
    through: float


def growth(motion: FreeMotion, path: Path) -> Growth:
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
