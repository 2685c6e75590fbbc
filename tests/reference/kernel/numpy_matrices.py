"""Functions of single matrices in the compiled kernel, in NumPy."""

from __future__ import annotations

from math import factorial

import numpy as np

Array = np.ndarray


def exponential(matrix: Array) -> Array:
    """exp(A) ``(m, m)``: the Taylor polynomial of a part of A of 1-norm below 1/2, squared."""
    size = np.abs(matrix).sum(axis=0).max(initial=0.0)
    count = max(0, int(np.ceil(np.log2(2 * size)))) if size > 0 else 0
    part, term = matrix * 0.5**count, np.eye(len(matrix))
    result = term
    for k in range(1, 20):
        term = term @ part
        # 0.5^20/20! is far below a rounding error.
        result = result + term / factorial(k)
    for _ in range(count):
        result = result @ result
    return result
