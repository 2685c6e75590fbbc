"""How long a search for boundaries will take, from the number of collisions and the time of a few evaluations.

Pairs of multipliers p <= q collide every (w_p + w_q) T = 2 pi, so that a range of mesh frequencies holds a number of
collisions that is known beforehand and grows with the length of the common period. For each of them a search takes
about EVALUATIONS monodromy matrices, in ROUNDS calls for all rows together, and NAMED growing solutions are looked at
for its name.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.boundaries.krein import evaluate
from gearstab.floquet.boundaries.labels import solution_actions
from gearstab.floquet.boundaries.parts import without_damping
from gearstab.floquet.boundaries.points import Resolved
from gearstab.floquet.boundaries.search import collisions
from gearstab.floquet.boundaries.smooth import undamped_patterns
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import GearSystem

EVALUATIONS, DAMPED_EVALUATIONS = 13.5, 25.0
"""For each collision: measured on trains of one to three coordinates with up to 59 segments, 12.7 to 13.8 and 22 to 36;
fewer where many modes hardly interact, 5 for 33 coordinates."""
NAMED, DAMPED_NAMED = 1.0, 1.5
"""For each collision, too."""
ROUNDS = 35
FEW, MANY = 4, 48
"""Points of two calls that are timed."""
TIMED = 64
"""Segments that are timed."""
QUICK = 1e-3
"""Seconds of a segment from which on more are not timed."""


@dataclass(frozen=True)
class Effort:
    """call: seconds of a call. collisions: about how many a row has; each: seconds of all that is done for one."""

    call: float
    collisions: float
    each: float

    def seconds(self, rows: float, batches: float = 1.0) -> float:
        """Of a search of so many rows like this one, in so many batches."""
        return batches * ROUNDS * self.call + rows * self.collisions * self.each


def effort(system: GearSystem, start: float, stop: float) -> Effort:
    """What a search of a single system (no batch) between two mesh frequencies takes on this machine.

    It is timed on a few points, which takes milliseconds. Raises NotPossible for a system without a common period.
    """
    evaluations, named = (EVALUATIONS, NAMED) if system.damping is None else (DAMPED_EVALUATIONS, DAMPED_NAMED)
    patterns = prepare(system) if system.piecewise_constant else undamped_patterns(system, start, stop)
    call, total, work = 0.0, 0.0, 0.0
    for pattern in patterns:
        blocks = [without_damping(block.pattern) for block in split(pattern) if not block.constant]
        for own in [pattern] if isinstance(pattern, Resolved) else blocks:
            if own.size:
                low, high = own.elastic.rate / stop, own.elastic.rate / start
                count = float(collisions(own, low, high)[0])
                each, point, name = _timed(own, low, high)
                call, total, work = call + each, total + count, work + count * (evaluations * point + named * name)
    return Effort(call, total, work / total if total else 0.0)


def _timed(pattern: Pattern, low: np.ndarray, high: np.ndarray) -> tuple[float, float, float]:
    """Seconds of a call, of each of its points and of looking at a solution, from calls on the first segments."""
    kept = len(pattern.states) if isinstance(pattern, Resolved) else min(TIMED, len(pattern.states))
    part = _first_segments(pattern, kept)
    spent = []
    for count in (FEW, FEW, MANY):
        cycle = np.linspace(float(low[0]), float(high[0]), count + 2)[1:-1]
        begin = time.process_time()
        evaluate(part, np.zeros(count, dtype=int), cycle)
        spent.append(time.process_time() - begin)
    scale = len(pattern.states) / kept
    point = max(spent[2] - spent[1], 0.1 * spent[2]) / (MANY - FEW)
    return max(spent[1] - FEW * point, 0.0) * scale, point * scale, _naming(pattern, float(high[0]))


def _naming(pattern: Pattern, cycle: float) -> float:
    """Seconds of looking at a solution: segments times frequencies, of which a long period has many."""
    each = 0.0
    for points, segments in ((1, 2), (FEW, TIMED)):
        part = _first_segments(pattern, segments)
        solution, still = np.ones((points, 2 * pattern.size), dtype=complex), np.zeros(points, dtype=complex)
        begin = time.process_time()
        solution_actions(part, np.zeros(points, dtype=int), np.full(points, cycle), solution, still)
        each = (time.process_time() - begin) / points / len(part.states)
        if each > QUICK:
            break
    return each * len(pattern.states)


def _first_segments(pattern: Pattern, count: int) -> Pattern:
    """The pattern without the others."""
    return replace(pattern, states=pattern.states[:count], fractions=pattern.fractions[:, :count])
