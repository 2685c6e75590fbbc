"""Instability intervals by counts of collisions and halving: the theory in boundaries/counting/krein.py, no more."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy_kernel

from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.counting.points import LARGEST, exact
from gearstab.floquet.boundaries.parts import Interval, Intervals, by_row
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

LOST = 1e8
"""Entries within the period beyond which signs of what is solved with the matrix are those of rounding errors."""
DENSITY = 1.0
"""Points of the scan a collision: for n >= 3 a pair off the circle may overtake a third multiplier between far ones."""
MIRROR, TIE = 1e-10, 1e-12


@dataclass
class Counts:
    """At points (row, cycle): stable; C, a pair off the circle as met (begun) and as not met (ended); known; meetings
    at +1 and at -1 ``(P, 2)``.
    """

    row: Array
    cycle: Array
    stable: Array
    begun: Array
    ended: Array
    known: Array
    real: Array

    def joined(self, other: Counts) -> Counts:
        return Counts(*(np.concatenate([getattr(part, f.name) for part in (self, other)]) for f in fields(self)))

    def put(self, place: Array, other: Counts) -> None:
        for f in fields(self):
            getattr(self, f.name)[place] = getattr(other, f.name)


def negative(matrix: Array) -> Array:
    """The number of negative eigenvalues of symmetric ``(P, n, n)``."""
    return (np.linalg.eigvalsh(0.5 * (matrix + np.swapaxes(matrix, -1, -2))) < 0).sum(axis=-1)


def morse(pattern: Pattern, row: Array, cycle: Array) -> tuple[Array, Array, Array, Array]:
    """(M ``(P, 2n, 2n)``, N(0), N(pi), whether they are right ``(P,)``), segment by segment."""
    n = pattern.size
    x, index = np.tile(np.eye(2 * n), (len(row), 1, 1)), np.zeros(len(row), dtype=int)
    good = np.ones(len(row), dtype=bool)
    for s, state in enumerate(pattern.states):
        w = np.sqrt(pattern.squared_frequency[row, state].astype(complex))
        time = (2 * np.pi * pattern.cycles * pattern.fractions[row, s] * cycle)[:, None]
        angle = w.real * time + 1j * np.minimum(w.imag * time, 300.0)
        cosine, over = np.cos(angle).real, (time * np.sinc(angle / np.pi)).real
        times = (-w * np.sin(angle)).real
        index += np.floor(angle.real / np.pi).sum(axis=1).astype(int)
        if s > 0:
            index += negative(_right(x[:, n:, n:], x[:, :n, n:]) + (cosine / over)[:, :, None] * np.eye(n))
        position = cosine[:, :, None] * x[:, :n] + over[:, :, None] * x[:, n:]
        x = np.concatenate([position, times[:, :, None] * x[:, :n] + cosine[:, :, None] * x[:, n:]], axis=1)
        if len(pattern.states) > 1:
            turn = pattern.change(s)[row]
            x = np.concatenate([turn @ x[:, :n], turn @ x[:, n:]], axis=1)
        good &= np.abs(x).max(axis=(1, 2)) < LOST
        x[~good] = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(n))
    inverse = _right(np.broadcast_to(np.eye(n), x[:, :n, :n].shape), x[:, :n, n:])
    both, across = inverse @ x[:, :n, :n] + x[:, n:, n:] @ inverse, inverse + np.swapaxes(inverse, -1, -2)
    return x, index + negative(both - across), index + negative(both + across), good


def below(matrix: Array, angle: Array) -> Array:
    """Count negative eigenvalues ``(P, L)`` of B^-1 A + D B^-1 - exp(i theta) B^-1 - exp(-i theta) B^-T.

    angle: theta, ``(P, L)``.
    """
    n = matrix.shape[-1] // 2
    a, b, d = matrix[:, :n, :n], matrix[:, :n, n:], matrix[:, n:, n:]
    inverse = np.linalg.inv(b)
    held = inverse @ a + d @ inverse
    turned = np.exp(1j * angle)[..., None, None] * inverse[:, None]
    form = 0.5 * (held + np.swapaxes(held, 1, 2))[:, None] - turned - np.swapaxes(turned.conj(), -1, -2)
    return (np.linalg.eigvalsh(form) < 0).sum(axis=-1)


def _right(a: Array, b: Array) -> Array:
    """A B^-1."""
    size = np.finfo(float).tiny + 1e-300 * np.eye(b.shape[-1])
    return np.swapaxes(np.linalg.solve(np.swapaxes(b + size, -1, -2), np.swapaxes(a, -1, -2)), -1, -2)


def counts(pattern: Pattern, row: Array, cycle: Array) -> Counts:
    """Counts at points (row, 1/Omega), ``(P,)`` each."""
    n = pattern.size
    matrix, periodic, antiperiodic, good = morse(pattern, row, cycle)
    if exact(pattern) is not pattern:
        matrix, scale = numpy_kernel.monodromy(exact(pattern), row, 1 / cycle)
        good &= scale == 0
    good &= np.abs(matrix).max(axis=(1, 2)) < LARGEST
    found = spectrum(np.where(good[:, None, None], matrix, 2 * np.eye(2 * n)))
    outside = found.off & (np.abs(found.values) > 1)
    chosen = np.where(found.off, outside, found.sign > 0)
    known = good & (chosen.sum(axis=1) == n) & (2 * outside.sum(axis=1) == found.off.sum(axis=1))
    order = np.argsort(~chosen, axis=1, kind="stable")[:, :n]
    values, off = (np.take_along_axis(part, order, axis=1) for part in (found.values, found.off))
    phase, real = np.angle(values) % (2 * np.pi), off & (values.imag == 0)
    # Twice the winding, from the angle that is farther from all multipliers.
    at_minus_one = real & (np.abs(phase - np.pi) < 1)
    from_pi = antiperiodic - 2 * ((phase > np.pi) & ~real).sum(axis=1) - at_minus_one.sum(axis=1)
    from_zero = periodic - n + (real & ~at_minus_one).sum(axis=1)
    gap_pi = np.where(real, np.inf, np.abs(phase - np.pi)).min(axis=1)
    gap_zero = np.where(real, np.inf, np.minimum(phase, 2 * np.pi - phase)).min(axis=1)
    twice = np.where(gap_pi > gap_zero, from_pi, from_zero)
    # Pairs off the circle as met, several real ones laid out at mirrored angles around +-1.
    place = np.where(real, np.where(at_minus_one, np.pi, 0.0), phase)
    for side in (at_minus_one, real & ~at_minus_one):
        several = side & (side.sum(axis=1, keepdims=True) > 1)
        rank = np.cumsum(side, axis=1) - 1 - 0.5 * (side.sum(axis=1, keepdims=True) - 1)
        place = np.where(several, place + MIRROR * rank, place)
    total = np.floor((place[:, :, None] + place[:, None, :] + TIE) / (2 * np.pi)).sum(axis=(1, 2)).astype(int)
    winding = twice // 2
    begun = 2 * n * winding + total
    met = np.stack([winding, winding + (phase > np.pi).sum(axis=1)], axis=1)
    stable = good & ~found.off.any(axis=1)
    return Counts(row, cycle, stable, begun, begun - off.sum(axis=1), known & (twice % 2 == 0), met)


def search(pattern: Pattern, first: Array, last: Array, tolerance: float, floor: float) -> Intervals:
    """Unstable intervals of all rows between two cycles ``(r,)``, wider than the floor, edges to the tolerance."""
    mean = np.sqrt(np.maximum(pattern.squared_frequency, 0)).mean(axis=1).sum(axis=-1)
    count = (8 + DENSITY * (pattern.size + 1) * mean * pattern.cycles * (last - first)).astype(int)
    row = np.repeat(np.arange(len(first)), count)
    cycle = np.concatenate([np.linspace(a, b, c) for a, b, c in zip(first, last, count, strict=True)])
    samples = counts(pattern, row, cycle)
    left = np.flatnonzero(row[1:] == row[:-1])
    right, edges = left + 1, [np.empty((2, 0), dtype=int)]
    coarse = 0.1 * ((last - first) / count)
    while len(left):
        width, start = samples.cycle[right] - samples.cycle[left], samples.cycle[left]
        one, two = samples.stable[left], samples.stable[right]
        known = (samples.known[left] | one) & (samples.known[right] | two)
        empty = (one & two & (samples.begun[left] == samples.ended[right])) | (
            ~one
            & ~two
            & ((samples.begun[left] > samples.ended[right]) | (~known & (width < coarse[samples.row[left]])))
        )
        done = width <= np.where(one != two, tolerance, floor) * start
        edges.append(np.stack([left, right])[:, done & (one != two)])
        left, right = left[~empty & ~done], right[~empty & ~done]
        a, b, new = samples.cycle[left], samples.cycle[right], len(samples.row) + np.arange(len(left))
        fresh = counts(pattern, samples.row[left], 0.5 * (a + b))
        for part in (0.41, 0.57, 0.34):  # where signs are lost in rounding, somewhere else
            lost = np.flatnonzero(fresh.stable & ~fresh.known)
            fresh.put(lost, counts(pattern, fresh.row[lost], (a + part * (b - a))[lost]))
        samples = samples.joined(fresh)
        left, right = np.concatenate([left, new]), np.concatenate([new, right])
    return _paired(samples, np.concatenate(edges, axis=1), first, last, floor)


def _paired(samples: Counts, edges: Array, first: Array, last: Array, floor: float) -> Intervals:
    """Entrances with exits; a region that reaches an end of the range is cut there."""
    found = []
    for row, own in enumerate(by_row(samples.row[edges[0]], len(first))):
        a, b = edges[:, own[np.argsort(samples.cycle[edges[0, own]])]]
        where = 0.5 * (samples.cycle[a] + samples.cycle[b])
        inner = [(x, s, False) for x, s in zip(where, np.where(samples.stable[a], a, b), strict=True)]
        mine = np.flatnonzero(samples.row == row)
        outer = [(end[row], mine[np.abs(samples.cycle[mine] - end[row]).argmin()], True) for end in (first, last)]
        whole = [outer[0]] * (not samples.stable[outer[0][1]]) + inner + [outer[1]] * (not samples.stable[outer[1][1]])
        for (start, at, cut), (stop, then, end) in zip(whole[::2], whole[1::2], strict=True):
            if stop - start > floor * start:
                real = samples.real[at], samples.real[then]
                passed = _by_class(real[0], samples.ended[at])
                meetings = _by_class(real[1] - real[0], samples.begun[then] - samples.ended[at])
                found.append(Interval(row, float(start), float(stop), passed, meetings, (0.0, 0.0), (cut, end)))
    return Intervals.of(found)


def _by_class(real: Array, total: int) -> tuple[int, int, int]:
    """Collisions at +1, at -1 and elsewhere, each once, from those at +-1 and C."""
    return int(real[0]), int(real[1]), (int(total) - int(real.sum())) // 2
