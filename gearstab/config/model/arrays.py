"""Arrays from nested parameters, any number of which may be an array of batch shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray


def vector(values: Sequence[Any] | Array) -> Array:
    """``(..., n)`` from n numbers, any of which may be an array of batch shape."""
    if isinstance(values, np.ndarray):
        return values
    return np.stack(np.broadcast_arrays(*[np.asarray(v, dtype=float) for v in values]), axis=-1)


def matrix(rows: Sequence[Sequence[Any]] | Array) -> Array:
    """``(..., n, m)`` from nested numbers, any of which may be an array of batch shape."""
    if isinstance(rows, np.ndarray):
        return rows
    return np.stack(np.broadcast_arrays(*[vector(row) for row in rows]), axis=-2)


def diagonal(values: Sequence[Any]) -> Array:
    """``(..., n, n)`` diagonal matrix."""
    entries = vector(values)
    return entries[..., :, None] * np.eye(entries.shape[-1])


def given(number: Any) -> bool:
    """Return whether a number is there and not zero everywhere."""
    return number is not None and bool(np.any(np.asarray(number) != 0))
