"""Fixed points of a map as a curve over a parameter: pseudo-arclength continuation, folds, other losses of stability.

A curve of fixed points x = P(x, p) is followed in (x, p), each in a unit of its own, along its tangent, the null vector
of [DP - I, dP/dp], and back onto the curve across it by Newton's method: so it goes through folds, where p turns back.

A loss of stability is found by the number of multipliers outside the unit circle, which differs on both sides of it,
also where several cross at once. Between two such points the multipliers sorted by magnitude are continuous: the n-th
largest one, n the greater of both numbers, is outside on one side and inside on the other; the root of the logarithm of
its magnitude is where it crosses, whatever it does there.

Source: Keller 1977 (pseudo-arclength); Seydel 2010, chapters 4 and 7 (tests, periodic motions).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import Protocol

import numpy as np
from scipy.optimize import brentq

from gearstab.system import Array

MOST_ITERATIONS = 12
CONVERGED, ACCEPTED = 1e-13, 1e-9
"""Residual, in units of the state, at which Newton's method ends, and that is accepted where it gets no smaller."""
DIFFERENCE = 1e-7
"""Step of the parameter, in its unit, for dP/dp by differences to one side. It serves directions only: points and what
crosses there do not depend on its error."""
TOLD = 0.1
"""Part of a step along the parameter from which on what it did to the map tells dP/dp."""
TURN, GENTLE = 0.3, 0.08
"""Radians between two tangents: beyond the former a step is halved, below the latter the next one is longer."""
KINK = 1e-4
"""A step as short as that, in the units of the curve, may turn by more: at a grazing motion the curve has a kink."""
SINGULAR = 1e-11
"""Singular values below this part of the largest one are none."""
VERTICAL = 1e-7
"""Part of a tangent along the parameter below which a curve with a multiplier 1 goes straight up: linear motions of any
amplitude at one parameter."""
SAME = 1e-4
"""Two multipliers that cross within this part of a step cross together."""
THROUGH = 1e-6
"""Distance, in units of the curve, below which a curve goes through a point."""
STATIONARY = 1e-9
"""Difference of parameters, in their unit, of folds that are one: a fold's parameter hardly depends on errors of the
state, along which multipliers of symmetric systems part."""

FOLD, DOUBLING, NEIMARK_SACKER, BRANCHING = "fold", "period_doubling", "neimark_sacker", "branch_point"
"""Events where multipliers cross the unit circle."""
END, CLOSED, UNBOUNDED, MORE = "range_end", "closed", "unbounded", "more_points"
FAILED, LINEAR = "step_failed", "linear_motions"
"""Why a curve ends: at an end of the range, where it began, beyond the largest state; as so many points were asked for,
or as no step was short enough; or as motions of any amplitude follow at one parameter."""
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


Image = Callable[[Array, float], Visit]
"""From a point and the parameter; raises ArithmeticError where there is no image."""


@dataclass(frozen=True)
class StepLimits:
    """Where a curve ends, and its steps.

    low, high: of the parameter.  most: points, but for those where multipliers cross.
    first, longest, shortest: steps, in units of the curve.  largest: of the state, in its unit.
    """

    low: float
    high: float
    most: int = 1000
    first: float = 0.01
    longest: float = 0.05
    shortest: float = 1e-8
    largest: float = 10.0


