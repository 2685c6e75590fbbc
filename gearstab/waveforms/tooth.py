"""A polynomial on each of a few pieces of the period, and the shape of a mesh stiffness made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np
from numpy.polynomial import chebyshev, legendre
from pydantic import Field

from gearstab.config.model.fields import Whole
from gearstab.waveforms.base import Array, Keys, OfStiffness, wrapped
from gearstab.waveforms.fourier import MOST_HARMONICS

ROUNDING = 1e-14  # relative: coefficients below it are left out
NO_WIDTH = 1e-12
"""Periods too short to average over: phases are known to 1e-16, and so the slope of a ramp of this width to 1e-4."""


@dataclass(frozen=True)
class Piecewise:
    """f(x) = sum_j c_bj T_j(t) on the piece b, t running from -1 to 1 over it; a :class:`Profile`.

    Parameters
    ----------
    edges: ``(..., B)``, ascending, where the pieces begin; the first is 0, the last piece ends at 1. A piece may be
    empty. coefficients: ``(..., B, P)`` of Chebyshev polynomials of degree below P.
    """

    edges: Array
    coefficients: Array

    @property
    def piecewise_constant(self) -> bool:
        return bool(np.shape(self.coefficients)[-1] == 1)

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(np.shape(self.edges)[:-1], np.shape(self.coefficients)[:-2])

    @property
    def lengths(self) -> Array:
        """``(..., B)``."""
        edges = np.asarray(self.edges)
        return np.diff(edges, axis=-1, append=np.ones((*edges.shape[:-1], 1)))

    def breakpoints(self) -> Array:
        """The edges; that of an empty last piece is the end of the period, phase 0."""
        return wrapped(self.edges)

    def piece(self, x: Array) -> Array:
        """Return the number of the piece at the phase x, which broadcasts against the batch."""
        phase = wrapped(x)
        shape = np.broadcast_shapes(phase.shape, self.batch)
        found: Array = np.sum(np.broadcast_to(phase, shape)[..., None] >= np.asarray(self.edges), axis=-1) - 1
        return found

    def value(self, x: Array) -> Array:
        phase, edges, coefficients = wrapped(x), np.asarray(self.edges), np.asarray(self.coefficients)
        shape = np.broadcast_shapes(phase.shape, self.batch)
        phase = np.broadcast_to(phase, shape)
        piece = self.piece(phase)[..., None]

        def chosen(values: Array) -> Array:
            return np.take_along_axis(np.broadcast_to(values, (*shape, values.shape[-1])), piece, axis=-1)[..., 0]

        length = chosen(self.lengths)
        t = np.clip(2 * (phase - chosen(edges)) / np.where(length > 0, length, 1.0) - 1, -1.0, 1.0)
        after, latest = np.zeros(shape), np.zeros(shape)  # Clenshaw's recurrence
        for j in range(coefficients.shape[-1] - 1, 0, -1):
            after, latest = latest, chosen(coefficients[..., j]) + 2 * t * latest - after
        return chosen(coefficients[..., 0]) + t * latest - after

    @property
    def means(self) -> Array:
        """``(..., B)``, over each piece."""
        even = np.asarray(self.coefficients)[..., ::2]
        return np.sum(even / (1.0 - (2 * np.arange(even.shape[-1])) ** 2), axis=-1)

    @cached_property
    def mean(self) -> Array:
        """``(...)``, over the period."""
        return np.sum(self.lengths * self.means, axis=-1)

    @cached_property
    def extremes(self) -> tuple[Array, Array]:
        """The least and the greatest value, ``(...)`` each, from the roots of the derivatives."""
        coefficients = np.broadcast_to(self.coefficients, (*self.batch, *np.shape(self.coefficients)[-2:]))
        lengths = np.broadcast_to(self.lengths, coefficients.shape[:-1])
        low, high = np.empty(self.batch), np.empty(self.batch)
        for index in np.ndindex(*self.batch):
            found = [_range(c) for c, length in zip(coefficients[index], lengths[index], strict=True) if length > 0]
            low[index], high[index] = min(f[0] for f in found), max(f[1] for f in found)
        return low[()], high[()]

    @cached_property
    def _legendre(self) -> Array:
        """``(..., B, P)``, coefficients of Legendre instead of Chebyshev polynomials, by Gauss's exact rule."""
        count = np.shape(self.coefficients)[-1]
        nodes, weights = legendre.leggauss(count)
        own = legendre.legvander(nodes, count - 1) * weights[:, None] * (np.arange(count) + 0.5)
        found: Array = np.asarray(self.coefficients) @ (chebyshev.chebvander(nodes, count - 1).T @ own)
        return found

    def fourier(self, order: int) -> tuple[Array, Array]:
        """(a_s, b_s) of f(x) - mean = sum_s a_s sin 2 pi s x + b_s cos 2 pi s x, in closed form.

        The integral of P_n(t) exp(-i z t) over a piece, -1 < t < 1, is 2 (-i)^n j_n(z), with the spherical Bessel
        function j_n and z = pi s times the length of the piece (Abramowitz & Stegun 1964, 10.1.14): as fast for the
        thousandth harmonic as for the first.
        """
        from scipy.special import spherical_jn  # takes as long to load as a small sweep to run

        n = np.arange(np.shape(self.coefficients)[-1])
        bessel = spherical_jn(n, np.pi * order * self.lengths[..., None])
        inner = np.sum(self._legendre * (-1j) ** n * bessel, axis=-1)
        middles = np.asarray(self.edges) + self.lengths / 2
        both = np.sum(2 * self.lengths * np.exp(-2j * np.pi * order * middles) * inner, axis=-1)
        return -both.imag, both.real


