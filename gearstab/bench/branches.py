"""Cost of motions along branches compared with running on until a motion settles."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np

from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import StepLimits
from gearstab.response.backlash.motions import speed_cycles
from gearstab.response.backlash.sections import SectionMap
from gearstab.system import GearSystem

STARTS, SPEEDS = 5, 20
"""Mesh frequencies at which branches begin, and at which motions are run on to."""


@dataclass(frozen=True)
class BranchCost:
    """Processor time per motion, in seconds.

    motions: how many were found along branches, of which ``unstable``.  along: of one of these;  on: of running on.
    """

    motions: int
    unstable: int
    along: float
    on: float

    def text(self, cycles: float) -> str:
        """Return the line that bench prints."""
        return (
            f"branches: {self.motions} motions ({self.unstable} unstable) in {self.motions * self.along:.3g} s, "
            f"{1e3 * self.along:.3g} ms each; running on over {cycles:g} cycles: {1e3 * self.on:.3g} ms each"
        )


def branch_cost(system: GearSystem, low: float, high: float, points: int = 300, cycles: float = 200) -> BranchCost:
    """Measure both over a range of mesh frequencies, of a system with backlash."""
    begin = process_time()
    search = BranchSearch(SectionMap(system), StepLimits(low, high, points))
    search.run(Starts(tuple(np.linspace(low, high, STARTS).tolist()), cycles=cycles))
    middle = process_time()
    speed_cycles(system, np.linspace(low, high, SPEEDS), cycles=cycles)
    end = process_time()
    unstable = sum(not motion.stability.stable for branch in search.found for motion in branch.motions)
    return BranchCost(search.points, unstable, (middle - begin) / max(1, search.points), (end - middle) / SPEEDS)
