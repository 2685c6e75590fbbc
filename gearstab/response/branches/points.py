"""Fixed points of a map, and what the map says there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gearstab.system import Array

OUTSIDE = 1e-9
"""Excess of the magnitude of a multiplier over 1 from which on it counts as outside."""


class Visit(Protocol):
    """Values of a map at a point: its image, DP ``(m, m)`` there, and its eigenvalues of descending magnitude."""

    @property
    def end(self) -> Array: ...
    @property
    def derivative(self) -> Array: ...
    @property
    def multipliers(self) -> Array: ...


@dataclass(frozen=True)
class Point:
    """A fixed point.

    x: ``(m,)``;  parameter: p;  visit: what the map says there.
    kind: what crosses the unit circle there, "" for nothing;  multiplicity: how many multipliers (a pair counts once).
    vector: ``(m, multiplicity)``, directions that belong to them, real where they are.
    """

    x: Array
    parameter: float
    visit: Visit
    kind: str = ""
    multiplicity: int = 0
    vector: Array | None = None

    @property
    def outside(self) -> int:
        """The number of multipliers outside of the unit circle."""
        return int(np.count_nonzero(np.abs(self.visit.multipliers) > 1 + OUTSIDE))


class NoPoint(ArithmeticError):
    """Newton's method finds no point."""
