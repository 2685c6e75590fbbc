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

from gearstab.certificates.balls import (
    ROUNDING,
    SPARE,
    UP,
    Array,
    Ball,
    exponential,
    known,
    plus,
    positive,
    product,
    size,
    total,
)  # fmt: skip
from gearstab.certificates.choices import coordinates
from gearstab.certificates.equations import Enclosed, Flow

DEGREE, COUNTED, CARRIED = 4, -1.0, -2.0
"""Degree of polynomials; rates of Theorems 3 and 4."""
LONGEST, MOST, ENDLESS, AT_ONCE = 1.2, 2**20, 1000.0, 2**22
"""Sum of |B|, and number, beyond which a part ends: radii grow with each segment. Sum of |B| of too long a piece.
Numbers that are multiplied at once."""


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
    m, shape = flow.generators[0].nrows(), np.shape(piece.coordinates)
    numbers = np.concatenate([[piece.low, piece.high, piece.rate], np.ravel(piece.coordinates), piece.separators])
    if shape != (m, m) or not np.isfinite(numbers).all() or not 0 < piece.low <= piece.high:
        return False
    if not 0 <= piece.outside <= m or not (piece.rate >= 1 if piece.outside else 0 <= piece.rate <= 1):
        return False
    try:
        with np.errstate(all="ignore"):
            own = flow.enclosed(piece.low)
            steps, span = (_by_speed if flow.following else _by_period)(flow, own, piece)
            proof = _grows_or_decays if piece.rate else _keeps_a_form
            return span < ENDLESS and proof(flow, own, piece, steps, span)
    except np.linalg.LinAlgError:  # a matrix that may be singular
        return False


def _by_period(flow: Flow, own: Enclosed, piece: Certificate) -> tuple[Ball, float]:
    """exp(f A T) = exp(f A T_0) exp(z B) of each sort of segments, and the sum of |B| over all."""
    states, fractions, sorts = flow.sorts
    first, last = (2 * np.pi * flow.cycles / omega for omega in (piece.high, piece.low))
    half = UP * (last - first) / 2 + SPARE * ROUNDING * last
    terms, radii, f = own.terms[states], own.radii[states], fractions[:, None, None]
    slopes = total(f * np.array([[0.0], [half]]), terms, radii)
    span = float(size(slopes.centre[:, 1])[sorts].sum())
    if not span < ENDLESS:
        return slopes, np.inf
    middle = exponential(total(f * (first + last) / 2, terms, radii), 0)
    return product(middle, exponential(slopes, DEGREE), DEGREE), span


def _by_speed(flow: Flow, own: Enclosed, piece: Certificate) -> tuple[Ball, float]:
    """exp(f 2 pi N A(u)) of each sort of segments, and the sum of |B| over all."""
    states, fractions, sorts = flow.sorts
    first, last = 1 / piece.high, 1 / piece.low
    middle, half = (first + last) / 2, UP * (last - first) / 2 + SPARE * ROUNDING * last
    powers = np.array([[1.0, middle, middle**2], [0.0, half, 2 * middle * half], [0.0, 0.0, half**2]])
    turn = 2 * np.pi * flow.cycles * fractions[:, None, None]
    exponent = total(turn * powers, own.terms[states], own.radii[states])
    sizes = size(exponent.centre)[sorts].sum(axis=0)
    return (exponential(exponent, DEGREE), sizes[1:].sum()) if sizes.sum() < ENDLESS else (exponent, np.inf)


def _joined(steps: Ball, sorts: Array, levels: int) -> Ball:
    """Products of 2^levels segments that follow each other; the last ones are filled up with unit matrices."""
    unit = np.zeros((1, *steps.centre.shape[1:]))
    unit[0, 0] = np.eye(unit.shape[-1])
    every = Ball(np.concatenate([steps.centre, unit]), np.append(steps.radius, 0.0))
    parts = np.pad(sorts, (0, -len(sorts) % 2**levels), constant_values=len(steps.radius)).reshape(-1, 2**levels)
    found = []
    for some in np.array_split(parts, -(-parts.size * unit.size // AT_ONCE)):
        own = every[some]
        for _ in range(levels):
            own = product(own[:, 1::2], own[:, ::2], DEGREE)
        found.append(own)
    return Ball(
        np.concatenate([own.centre[:, 0] for own in found]), np.concatenate([own.radius[:, 0] for own in found])
    )


def _grows_or_decays(flow: Flow, own: Enclosed, piece: Certificate, steps: Ball, span: float) -> bool:
    """Theorem 1."""
    signs, count = np.where(np.arange(len(own.modes)) < piece.outside, 1.0, -1.0), len(flow.fractions)
    levels = int(np.ceil(np.log2(count)))
    while levels > 0 and (2**levels > MOST or span * min(1.0, 2**levels / count) > LONGEST):
        levels -= 1
    parts = _joined(steps, flow.sorts[2], levels)
    shares = np.add.reduceat(flow.fractions, np.arange(0, count, 2**levels))
    start, decay = np.linalg.solve(own.modes, piece.coordinates), flow.decay(own, piece.low)
    here = np.array(coordinates(parts.centre[:, 0], shares, signs, piece.rate, start, decay))
    back = np.linalg.inv(here)
    # X^-1 is not exactly the inverse of X: y = X^-1 x is what defines coordinates.
    off = size(back @ here - np.eye(len(signs))) + (len(signs) + SPARE) * ROUNDING * size(back) * size(here)
    if not (off < 0.5).all():
        return False
    moved = product(known(np.roll(back, -1, axis=0)), product(parts, known(here), DEGREE), DEGREE)
    rates = (np.maximum if piece.outside else np.minimum)(piece.rate**shares, 1.0)
    form = product(Ball(moved.turned.centre * signs, moved.radius), moved, 2 * DEGREE)
    return positive(plus(form, Ball(rates[:, None, None, None] * np.diag(-signs), UP * rates * off * (2 + off))))


def _keeps_a_form(flow: Flow, own: Enclosed, piece: Certificate, steps: Ball, span: float) -> bool:
    """Theorem 2."""
    if flow.form is None:
        return False
    start, period = (
        known(np.linalg.solve(own.modes, piece.coordinates)),
        _joined(steps, flow.sorts[2], int(np.ceil(np.log2(len(flow.fractions)))))[0],
    )
    form, inverse = (Ball(matrix[None], radius) for matrix, radius in zip(own.forms, own.form_radii, strict=True))
    moved = product(form, period, DEGREE)
    back = product(inverse, moved.turned, DEGREE)
    turns = plus(period, Ball(-back.centre, back.radius))
    found = plus(moved, moved.turned)
    for zero in piece.separators:
        found = product(found, plus(turns, known(-zero * np.eye(len(own.modes)))), DEGREE)
    found = product(product(start.turned, found, DEGREE), start, DEGREE)
    return positive(Ball(found.centre * np.sign(found.centre[0, 0, 0]), found.radius))
