"""What many Magnus steps make together, and its eigenvalues: compiled where that kernel is in use, else in NumPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab import ckernel
from gearstab.propagation.magnus import expm, exponent
from gearstab.system import Array

SHORT = 100.0
"""Size of a step (1-norm) below which no growth is taken out of it: exp of that is far from overflow."""


@dataclass(frozen=True)
class MagnusSteps:
    """Consecutive steps, the first one acting first.

    coefficients: ``(S, 5, m, m)``, see :func:`~gearstab.propagation.magnus.polynomial`.
    length: ``(S,)``, parts of a period.
    """

    coefficients: Array
    length: Array

    def growth(self, longest: float) -> Array:
        """``(S,)``: the fastest growth in each step, 1/time; 0 where steps are short at the longest of the periods.

        Without it a long segment neither overflows nor underflows.
        """
        rates = self.coefficients[:, 0]
        size = np.abs(rates).sum(axis=-2).max(axis=-1, initial=0.0) * self.length * longest
        long = np.flatnonzero(size > SHORT)
        growth = np.zeros(len(rates))
        growth[long] = np.linalg.eigvals(rates[long]).real.max(
            axis=-1, initial=0.0 if rates.shape[-1] == 0 else -np.inf
        )
        return growth


def propagated(steps: MagnusSteps, period: Array, matrix: Array, scale: Array) -> tuple[Array, Array]:
    """Return what the steps make of matrices times exp(scale) at periods ``(P,)``, as such products again.

    The new matrices have entries of about one. matrix: ``(P, m, m)``. scale: ``(P,)``.
    """
    growth = steps.growth(float(np.max(period, initial=0.0)))
    if ckernel.in_use() and matrix.shape[-1]:
        return ckernel.magnus_steps(steps.coefficients, steps.length, growth, period, matrix, scale)
    for coefficients, length, taken in zip(steps.coefficients, steps.length, growth, strict=True):
        step = length * period
        shift = (taken * step)[:, None, None] * np.eye(matrix.shape[-1])
        matrix = expm(exponent(coefficients, step) - shift) @ matrix
        size = np.abs(matrix).max(axis=(1, 2), initial=0.0)
        size = np.where((size > 0) & np.isfinite(size), size, 1.0)
        matrix = matrix / size[:, None, None]
        scale = scale + taken * step + np.log(size)
    return matrix, scale


def eigenvalues(matrix: Array) -> Array:
    """Return all eigenvalues ``(P, m)``, complex, of matrices of entries of about one; NaN where one is not finite."""
    if ckernel.in_use() and matrix.shape[-1]:
        return ckernel.eigenvalues(matrix)
    finite = np.isfinite(matrix).all(axis=(1, 2))
    found = np.linalg.eigvals(np.where(finite[:, None, None], matrix, 0.0)).astype(complex)
    return np.where(finite[:, None], found, np.nan)


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
