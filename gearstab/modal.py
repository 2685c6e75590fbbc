"""Modes of the mean system, rigid-body modes and modal mesh deflections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array, GearSystem

RIGID_TOLERANCE = 1e-11
"""A mode is rigid when its squared frequency is below this part of the largest one: an eigensolver in double
precision leaves n eps ~ 1e-14 of the largest on an exact zero, while real gear trains stay above 1e-9."""


def mass_factor(mass: Array) -> Array:
    """L^-T of the Cholesky factorisation M = L L^T, ``(..., n, n)``: its columns are M-orthonormal."""
    lower = np.linalg.cholesky(np.asarray(mass, dtype=float))
    return np.swapaxes(np.linalg.inv(lower), -1, -2)


def eigenmodes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Solve K phi = lambda M phi; eigenvalues ``(..., n)`` ascending, modes ``(..., n, n)`` with Phi^T M Phi = I."""
    factor = mass_factor(mass)
    scaled = np.swapaxes(factor, -1, -2) @ stiffness @ factor
    values, vectors = np.linalg.eigh(0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
    return values, factor @ vectors


def _rigid_at_zero(values: Array) -> Array:
    """Squared frequencies with those of rigid-body modes, rounding errors, set to exactly 0."""
    largest = np.max(np.abs(values), axis=-1, keepdims=True)
    return np.where(np.abs(values) <= RIGID_TOLERANCE * largest, 0.0, values)


@dataclass(frozen=True)
class Modes:
    """Modes of the mean system: (K0 + sum_i k_gi g_i g_i^T) phi_p = w_p^2 M phi_p, Phi^T M Phi = I.

    squared_frequency: ``(..., n)``, w_p^2 ascending; exactly 0 for rigid-body modes.
    shapes: ``(..., n, n)``, column p is phi_p; the largest entry of a column is positive.
    mesh_deflection: ``(..., n, meshes)``, delta_ip = g_i^T phi_p.
    """

    squared_frequency: Array
    shapes: Array
    mesh_deflection: Array

    @property
    def natural_frequency(self) -> Array:
        """w_p; NaN where the mean stiffness is negative along a mode."""
        return np.sqrt(np.where(self.squared_frequency >= 0, self.squared_frequency, np.nan))

    @property
    def rigid(self) -> Array:
        """``(..., n)``, True for rigid-body modes."""
        return self.squared_frequency == 0


def mean_modes(system: GearSystem) -> Modes:
    """The modes of the mean system, see :class:`Modes`. Source: Lin & Parker 2002, (5)."""
    values, shapes = eigenmodes(system.mass, system.mean_stiffness_matrix())
    values = _rigid_at_zero(values)
    leading = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=-2)[..., None, :], axis=-2)
    shapes = shapes * np.where(leading < 0, -1.0, 1.0)
    deflection = np.stack([mesh_deflection(shapes, mesh.direction) for mesh in system.meshes], axis=-1)
    return Modes(values, shapes, deflection)


def mesh_deflection(shapes: Array, direction: Array) -> Array:
    """g^T phi_p for every mode, ``(..., n)``."""
    return np.einsum("...ip,...i->...p", shapes, direction)


def modal_damping_matrix(mass: Array, mean_stiffness: Array, ratios: Array) -> Array:
    """C = M Phi diag(2 zeta_p w_p) Phi^T M, the viscous damping with the given ratio in every mode of the mean system.

    ratios: ``(...)`` for one ratio for all modes or ``(..., n)``, ordered by ascending natural frequency.
    """
    values, shapes = eigenmodes(mass, mean_stiffness)
    weighted = mass @ shapes
    # The square root would turn a rounding error of 1e-17 in a rigid mode into a damping of 1e-9.
    rate = 2 * np.asarray(ratios) * np.sqrt(np.maximum(_rigid_at_zero(values), 0.0))
    return (weighted * rate[..., None, :]) @ np.swapaxes(weighted, -1, -2)
