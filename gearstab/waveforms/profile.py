"""Profiles made of other profiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.waveforms.base import Array, Profile


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
