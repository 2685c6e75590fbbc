"""The ways to compute the growth of a scene, one function each, one explicit table.

A method takes a scene, mesh frequencies ``(P,)`` and a tolerance (ignored by exact ones) and returns ln max |lambda|
over one common period, ``(P,)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearstab.bench.scene import Scene
from gearstab.floquet import solve
from gearstab.floquet.dispatch import in_modes
from gearstab.floquet.segments.pattern import prepare
from gearstab.system import Array

Method = Callable[[Scene, Array, float], Array]


@dataclass(frozen=True)
class Entry:
    """A method and the settings to try: the ``tolerances`` it is given, or (nan,) for an exact one.

    batch: whether it treats many frequencies at once, and is therefore timed on many.
    fits: whether it can be applied to a scene.
    """

    name: str
    run: Method
    tolerances: tuple[float, ...] = (np.nan,)
    batch: bool = False
    fits: Callable[[Scene], bool] = lambda scene: True


def batched_eigenvalues(scene: Scene, omega: Array, _: float) -> Array:
    """Batched NumPy products of the segments' propagators, then numpy.linalg.eigvals of all monodromy matrices."""
    (pattern,) = prepare(scene.system)
    elastic, turns = pattern.elastic, 2 * np.pi * pattern.cycles / omega[:, None]
    product = np.eye(2 * pattern.size)
    for s, state in enumerate(pattern.states):
        w = np.sqrt(pattern.squared_frequency[0, state].astype(complex))
        time = float(elastic.rate[0]) * pattern.fractions[0, s] * turns
        change = pattern.change(s)[0] if len(pattern.states) > 1 else np.eye(pattern.size)
        terms = np.cos(w * time), time * np.sinc(w * time / np.pi), -w * np.sin(w * time)
        cosine, over, times = (change * term.real[:, None, :] for term in terms)
        product = np.block([[cosine, over], [times, cosine]]) @ product
    growth = np.log(np.abs(np.linalg.eigvals(product)).max(axis=-1))
    return np.asarray(growth - float(elastic.shift[0] * elastic.rate[0]) * turns[:, 0])


def exponential_products(scene: Scene, omega: Array, _: float) -> Array:
    """scipy.linalg.expm of every segment at every frequency, multiplied; eigenvalues of the product."""
    parts = [(duration, scene.generator(levels)) for duration, levels in scene.segments]
    growth = np.empty(len(omega))
    for k, frequency in enumerate(omega):
        total = np.eye(2 * scene.system.size)
        for duration, generator in parts:
            total = expm(generator * (duration * 2 * np.pi / frequency)) @ total
        growth[k] = np.log(np.abs(np.linalg.eigvals(total)).max())
    return growth


HARMONICS = 5
"""Harmonics of a mesh's wave that the number of collocation points allows for."""
LARGEST = 1500
"""Order of an eigenvalue problem that Hill's method may take; minutes per point beyond it."""


def periods(scene: Scene, omega: Array) -> Array:
    """The common period, ``(P,)``."""
    return 2 * np.pi * scene.cycles / omega


def product(scene: Scene, omega: Array, tolerance: float) -> Array:
    """The product's own way, to a tolerance of the multipliers where it is not exact."""
    found = solve(scene.system, omega, tolerance=tolerance)
    return found.growth_rate[0] * periods(scene, omega)


def _growth(matrix: Array) -> float:
    return float(np.log(np.abs(np.linalg.eigvals(matrix)).max()))


def _radians(scene: Scene, tau: float, span: float) -> float:
    """Phase of the fastest mode over a time span."""
    return float(np.abs(np.linalg.eigvals(scene.generator_at(tau))).max() * span)


