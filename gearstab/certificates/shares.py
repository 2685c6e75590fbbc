"""How much of a range of mesh frequencies has certificates."""

from __future__ import annotations

from math import floor

import numpy as np

Array = np.ndarray


def said(shares: Array, widths: Array) -> str:
    """Return one line on what of the range of all rows has certificates."""
    least = f", of the worst row {_percent(shares.min())}" if shares.size > 1 else ""
    rest = f"; no part without is wider than {widths.max():.2g} of its mesh frequency"
    return f"{_percent(shares.mean())} of the mesh frequencies have certificates{least}{rest}"


def _percent(share: float) -> str:
    """Rounded down: all is all."""
    return f"{floor(share * 1e5 + 1e-6) / 1e3:g} %"


def union_length(ends: Array, start: float, stop: float) -> tuple[float, float]:
    """How much of [start, stop] intervals ``(K, 2)`` cover, and the widest gap relative to where it is."""
    at, covered, widest = start, 0.0, 0.0
    for low, high in [*sorted(np.clip(ends, start, stop).tolist()), (stop, stop)]:
        if low > at:
            widest = max(widest, 2 * (low - at) / (low + at))
        covered += max(0.0, high - max(low, at))
        at = max(at, high)
    return covered, widest
