"""Phases: positions within one period."""

from __future__ import annotations

import numpy as np

from gearstab.waveforms.base import Array


def wrapped(x: Array) -> Array:
    """x modulo 1, in [0, 1): also where rounding would make it 1."""
    found = np.asarray(x) - np.floor(x)
    return np.where(found >= 1.0, 0.0, found)


def stiff_fraction(contact_ratio: Array | float) -> Array:
    """d = c - floor(c), the fraction of the period in which floor(c) + 1 pairs of teeth carry."""
    c = np.asarray(contact_ratio, dtype=float)
    return c - np.floor(c)
