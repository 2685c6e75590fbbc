"""The one abstraction of the package: a linear gear system with periodic mesh stiffness.

    M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = f(t),        k_i(t) = k_gi + k_vi(t)

Systems (``gearstab.systems``) build it, methods (Floquet, perturbation, response) read it, and neither knows
about the other. Every array may carry leading *batch* dimensions, one entry a grid row, so that a
whole slab of a sweep is built and solved with a handful of array operations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import gcd, lcm

import numpy as np

from gearstab.waveforms import Waveform

Array = np.ndarray


@dataclass(frozen=True)
class Mesh:
    """One tooth mesh: a spring of periodic stiffness along a direction vector.

        k_i(t) = k_g [1 + 2 epsilon w(r Omega t/2 pi - lag)]

    Parameters
    ----------
    name: what messages and results call it.
    direction: ``(..., n)``, g_i; the mesh deflection is g_i^T q.
    mean_stiffness: ``(...)``, k_g.
    epsilon: ``(...)``, k_a/k_g, where 2 k_a is the peak-to-peak of the variation.
    waveform: the shape w of period 1, zero mean and peak-to-peak 1.
    frequency_ratio: r = Omega_i/Omega, exact.
    lag: ``(...)``, the start of the wave as a fraction of this mesh's own period.
    """

    name: str
    direction: Array
    mean_stiffness: Array
    epsilon: Array
    waveform: Waveform
    frequency_ratio: Fraction = Fraction(1)
    lag: Array | float = 0.0

    @property
    def amplitude(self) -> Array:
        """k_a = epsilon k_g, half of the peak-to-peak stiffness variation."""
        return np.asarray(self.epsilon) * self.mean_stiffness

    @property
    def lowest_stiffness(self) -> Array:
        """The softest level of k_i(t)."""
        return self.mean_stiffness + 2 * self.amplitude * self.waveform.extremes()[0]

    @property
    def outer(self) -> Array:
        """g g^T, ``(..., n, n)``."""
        g = np.asarray(self.direction)
        return g[..., :, None] * g[..., None, :]


@dataclass(frozen=True)
class Cyclic:
    """Cyclic symmetry of the mean system: turned by 2 pi/N it is the same.

    Parameters
    ----------
    order: N.
    turn: ``(n, n)``, R with R^T M R = M and R^T K R = K: the displacement R q is q turned by 2 pi/N.
    types: what modes are called that a turn by 2 pi/N takes into cos(2 pi T/N) of themselves, from T = 0 on; the last
        name is that of all further T.
    still: what modes without mesh deflection are called.
    """

    order: int
    turn: Array
    types: tuple[str, ...]
    still: str = "no mesh deflection"


@dataclass(frozen=True)
class GearSystem:
    """M, C, K0 and the meshes.

    Parameters
    ----------
    mass, stiffness: ``(..., n, n)``, symmetric; ``stiffness`` is K0, everything but the meshes.
    damping: ``(..., n, n)`` or None for an undamped system.
    meshes: at least one.
    coordinates: names of the n coordinates.
    symmetry: of the mean system, where it has one; it serves to name modes, nothing relies on it.
    """

    mass: Array
    stiffness: Array
    meshes: tuple[Mesh, ...]
    damping: Array | None = None
    coordinates: tuple[str, ...] = ()
    symmetry: Cyclic | None = None

    @property
    def size(self) -> int:
        """n, the number of coordinates."""
        return int(np.shape(self.mass)[-1])

    @property
    def batch(self) -> tuple[int, ...]:
        """The common leading shape of all arrays; ``()`` for a single system."""
        shapes = [np.shape(self.mass)[:-2], np.shape(self.stiffness)[:-2]]
        if self.damping is not None:
            shapes.append(np.shape(self.damping)[:-2])
        for mesh in self.meshes:
            shapes += [np.shape(mesh.direction)[:-1], np.shape(mesh.mean_stiffness)]
            shapes += [np.shape(mesh.epsilon), np.shape(mesh.lag), mesh.waveform.batch]
        return np.broadcast_shapes(*shapes)

    def over(self, batch: tuple[int, ...]) -> GearSystem:
        """The same system with the given batch shape, carried by its mass: what varies or not no longer decides it."""
        return replace(self, mass=np.broadcast_to(self.mass, (*batch, self.size, self.size)))

    def mean_stiffness_matrix(self) -> Array:
        """K0 + sum_i k_gi g_i g_i^T, ``(..., n, n)``."""
        return self.stiffness_matrix([mesh.mean_stiffness for mesh in self.meshes])

    def stiffness_matrix(self, levels: list[Array]) -> Array:
        """K0 + sum_i k_i g_i g_i^T for the given stiffness of each mesh."""
        total = np.asarray(self.stiffness, dtype=float)
        for mesh, level in zip(self.meshes, levels, strict=True):
            total = total + np.asarray(level)[..., None, None] * mesh.outer
        return total

    def common_period(self) -> tuple[Fraction, tuple[int, ...]]:
        """The period that all mesh stiffnesses share.

        Returns (N, (N_1, N_2, ...)): the common period is N 2 pi/Omega and holds N_i whole cycles of mesh i.
        """
        ratios = [mesh.frequency_ratio for mesh in self.meshes]
        common = Fraction(
            gcd(*(r.numerator * lcm(*(s.denominator for s in ratios)) // r.denominator for r in ratios)),
            lcm(*(r.denominator for r in ratios)),
        )
        return 1 / common, tuple(int(r / common) for r in ratios)
