"""Interpolation on a cell, at equidistant places around it, and what it leaves."""

from __future__ import annotations

from functools import cache
from math import factorial

from flint import arb, arb_mat, ctx, fmpq

CELL, NODES = 4, 48
"""Distances of nodes that a cell is long; nodes, half of them on each side of its middle."""
PRECISE = 512
"""Bits in which coefficients are found, which are large and cancel each other."""


@cache
def bend() -> arb:
    """Bound the product of all |z - z_j| on a cell, of NODES numbers z_j at distances 1, symmetric to 0, divided by
    NODES!: in pairs, |z^2 - z_j^2|.
    """
    found = fmpq(1)
    for k in range(NODES // 2):
        square = fmpq(2 * k + 1, 2) ** 2
        found *= max(square, fmpq(CELL * CELL, 4) - square)
    return arb(found / factorial(NODES))


@cache
def to_coefficients() -> arb_mat:
    """From values at the nodes to coefficients in z, which is -1 and 1 at the ends of a cell."""
    with ctx.workprec(PRECISE):
        nodes = [arb(fmpq(2 * j - NODES + 1, CELL)) for j in range(NODES)]
        found = arb_mat([[z**k for k in range(NODES)] for z in nodes]).inv()
    return found * arb(1)  # rounded to the bits of all other matrices
