"""Multipliers counted in balls: as many as in floating point, up to edges known in closed form, and no false claim."""

from dataclasses import replace
from functools import cache
from inspect import getsource
from itertools import combinations

import numpy as np
import pytest

pytest.importorskip("flint")

from flint import arb, arb_poly, ctx
from test_verifier import SYSTEMS, edge, meissner, multipliers, pieces_of, turning

from gearstab.certificates import circle, counting
from gearstab.certificates.circle import Circle, Disc, Factor, cut
from gearstab.certificates.counting import Counter
from gearstab.certificates.equations import Flow, flow
from gearstab.certificates.proof import LONG, Proof, counter
from gearstab.certificates.verifier import COUNTED, Certificate

COUNTABLE = sorted(name for name in SYSTEMS if SYSTEMS[name].following is None)


def claim(low: float, high: float, outside: int) -> Certificate:
    return Certificate(low, high, outside, COUNTED, np.zeros((0, 0)))


@cache
def counted(name: str) -> tuple[Flow, Counter]:
    known = flow(SYSTEMS[name])
    found = counter(known)
    assert found is not None
    return known, found


@pytest.mark.parametrize("name", COUNTABLE)
def test_both_theorems_and_multipliers_agree(name: str) -> None:
    """Nearly all that a form proves is proved by counting, too; where something is damped, the number is known."""
    known, found = counted(name)
    pieces = pieces_of(name)[1]
    told = 0
    for piece in pieces:
        outside = found.outside(piece.low, piece.high)
        if outside is None:
            continue
        told += 1
        assert (outside > 0) == (piece.outside > 0)
        if known.form is None:
            assert outside == (multipliers(known, piece.low) > 1).sum()
    assert told > 0.8 * len(pieces)