@dataclass(frozen=True)
class Curve:
    """A map, and the units in which its curves are measured. unit: of the state;  span: of the parameter."""

    mapping: Image
    unit: float
    span: float

    def slope(self, x: Array, parameter: float, end: Array) -> Array:
        """``(m,)``, dP/dp, in units; end: P."""
        ahead = self.mapping(x, parameter + DIFFERENCE * self.span).end
        return np.asarray((ahead - end) / (DIFFERENCE * self.unit))

    def tangent(self, point: Point, along: Array) -> Array:
        """``(m + 1,)``, of unit length, to the side of ``along``."""
        m = len(point.x)
        slope = self.slope(point.x, point.parameter, point.visit.end)
        matrix = np.column_stack([point.visit.derivative - np.eye(m), slope])
        found = np.linalg.svd(matrix)[2][-1]
        return np.asarray(found if found @ along >= 0 else -found)

    def moved(self, point: Point, step: Array) -> tuple[Array, float]:
        """(x, p) from a point on by a step ``(m + 1,)`` in units."""
        return point.x + self.unit * step[:-1], point.parameter + self.span * float(step[-1])

    def between(self, known: Mapping[float, Point], s: float, along: Array) -> tuple[Array, float]:
        """(x, p) at s along a line from the point at 0, by a polynomial through the three nearest known points, or two.

        along: ``(m + 1,)``, of unit length, in units.
        """
        near = sorted(known, key=lambda at: abs(at - s))[:3]
        weights = [prod((s - other) / (at - other) for other in near if other != at) for at in near]
        own = [known[at] for at in near]
        step = sum(weight * self.difference(point, known[0.0]) for weight, point in zip(weights, own, strict=True))
        # Of points close to each other it may be far off, but not along the line.
        return self.moved(known[0.0], step + (s - step @ along) * along)

    def difference(self, one: Point, other: Point) -> Array:
        """``(m + 1,)``, from the other to the one, in units."""
        return np.append((one.x - other.x) / self.unit, (one.parameter - other.parameter) / self.span)

    def corrected(self, x: Array, parameter: float, normal: Array) -> tuple[Point, int]:
        """The point of the curve in the plane through (x, p) across ``normal (m + 1,)``, and how many steps it took.

        Raises NoPoint.
        """
        m, least, step = len(x), np.inf, np.zeros(len(x) + 1)
        slope = None if np.any(normal[:-1]) else np.zeros(m)
        residual, across = np.zeros(m), np.zeros((m, m))
        for iteration in range(MOST_ITERATIONS):
            visit = self.mapping(x, parameter)
            before, residual = residual, (visit.end - x) / self.unit
            size = float(np.linalg.norm(residual))
            if size <= CONVERGED or (size <= ACCEPTED and size > 0.3 * least):
                return Point(x, parameter, visit), iteration
            if not size < 1e3 * min(least, 1.0):
                break
            least = min(size, least)
            former, across = across, visit.derivative - np.eye(m)
            if slope is None:
                slope = self.slope(x, parameter, visit.end)
            elif abs(step[m]) > TOLD * np.linalg.norm(step) > TOLD * DIFFERENCE:
                # In the middle of the step it is what the other changes leave; from its begin through there to here.
                slope = 2 * (residual - before - 0.5 * (former + across) @ step[:m]) / step[m] - slope
            matrix = np.block([[across, slope[:, None]], [normal[None]]])
            # Least squares: where two multipliers are 1 at once, nothing is done along the second direction.
            step = np.linalg.lstsq(matrix, -np.append(residual, 0.0), rcond=SINGULAR)[0]
            x, parameter = x + self.unit * step[:m], parameter + self.span * float(step[m])
        raise NoPoint

    def at(self, x: Array, parameter: float) -> Point:
        """The fixed point near x at a given parameter. Raises NoPoint."""
        return self.corrected(x, parameter, np.append(np.zeros(len(x)), 1.0))[0]

    def follow(self, start: Point, along: Array, limits: StepLimits) -> Iterator[Point | str]:
        """Points from the start on to the side of ``along (m + 1,)``, the start left out; then why they end."""
        here, step, count = start, limits.first, 0
        tangent, bend = self.tangent(here, along), np.zeros(len(here.x) + 1)
        while count < limits.most:
            try:
                ahead = step * tangent + 0.5 * step**2 * (bend - (bend @ tangent) * tangent)
                there, iterations = self.corrected(*self.moved(here, ahead), tangent)
                following = self.tangent(there, self.difference(there, here))
            except (ArithmeticError, np.linalg.LinAlgError):
                if step < limits.shortest:
                    yield FAILED
                    return
                step *= 0.25
                continue
            turn = float(np.arccos(np.clip(tangent @ following, -1.0, 1.0)))
            upright = abs(following[-1]) < VERTICAL and np.abs(there.visit.multipliers - 1).min(initial=1.0) < VERTICAL
            if step > KINK and (turn > TURN or upright):
                step *= 0.5
                continue
            if upright:
                yield LINEAR
                return
            if not limits.low <= there.parameter <= limits.high:
                yield from self._last(here, there, limits)
                return
            crossed = self._crossed(here, there, tangent, following)
            if crossed is None and step > KINK:
                step *= 0.5
                continue
            yield from crossed or []
            yield there
            count += 1
            if count > 3 and self._passes(start, here, there, tangent):
                yield CLOSED
                return
            if np.abs(there.x).max() > limits.largest * self.unit:
                yield UNBOUNDED
                return
            # At a kink the curve bends otherwise behind it.
            bend = (following - tangent) / step if turn < TURN else 0.0 * bend
            if turn < GENTLE and iterations < 5:
                step = min(1.4 * step, limits.longest)
            here, tangent = there, following
        yield MORE

    def _passes(self, start: Point, here: Point, there: Point, tangent: Array) -> bool:
        """Whether the curve goes through a point between two others, and not only by it."""
        whole, gap = float(self.difference(there, here) @ tangent), self.difference(start, here)
        at = float(gap @ tangent)
        if not 0 <= at <= whole or np.linalg.norm(gap) > 2 * whole:
            return False
        try:
            point, _ = self.corrected(*self.between({0.0: here, whole: there}, at, tangent), tangent)
        except ArithmeticError:
            return False
        return bool(np.linalg.norm(self.difference(point, start)) < THROUGH)

    def _last(self, here: Point, there: Point, limits: StepLimits) -> Iterator[Point | str]:
        """The point at the end of the range, between two."""
        bound = limits.low if there.parameter < limits.low else limits.high
        part = (bound - here.parameter) / (there.parameter - here.parameter)
        try:
            last = self.at(here.x + part * (there.x - here.x), bound)
        except ArithmeticError:
            yield FAILED
            return
        if bound != here.parameter:
            along = self.difference(last, here)
            along /= np.linalg.norm(along)
            yield from self._crossed(here, last, along, along) or []
            yield last
        yield END

    def _crossed(self, here: Point, there: Point, tangent: Array, following: Array) -> list[Point] | None:
        """The same as a list; None where the curve is lost on the way to one."""
        try:
            return [*self.crossings(here, there, tangent, following)]
        except (ArithmeticError, RuntimeError):
            return None

    def crossings(self, here: Point, there: Point, tangent: Array, following: Array) -> Iterator[Point]:
        """Where multipliers cross the unit circle between two points of the curve, in its order.

        Raises ArithmeticError or RuntimeError where one that does is not found.
        """
        low, high = sorted((here.outside, there.outside))
        if low == high:
            return
        whole = float(self.difference(there, here) @ tangent)
        known: dict[float, Point] = {}

        def point(s: float) -> Point:
            if s not in known:
                known[s] = self.corrected(*self.between(known, s, tangent), tangent)[0]
            return known[s]

        def excess(s: float, n: int) -> float:
            return float(np.log(np.abs(point(s).visit.multipliers[n])))

        known[0.0], known[whole] = here, there
        found: list[tuple[float, int]] = []
        for n in range(low, high):
            try:
                # One rounding error of the parameter, but for the flatness of the root.
                found.append((brentq(excess, 0.0, whole, args=(n,), xtol=1e-14, rtol=1e-14, maxiter=60), n))
            except ValueError:
                # It was 1 but for rounding at one of the points, and does not cross.
                continue
        turned = tangent[-1] * following[-1] < 0
        found.sort()
        while found:
            s = found[0][0]
            near = [abs(point(other).parameter - point(s).parameter) <= STATIONARY * self.span for other, _ in found]
            together = [
                n for (other, n), alike in zip(found, near, strict=True)
                if other - s <= SAME * whole or (turned and alike)
            ]  # fmt: skip
            yield _named(point(s), together, turned)
            found = found[len(together) :]


def _named(point: Point, which: list[int], turned: bool) -> Point:
    """The point with what its multipliers, by their numbers, do there."""
    values = point.visit.multipliers[which]
    first = values[0]
    if abs(first.imag) > 1e-4 * abs(first):
        return replace(point, kind=NEIMARK_SACKER, multiplicity=max(1, len(which) // 2))
    target = 1.0 if first.real > 0 else -1.0
    kind = DOUBLING if target < 0 else FOLD if turned else BRANCHING
    # The singular vectors of DP -+ I of as many singular values.
    vector = np.linalg.svd(point.visit.derivative - target * np.eye(len(point.x)))[2][-len(which) :].T
    return replace(point, kind=kind, multiplicity=len(which), vector=vector)
