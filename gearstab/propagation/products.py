"""Products of many Magnus steps, and their eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab import ckernel
from gearstab.system import Array


@dataclass(frozen=True)
class MagnusSteps:
    """Consecutive steps, the first one acting first.

    coefficients: ``(S, 5, m, m)``, see :func:`~gearstab.propagation.magnus.polynomial`.
    length: ``(S,)``, parts of a period.
    """

    coefficients: Array
    length: Array


def propagated(steps: MagnusSteps, period: Array, matrix: Array, scale: Array) -> tuple[Array, Array]:
    """Return what the steps make of matrices times exp(scale) at periods ``(P,)``, as such products again.

    The new matrices have entries of about one. matrix: ``(P, m, m)``. scale: ``(P,)``.
    """
    if matrix.shape[-1] == 0:
        return matrix, scale
    return ckernel.magnus_steps(steps.coefficients, steps.length, period, matrix, scale)


def eigenvalues(matrix: Array) -> Array:
    """Return all eigenvalues ``(P, m)``, complex, of matrices of entries of about one; NaN where one is not finite."""
    return ckernel.eigenvalues(matrix) if matrix.shape[-1] else np.empty(matrix.shape[:2], dtype=complex)


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
