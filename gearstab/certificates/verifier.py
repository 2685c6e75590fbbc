r"""Stability over whole intervals of the mesh frequency, proved in balls of matrices.

x' = A_s x holds in segment s = 1, ..., S of a period T and lasts f_s T. With T = 2 pi N/Omega a period is

    Phi(T) = exp(f_S A_S T) ... exp(f_1 A_1 T).

A *piece* claims, of all Omega in [low, high], that every solution decays (is bounded), or that some grow.

**Theorem 1.** Cut the period into parts of one or more segments, part i with the propagator Phi_i. Let
J = diag(I_k, -I), let Y_1, Y_2, ... back to Y_1 after the last part be nonsingular, and all r_i > 0. If for every part

    N_i = Psi_i^T J Psi_i - r_i J,      Psi_i = Y_(i+1) Phi_i Y_i^-1,

is positive definite, then (i) for k = 0 and all r_i <= 1 all solutions decay exponentially; (ii) for k > 0 and all
r_i >= 1 some grow exponentially. *Proof.* V_i(x) = y^T J y with y = Y_i x. Part i makes of V_i a V_(i+1) > r_i V_i for
x != 0, so that V = V_1 has V(Phi x) >= R V(x) + c |x|^2 with the product R of all r_i and some c > 0. (i) -V is
positive definite, and shrinks by a factor below 1 in a period. (ii) From a V(x) > 0, which k > 0 admits, V grows by a
factor above 1 in every period, and |x|^2 >= V/|Y_1|^2 with it. The certificate is X_1, near Y_1^-1, k and r, of which
a part takes its share: other Y_i are free. With X_i for Y_i^-1, N_i is found but for r_i (X_i^T Y_i^T J Y_i X_i - J)
below r_i (2 d + d^2) where |Y_i X_i - I| = d < 1; this also says that Y_i and X_i are nonsingular.

**Theorem 2.** Let Q be skew, nonsingular and A_s^T Q + Q A_s = 0 for all s (nothing is damped), W = Phi + Phi^-1 and p
a real polynomial. Then H = (Q Phi + (Q Phi)^T) p(W) is symmetric and Phi^T H Phi = H. If H is definite, all solutions
are bounded, also for all A_s near enough that keep Q (strong stability). *Proof.* x^T Q y of two solutions is constant:
Phi^T Q Phi = Q, so that Q Phi^-1 = Phi^T Q = -(Q Phi)^T and Q W = W^T Q. Hence H = Q (Phi - Phi^-1) p(W) is symmetric,
and Phi^T Q = Q Phi^-1 gives the second claim. x^T H x is the same at t = 0, T, 2T, ... and bounds |x|.
The zeros of p, the *separators*, are the certificate, with coordinates X_1 in which H is looked at.

**From a period to a piece.** T = T_0 + h z, -1 <= z <= 1, and exp(f A T) = exp(f A T_0) exp(z B), B = h f A. All
matrices are balls of polynomials in z (balls.py), which hold them at all z at once. A polynomial is a convex
combination of its Bernstein coefficients on [-1, 1], and positive definite if they are. All is looked at in coordinates
of modes, which keep A nearly normal: they change neither theorem.

**Matrices that follow the speed.** In the time Omega t, A_s = A_0 + u A_1 + u^2 A_2, u = 1/Omega, over 2 pi N f_s. With
u = u_0 + h z the exponent is a polynomial in z.

**Not covered**: how A_s and f_s, doubles taken exactly, came from gears; what lies between pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

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
)
from gearstab.certificates.choices import coordinates
from gearstab.certificates.equations import Enclosed, Flow

DEGREE, GENTLE, COUNTED, CARRIED = 4, 0.05, -1.0, -2.0
"""Degree of polynomials; sum of |B| below which it is 2; rates of Theorems 3 and 4."""
LONGEST, ENDLESS, AT_ONCE = 1.2, 1000.0, 2**22
"""Sum of |B| beyond which a part ends, and of too long a piece; numbers that are multiplied at once."""


@dataclass(frozen=True)
class Certificate:
    """A claim for low <= Omega <= high: growth if outside = k > 0, else stability; rate r, 0 for Theorem 2, COUNTED
    and CARRIED for those of multipliers and lyapunov.py; coordinates X_1 ``(m, m)``; separators, the zeros of p.
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
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
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
    degree = DEGREE if span > GENTLE else 2
    return product(middle, exponential(slopes, degree), degree), span


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


