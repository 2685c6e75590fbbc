"""Products of chains and their moduli in NumPy, step by step; clear rather than fast."""

import numpy as np
from numpy_lyapunov import exponential
from scipy.linalg import expm

from gearstab.floquet.kernel.chain import Chain

Array = np.ndarray


def moduli(chain: Chain, row: Array, cycle: Array) -> Array:
    """ln |lambda| of all multipliers, descending, ``(P, m)``, at points (row, 1/Omega) ``(P,)``."""
    product, scale = products(chain, row, cycle)
    with np.errstate(divide="ignore"):
        logs = np.log(np.abs(np.linalg.eigvals(product))) + scale[:, None]
    return -np.sort(-logs, axis=1)


def products(chain: Chain, row: Array, cycle: Array) -> tuple[Array, Array]:
    """The product of all segments ``(P, m, m)`` in the coordinates of the states, over exp(scale); scale ``(P,)``."""
    period, m, scale = chain.period(cycle), chain.size, np.zeros(len(row))
    product = np.tile(np.eye(m), (len(row), 1, 1))
    for s in range(len(chain.states)):
        product = _step(chain, s, row, chain.fractions[row, s] * period) @ product
        size = np.maximum(np.abs(product).max(axis=(1, 2)), np.finfo(float).tiny)
        product, scale = product / size[:, None, None], scale + np.log(size)
    return product, scale


def _step(chain: Chain, segment: int, row: Array, duration: Array) -> Array:
    """exp(A t) of a segment and what follows it; where the modes are meaningless, in the coordinates themselves."""
    state, sound = chain.states[segment], chain.sound[row]
    result = chain.change[row, chain.index[segment]] @ exponential(chain.values[row, state], duration)
    if not sound.all():
        left = np.flatnonzero(~sound)
        result[left] = expm(chain.generator.matrix[row[left], state] * duration[left, None, None])
    return result
