"""Other ways to the multipliers of a pattern's first row: products of exponentials, an integrator, batched NumPy."""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bench.scenes import CONFIGS
from gearstab.floquet.kernel import damped
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

sys.path.append(str(CONFIGS.parent / "tests" / "reference" / "kernel"))
import numpy_kernel

ACCURATE = 1e-10
"""Tolerance of DOP853 that leaves 1e-10..5e-9 on rho = lambda + 1/lambda of the train (Omega from 0.35 to 6.5)."""


def segments(pattern: Pattern, omega: Array) -> tuple[Array, Array]:
    """Return the generators ``(S, 2n, 2n)`` and durations ``(S, P)`` of the segments of a period."""
    return damped.generators(pattern).matrix[0][list(pattern.states)], pattern.durations(0, omega)


def expm_product(pattern: Pattern, omega: Array) -> Array:
    """Multiply ``scipy.linalg.expm`` of each segment, point by point; eigenvalues ``(P, 2n)``."""
    generators, durations = segments(pattern, omega)
    products = np.tile(np.eye(generators.shape[-1]), (len(omega), 1, 1))
    for k in range(len(omega)):
        for factor in expm(generators * durations[:, k, None, None]):
            products[k] = factor @ products[k]
    return np.linalg.eigvals(products)


def integrate(pattern: Pattern, omega: Array) -> Array:
    """Integrate all 2n columns at once by DOP853, begun afresh at every jump; eigenvalues ``(P, 2n)``."""
    generators, durations = segments(pattern, omega)
    size = generators.shape[-1]
    products = np.empty((len(omega), size, size))
    for k in range(len(omega)):
        state = np.eye(size)
        jumps = np.append(0.0, np.cumsum(durations[:, k]))
        for (begin, end), matrix in zip(pairwise(jumps), generators, strict=True):
            right = lambda _, y, m=matrix: (m @ y.reshape(size, size)).ravel()  # noqa: E731
            done = solve_ivp(right, (begin, end), state.ravel(), method="DOP853", rtol=ACCURATE, atol=ACCURATE)
            state = done.y[:, -1].reshape(size, size)
        products[k] = state
    return np.linalg.eigvals(products)


def numpy_eigenvalues(pattern: Pattern, omega: Array, row: int = 0) -> Array:
    """Multiply in batches by NumPy; eigenvalues by ``numpy.linalg.eigvals``, ``(P, 2n)``."""
    return np.linalg.eigvals(numpy_kernel.monodromy(pattern, row, omega)[0])