def _parts(flow: Flow, steps: Ball, span: float) -> tuple[Ball, Array]:
    """Products of 2, 4, 8, ... segments that follow each other, and their shares of the period.

    The last part is filled up with unit matrices.
    """
    count, degree, unit = len(flow.states), steps.centre.shape[1] - 1, np.zeros((1, *steps.centre.shape[1:]))
    unit[0, 0] = np.eye(unit.shape[-1])
    length = 2 ** int(np.ceil(np.log2(count)))
    while length > 1 and (length * unit.size > AT_ONCE or span * min(1.0, length / count) > LONGEST):
        length //= 2
    every = Ball(np.concatenate([steps.centre, unit]), np.append(steps.radius, 0.0))
    parts = np.pad(flow.sorts[2], (0, -count % length), constant_values=len(steps.radius)).reshape(-1, length)
    found = []
    for some in np.array_split(parts, -(-parts.size * unit.size // AT_ONCE)):
        own = every[some]
        while own.radius.shape[1] > 1:
            own = product(own[:, 1::2], own[:, ::2], degree)
        found.append(own[:, 0])
    whole = Ball(np.concatenate([own.centre for own in found]), np.concatenate([own.radius for own in found]))
    return whole, np.add.reduceat(flow.fractions, np.arange(0, count, length))


def _grows_or_decays(flow: Flow, own: Enclosed, piece: Certificate, steps: Ball, span: float) -> bool:
    """Theorem 1."""
    signs = np.where(np.arange(len(own.modes)) < piece.outside, 1.0, -1.0)
    parts, shares = _parts(flow, steps, span)
    start, decay = np.linalg.solve(own.modes, piece.coordinates), flow.decay(own, piece.low)
    here = np.array(coordinates(parts.centre[:, 0], shares, signs, piece.rate, start, decay))  # X_i
    back = np.linalg.inv(here)  # Y_i
    off = size(back @ here - np.eye(len(signs))) + (len(signs) + SPARE) * ROUNDING * size(back) * size(here)
    if not (off < 0.5).all():
        return False
    degree = parts.centre.shape[1] - 1
    moved = product(known(np.roll(back, -1, axis=0)), product(parts, known(here), degree), degree)
    rates = (np.maximum if piece.outside else np.minimum)(piece.rate**shares, 1.0)
    form = product(Ball(moved.turned.centre * signs, moved.radius), moved, 2 * degree)
    return positive(plus(form, Ball(rates[:, None, None, None] * np.diag(-signs), UP * rates * off * (2 + off))))


def _keeps_a_form(flow: Flow, own: Enclosed, piece: Certificate, steps: Ball, span: float) -> bool:
    """Theorem 2; the span, by which a piece changes, needs no parts."""
    if flow.form is None:
        return False
    start = known(np.linalg.solve(own.modes, piece.coordinates))
    parts, shares = _parts(flow, steps, 0 * span)
    period = reduce(lambda whole, part: product(part, whole, DEGREE), [parts[i] for i in range(len(shares))])
    form, inverse = (Ball(matrix[None], radius) for matrix, radius in zip(own.forms, own.form_radii, strict=True))
    moved = product(form, period, DEGREE)
    back = product(inverse, moved.turned, DEGREE)
    turns = plus(period, Ball(-back.centre, back.radius))
    found = plus(moved, moved.turned)
    for zero in piece.separators:
        found = product(found, plus(turns, known(-zero * np.eye(len(own.modes)))), DEGREE)
    found = product(product(start.turned, found, DEGREE), start, DEGREE)
    return positive(Ball(found.centre * np.sign(found.centre[0, 0, 0]), found.radius))
