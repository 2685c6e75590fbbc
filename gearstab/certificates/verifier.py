r"""Stability over whole intervals of the mesh frequency, proved in ball arithmetic.

x' = A_s x holds in segment s = 1, ..., S of a period T and lasts f_s T. With T = 2 pi N/Omega a period is

    Phi(T) = exp(f_S A_S T) ... exp(f_1 A_1 T).

A *piece* claims, of all Omega in [low, high], that every solution decays (is bounded), or that some grow.

**Theorem 1.** Cut the period into parts of one or more segments, part i with the propagator Phi_i, of length g_i T. Let
J = diag(I_k, -I), r > 0, and let X_1, X_2, ... back to X_1 after the last part be nonsingular. If for every part

    N_i = Psi_i^T J Psi_i - r^(g_i) J,      Psi_i = X_(i+1)^-1 Phi_i X_i,

is positive definite, then (i) for k = 0 and r <= 1 all solutions decay exponentially; (ii) for k > 0 and r >= 1 some
grow exponentially. *Proof.* V_i(x) = y^T J y with X_i y = x. Part i makes of V_i a V_(i+1) > r^(g_i) V_i for x != 0, so
that V = V_1 has V(Phi x) >= R V(x) + c |x|^2 with R = prod r^(g_i) and some c > 0. (i) -V is positive definite, and
shrinks by a factor below 1 in a period. (ii) From a V(x) > 0, which k > 0 admits, V grows by a factor above 1 in
every period, and |x|^2 >= V/|X_1^-1|^2 with it. The certificate is X_1, k and r; other X_i are free.

**Theorem 2.** Let Q be skew, nonsingular and A_s^T Q + Q A_s = 0 for all s (nothing is damped), W = Phi + Phi^-1 and p
a real polynomial. Then H = (Q Phi + (Q Phi)^T) p(W) is symmetric and Phi^T H Phi = H. If H is definite, all solutions
are bounded, also for all A_s near enough that keep Q (strong stability). *Proof.* x^T Q y of two solutions is constant:
Phi^T Q Phi = Q, so that Q Phi^-1 = Phi^T Q = -(Q Phi)^T and Q W = W^T Q. Hence H = Q (Phi - Phi^-1) p(W) is symmetric,
and Phi^T Q = Q Phi^-1 gives the second claim. x^T H x is the same at t = 0, T, 2T, ... and bounds |x|.
The zeros of p, the *separators*, are the certificate, with coordinates X_1 in which H is looked at.

**From a period to a piece.** T = T_0 + h z, -1 <= z <= 1, and exp(f A T) = exp(f A T_0) exp(z B), B = h f A. The rest
of a Taylor polynomial of degree p is its term of degree p times an average of exp(u z B), 0 <= u <= 1 (of a form:
between two of them), whose entries differ from those of the unit matrix by exp(|B|) - 1 at most: the last
coefficient is a ball. So is in the end what is of higher degree than 2. On [-1, 1] c_0 + c_1 z + c_2 z^2 is a convex
combination of its Bernstein coefficients c_0 - c_1 + c_2, c_0 - c_2, c_0 + c_1 + c_2, and definite if they are. P is
positive definite if |R P R^T - I| < 1 for some R, or R P R^T has a dominant diagonal: the inverse of a Cholesky factor
in floating point. |.| is the root of the sum of squares throughout.

**Matrices that follow the speed.** In the time Omega t, A_s = A_0 + u A_1 + u^2 A_2, u = 1/Omega, over 2 pi N f_s. With
u = u_0 + h z, exp(f_s 2 pi N A_s) is a polynomial in z with a ball for its last coefficient.

**Not covered**: how A_s and f_s, doubles taken exactly, came from gears; what lies between pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat, ctx

from gearstab.certificates.choices import coordinates
from gearstab.certificates.polynomials import (
    centre,
    definite,
    exact,
    exponential,
    identity,
    moving,
    near,
    product,
    pulled_back,
    size,
)

Array = np.ndarray
Key = tuple[int, float]

PRECISION, DEGREE, GENTLE, COUNTED, CARRIED = 64, 4, 0.1, -1.0, -2.0
"""Bits of midpoints; degree of Taylor polynomials, sum of |B| below which it is 2; rates of Theorems 3 and 4."""
LONGEST, MOST, ENDLESS = 0.4, 16, 1000.0
"""Sum of |B|, and number, beyond which a part ends: radii grow with each segment. Sum of |B| of too long a piece."""


@dataclass(frozen=True)
class Flow:
    """A of each state; of each segment its state and f_s; cycles N; form Q, None where something is damped.

    following: of each state (A_1, A_2) where matrices follow the speed: the generators are then A_0.
    """

    generators: Sequence[arb_mat]
    states: Sequence[int]
    fractions: Sequence[float]
    cycles: float
    form: arb_mat | None
    following: Sequence[tuple[arb_mat, arb_mat]] = ()


@dataclass(frozen=True)
class Step:
    """The flow of a segment, times exp(z slope) where there is a slope B; span: by how much it changes in a piece."""

    flow: Sequence[arb_mat]
    slope: arb_mat | None
    span: arb


@dataclass(frozen=True)
class Certificate:
    """A claim for low <= Omega <= high: growth if outside = k > 0, else stability; rate r, 0 for Theorem 2, COUNTED
    and CARRIED for those of counting.py and lyapunov.py; coordinates X_1 ``(m, m)``; separators, the zeros of p.
    """

    low: float
    high: float
    outside: int
    rate: float
    coordinates: Array
    separators: Sequence[float] = ()


def proves(flow: Flow, piece: Certificate) -> bool:
    """Whether the claim of a piece is proved; False for everything else, be the piece malformed."""
    ctx.prec = PRECISION
    m, shape = flow.generators[0].nrows(), np.shape(piece.coordinates)
    numbers = np.concatenate([[piece.low, piece.high, piece.rate], np.ravel(piece.coordinates), piece.separators])
    if shape != (m, m) or not np.isfinite(numbers).all() or not 0 < piece.low <= piece.high:
        return False
    if not 0 <= piece.outside <= m or not (piece.rate >= 1 if piece.outside else 0 <= piece.rate <= 1):
        return False
    try:
        # In coordinates of X_1; segments that are alike once.
        start, keys = exact(piece.coordinates), [*zip(flow.states, flow.fractions, strict=True)]
        steps, degree = (_by_speed if flow.following else _by_period)(flow, piece, start, keys)
        proof = _grows_or_decays if piece.rate else _keeps_a_form
        return proof(flow, piece, [steps[key] for key in keys], degree) if degree else False
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
        return False


def _by_period(flow: Flow, piece: Certificate, start: arb_mat, keys: list[Key]) -> tuple[dict[Key, Step], int]:
    """exp(f A T_0) and B of each sort of segments, and the degree of polynomials in z; 0 of too long a piece."""
    turn, back = 2 * arb.pi() * arb(flow.cycles), start.inv()
    middle, half = centre(turn / arb(piece.high), turn / arb(piece.low))
    own = [back * generator * start for generator in flow.generators]
    slopes = {(s, f): own[s] * (half * arb(f)) for s, f in keys}
    sizes = {key: size(slope) for key, slope in slopes.items()}
    total = sum((sizes[key] for key in keys), arb(0))
    if not total < ENDLESS:
        return {}, 0
    steps = {(s, f): Step([(own[s] * (middle * arb(f))).exp()], slopes[s, f], sizes[s, f]) for s, f in slopes}
    return steps, DEGREE if total > GENTLE else 2


def _by_speed(flow: Flow, piece: Certificate, start: arb_mat, keys: list[Key]) -> tuple[dict[Key, Step], int]:
    """exp(f 2 pi N A(u)) of each sort of segments as a polynomial in z, and its degree; 0 of too long a piece."""
    steps, back = {}, start.inv()
    middle, half = centre(1 / arb(piece.high), 1 / arb(piece.low))
    for s, f in set(keys):
        turn = 2 * arb.pi() * arb(flow.cycles) * arb(f)
        a, b, c = (back * part * start * turn for part in (flow.generators[s], *flow.following[s]))
        exponent = [a + (b + c * middle) * middle, (b + c * middle * 2) * half, c * (half * half)]
        sizes = [size(part) for part in exponent]
        if not sizes[0] + sizes[1] + sizes[2] < ENDLESS:
            return {}, 0
        steps[s, f] = Step(exponential(exponent, DEGREE), None, sizes[1])
    return steps, DEGREE


def _grows_or_decays(flow: Flow, piece: Certificate, steps: list[Step], degree: int) -> bool:
    """Theorem 1, from the end of the period to its beginning."""
    signs = np.where(np.arange(len(piece.coordinates)) < piece.outside, 1.0, -1.0)
    form, rate = exact(np.diag(signs)), arb(piece.rate)
    middles = {id(step): near(step.flow[0]) for step in steps}
    here = [exact(x) for x in coordinates([middles[id(s)] for s in steps], flow.fractions, signs, piece.rate)]
    back = [x.inv() for x in here]
    terms, share, span, count = [form], arb(0), arb(0), 0  # of a part
    for s in reversed(range(len(steps))):
        own = [back[(s + 1) % len(back)] * part * here[s] for part in steps[s].flow]
        if (slope := steps[s].slope) is not None:
            slope = back[s] * slope * here[s]
        terms, span = pulled_back(terms, own, slope, degree), span + (steps[s].span if slope is None else size(slope))
        share, count = share + arb(flow.fractions[s]), count + 1
        if s == 0 or count == MOST or span > LONGEST:
            if not _definite_throughout([terms[0] - form * rate**share, *terms[1:]]):
                return False
            terms, share, span, count = [form], arb(0), arb(0), 0
    return True


def _keeps_a_form(flow: Flow, piece: Certificate, steps: list[Step], degree: int) -> bool:
    """Theorem 2."""
    if flow.form is None:
        return False
    start, unit = exact(piece.coordinates), identity(len(piece.coordinates))
    form, period = start.transpose() * flow.form * start, [unit]
    for step in steps:
        period = product(moving(step.flow, step.slope, degree), period, degree)
    turned, inverse = [form * term for term in period], form.inv()
    total = [term - inverse * other.transpose() for term, other in zip(period, turned, strict=True)]
    found = [term + term.transpose() for term in turned]
    for zero in piece.separators:
        found = product(found, [total[0] - unit * arb(zero), *total[1:]], degree)
    return _definite_throughout([term * (1 if found[0][0, 0] > 0 else -1) for term in found])


def _definite_throughout(terms: list[arb_mat]) -> bool:
    """Whether a polynomial with symmetric coefficients, of degree 2 or more, is positive definite on [-1, 1]."""
    constant, linear, square = terms[0], terms[1], terms[2]
    for k, term in enumerate(terms[3:], start=1):
        square = square + term * (arb(0, 1) if k % 2 else (arb(0, 1) + 1) / 2)
    return all(map(definite, (constant - linear + square, constant - square, constant + linear + square)))
