"""Motions along a branch at which a contact begins with no speed: where one more contact comes in, or goes.

Near such a motion the square of the speed with which the flank is met falls to 0 in proportion to the distance along
the branch, on the side where it is met; on the other it is missed. Source: di Bernardo et al. 2008, chapter 6.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from gearstab.response.branches.continuation import Curve
from gearstab.response.branches.motions import GRAZING
from gearstab.response.branches.points import Point
from gearstab.response.branches.sections import Lap

NARROW = 1e-5
"""Part of the step between two motions within which the grazing one is found."""
MOST = 20
"""Evaluations: bisection alone needs 17."""


def contacts(point: Point) -> tuple[Counter[tuple[int, int]], float]:
    """How often each mesh changes its contact in each way, and the square of the least speed with which one does."""
    lap = point.visit
    assert isinstance(lap, Lap)
    met = lap.track.mesh >= 0
    pairs = zip(lap.track.mesh[met].tolist(), lap.track.kind[met].tolist(), strict=True)
    return Counter(pairs), float(np.min(np.abs(lap.track.speed[met]), initial=np.inf)) ** 2


def grazing_between(curve: Curve, here: Point, there: Point) -> Point | None:
    """Return the motion between two that grazes, on the side with more contacts; None where both have the same.

    Of several grazing ones between the two it is one. None, too, where the curve is lost between them.
    """
    (own, _), (others, _) = contacts(here), contacts(there)
    if own == others:
        return None
    few, many = (here, there) if own.total() < others.total() else (there, here)
    along = curve.difference(many, few)
    whole = float(np.linalg.norm(along))
    along /= whole
    without, known = contacts(few)[0], [(whole, contacts(many)[1])]
    low, high, found = 0.0, whole, many
    points = {low: few, high: many}
    for _ in range(MOST):
        if high - low <= NARROW * whole:
            break
        s = _guess(low, high, known)
        try:
            point, _ = curve.corrected(*curve.between(points, s), along)
        except ArithmeticError:
            return None
        points[s] = point
        count, speed = contacts(point)
        if count == without:
            low = s
        else:
            high, found = s, point
            known = [*known[-1:], (s, speed)]
    return replace(found, kind=GRAZING)


def _guess(low: float, high: float, known: list[tuple[float, float]]) -> float:
    """Where the square of the speed is 0 by a straight line, a little to the side of it; else the middle."""
    middle, margin = 0.5 * (low + high), 0.4 * NARROW * known[0][0]
    if len(known) < 2:
        return middle
    (a, u), (b, v) = known
    zero = (a * v - b * u) / (v - u) if u != v else middle
    # A little beyond on the side that is wider: then the bracket closes from both.
    zero += margin if zero - low > high - zero else -margin
    return zero if low < zero < high else middle
