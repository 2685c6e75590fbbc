"""The growth of a scene in more than double precision.

The segments' generators are the doubles of the scene; their exponentials, the product and the refinement of its
dominant multiplier by inverse iteration are carried out with 30 digits (mpmath) or, for more than SMALL coordinates
where that takes minutes per point, with the 64-bit mantissa of an extended double where the processor has one.

Where the stiffness is smooth, x' = A(t) x is solved by Gauss collocation of order 16 in extended doubles, on steps
between the kinks, short enough for a truncation error below their rounding.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np

from gearstab.bench.scene import Scene
from gearstab.system import Array

DIGITS = 30
SMALL = 6
STEPS = 40
ON_CIRCLE = 1e-10
"""Growth of a conservative system below which its multipliers, from generators in doubles, lie on the circle."""


def growth(scene: Scene, omega: float) -> float:
    """ln max |lambda| over one common period; its own error is far below the rounding error of a double.

    A conservative system whose dominant multiplier is on the unit circle within 1e-10 has growth 0.
    """
    if not scene.exact:
        logarithm = collocation(scene, omega)
    elif scene.system.size > SMALL and np.finfo(np.longdouble).nmant >= 63:
        logarithm = extended(scene, omega)
    else:
        logarithm = multiprecision(scene, omega)
    if scene.conservative and not scene.system.damped and abs(logarithm) < ON_CIRCLE:
        return 0.0
    return logarithm


def _dominant(matrix: Array) -> complex:
    values = np.linalg.eigvals(matrix)
    return complex(values[np.argmax(np.abs(values))])


# ---- 30 digits


def multiprecision(scene: Scene, omega: float) -> float:
    """Return ln max |lambda| of a scene of exact segments, in 30 digits."""
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


def extended(scene: Scene, omega: float) -> float:
    """Return ln max |lambda| of a scene of exact segments, in extended doubles."""
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
    with np.errstate(divide="ignore", invalid="ignore"):
        return _eliminated(matrix, right[:, None])[:, 0]


# ---- smooth systems


STAGES = 8
RADIANS = 0.6
"""Phase of the fastest mode and of the highest harmonic in a step: the error constant of the order 16 leaves 1e-19."""
OSCILLATIONS = 12
"""Oscillations of a smooth piece of a wave in a period of the mesh that the steps resolve."""


@lru_cache
def _rule() -> tuple[Array, Array, Array]:
    """Nodes, weights and coefficients a_ij of the Gauss method, in extended doubles."""
    with mp.workdps(40):
        roots = [(1 + _legendre_root(x)) / 2 for x in np.polynomial.legendre.leggauss(STAGES)[0]]
        vandermonde = mp.matrix([[root**k for root in roots] for k in range(STAGES)])
        inverse = vandermonde**-1
        ones = mp.matrix([[mp.mpf(1) / (k + 1) for k in range(STAGES)]])
        powers = mp.matrix([[root ** (k + 1) / (k + 1) for k in range(STAGES)] for root in roots])
        texts = [[[mp.nstr(entry, 30) for entry in row] for row in m.tolist()]
                 for m in (mp.matrix([roots]), (inverse * ones.T).T, powers * inverse.T)]  # fmt: skip
    nodes, weights, a = (np.array([[np.longdouble(entry) for entry in row] for row in text]) for text in texts)
    return nodes[0], weights[0], a


def _legendre_root(x: float) -> Any:
    """The zero of the Legendre polynomial near x, by Newton's method."""
    root = mp.mpf(float(x))
    for _ in range(4):
        value, before = mp.legendre(STAGES, root), mp.legendre(STAGES - 1, root)
        root -= value * (root**2 - 1) / (STAGES * (root * value - before))
    return root


def collocation(scene: Scene, omega: float) -> float:
    """Return ln max |lambda| of a scene of smooth stiffness, by Gauss collocation in extended doubles."""
    size = 2 * scene.system.size
    period = 2 * np.longdouble(np.pi) * np.longdouble(scene.cycles) / np.longdouble(omega)
    total, scale = np.eye(size, dtype=np.longdouble), 0.0
    cycles = max(scene.system.common_period()[1])
    for a, b in pairwise(scene.edges):
        if b - a < 4e-16:
            continue
        generator = scene.generator_at(0.5 * (a + b))
        radians = float(period) * (b - a) * np.abs(np.linalg.eigvals(generator)).max()
        waves = OSCILLATIONS * cycles * (b - a)
        count = int(np.ceil(max(radians, 0 if scene.system.piecewise_constant else waves) / RADIANS)) + 1
        for k in range(count):
            total = _step(scene, a + (b - a) * k / count, (b - a) / count, period) @ total
        largest = float(np.abs(total).max())
        total, scale = total / np.longdouble(largest), scale + np.log(largest)
    value = _refined_extended(total, _dominant(total.astype(float)))
    return float(np.log(np.abs(value))) + scale


def _step(scene: Scene, start: float, length: float, period: Any) -> Array:
    """The propagator over one step: stages Y = 1 + h (a x A) Y, then 1 + h sum b_i A_i Y_i."""
    nodes, weights, a = _rule()
    generators = [scene.generator_at(float(start + length * node)).astype(np.longdouble) for node in nodes]
    n, h = len(generators[0]), np.longdouble(length) * period
    matrix = np.eye(STAGES * n, dtype=np.longdouble)
    for j, generator in enumerate(generators):
        matrix[:, j * n : (j + 1) * n] -= h * np.kron(a[:, j : j + 1], generator)
    stages = _eliminated(matrix, np.tile(np.eye(n, dtype=np.longdouble), (STAGES, 1)))
    result = np.eye(n, dtype=np.longdouble)
    for j, generator in enumerate(generators):
        result = result + h * weights[j] * (generator @ stages[j * n : (j + 1) * n])
    return result


def _eliminated(matrix: Array, right: Array) -> Array:
    """The solution for several right sides by Gaussian elimination with partial pivoting."""
    work = np.concatenate([matrix, right], axis=1)
    size = len(matrix)
    for k in range(size):
        pivot = k + int(np.argmax(np.abs(work[k:, k])))
        work[[k, pivot]] = work[[pivot, k]]
        work[k] /= work[k, k]
        rest = np.arange(size) != k
        work[rest] -= work[rest, k][:, None] * work[k]
    return work[:, size:]
