"""Least and greatest values of smooth functions between samples, from values and derivatives on panels.

Through five values and five derivatives at the Gauss-Lobatto nodes of a panel goes a polynomial of degree nine. Its
error for exp(i w t) on a panel of length h is below (w h)^10/4e10 or so: 1e-8 at two radians a panel. The largest of
its values on a grid tells the panels where the extreme may be, and Newton's method on the derivative finds it there.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial

from gearstab.system import Array

NODES = 0.5 + 0.5 * np.array([-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0])
"""Nodes of the Gauss-Lobatto rule on [0, 1]."""
BETWEEN = np.array([0.055, 0.32, 0.68, 0.945])
"""Further points where a product with a function without known derivative is looked at."""
DEGREE = 2 * len(NODES) - 1
ROUNDS = 4
"""Rounds of Newton's method, from a ninth of a panel away."""
FLAT = 1e-13
"""Curvature below this part of a value is rounding."""


def _powers(x: Array, degree: int = DEGREE) -> Array:
    """Values at x in [0, 1] of the powers of y = 2 x - 1."""
    return polynomial.polyvander(2 * x - 1, degree)


def _derivatives(x: Array, degree: int = DEGREE) -> Array:
    """Their derivatives with respect to x."""
    return np.hstack([np.zeros((len(x), 1)), 2 * np.arange(1, degree + 1) * _powers(x, degree - 1)])


COEFFICIENTS = np.linalg.inv(np.vstack([_powers(NODES), _derivatives(NODES)]))
"""``(10, 10)``, powers of y from five values and five derivatives."""
GRID = np.linspace(0.0, 1.0, 9)
ON_GRID = _powers(GRID) @ COEFFICIENTS
HERMITE = _powers(BETWEEN) @ COEFFICIENTS
"""``(9, 10)`` and ``(4, 10)``, values on the grid and at the points between."""
RATES = _derivatives(NODES, 8) @ np.linalg.inv(_powers(np.concatenate([NODES, BETWEEN]), 8))
"""``(5, 9)``, derivatives at the nodes of the polynomial of degree eight through nodes and points between."""
CURVES = np.hstack([np.zeros((5, 2)), 4 * _powers(NODES, DEGREE - 2) * (np.arange(2, 10) * np.arange(1, 9))])
CURVES = CURVES @ COEFFICIENTS
"""``(5, 10)``, second derivatives at the nodes."""
_OFF = np.array([0.07, 0.93])
"""Between the outer two nodes at either end, where interpolation errs most."""
DOUBT = _powers(_OFF) @ COEFFICIENTS
DOUBT[:, :5] -= _powers(_OFF, 4) @ np.linalg.inv(_powers(NODES, 4))
"""``(2, 10)``, by how much the polynomial of degree four through the values alone is off."""


def extremes(values: Array, rates: Array) -> tuple[Array, Array, Array]:
    """Least and greatest value ``(...)`` on all panels, and the largest error ``(...)`` without the derivatives.

    values, rates: ``(panels, 5, ...)``, at the nodes of each panel, and their derivatives times its length.
    """
    shape, origin = values.shape[2:], values[0, 0]
    # A small fluctuation of a large force keeps its digits.
    data = np.concatenate([values - origin, rates], axis=1).reshape(len(values), len(COEFFICIENTS), -1)
    grid = ON_GRID @ data
    doubt = np.abs(DOUBT @ data).max(axis=(0, 1), initial=0.0)
    both = _greatest(np.concatenate([data, -data], axis=2), np.concatenate([grid, -grid], axis=2)).reshape(2, *shape)
    least, greatest = origin - both[1], origin + both[0]
    exact = values.min(axis=(0, 1)), values.max(axis=(0, 1))
    return np.minimum(least, exact[0]), np.maximum(greatest, exact[1]), doubt.reshape(shape)


def _greatest(data: Array, grid: Array) -> Array:
    """``(Q,)``, of the functions with ``data (panels, 10, Q)`` and values ``(panels, 9, Q)`` on the grid."""
    at = grid.argmax(axis=1)[:, None]
    inner = np.clip(at, 1, len(GRID) - 2)
    left, middle, right = (np.take_along_axis(grid, inner + k, axis=1)[:, 0] for k in (-1, 0, 1))
    top = np.take_along_axis(grid, at, axis=1)[:, 0]
    best = top.max(axis=0)
    # A parabola through neighbours rises above them by an eighth of their second difference at most.
    bend = np.abs(left - 2 * middle + right)
    panel, column = np.nonzero((top + bend > best) & (bend > FLAT * np.abs(best)))
    c = (data[panel, :, column] @ COEFFICIENTS.T).T
    slope, curve = polynomial.polyder(c), polynomial.polyder(c, 2)
    start, width = 2 * GRID[at[panel, 0, column]] - 1, 2 * GRID[1]
    low, high = np.maximum(start - width, -1.0), np.minimum(start + width, 1.0)
    y = start
    for _ in range(ROUNDS):
        first, second = polynomial.polyval(y, slope, tensor=False), polynomial.polyval(y, curve, tensor=False)
        step = np.where(second < 0, -first / np.where(second < 0, second, -1.0), width * np.sign(first))
        y = np.clip(y + step, low, high)
    np.maximum.at(best, column, polynomial.polyval(y, c, tensor=False))
    return np.asarray(best)
