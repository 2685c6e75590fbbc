"""Number of steps that each point needs: compared with half of them, and multiplied until a tolerance is reached.

With a scheme of order p the difference of two results is 2^p - 1 times the error of the finer one once that has
converged (Richardson). How results are compared is left to whoever computes them; here it is decided which points are
computed again, and with how many steps.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearstab.system import Array

AIM = 0.5
"""Error aimed at, as a part of the tolerance."""
LEAP = 3
"""Most doublings at once: a factor 8 in the number of steps, 2^18 in an error of order six."""


def remainder(order: int) -> float:
    """Return the error of a converged result, as a part of its difference from that of half of the steps."""
    return 1.0 / (2**order - 1)


class StepControl:
    """Iteration over levels of resolution, each with the points to be computed there.

    level: ``(...)`` int, at which each point begins, raised in place. last: the largest one of each point. doubling:
    levels that double the steps. leap: doublings at once, at most. Every level is answered by :meth:`judge` before the
    next::

        for level, chosen in control:
            control.judge(error of the chosen points)
    """

    def __init__(
        self, level: Array, last: Array | int, tolerance: float, order: int, doubling: int = 1, leap: int = LEAP
    ) -> None:
        self.level, self.last = level, np.broadcast_to(last, level.shape)
        self.pending = np.ones(level.shape, dtype=bool)
        self.tolerance, self.order, self.doubling, self.leap = tolerance, order, doubling, leap

    def __iter__(self) -> Iterator[tuple[int, Array]]:
        """Yield levels in ascending order, and which points are to be computed there, bool."""
        while self.pending.any():
            level = int(self.level[self.pending].min())
            self.chosen = self.pending & (self.level == level)
            yield level, self.chosen

    def judge(self, error: Array | float, rounding: Array | float = 0.0) -> None:
        """Take the estimated errors of the points of this level; more steps follow where they are too large.

        rounding: the part of an error that more steps do not lessen. Errors that are not finite: an endless one is
        followed by twice the steps, NaN by none.
        """
        error, before = np.asarray(error), self.level[self.chosen]
        with np.errstate(divide="ignore", invalid="ignore"):
            excess = np.maximum(error - rounding, 0.0) / np.maximum(AIM * self.tolerance, rounding)
            times = np.ceil(np.nan_to_num(np.log2(excess) / self.order, nan=1.0, posinf=1.0))
        more = self.doubling * np.clip(times, 1, self.leap).astype(int)
        # Where rounding has the last word more steps do not help.
        again = (error > self.tolerance) & (error > 2 * np.asarray(rounding)) & (before < self.last[self.chosen])
        self.level[self.chosen] = np.minimum(before + np.where(again, more, 0), self.last[self.chosen])
        self.pending[self.chosen] = again
