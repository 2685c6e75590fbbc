"""The growth of a scene in more than double precision.

The segments' generators are the doubles of the scene; their exponentials, the product and the refinement of its
dominant multiplier by inverse iteration are carried out with 30 digits (mpmath) or, for more than SMALL coordinates
where that takes minutes a point, with the 64-bit mantissa of an extended double where the processor has one.
"""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np

from gearstab.bench.scene import Scene
from gearstab.system import Array

DIGITS = 30
SMALL = 6
STEPS = 40
ON_CIRCLE = 1e-10


def growth(scene: Scene, omega: float) -> float:
    """ln max |lambda| over one common period; its own error is far below the rounding error of a double.

    A conservative system whose dominant multiplier is on the unit circle within 1e-10 has growth 0.
    """
    if scene.system.size > SMALL and np.finfo(np.longdouble).nmant >= 63:
        logarithm = _extended(scene, omega)
    else:
        logarithm = _multiprecision(scene, omega)
    if scene.system.damping is None and abs(logarithm) < ON_CIRCLE:
        return 0.0
    return logarithm


def _dominant(matrix: Array) -> complex:
    values = np.linalg.eigvals(matrix)
    return complex(values[np.argmax(np.abs(values))])


# ---- 30 digits


def _multiprecision(scene: Scene, omega: float) -> float:
    with mp.workdps(DIGITS):
        period = 2 * mp.pi / mp.mpf(float(omega))
        total = mp.eye(2 * scene.system.size)
        for duration, levels in scene.segments:
            generator = mp.matrix(scene.generator(levels).tolist())
            total = mp.expm(generator * (mp.mpf(duration) * period)) * total
        value = _refined(total, _dominant(np.array(total.tolist(), dtype=complex)))
        return float(mp.log(abs(value)))


def _refined(matrix: Any, value: complex) -> Any:
    """Inverse iteration with the shift updated each time; quadratic for a simple multiplier."""
    size = matrix.rows
    shift = mp.mpc(value) * (1 + mp.mpf(10) ** -9)
    vector = mp.matrix([mp.mpc(1, k % 3) / (k + 1) for k in range(size)])
    for _ in range(STEPS):
        try:
            found = mp.lu_solve(matrix - shift * mp.eye(size), vector)
        except ZeroDivisionError:
            return shift
        norm = mp.norm(found)
        # (M - shift) y = x with x near an eigenvector: x = (lambda - shift) y.
        step = (found.H * vector)[0] / norm**2
        shift, vector = shift + step, found / norm
        if abs(step) < abs(shift) * mp.mpf(10) ** (8 - DIGITS):
            break
    return shift


# ---- extended doubles


def _extended(scene: Scene, omega: float) -> float:
    # pi to 64 bits: its double and the rest.
    two_pi = 2 * (np.longdouble(np.pi) + np.longdouble(1.2246467991473532e-16))
    period = two_pi / np.longdouble(omega)
    total = np.eye(2 * scene.system.size, dtype=np.longdouble)
    for duration, levels in scene.segments:
        total = _exponential(scene.generator(levels).astype(np.longdouble) * (np.longdouble(duration) * period)) @ total
    return float(np.log(np.abs(_refined_extended(total, _dominant(total.astype(float))))))


def _exponential(matrix: Array) -> Array:
    """Taylor series of the matrix over 2^k, squared k times."""
    halvings = max(0, int(np.ceil(np.log2(float(np.abs(matrix).sum(axis=1).max()) + 1e-30))) + 2)
    small = matrix / np.longdouble(2) ** halvings
    term: Array = np.eye(len(matrix), dtype=np.longdouble)
    total = term.copy()
    # 0.25^17/17! < 2^-64.
    for k in range(1, 18):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


def _refined_extended(matrix: Array, value: complex) -> Any:
    """As :func:`_refined`."""
    size = len(matrix)
    shift = np.clongdouble(value) * (1 + np.longdouble(1e-9))
    vector = (1 + 1j * (np.arange(size) % 3)) / (np.arange(size) + 1).astype(np.clongdouble)
    for _ in range(STEPS):
        found = _solved(matrix - shift * np.eye(size, dtype=np.clongdouble), vector)
        norm = np.sqrt(np.sum(np.abs(found) ** 2))
        if not np.isfinite(norm):
            break
        step = np.sum(np.conj(found) * vector) / norm**2
        shift, vector = shift + step, found / norm
        if abs(step) < abs(shift) * 1e-17:
            break
    return shift


def _solved(matrix: Array, right: Array) -> Array:
    """Gaussian elimination with partial pivoting, which numpy.linalg does not do in this precision."""
    a = np.concatenate([matrix, right[:, None]], axis=1)
    size = len(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(size):
            pivot = k + int(np.argmax(np.abs(a[k:, k])))
            a[[k, pivot]] = a[[pivot, k]]
            a[k] /= a[k, k]
            rest = np.arange(size) != k
            a[rest] -= a[rest, k][:, None] * a[k]
    return a[:, -1]