def collocation(scene: Scene, omega: Array, tolerance: float) -> Array:
    """Chebyshev collocation of x' = A(t) x on every smooth piece, with more points for smaller tolerances.

    Spectrally accurate on an analytic piece. Its number of points must be guessed beforehand, and one piece costs the
    cube of it.
    """
    growth, cycles = np.empty(len(omega)), max(scene.system.common_period()[1])
    for k, period in enumerate(periods(scene, omega)):
        total = np.eye(2 * scene.system.size)
        for a, b in pairwise(scene.edges):
            if b - a > 4e-16:
                radians = _radians(scene, 0.5 * (a + b), period * (b - a)) + 2 * np.pi * HARMONICS * cycles * (b - a)
                pieces = int(np.ceil(radians / 20))
                count = int(np.ceil(6 + 0.7 * radians / pieces + 1.1 * np.log10(1 / tolerance)))
                for part in range(pieces):
                    start, length = a + (b - a) * part / pieces, (b - a) / pieces
                    total = _piece(scene, start, length, period, count) @ total
        growth[k] = _growth(total)
    return growth


def _piece(scene: Scene, start: float, length: float, period: float, count: int) -> Array:
    """The propagator over a piece from its values at the Chebyshev points, the end being one of them."""
    size = 2 * scene.system.size
    nodes, derivative = chebyshev(count)
    matrix = np.kron(derivative, np.eye(size))
    for j, node in enumerate(nodes):
        block = slice(j * size, (j + 1) * size)
        inside = min(max(0.5 * (1 + node), 1e-12), 1 - 1e-12)
        matrix[block, block] -= 0.5 * length * period * scene.generator_at(start + length * inside)
    # The last node, -1, is the beginning, where the state is known.
    right = -matrix[:-size, -size:]
    return np.asarray(np.linalg.solve(matrix[:-size, :-size], right)[:size])


def chebyshev(count: int) -> tuple[Array, Array]:
    """Chebyshev points from 1 to -1 and the derivative of the polynomial through them (Trefethen 2000, chapter 6)."""
    x = np.cos(np.pi * np.arange(count + 1) / count)
    c = np.concatenate([[2.0], np.ones(count - 1), [2.0]]) * (-1.0) ** np.arange(count + 1)
    gap = x[:, None] - x[None, :]
    d = np.outer(c, 1 / c) / (gap + np.eye(count + 1))
    return x, d - np.diag(d.sum(axis=1))


