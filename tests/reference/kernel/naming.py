"""Names of instability regions of one row: the rules of boundaries/names, no more.

Every root within reach is scored for every slot, and the assignment with the greatest total is that of SciPy.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from gearstab.floquet.boundaries.names import Root
from gearstab.system import Array

SURE, FORBIDDEN, REACH = 0.5, -10.0, 1.3


@dataclass(frozen=True)
class Unnamed:
    """A region: where it is (cycle = 1/Omega), the shares of roots in its growing solutions, and how many collisions of
    each class (at +1, at -1, elsewhere) lie below it and inside it.
    """

    cycle: float
    shares: dict[Root, float]
    passed: tuple[int, int, int]
    meetings: tuple[int, int, int]

    @property
    def leading(self) -> Root | None:
        return max(self.shares, key=self.shares.__getitem__, default=None)

    @property
    def classes(self) -> list[int]:
        """Classes of the roots that it must have; where its counts cannot tell, that of the leading solution."""
        own = [c for c, count in enumerate(self.meetings) for _ in range(count)]
        return own or ([] if self.leading is None else [class_of(self.leading)])


def class_of(root: Root) -> int:
    return 2 if root.p != root.q else root.cycles % 2


def center(root: Root, frequency: Array, cycles: float) -> float:
    """The cycle at which a root lies for epsilon = 0."""
    return root.cycles / float((frequency[root.p] + frequency[root.q]) * cycles)


def below(cycle: float, frequency: Array, cycles: float) -> tuple[int, int, int]:
    """How many roots of each class lie below a cycle, since T = 0."""
    turns = frequency * cycles * cycle
    pairs = (turns[:, None] + turns)[np.triu_indices(len(turns), 1)]
    at_one, at_minus_one, elsewhere = (np.floor(part).sum() for part in (turns, turns + 0.5, pairs))
    return int(at_one), int(at_minus_one), int(elsewhere)


def rank(root: Root, frequency: Array, cycles: float) -> int:
    """How many roots of its class lie below a root, which is none below itself."""
    return below(center(root, frequency, cycles) * (1 - 1e-9), frequency, cycles)[class_of(root)]


def assign(regions: list[Unnamed], frequency: Array, cycles: float) -> list[list[Root]]:
    """The roots of each region, that with the largest share first; every region has at least one."""
    settled = [
        lead
        for region in regions
        if (lead := region.leading) is not None
        and region.classes == [class_of(lead)]
        and region.shares[lead] > SURE
        and rank(lead, frequency, cycles) == region.passed[class_of(lead)]
    ]
    fixed = {lead for lead in settled if settled.count(lead) == 1}
    result = [[region.leading] if region.leading in fixed else [] for region in regions]
    left = [k for k, own in enumerate(result) if not own]
    slots = [(k, c, regions[k].classes[:j].count(c)) for k in left for j, c in enumerate(regions[k].classes)]
    roots = [root for root in near([regions[k] for k in left], frequency, cycles) if root not in fixed]
    score = np.array([[scored(regions[k], c, j, r, frequency, cycles) for r in roots] for k, c, j in slots])
    if score.size:
        for slot, column in zip(*linear_sum_assignment(score, maximize=True), strict=True):
            if score[slot, column] > FORBIDDEN:
                result[slots[slot][0]].append(roots[column])
    for k in left:
        own = regions[k].shares
        result[k].sort(key=lambda root: (-round(own.get(root, 0.0), 3), root))
        if not result[k]:
            distance = [abs(np.log(center(root, frequency, cycles) / regions[k].cycle)) for root in roots]
            result[k] = [regions[k].leading or roots[int(np.argmin(distance))]]
    return result


def near(regions: list[Unnamed], frequency: Array, cycles: float) -> list[Root]:
    """All roots with a share in the regions, and all whose centre is near them."""
    found = {root for region in regions for root in region.shares}
    low = min((region.cycle for region in regions), default=1.0) / REACH
    high = max((region.cycle for region in regions), default=0.0) * REACH
    for p in range(len(frequency)):
        for q in range(p, len(frequency)):
            rate = float(frequency[p] + frequency[q]) * cycles
            found |= {Root(p, q, m) for m in range(max(1, int(low * rate)), int(high * rate) + 2)}
    return sorted(found)


def scored(region: Unnamed, kind: int, number: int, root: Root, frequency: Array, cycles: float) -> float:
    """The share; something for a root whose turn it is by the counts; a little for one that is near."""
    if class_of(root) != kind:
        return FORBIDDEN
    distance = abs(np.log(center(root, frequency, cycles) / region.cycle))
    turn = abs(rank(root, frequency, cycles) - region.passed[kind] - number)
    return float(region.shares.get(root, 0.0) + 0.5 * np.exp(-turn) + 0.1 * np.exp(-distance / 0.1))
