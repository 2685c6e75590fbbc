"""The stiffness that a mesh lacks while a weak pair of teeth carries: once in a revolution of its gear."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearstab.waveforms.base import Array, Waveform
from gearstab.waveforms.phase import stiff_fraction, wrapped
from gearstab.waveforms.tooth import ROUNDING, Piecewise, averaged, stacked
from gearstab.waveforms.tooth_pair import ToothPair

DEGREES = (8, 16, 32, 64)
"""Degrees of the polynomials that stand for a smooth stiffness, until the last coefficients do not count."""
RESOLVED = 1e-12

OnePair = Callable[[Array, Array], Array]
"""(phase x in mesh periods since a pair entered, its number of cycles floor(x)) -> stiffness of that pair, N/m."""


def equal_shares(wave: Waveform, contact_ratio: Array, mean: Array, amplitude: Array) -> OnePair:
    """Return the stiffness of one of n(x) equal pairs, k(x)/n(x), with k = mean + 2 amplitude w(x)."""
    c = np.asarray(contact_ratio, dtype=float)

    def of(x: Array, cycle: Array) -> Array:
        phase = wrapped(x)
        pairs = np.floor(c) + (phase < stiff_fraction(c))
        found: Array = (np.asarray(mean) + 2 * np.asarray(amplitude) * wave.value(phase)) / pairs
        return found

    return of


def own_pairs(wave: ToothPair, mean: Array, amplitude: Array) -> OnePair:
    """Return the stiffness of one pair of a wave that sums over pairs, k = a + b sum_j p: b p and its share of a."""
    size = 2 * wave.amplitude
    b = np.where(size > 0, 2 * np.asarray(amplitude) / np.where(size > 0, size, 1.0), 0.0)
    a = np.asarray(mean) - b * wave.mean_stiffness
    rest = equal_shares(wave, np.asarray(wave.contact_ratio), a, np.zeros(()))

    def of(x: Array, cycle: Array) -> Array:
        found: Array = b * wave.shape.value(x / np.asarray(wave.contact_ratio)) + rest(x, cycle)
        return found

    return of


def missing(wave: Waveform, contact_ratio: Array, teeth: int, loss: Array, one_pair: OnePair) -> Piecewise:
    """Return -loss k_pair(z u) over the revolution 0 <= u < 1, in which pair 0 of z enters at u = 0 and leaves at c/z.

    With it a mesh has k(x) = sum_j k_pair(x - j) (1 - loss [j = 0 mod z]). A wave that is piecewise constant loses a
    piecewise constant part.

    Parameters
    ----------
    wave: of the mesh, whose kinks and jumps the lost part shares. contact_ratio: ``(...)``, c < z. teeth: z.
    loss: ``(...)``, 1 - q of a pair whose stiffness is q times that of the others.
    """
    c = np.asarray(contact_ratio, dtype=float)
    edges = _edges(wave, c)
    ends = np.concatenate([edges[..., 1:], np.broadcast_to(c[..., None], (*edges.shape[:-1], 1))], axis=-1)
    for degree in (0,) if wave.piecewise_constant else DEGREES:
        coefficients = _polynomials(edges, ends, degree, one_pair)
        size = np.abs(coefficients)
        if degree == 0 or size[..., -2:].max() < RESOLVED * size.max():
            break
    lost = -np.asarray(loss)[..., None, None] * coefficients
    kept = np.flatnonzero(np.abs(lost).reshape(-1, lost.shape[-1]).max(axis=0) > ROUNDING * np.abs(lost).max())
    lost = lost[..., : kept[-1] + 1 if len(kept) else 1]
    if lost.shape[-1] == 1:
        lost, edges = _joined(lost, edges)
    rest = np.zeros((*lost.shape[:-2], 1, lost.shape[-1]))
    places = np.concatenate([edges, np.broadcast_to(c[..., None], (*edges.shape[:-1], 1))], axis=-1) / teeth
    places = np.broadcast_to(places, (*lost.shape[:-2], places.shape[-1]))
    return Piecewise(places, np.concatenate([lost, rest], axis=-2))


def over_the_width(course: Piecewise, overlap: Array) -> Piecewise:
    """Return the mean of a course over the overlap ratio of helical teeth ``(...)``, in revolutions; 0 of spur ones."""
    if not np.any(overlap):
        return course
    batch = np.broadcast_shapes(course.batch, np.shape(overlap))
    edges, tables = np.asarray(course.edges), np.asarray(course.coefficients)
    each = zip(
        np.broadcast_to(edges, (*batch, *edges.shape[-1:])).reshape(-1, *edges.shape[-1:]),
        np.broadcast_to(tables, (*batch, *tables.shape[-2:])).reshape(-1, *tables.shape[-2:]),
        np.broadcast_to(overlap, batch).ravel(),
        strict=True,
    )
    return stacked([averaged(Piecewise(at, table), float(width)) for at, table, width in each], batch)


def _joined(levels: Array, edges: Array) -> tuple[Array, Array]:
    """Leave out pieces whose level is that of the piece before, in every entry of the batch."""
    steps = np.abs(np.diff(levels[..., 0], axis=-1)).reshape(-1, levels.shape[-2] - 1).max(axis=0)
    kept = np.concatenate([[True], steps > ROUNDING * np.abs(levels).max()])
    return levels[..., kept, :], edges[..., kept]


def _edges(wave: Waveform, c: Array) -> Array:
    """``(..., B)`` ascending in [0, c]: where pairs enter and leave, and the kinks of the wave, in every cycle."""
    d = stiff_fraction(c)[..., None]
    breaks = np.asarray(wave.breakpoints())
    batch = np.broadcast_shapes(d.shape[:-1], breaks.shape[:-1])
    own = [np.broadcast_to(part, (*batch, part.shape[-1])) for part in (np.zeros_like(d), d, breaks)]
    inner = np.concatenate(own, axis=-1)
    cycles = np.arange(int(np.max(np.floor(c), initial=0.0)) + 1)
    found = (inner[..., None, :] + cycles[:, None]).reshape(*batch, -1)
    if not batch:
        found = np.unique(found)
    return np.sort(np.minimum(found, c[..., None]), axis=-1)


def _polynomials(edges: Array, ends: Array, degree: int, one_pair: OnePair) -> Array:
    """``(..., B, degree + 1)``, Chebyshev coefficients of the stiffness of the pair on each piece."""
    angles = np.pi * (np.arange(degree, -1, -1) + 0.5) / (degree + 1)
    middle, half = (edges + ends) / 2, (ends - edges) / 2
    x = middle[..., None] + half[..., None] * np.cos(angles)
    at = np.moveaxis(x, (-2, -1), (0, 1))
    cycle = np.moveaxis(np.broadcast_to(np.floor(middle)[..., None], x.shape), (-2, -1), (0, 1))
    values = np.moveaxis(one_pair(at, cycle), (0, 1), (-2, -1))
    basis = np.cos(np.outer(angles, np.arange(degree + 1)))
    scale = np.where(np.arange(degree + 1) == 0, 1.0, 2.0) / (degree + 1)
    found: Array = values @ basis * scale
    return found
