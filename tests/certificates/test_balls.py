"""Balls of matrix polynomials hold what exact arithmetic says of functions that they are made of."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("flint")

from flint import arb, arb_mat, ctx

from gearstab.certificates.balls import Ball, exact, exponential, known, plus, positive, product, reach, total

PLACES = (-1.0, -0.375, 0.0, 0.75, 1.0)


def value(coefficients: np.ndarray, z: float) -> arb_mat:
    """A polynomial ``(p + 1, m, m)`` at z."""
    parts = [exact(part) * arb(z) ** k for k, part in enumerate(coefficients)]
    return sum(parts[1:], parts[0])


def holds(ball: Ball, truth: arb_mat, z: float) -> bool:
    """Whether a ball is shown to hold a matrix, by the root of the sum of squares, which is the larger norm."""
    away = truth - value(ball.centre, z)
    return bool((away.transpose() * away).trace().sqrt() <= arb(float(ball.radius)))


def matrices(random: np.random.Generator, *shape: int) -> np.ndarray:
    """Nearly those of oscillators in their modes, of sizes from 1e-3 to 10."""
    a = random.standard_normal((*shape, 4, 4))
    return 10.0 ** random.uniform(-3, 1) * (a - np.swapaxes(a, -1, -2) + 0.05 * a)


@pytest.fixture(autouse=True)
def precision() -> object:
    before, ctx.prec = ctx.prec, 300
    yield
    ctx.prec = before


@pytest.mark.parametrize("number", range(20))
def test_an_exponential_is_held_and_its_radius_small(number: int) -> None:
    random = np.random.default_rng(number)
    exponent = np.concatenate([matrices(random, 1), 0.02 * random.standard_normal((number % 3, 4, 4))])
    ball = exponential(Ball(exponent, np.array(0.0)), 4)
    size = max(float(reach(ball.centre)), 1.0)
    # Rounding is 1e-15 for each of up to 9 squares, which double it; with |E_k| near 0.08 terms beyond z^4 are below
    # (0.08 e/5)^5 e^5, or where E_2 is as large as E_1 the fifth power of the root of (0.08/5), times e^10.
    assert ball.radius < (1e-10, 1e-4, 3e-2)[number % 3] * size**2
    for z in PLACES:
        assert holds(ball, value(exponent, z).exp(), z)


@pytest.mark.parametrize("number", range(20))
def test_sums_and_products_are_held(number: int) -> None:
    random = np.random.default_rng(number)
    a, b = matrices(random, 3), matrices(random, 2)
    for degree in (1, 2, 3):
        for z in PLACES:
            first, second = value(a, z), value(b, z)
            found = product(Ball(a, np.array(0.0)), Ball(b, np.array(0.0)), degree)
            assert holds(found, first * second, z)
            # What the factors are off by: a perturbation of the largest size that a radius of 1e-3 allows.
            off = 1e-3 * np.linalg.qr(random.standard_normal((4, 4)))[0]
            found = product(Ball(a, np.array(1e-3)), Ball(b, np.array(1e-3)), 3)
            away = (first + exact(off)) * (second - exact(off)) - value(found.centre, z)
            middle = np.array([*map(float, away.entries())]).reshape(4, 4)
            assert np.linalg.norm(middle, 2) <= found.radius
        assert holds(plus(known(a[0]), Ball(b, np.array(0.0))), exact(a[0]) + value(b, 1.0), 1.0)


def test_sums_with_weights_are_held() -> None:
    random = np.random.default_rng(1)
    terms, weights = matrices(random, 3), random.standard_normal((2, 3)) * 1e5
    ball = total(weights, terms, np.zeros(3))
    for z in PLACES:
        parts = [
            sum((exact(t) * arb(w) for w, t in zip(row, terms, strict=True)), exact(0 * terms[0])) for row in weights
        ]
        assert holds(ball, parts[0] + parts[1] * arb(z), z)


def test_the_bound_of_a_spectral_norm_is_one_and_exact_for_rotations() -> None:
    random = np.random.default_rng(2)
    for _ in range(100):
        a = random.standard_normal((5, 5)) * np.logspace(0, random.uniform(-8, 0), 5)
        assert np.linalg.norm(a, 2) <= reach(a[None]) < 1.7 * np.linalg.norm(a, 2)
    turn = np.linalg.qr(random.standard_normal((5, 5)))[0]
    assert 1 <= reach(turn[None]) < 1.002


def test_positive_from_end_to_end_and_not_only_in_places() -> None:
    """(z - a)^2 + b on the diagonal of a matrix, turned: positive definite on [-1, 1] where b > 0 or a is outside."""
    random = np.random.default_rng(3)
    turn = np.linalg.qr(random.standard_normal((4, 4)))[0]
    for a, b, radius, answer in (
        (1.2, 0.0, 1e-3, True), (1.2, 0.0, 0.05, False), (0.9, -1e-9, 0.0, False), (1.0, -1e-9, 0.0, False),
        (0.2, -0.1, 0.0, False), (-1.3, 0.0, 0.0, True),
    ):  # fmt: skip
        parts = np.array([np.diag([a * a + b, 1, 2, 3]), np.diag([-2 * a, 0.1, 0, 0]), np.diag([1.0, 0, 0, 0.1])])
        assert positive(Ball(turn @ parts @ turn.T, np.array(radius))) == answer
    assert not positive(Ball(np.full((1, 2, 2), np.nan), np.array(0.0)))
