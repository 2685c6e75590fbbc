"""The ways to compute the growth of a scene, one function each, one explicit table.

A method takes a scene, mesh frequencies ``(P,)`` and a tolerance (ignored by exact ones) and returns ln max |lambda|
over one common period, ``(P,)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from gearstab.bench import smooth_methods as smooth
from gearstab.bench.scene import Scene
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


def _exact(scene: Scene) -> bool:
    return scene.exact


def _smooth(scene: Scene) -> bool:
    return not scene.exact


def _of_second_order(scene: Scene) -> bool:
    return not scene.exact and in_modes(scene.system)


INTEGRATOR_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)

METHODS: tuple[Entry, ...] = (
    Entry("exact", smooth.product, batch=True, fits=_exact),
    Entry(
        "NumPy products + eigvals",
        batched_eigenvalues,
        batch=True,
        fits=lambda scene: scene.exact and scene.conservative,
    ),
    Entry("products of expm", exponential_products, fits=_exact),
    Entry("DOP853, broken at jumps", smooth.integration("DOP853", True), INTEGRATOR_TOLERANCES, fits=_exact),
    Entry("RK45, broken at jumps", smooth.integration("RK45", True), INTEGRATOR_TOLERANCES[:4], fits=_exact),
    Entry("DOP853, unbroken", smooth.integration("DOP853", False), INTEGRATOR_TOLERANCES, fits=_exact),
    Entry("RK45, unbroken", smooth.integration("RK45", False), INTEGRATOR_TOLERANCES[:4], fits=_exact),
    Entry("Magnus", smooth.product, INTEGRATOR_TOLERANCES, batch=True, fits=_of_second_order),
    Entry(
        "Magnus of the first-order form",
        smooth.product,
        INTEGRATOR_TOLERANCES,
        batch=True,
        fits=lambda scene: not in_modes(scene.system),
    ),
    Entry("Chebyshev collocation", smooth.collocation, INTEGRATOR_TOLERANCES, fits=_smooth),
    Entry("Hill's method", smooth.hill, INTEGRATOR_TOLERANCES[:4], fits=_of_second_order),
    Entry("DOP853, broken at kinks", smooth.integration("DOP853", True), INTEGRATOR_TOLERANCES, fits=_smooth),
    Entry("DOP853, across kinks", smooth.integration("DOP853", False), INTEGRATOR_TOLERANCES, fits=_smooth),
)
