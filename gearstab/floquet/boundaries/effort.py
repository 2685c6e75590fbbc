"""How long a search for boundaries will take, from the number of collisions and the time of a few evaluations.

Pairs of multipliers p <= q collide every (w_p + w_q) T = 2 pi, so that a range of mesh frequencies holds a number of
collisions that is known beforehand and grows with the length of the common period. For each of them a search takes
about EVALUATIONS monodromy matrices, in ROUNDS calls for all rows together, and NAMED growing solutions are looked at
for its name. The compiled search is timed as a whole, on short ranges.

With damping there is no such number: a proof takes about POINTS mesh frequencies for each one it begins with, which lie
a few damping ratios apart, and the scan of the rest as much again at most; both have a budget.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from gearstab.ckernel import in_use
from gearstab.floquet.boundaries import periodic, smooth
from gearstab.floquet.boundaries.counting.krein import evaluate
from gearstab.floquet.boundaries.counting.points import Resolved, exact
from gearstab.floquet.boundaries.damped.proof import FEWEST, FIRST, MODULI, PROOF, damping_ratio
from gearstab.floquet.boundaries.damped.search import COARSEST, Limits
from gearstab.floquet.boundaries.damped.search import collisions as flow_collisions
from gearstab.floquet.boundaries.names import naming
from gearstab.floquet.boundaries.names.labels import solution_actions
from gearstab.floquet.boundaries.solve import BUDGET
from gearstab.floquet.boundaries.solve import FEW as FEW_COLLISIONS
from gearstab.floquet.boundaries.undamped import choice as undamped
from gearstab.floquet.boundaries.undamped.search import collisions
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.kernel.chain import Chain, chain
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.floquet.smooth.schemes import CF6_5
from gearstab.system import GearSystem

EVALUATIONS = 13.5
"""Evaluations per collision: measured on trains of one to three coordinates with up to 59 segments, 12.7 to 13.8; fewer
where many modes hardly interact, 5 for 33 coordinates.
"""
NAMED = 1.0
"""Solutions per collision that are looked at for a name."""
POINTS = 40.0
"""Of a proof for each first one: 2 where all is stable, 20 to 60 for trains of ratios 1 and 3/5, 200 for 99/100."""
TRIED = 16
"""Points at which a proof is timed."""
ROUNDS = 35
FEW, MANY = 4, 48
"""Points of two calls, or collisions of two searches, that are timed."""
LEAST = 0.1
"""Part of the time of the longer one: their difference counts no less, whatever a coarse clock says."""
TOLERANCE, FLOOR = 1e-10, 1e-6
"""Tolerance and width floor of the searches, the defaults."""
KEPT = 2.0
"""Seconds of all over those of the compiled search and names: 1.4 to 2.3 for ratios of 49/50 and 99/100."""
TIMED = 64
"""Segments that are timed."""
LONGEST = 30.0
"""Periods over the shortest one, beyond which time is taken to grow in proportion."""
QUICK = 1e-3
"""Seconds of a segment from which on more are not timed."""


@dataclass(frozen=True)
class Effort:
    """call: seconds of a call. collisions: about how many a row has; each: seconds of all that is done for one."""

    call: float
    collisions: float
    each: float

    def seconds(self, rows: float, batches: float = 1.0) -> float:
        """Return the seconds of a search of so many rows like this one, in so many batches."""
        return batches * ROUNDS * self.call + rows * self.collisions * self.each


def effort(system: GearSystem, start: float, stop: float) -> Effort:
    """Measure what a search of a single system (no batch) between two mesh frequencies takes on this machine.

    It is timed on a few points, which takes milliseconds. Raises NotPossible for a system without a common period.
    """
    limits = Limits(start, stop, TOLERANCE, FLOOR, BUDGET)
    if system.terms:
        return _periodic(system, limits)
    call, total, work = 0.0, 0.0, 0.0
    for own in _patterns(system, limits):
        low, high = limits.cycles(own)
        count = float(collisions(own, low, high)[0])
        moving = own.elastic.damping is not None or bool(own.elastic.shift[0])
        work += _proof(chain(exact(own)), low, high) if moving else 0.0
        # Names of few damped regions ask for the undamped ones.
        if not moving or (count <= FEW_COLLISIONS and not isinstance(own, Resolved)):
            fixed, each = (_searched if in_use() else _evaluated)(own.without_damping(), low, high)
            call, work = call + fixed, work + count * each
        total += count
    return Effort(call, total, work / total if total else 0.0)


def _patterns(system: GearSystem, limits: Limits) -> list[Pattern]:
    """The blocks that are searched."""
    if system.piecewise_constant:
        found = [block.pattern for pattern in prepare(system) for block in split(pattern) if not block.constant]
    else:
        found = list(smooth.patterns(system, limits))
    return [pattern for pattern in found if pattern.size]


def _periodic(system: GearSystem, limits: Limits) -> Effort:
    """That of a system with periodic terms: all is proof and scan, as often as the steps are doubled."""
    work, total = 0.0, 0.0
    for own in periodic.parts(system):
        moving, bounds = own.varies.any(), limits.cycles(own.part.pattern)
        flow = own.flow(CF6_5, periodic.resolution(own, limits, CF6_5, np.pi * limits.tolerance) if moving else 0)
        work += (1 + moving) * _proof(flow, *bounds)
        total += float(flow_collisions(flow, *bounds)[0])
    return Effort(0.0, total, work / total if total else 0.0)


def _proof(flow: Chain, low: np.ndarray, high: np.ndarray) -> float:
    """Seconds of proof and scan of a damped chain, from proofs tried at a few points."""
    row, x = np.zeros(TRIED, dtype=int), np.linspace(np.log(low[0]), np.log(high[0]), TRIED)
    begin = time.process_time()
    growth = kernel.current().moduli(flow, row, np.exp(x))[:, 0]
    kernel.current().radii(flow, row, np.exp(x), growth)
    each = (time.process_time() - begin) / TRIED
    step = FIRST * float(damping_ratio(flow)[0])
    # Python's numbers: a step may be so small that this is infinite, of which NumPy warns.
    first = max(float(x[-1] - x[0]) / step if step > 0 else np.inf, FEWEST)
    most = 2 * BUDGET / (flow.size**3 * len(flow.states) * (MODULI + PROOF))
    return each * min(POINTS * first, max(most, COARSEST))


def _searched(pattern: Pattern, low: np.ndarray, high: np.ndarray) -> tuple[float, float]:
    """Seconds of a round (next to nothing in the compiled kernel) and of a collision, from searches of short ranges."""
    count, middle, spent = float(collisions(pattern, low, high)[0]), 0.5 * (low + high), []
    frequency = np.sqrt(np.abs(pattern.squared_frequency[:, 0]))
    for few in (FEW, FEW, MANY):
        half = 0.5 * (high - low) * min(1.0, few / count)
        begin = time.process_time()
        found = undamped.search(pattern, middle - half, middle + half, TOLERANCE, FLOOR)
        naming.named(pattern, found.intervals, frequency)
        spent.append(time.process_time() - begin)
    return 0.0, KEPT * max(spent[2] - spent[1], LEAST * spent[2]) / (MANY - FEW)


def _evaluated(pattern: Pattern, low: np.ndarray, high: np.ndarray) -> tuple[float, float]:
    """Seconds of a round and of a collision, from evaluations of the first segments and a look at a solution."""
    kept = len(pattern.states) if isinstance(pattern, Resolved) else min(TIMED, len(pattern.states))
    part = _first_segments(pattern, kept)
    spent = []
    for count in (FEW, FEW, MANY):
        cycle = np.linspace(float(low[0]), float(high[0]), count + 2)[1:-1]
        begin = time.process_time()
        evaluate(part, np.zeros(count, dtype=int), cycle)
        spent.append(time.process_time() - begin)
    scale = len(pattern.states) / kept
    point = max(spent[2] - spent[1], LEAST * spent[2]) / (MANY - FEW)
    each = EVALUATIONS * point * scale + NAMED * _naming(pattern, float(low[0]), float(high[0]))
    return max(spent[1] - FEW * point, 0.0) * scale, each


def _naming(pattern: Pattern, low: float, high: float) -> float:
    """Seconds of looking at a solution: segments times frequencies, of which a long period has many."""
    # Frequencies, and the memory they take, are as many as the period is long.
    each, cycle = 0.0, min(high, LONGEST * low)
    for points, segments in ((1, 2), (FEW, TIMED)):
        part = _first_segments(pattern, segments)
        solution, still = np.ones((points, 2 * pattern.size), dtype=complex), np.zeros(points, dtype=complex)
        begin = time.process_time()
        solution_actions(part, np.zeros(points, dtype=int), np.full(points, cycle), solution, still)
        each = (time.process_time() - begin) / points / len(part.states)
        if each > QUICK:
            break
    return each * len(pattern.states) * high / cycle


def _first_segments(pattern: Pattern, count: int) -> Pattern:
    """The pattern without the others."""
    return replace(pattern, states=pattern.states[:count], fractions=pattern.fractions[:, :count])
