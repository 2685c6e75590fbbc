"""Motions of a branch, with what is told of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gearstab.response.backlash.history import BACKLASH_FLAGS
from gearstab.response.backlash.measure import LimitCycle
from gearstab.response.branches.continuation import BRANCHING, DOUBLING, FOLD, NEIMARK_SACKER
from gearstab.response.branches.stability import MotionStability
from gearstab.system import Array

GRAZING = "grazing"
MOST_BRANCHES = 32
"""Branches of a system, at most."""
KINDS = {"none": 0, FOLD: 1, DOUBLING: 2, NEIMARK_SACKER: 3, GRAZING: 4, BRANCHING: 5}
"""Events of motions: what crosses the unit circle; the first of a doubled branch, up to which motions are linear."""
BRANCH_FLAGS = {
    "range_end": 1, "closed": 2, "unbounded": 4, "more_points": 8, "step_failed": 16, "linear_motions": 32,
    "doubling": 64, "branch_point": 128, "grazing": BACKLASH_FLAGS["grazing"],
}  # fmt: skip
"""Bits of ``status``: why a branch ends at a motion, at an end of the range, where it began, or beyond the amplitude
limit; as so many points were asked for; as no step was short enough; at linear motions of any amplitude; at the
doubling or branch point that it leaves from. ``grazing``: a flank is hardly touched or missed."""


@dataclass(frozen=True)
class BranchMotion:
    """A point of a branch. x, parameter, kind, multiplicity, vector: as there.  grazing: a flank is hardly touched."""

    x: Array
    parameter: float
    kind: str
    multiplicity: int
    vector: Array | None
    stability: MotionStability
    cycle: LimitCycle
    grazing: bool


@dataclass(frozen=True)
class Branch:
    """Periodic motions along a curve.

    motions: in its order;  periods: common periods of each.
    parent, leaves: the branch that it leaves and the number of the motion there, -1 for none.
    ends: why it ends at the first and the last, of BRANCH_FLAGS.
    """

    motions: tuple[BranchMotion, ...]
    periods: int
    ends: tuple[str, str]
    parent: int = -1
    leaves: int = -1

    def between(self, parameter: float) -> Iterator[tuple[int, Array, float]]:
        """Where the branch passes a parameter: the motion next to it, the state ``(m,)`` there by a straight line, and
        the step between the motions on both sides.
        """
        for k, (one, other) in enumerate(pairwise(self.motions)):
            if (one.parameter - parameter) * (other.parameter - parameter) <= 0:
                part = (parameter - one.parameter) / (other.parameter - one.parameter or 1.0)
                step = other.x - one.x
                yield k + round(part), one.x + part * step, float(np.abs(step).max(initial=0.0))