def hill(scene: Scene, omega: Array, tolerance: float) -> Array:
    """Hill's method: eigenvalues of the truncated harmonic balance x = exp(mu t) sum_j x_j exp(i j w t).

    More harmonics for smaller tolerances. Of the eigenvalues, each of which repeats along the imaginary axis, those of
    the eigenvectors centred at j = 0 are taken. Waves with kinks or jumps converge slowly, as j^-3 and j^-2, and all
    eigenvalues near the cut are wrong: it is a check, not a method of choice.

    Source: Hill 1886; in this form Lazarus & Thomas 2010, C. R. Mecanique 338, 510-517.
    """
    size = 2 * scene.system.size
    growth = np.empty(len(omega))
    for k, (frequency, period) in enumerate(zip(omega, periods(scene, omega), strict=True)):
        base = frequency / scene.cycles
        spread = _radians(scene, 0.5 * (scene.edges[0] + scene.edges[1]), 1.0) / base
        order = int(np.ceil(spread + 2 + 2.5 * np.log10(1 / tolerance)))
        order = min(order, (LARGEST // size - 1) // 2)
        matrix = _harmonic_balance(scene, base, order)
        values, vectors = np.linalg.eig(matrix)
        weight = np.sum(np.abs(vectors.reshape(2 * order + 1, size, -1)) ** 2, axis=1)
        centre = (np.arange(-order, order + 1) @ weight) / weight.sum(axis=0)
        chosen = np.argsort(np.abs(centre), kind="stable")[:size]
        growth[k] = float(values[chosen].real.max() * period)
    return growth


def _harmonic_balance(scene: Scene, base: float, order: int) -> Array:
    size, count = 2 * scene.system.size, 2 * order + 1
    system, n = scene.system, scene.system.size
    mean = scene.generator(tuple(float(mesh.mean_stiffness) for mesh in system.meshes))
    inverse = np.linalg.inv(system.mass)
    total = np.kron(np.eye(count), mean).astype(complex)
    total -= np.kron(np.diag(1j * base * np.arange(-order, order + 1)), np.eye(size))
    for mesh, cycles in zip(system.meshes, system.common_period()[1], strict=True):
        part = np.zeros((size, size))
        part[n:, :n] = -inverse @ mesh.outer
        for s in range(1, 2 * order // cycles + 1):
            a, b = (float(value) for value in mesh.waveform.fourier(s))
            # 2 k_a (a sin s x + b cos s x), x = 2 pi (cycles tau - lag)
            coefficient = float(mesh.amplitude) * (b - 1j * a) * np.exp(-2j * np.pi * s * float(mesh.lag))
            above = np.diag(np.ones(count - s * cycles), -s * cycles)
            total += np.kron(coefficient * above + np.conj(coefficient) * above.T, part)
    return total


def integration(method: str, broken: bool) -> Method:
    """scipy.integrate.solve_ivp of the 2n fundamental solutions, restarted at every edge (broken) or run across."""

    def run(scene: Scene, omega: Array, tolerance: float) -> Array:
        size, generator = 2 * scene.system.size, scene.lookup()
        cuts = list(pairwise(scene.edges)) if broken else [(0.0, 1.0)]
        growth = np.empty(len(omega))
        for k, period in enumerate(periods(scene, omega)):

            def field(tau: float, x: Array, period: float = period) -> Array:
                return (period * generator(tau) @ x.reshape(size, size)).ravel()

            y = np.eye(size).ravel()
            for a, b in cuts:
                if b - a > 4e-16:
                    inside = (a + 1e-15, b - 1e-15)
                    y = solve_ivp(field, inside, y, method, rtol=tolerance, atol=1e-2 * tolerance).y[:, -1]
            growth[k] = _growth(y.reshape(size, size))
        return growth

    return run


def _exact(scene: Scene) -> bool:
    return scene.exact


def _smooth(scene: Scene) -> bool:
    return not scene.exact


def _of_second_order(scene: Scene) -> bool:
    return not scene.exact and in_modes(scene.system)


INTEGRATOR_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)

METHODS: tuple[Entry, ...] = (
    Entry("exact", product, batch=True, fits=_exact),
    Entry(
        "NumPy products + eigvals",
        batched_eigenvalues,
        batch=True,
        fits=lambda scene: scene.exact and scene.conservative,
    ),
    Entry("products of expm", exponential_products, fits=_exact),
    Entry("DOP853, broken at jumps", integration("DOP853", True), INTEGRATOR_TOLERANCES, fits=_exact),
    Entry("RK45, broken at jumps", integration("RK45", True), INTEGRATOR_TOLERANCES[:4], fits=_exact),
    Entry("DOP853, unbroken", integration("DOP853", False), INTEGRATOR_TOLERANCES, fits=_exact),
    Entry("RK45, unbroken", integration("RK45", False), INTEGRATOR_TOLERANCES[:4], fits=_exact),
    Entry("Magnus", product, INTEGRATOR_TOLERANCES, batch=True, fits=_of_second_order),
    Entry(
        "Magnus of the first-order form",
        product,
        INTEGRATOR_TOLERANCES,
        batch=True,
        fits=lambda scene: not in_modes(scene.system),
    ),
    Entry("Chebyshev collocation", collocation, INTEGRATOR_TOLERANCES, fits=_smooth),
    Entry("Hill's method", hill, INTEGRATOR_TOLERANCES[:4], fits=_of_second_order),
    Entry("DOP853, broken at kinks", integration("DOP853", True), INTEGRATOR_TOLERANCES, fits=_smooth),
    Entry("DOP853, across kinks", integration("DOP853", False), INTEGRATOR_TOLERANCES, fits=_smooth),
)