def _range(coefficients: Array) -> tuple[float, float]:
    """The least and the greatest value of a Chebyshev series on [-1, 1]."""
    points = np.array([-1.0, 1.0])
    slope = chebyshev.chebder(coefficients)
    slope = chebyshev.chebtrim(slope, 1e-15 * np.max(np.abs(coefficients)))
    if len(slope) > 1:
        roots = chebyshev.chebroots(slope)
        # A double root, of a flat extremum, may come out as a pair with an imaginary part of rounding's square root.
        real = np.real(roots[np.abs(np.imag(roots)) < 1e-6])
        points = np.append(points, real[np.abs(real) < 1])
    values = chebyshev.chebval(points, coefficients)
    return float(values.min()), float(values.max())


def nodes(edges: Array, degree: int) -> Array:
    """``(B, degree + 1)``: the Chebyshev points inside each of the pieces that begin at ``edges``, ``(B,)``."""
    ends = np.append(edges[1:], 1.0)
    return edges[:, None] + (ends - edges)[:, None] * (np.cos(angles_of(degree)) + 1) / 2


def angles_of(degree: int) -> Array:
    """``(degree + 1,)``, descending: the Chebyshev points are their cosines."""
    return np.pi * (np.arange(degree, -1, -1) + 0.5) / (degree + 1)


def interpolated(values: Array) -> Array:
    """Chebyshev coefficients of the polynomials through values ``(..., degree + 1)`` at the Chebyshev points."""
    order = np.arange(values.shape[-1])
    basis = np.cos(np.outer(angles_of(len(order) - 1), order))
    found: Array = values @ basis * (np.where(order == 0, 1.0, 2.0) / len(order))
    return found


def through(edges: Array, values: Array) -> Piecewise:
    """The polynomials through ``values`` at the :func:`nodes` of the pieces, ``(B, degree + 1)``."""
    coefficients = interpolated(values)
    size = np.max(np.abs(coefficients), axis=0)
    needed = np.flatnonzero(size > ROUNDING * np.max(size))
    return Piecewise(edges, coefficients[:, : needed[-1] + 1 if len(needed) else 1])