@pytest.mark.parametrize("name", ["train", "undamped train", "rotor", "free, damped to ground"])
def test_cells_hold_the_characteristic_polynomial(name: str) -> None:
    """Against its coefficients by exponentials at T between the nodes, with more digits."""
    known, found = counted(name)
    b, precision = 7, ctx.prec
    cell = found.cell(b)
    assert cell is not None
    ctx.prec = 400
    try:
        precise = flow(SYSTEMS[name])
        for z in (-1.0, -0.77, 0.1, 0.93, 1.0):
            at = found.step * (4 * b + 1.5 + 2 * arb(z))
            period = None
            for state, f in zip(known.states, known.fractions, strict=True):
                own = (precise.generators[state] * (at * arb(f))).exp()
                period = own if period is None else own * period
            chi = period.charpoly()
            if isinstance(cell, Circle):  # q(x + 1/x) = x^-n chi(x)
                places = [arb(x) for x in (1.0, -1.0, 0.5, 2.5, -3.0)]
                q = arb_poly([p(arb(z)) for p in cell.q])
                pairs = [(q(x + 1 / x), chi(x) / x ** (found.m // 2)) for x in places]
            else:
                pairs = [*zip((p(arb(z)) for p in cell.a), chi.coeffs(), strict=True)]
            for ball, value in pairs:
                assert ball.overlaps(value)
                assert ball.rad() < 1e-9
    finally:
        ctx.prec = precision


@pytest.mark.parametrize("n", range(1, 9))
def test_crossing_is_the_product_of_what_vanishes_on_the_circle(n: int) -> None:
    """p(1) p(-1) times the product of all 1 - z_i z_j, up to sign, of polynomials with known zeros."""
    random = np.random.default_rng(n)
    pairs = random.uniform(0.3, 1.4, n // 2) * np.exp(1j * random.uniform(0.1, 3.0, n // 2))
    zeros = np.concatenate([pairs, pairs.conj(), random.uniform(-1.5, 1.5, n % 2)])
    a = np.poly(zeros).real[::-1]
    found = Disc([arb_poly([float(value)]) for value in a])
    product = np.prod([1 - x * y for x, y in combinations(zeros, 2)]).real
    for factor, expected in zip(found.barrier, (np.polyval(a[::-1], 1), np.polyval(a[::-1], -1), product), strict=True):
        assert abs(float(factor.p(arb(0)))) == pytest.approx(abs(expected), rel=1e-9)
    assert found.outside(arb(-1), arb(1)) == (np.abs(zeros) > 1).sum()


def reciprocal(w: np.ndarray) -> Circle:
    """Return what is known of the product of all z^2 - w z + 1."""
    a = np.ones(1)
    for value in w:
        a = np.convolve(a, [1.0, -value, 1.0])
    return Circle([arb_poly([float(value)]) for value in a.real[len(w) :]])


@pytest.mark.parametrize("n", range(1, 6))
def test_on_the_circle_or_not_is_told_by_known_zeros(n: int) -> None:
    random = np.random.default_rng(n)
    for _ in range(20):
        w = random.uniform(-1.99, 1.99, n).astype(complex)
        kinds = int(random.integers(4))
        if kinds == 1:
            w[0] = random.uniform(2.01, 4.0) * (1 if random.integers(2) else -1)
        elif kinds > 1 and n > 1:
            at = random.uniform(-3, 3, kinds)
            w[:2] = at if kinds == 2 else at[0] + 0.1j * at[1] * np.array([1, -1])
        found = reciprocal(w)
        expected = np.prod(2 - w), np.prod(2 + w), np.prod([(x - y) ** 2 for x, y in combinations(w, 2)])
        scale = 1, 1, n ** (n - 2)
        for factor, value, by in zip(found.barrier, expected, scale, strict=True):
            assert float(factor.p(arb(0))) == pytest.approx(value.real * by, rel=1e-8, abs=1e-9)
        calm = (np.abs(w.imag) == 0).all() and (np.abs(w.real) < 2).all()
        assert found.outside(arb(-1), arb(1)) == int(not calm)


def test_what_is_on_its_way_off_the_circle_is_not_told() -> None:
    """w = 1.9 + 0.2 z is 2 within, and so is a pair 0.1 (1 +- sqrt(z))."""
    line = arb_poly([1])
    through = Circle([arb_poly([-1.9, -0.2]), line])
    assert [through.outside(arb(a), arb(b)) for a, b in ((-1, 1), (-1, 0.4), (0.6, 1))] == [None, 0, 1]
    # q = (w - 0.1)^2 - 0.01 z: a_1 = -0.2, and a_2 is q_0 + 2.
    meeting = Circle([arb_poly([2.01, -0.01]), arb_poly([-0.2]), line])
    assert [meeting.outside(arb(a), arb(b)) for a, b in ((-1, 1), (0.01, 1), (-1, -0.01))] == [None, 0, 1]


def test_what_is_cut_off_is_held_by_the_last_coefficient() -> None:
    random = np.random.default_rng(0)
    whole = arb_poly([float(value) for value in random.standard_normal(30)])
    short = cut(whole, 12)
    assert short.degree() == 12
    for z in np.linspace(-1.0, 1.0, 41).tolist():
        assert short(arb(z)).contains(whole(arb(z)).mid())


def test_zeros_are_not_overlooked() -> None:
    """Polynomials with a simple and with a double zero within, and with none; zeros outside do not count."""
    one, two = arb_poly([arb(-0.3), arb(1)]), arb_poly([arb(0.7), arb(1)])
    simple, double = Factor(one * two), Factor(one * one)
    assert not simple.sign(arb(-1), arb(1))
    assert not double.sign(arb(-1), arb(1))
    assert double.sign(arb(0.301), arb(1)) == 1
    assert simple.sign(arb(-0.69), arb(0.29)) == -1
    assert not simple.sign(arb(-0.69), arb(0.31))
    assert not Factor(arb_poly([])).sign(arb(-1), arb(1))


@pytest.mark.parametrize("damping", [0.0, 0.001])
def test_intervals_reach_up_to_the_edge(damping: float) -> None:
    """Meissner's equation, whose edge without damping is known in closed form."""
    known = flow(meissner(damping=damping))
    where = edge(0.3, 1.6, 1.95)
    if damping:
        low, high = where * 0.99, where * 1.01
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if multipliers(known, middle)[0] < 1 else (low, middle)
        where = low
    proof = Proof(known)
    assert proof(claim(1.5, where * (1 - 1e-6), 0))
    assert proof(claim(where * (1 + 1e-6), 1.9, 1))
    assert not proof(claim(1.5, where * (1 + 1e-6), 0))
    assert not proof(claim(where * (1 - 1e-6), 1.9, 1))


@pytest.mark.parametrize("number", range(50))
def test_a_forged_claim_without_coordinates_is_refused(number: int) -> None:
    random = np.random.default_rng(100 + number)
    name = ("train", "undamped train", "rotor", "damped meissner", "meissner")[number // 5 % 5]
    known, pieces = pieces_of(name)
    changes = [k for k in range(1, len(pieces)) if (pieces[k].outside > 0) != (pieces[k - 1].outside > 0)]
    k = int(random.choice(changes))
    before, after = (claim(p.low, p.high, int(p.outside > 0)) for p in (pieces[k - 1], pieces[k]))
    forged = [
        replace(before, high=after.low * (1 + 1e-3)) if random.integers(2) else replace(after, low=before.high * 0.999),
        replace(after, outside=1 - after.outside),
        replace(after, outside=int(random.integers(2, 9)) * (1 if random.integers(2) else -1)),
        replace(after, low=np.nan) if random.integers(2) else replace(after, high=np.inf),
        replace(after, low=1e-300) if random.integers(2) else replace(after, low=after.high, high=after.low),
    ][number % 5]
    assert not Proof(known)(forged)


def test_what_counting_is_not_about_is_refused() -> None:
    """Speeds that follow, many segments: nothing is proved without coordinates there."""
    following = flow(turning(0.02))
    assert counter(following) is None
    assert not Proof(following)(claim(2.0, 2.1, 0))
    many = flow(replace(SYSTEMS["train"], states=[0, 1] * LONG, fractions=[0.5 / LONG] * (2 * LONG)))
    assert counter(many) is None


def test_growth_without_bound_over_a_window_is_no_proof() -> None:
    """At T so long that the rest of the interpolation is no longer small, the claim is refused, true or not."""
    known, found = counted("train")
    low = 0.02
    assert found.outside(low, low * 1.0001) is None
    assert not Proof(known)(claim(low, low * 1.0001, 0))
    assert not Proof(known)(claim(low, low * 1.0001, 1))


def test_a_referee_reads_few_lines() -> None:
    assert len(getsource(counting).splitlines()) <= 200
    assert len(getsource(circle).splitlines()) <= 240
