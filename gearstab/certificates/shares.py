"""How much of a range of mesh frequencies has certificates."""

from __future__ import annotations

from math import floor

import numpy as np

Array = np.ndarray


def said(shares: Array, widths: Array, around: Array) -> str:
    """Return one line on what of the range of all rows has certificates, and how much around edges has none."""
    least = f", of the worst row {_percent(shares.min())}" if shares.size > 1 else ""
    rest = f"; no part without is wider than {widths.max():.2g} of its mesh frequency"
    known = around[np.isfinite(around)]
    if known.size:
        rest += (
            f", around {known.size} edges {known.min():.2g} to {known.max():.2g}, half of them {np.median(known):.2g}"
        )
    return f"{_percent(shares.mean())} of the mesh frequencies have certificates{least}{rest}"


def _percent(share: float) -> str:
    """Rounded down: all is all."""
    return f"{floor(share * 1e5 + 1e-6) / 1e3:g} %"


def gaps(ends: Array, start: float, stop: float) -> Array:
    """``(G, 2)``: what of [start, stop] intervals ``(K, 2)`` leave, ascending."""
    at, found = start, []
    for low, high in [*sorted(np.clip(ends, start, stop).tolist()), (stop, stop)]:
        if low > at:
            found.append((at, low))
        at = max(at, high)
    return np.array(found).reshape(-1, 2)


def union_length(ends: Array, start: float, stop: float) -> tuple[float, float]:
    """How much of [start, stop] intervals ``(K, 2)`` cover, and the widest gap relative to where it is."""
    left = gaps(ends, start, stop)
    covered = (stop - start) - float(np.ptp(left, axis=1).sum())
    return covered, float((np.ptp(left, axis=1) / left.mean(axis=1)).max(initial=0.0))


def around_edges(edges: Array, ends: Array, start: float, stop: float) -> Array:
    """How wide the gap is that has an edge in it, relative to the edge, for any shape of edges; NaN where none is."""
    left, found = gaps(ends, start, stop), np.full(edges.shape, np.nan)
    for low, high in left:
        there = (low <= edges) & (edges <= high)
        found[there] = (high - low) / edges[there]
    return found
