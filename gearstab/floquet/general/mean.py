"""Motions of the mean system as a whole: its damping and the means of its periodic terms included.

    M q'' + [C + sum_j mean(c_j) u_j v_j^T] q' + [K0 + sum_i k_gi g_i g_i^T + sum_j mean(a_j) u_j v_j^T] q = 0

The natural frequencies of :func:`gearstab.modal.mean_modes` are those of its symmetric part without damping. Cross
coupling and negative damping may let the whole grow by itself, without any variation of the mesh stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.general.coordinates import Generator, generators
from gearstab.system import Array, GearSystem
from gearstab.waveforms.profile import harmonic

ROUNDING = 1e-11
"""A growth rate below this part of the largest exponent is rounding: an eigensolver leaves n eps ~ 1e-14 of it."""


@dataclass(frozen=True)
class MeanMotions:
    """Motions of the mean system, ``(rows, n)`` each, by ascending frequency.

    frequency: |Im| of a pair of exponents, rad per unit time, 0 for motions that do not oscillate. growth_rate: its
    real part, the larger one of two real exponents, 1/time; exactly 0 where only rounding is left.
    """

    frequency: Array
    growth_rate: Array

    @property
    def unstable(self) -> Array:
        """``(rows, n)``, whether a motion grows by itself."""
        return self.growth_rate > 0


def mean_motions(system: GearSystem) -> MeanMotions:
    """Return the motions of the mean system of every row of the flattened batch: one eigenproblem each."""
    levels = [system.flat(mesh.mean_stiffness) for mesh in system.meshes]
    profiles = [profile for term in system.terms for profile in term.profiles]
    levels += [system.flat(harmonic(profile, 0).real) for profile in profiles]
    means = np.stack(levels, axis=-1)
    rows = [_exponents(own, level) for own, level in zip(generators(system), means, strict=True)]
    frequency, growth = np.stack([np.stack(_pairs(row)) for row in rows], axis=1)
    size = np.abs(np.stack([np.abs(row) for row in rows])).max(axis=1, keepdims=True, initial=0.0)
    return MeanMotions(frequency, np.where(np.abs(growth) <= ROUNDING * size, 0.0, growth))


def _exponents(own: Generator, level: Array) -> Array:
    """The 2 n exponents of one row, 1/time."""
    matrix = own.constant + np.einsum("j,jkl->kl", level, own.parts)
    return np.concatenate([own.rate * np.linalg.eigvals(matrix), own.rigid_exponents]).astype(complex)


def _pairs(exponents: Array) -> tuple[Array, Array]:
    """(frequency, growth rate) of each pair of exponents: conjugate ones, or two real ones, the largest ones first."""
    upper = exponents[exponents.imag > 0]
    real = np.sort(exponents[exponents.imag == 0].real)[::-1][::2]
    frequency = np.concatenate([np.zeros(len(real)), upper.imag])
    growth = np.concatenate([real, upper.real])
    order = np.lexsort((-growth, frequency))
    return frequency[order], growth[order]
