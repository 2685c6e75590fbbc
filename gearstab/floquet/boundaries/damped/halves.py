"""The two halves of a period, for Floquet vectors at its beginning and in its middle."""

from __future__ import annotations

import numpy as np

from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.kernel.chain import Chain
from gearstab.system import Array


def halves(chain: Chain, row: Array, cycle: Array) -> tuple[Array, Array, Array]:
    """The products of the first and the second half of the segments ``(P, m, m)`` in the coordinates of the states,
    over exp(scale) together, and scale ``(P,)``, at points (row, 1/Omega) ``(P,)``.
    """
    middle = len(chain.states) // 2
    first, one = np.tile(np.eye(chain.size), (len(row), 1, 1)), np.zeros(len(row))
    if middle:
        first, one = kernel.current().products(chain.part(slice(0, middle)), row, cycle)
    second, other = kernel.current().products(chain.part(slice(middle, None)), row, cycle)
    return first, second, one + other
