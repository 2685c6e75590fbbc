"""Profiles made of other profiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.waveforms.base import Array, Profile, Waveform

NODES = 24
"""Gauss-Legendre nodes of a piece, besides those for the oscillation: pieces are polynomials of low degree, products of
such, or smooth."""
NODES_OF_A_HARMONIC = 4
"""Further nodes for each harmonic: exp(i z t) on [-1, 1] needs little more than z of them, and z is at most pi s."""
ROUNDING = 1e-13
"""Coefficients below this part of the function are rounding, so that harmonics that are missing are exactly zero."""


@dataclass(frozen=True)
class Scaled:
    """mean + factor w(x), for example a damping that follows the mesh stiffness."""

    profile: Profile
    mean: Array | float
    factor: Array | float

    @property
    def piecewise_constant(self) -> bool:
        return self.profile.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.profile.batch, np.shape(self.mean), np.shape(self.factor))

    def value(self, x: Array) -> Array:
        return np.asarray(self.mean) + np.asarray(self.factor) * self.profile.value(x)

    def breakpoints(self) -> Array:
        return self.profile.breakpoints()


@dataclass(frozen=True)
class Constant:
    """The same value at every phase."""

    level: Array | float

    @property
    def piecewise_constant(self) -> bool:
        return True

    @property
    def batch(self) -> tuple[int, ...]:
        return np.shape(self.level)

    def value(self, x: Array) -> Array:
        return np.broadcast_to(self.level, np.broadcast_shapes(np.shape(self.level), np.shape(x)))

    def breakpoints(self) -> Array:
        return np.zeros((*self.batch, 0))


@dataclass(frozen=True)
class Product:
    """f(x) h(x), for example a share of the mesh stiffness."""

    first: Profile
    second: Profile

    @property
    def piecewise_constant(self) -> bool:
        return self.first.piecewise_constant and self.second.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.first.batch, self.second.batch)

    def value(self, x: Array) -> Array:
        return self.first.value(x) * self.second.value(x)

    def breakpoints(self) -> Array:
        found = [self.first.breakpoints(), self.second.breakpoints()]
        return np.concatenate([np.broadcast_to(part, (*self.batch, part.shape[-1])) for part in found], axis=-1)


def harmonic(profile: Profile, order: int) -> Array:
    """Return c of f(x) = sum_s c_s exp(2 pi i s x), s = ``order`` >= 0, complex, of the shape of the batch.

    In closed form of the wave of a mesh, scaled or not, else by Gauss's rule between the breakpoints.
    """
    if isinstance(profile, Scaled) and isinstance(profile.profile, Waveform):
        if order == 0:
            return np.broadcast_to(profile.mean, profile.batch).astype(complex)
        a, b = profile.profile.fourier(order)
        wave = 0.5 * (np.asarray(b) - 1j * np.asarray(a))
        return np.asarray(profile.factor) * np.where(np.abs(wave) <= ROUNDING, 0.0, wave)
    breaks = np.sort(np.broadcast_to(profile.breakpoints(), (*profile.batch, profile.breakpoints().shape[-1])), axis=-1)
    ends = np.zeros((*profile.batch, 1))
    edges = np.moveaxis(np.concatenate([ends, breaks, ends + 1], axis=-1), -1, 0)
    nodes, weights = np.polynomial.legendre.leggauss(NODES + NODES_OF_A_HARMONIC * order)
    column = (-1, *[1] * edges.ndim)
    length = np.diff(edges, axis=0)
    at = edges[:-1] + length * 0.5 * (1 + nodes.reshape(column))
    part = 0.5 * length * weights.reshape(column) * profile.value(at)
    found = np.sum(part * np.exp(-2j * np.pi * order * at), axis=(0, 1))
    return np.where(np.abs(found) <= ROUNDING * np.abs(part).sum(axis=(0, 1)), 0.0, found)
