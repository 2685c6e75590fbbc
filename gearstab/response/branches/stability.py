"""Whether a periodic motion attracts what is near, and how it does not, by its multipliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.response.branches.continuation import Curve
from gearstab.response.branches.points import NoPoint
from gearstab.response.branches.sections import Lap, SectionMap
from gearstab.system import Array

LOSSES = {"none": 0, "fold": 1, "period_doubling": 2, "neimark_sacker": 3}
"""Kind of stability loss by the multiplier of the largest magnitude: it is 1, -1 or one of a pair where stability is
lost."""
NEAR = 1e-3
"""Part of its extent by which a motion may move when it is made periodic."""


@dataclass(frozen=True)
class MotionStability:
    """Stability of a periodic motion.

    multipliers: ``(m,)`` complex, of descending magnitude;  error: an estimate for them.
    loss: a value of LOSSES, of what is lost, or would be first;  residual: of the motion, relative to its extent.
    """

    multipliers: Array
    error: float
    loss: int
    residual: float

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside of the unit circle."""
        return bool(np.all(np.abs(self.multipliers) < 1))


def stability(laps: SectionMap, lap: Lap, omega: float) -> MotionStability:
    """The stability of a motion that ends, but for rounding, where it begins."""
    values = lap.multipliers
    extent = float(np.abs(lap.start).max(initial=0.0)) or 1.0
    residual = float(np.abs(lap.end - lap.start).max(initial=0.0)) / extent
    error = lap.multiplier_error(laps.lap(lap.end, omega, lap.periods))
    return MotionStability(values, error, loss_of(values), residual)


def loss_of(multipliers: Array) -> int:
    """The value of LOSSES by multipliers of descending magnitude."""
    if not len(multipliers):
        return LOSSES["none"]
    first = multipliers[0]
    if first.imag != 0:
        return LOSSES["neimark_sacker"]
    return LOSSES["fold" if first.real > 0 else "period_doubling"]


def of_settled(laps: SectionMap, x: Array, omega: float, periods: int) -> MotionStability | None:
    """The stability of the periodic motion that the elastic state x has come near to; None where there is none."""
    extent = float(np.abs(x).max(initial=0.0)) or 1.0
    try:
        point = Curve(lambda x, omega: laps.lap(x, omega, periods), extent, 1.0).at(x, omega)
    except NoPoint:
        return None
    lap = point.visit
    assert isinstance(lap, Lap)
    if np.abs(point.x - x).max(initial=0.0) > NEAR * extent:
        return None
    return stability(laps, lap, omega)
