"""Curves of fixed points of maps that textbooks know: where they turn, where stability is lost and by how many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from gearstab.response.backlash.continuation import (
    BRANCHING,
    CLOSED,
    DOUBLING,
    END,
    FOLD,
    LINEAR,
    MORE,
    NEIMARK_SACKER,
    UNBOUNDED,
    Curve,
    NoPoint,
    Point,
    StepLimits,
)

Array = np.ndarray


@dataclass(frozen=True)
class Image:
    end: Array
    derivative: Array

    @property
    def multipliers(self) -> Array:
        found = np.linalg.eigvals(self.derivative).astype(complex)
        return found[np.argsort(-np.abs(found))]


def curve(image: Callable[[Array, float], Array], derivative: Callable[[Array, float], Array]) -> Curve:
    return Curve(lambda x, p: Image(np.asarray(image(x, p)), np.atleast_2d(derivative(x, p))), 1.0, 1.0)


def followed(own: Curve, x: Array, p: float, along: float, limits: StepLimits) -> tuple[list[Point], str]:
    start = own.at(np.asarray(x, dtype=float), p)
    *points, end = own.follow(start, np.append(np.zeros(len(start.x)), along), limits)
    assert isinstance(end, str)
    return [point for point in points if isinstance(point, Point)], end


def special(points: list[Point]) -> list[tuple[str, float, int]]:
    return [(point.kind, point.parameter, point.multiplicity) for point in points if point.kind]


PARABOLA = curve(lambda x, p: x + p - x**2, lambda x, p: np.diag(1 - 2 * x))
LOGISTIC = curve(lambda x, p: p * x * (1 - x), lambda x, p: np.diag(p * (1 - 2 * x)))


def test_a_fold() -> None:
    """x^2 = p turns back at 0; both sides are on the curve, the far one unstable, up to the end of the range."""
    points, end = followed(PARABOLA, [0.7], 0.49, -1, StepLimits(-1.0, 0.6))
    assert end == END
    ((kind, p, multiplicity),) = special(points)
    assert (kind, multiplicity) == (FOLD, 1)
    assert abs(p) < 1e-14
    assert points[-1].x[0] == pytest.approx(-np.sqrt(0.6), abs=1e-12)
    assert [point.outside for point in points if not point.kind] == [int(p.x[0] < 0) for p in points if not p.kind]


def test_a_period_doubling_and_a_branch_point() -> None:
    points, _ = followed(LOGISTIC, [0.5], 2.0, 1, StepLimits(0.5, 3.4))
    ((kind, p, multiplicity),) = special(points)
    assert (kind, multiplicity) == (DOUBLING, 1)
    assert p == pytest.approx(3.0, abs=1e-12)
    points, _ = followed(LOGISTIC, [0.0], 0.5, 1, StepLimits(0.4, 1.5))
    ((kind, p, _),) = special(points)
    assert kind == BRANCHING
    assert p == pytest.approx(1.0, abs=1e-12)


def test_two_multipliers_that_cross_at_once() -> None:
    """det(DP + I) of two equal maps only touches zero; the number of multipliers outside tells it, and where to."""
    points, _ = followed(LOGISTIC, [0.5, 0.5], 2.0, 1, StepLimits(0.5, 3.4))
    ((kind, p, multiplicity),) = special(points)
    assert (kind, multiplicity) == (DOUBLING, 2)
    assert p == pytest.approx(3.0, abs=1e-12)
    (found,) = [point for point in points if point.kind]
    assert found.vector is not None
    np.testing.assert_allclose(found.vector.T @ found.vector, np.eye(2), atol=1e-12)


def test_a_double_fold_that_rounding_parts_is_one() -> None:
    """Two equal parabolas, one of them lower by 1e-10, have folds that are 1e-5 apart along the curve."""
    offset = np.array([0.0, 1e-10])
    image = curve(lambda x, p: x + p - offset - x**2, lambda x, p: np.diag(1 - 2 * x))
    points, _ = followed(image, [0.7, np.sqrt(0.49 - 1e-10)], 0.49, -1, StepLimits(-1.0, 0.6))
    folds = [(kind, multiplicity) for kind, _, multiplicity in special(points)]
    assert folds == [(FOLD, 2)]


def test_two_multipliers_that_cross_within_a_step() -> None:
    """A map and a slightly slower one: doublings at 3 and 3.001, told apart within one step."""
    image = curve(
        lambda x, p: np.array([p, p - 1e-3]) * x * (1 - x), lambda x, p: np.diag(np.array([p, p - 1e-3]) * (1 - 2 * x))
    )
    points, _ = followed(image, [0.5, 0.5], 2.0, 1, StepLimits(0.5, 3.4))
    assert [kind for kind, _, _ in special(points)] == [DOUBLING, DOUBLING]
    np.testing.assert_allclose([p for _, p, _ in special(points)], [3.0, 3.001], atol=1e-11)


def test_a_pair_that_leaves() -> None:
    """The delayed logistic map loses its fixed point to an invariant curve at 2, with multipliers exp(+- i pi/3)."""
    delayed = curve(
        lambda x, p: np.array([p * x[0] * (1 - x[1]), x[0]]),
        lambda x, p: np.array([[p * (1 - x[1]), -p * x[0]], [1.0, 0.0]]),
    )
    points, _ = followed(delayed, [1 / 3, 1 / 3], 1.5, 1, StepLimits(1.0, 2.2))
    (found,) = [point for point in points if point.kind]
    assert (found.kind, found.multiplicity) == (NEIMARK_SACKER, 1)
    assert found.parameter == pytest.approx(2.0, abs=1e-12)
    np.testing.assert_allclose(found.visit.multipliers.real, 0.5, atol=1e-9)


def test_a_closed_curve_ends_where_it_began() -> None:
    """x^2 + p^2 = 1, an isola with two folds."""
    circle = curve(lambda x, p: x + 0.5 * (1 - x**2 - p**2), lambda x, p: np.diag(1 - x))
    points, end = followed(circle, [1.0], 0.0, 1, StepLimits(-2.0, 2.0))
    assert end == CLOSED
    np.testing.assert_allclose(sorted(p for _, p, _ in special(points)), [-1.0, 1.0], atol=1e-13)
    assert {kind for kind, _, _ in special(points)} == {FOLD}


def test_a_curve_that_goes_straight_up_is_not_followed() -> None:
    """P = p x: at p = 1 every x stays where it is. No hundreds of folds there."""
    proportional = curve(lambda x, p: p * x, lambda x, p: np.array([[p]]))
    start = Point(np.array([0.5]), 1.0, proportional.mapping(np.array([0.5]), 1.0))
    assert [*proportional.follow(start, np.array([1.0, 0.0]), StepLimits(0.0, 2.0))] == [LINEAR]


def test_a_kink_is_passed_with_short_steps() -> None:
    """p = x^2 for x > 0 and -3 x for x < 0: the curve turns by 72 degrees, as where a motion grazes, and the fold is
    there.
    """
    kinked = curve(
        lambda x, p: x + p - np.where(x > 0, x**2, -3 * x), lambda x, p: np.diag(1 - np.where(x > 0, 2 * x, -3.0))
    )
    points, end = followed(kinked, [0.7], 0.49, -1, StepLimits(-1.0, 0.6))
    assert end == END
    assert points[-1].x[0] == pytest.approx(-0.2, abs=1e-12)
    assert abs(next(p for kind, p, _ in special(points) if kind == FOLD)) < 1e-3


def test_curves_without_end_and_without_a_start() -> None:
    """x = 1/(1 - p) outgrows every range below 1; what has no fixed point near is no start."""
    pole = curve(lambda x, p: 1 + p * x, lambda x, p: np.array([[p]]))
    points, end = followed(pole, [2.0], 0.5, 1, StepLimits(0.0, 1.5, largest=50.0))
    assert end == UNBOUNDED
    assert 50 < points[-1].x[0] < 52
    points, end = followed(pole, [2.0], 0.5, 1, StepLimits(0.0, 1.5, most=7))
    assert (end, len(points)) == (MORE, 7)
    with pytest.raises(NoPoint):
        PARABOLA.at(np.array([0.5]), -1.0)