def averaged(curve: Piecewise, width: float) -> Piecewise:
    """Return the mean of a curve (no batch) over the periods behind each phase, 1/width int_0^width f(x - u) du.

    It is exact: a polynomial of one degree more on each piece between the edges and the edges delayed by the width.
    Whole periods of the width bring the mean alone, so that a width of a whole number leaves nothing else.
    """
    whole = np.floor(width + NO_WIDTH)
    part = width - whole
    if width <= NO_WIDTH:
        return curve
    mean = float(curve.mean)
    if part <= NO_WIDTH:
        return Piecewise(np.zeros(1), np.array([[mean]]))
    edges = np.unique(wrapped(np.concatenate([curve.edges, np.asarray(curve.edges) + part])))
    at = nodes(edges, np.shape(curve.coefficients)[-1])
    return through(edges, (whole * mean + part * _window_means(curve, at, part)) / width)


def _window_means(curve: Piecewise, x: Array, width: float) -> Array:
    """Means over x - width .. x, width < 1, of the shape of x, by Gauss's rule on the part of each piece within."""
    coefficients, ends = np.asarray(curve.coefficients), np.append(curve.edges, 1.0)
    points, weights = legendre.leggauss(coefficients.shape[-1] // 2 + 1)
    total, covered = np.zeros(np.shape(x)), np.zeros(np.shape(x))
    for piece, (low, high) in enumerate(pairwise(ends)):
        for shift in (-1.0, 0.0):
            first = np.maximum(x - width, low + shift)
            length = np.maximum(np.minimum(x, high + shift) - first, 0.0)
            phase = first[..., None] + length[..., None] * (points + 1) / 2 - shift
            t = np.clip(2 * (phase - low) / (high - low if high > low else 1.0) - 1, -1.0, 1.0)
            total += length * (chebyshev.chebval(t, coefficients[piece]) @ weights) / 2
            covered += length
    # Not over the width: the lengths of a narrow window have its rounding errors too.
    return total / covered


def stacked(curves: Sequence[Piecewise], shape: tuple[int, ...]) -> Piecewise:
    """One batch of the given shape from single curves, in the order of the batch; empty pieces make up for fewer."""
    degrees = max(np.shape(curve.coefficients)[-1] for curve in curves)
    pieces = max(len(curve.edges) for curve in curves)
    edges = [np.pad(curve.edges, (pieces - len(curve.edges), 0)) for curve in curves]
    padded = [
        np.pad(curve.coefficients, ((pieces - len(part), 0), (0, degrees - part.shape[-1])))
        for curve in curves
        for part in (curve.coefficients,)
    ]
    return Piecewise(np.reshape(edges, (*shape, -1)), np.reshape(padded, (*shape, pieces, degrees)))


class ToothKeys(Keys):
    """How much of the computed stiffness is kept."""

    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONICS), Whole] | None = None
    """tooth: keep the wave's first harmonics only; all without."""


@dataclass(frozen=True)
class Tooth(OfStiffness):
    """w = (k - mean k)/(max k - min k) of a stiffness k given piece by piece, such as one computed from the teeth.

    Phase 0 is the entry of a pair of teeth. A constant stiffness has w = 0.

    contact_ratio: of the teeth, in all, where they are known; None for another periodic stiffness.
    """

    said: ClassVar[str] = "computed from the teeth of a gearbox"
    keys: ClassVar[type[Keys]] = ToothKeys
    has_contact_ratio: ClassVar[bool] = False
    of_teeth: ClassVar[bool] = True

    stiffness: Piecewise
    contact_ratio: Array | float | None = None

    @property
    def piecewise_constant(self) -> bool:
        return self.stiffness.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return self.stiffness.batch

    @property
    def mean_stiffness(self) -> Array:
        return self.stiffness.mean

    @cached_property
    def stiffness_range(self) -> tuple[Array, Array]:
        return self.stiffness.extremes

    def stiffness_at(self, x: Array) -> Array:
        return self.stiffness.value(x)

    def breakpoints(self) -> Array:
        return self.stiffness.breakpoints()

    def stiffness_harmonic(self, order: int) -> tuple[Array, Array]:
        return self.stiffness.fourier(order)

    def levels(self) -> Array:
        low, high = self.stiffness_range
        size = np.where(high > low, high - low, 1.0)
        return (self.stiffness.coefficients[..., 0] - self.mean_stiffness[..., None]) / np.asarray(size)[..., None]

    def level_at(self, x: Array) -> Array:
        return self.stiffness.piece(x)
