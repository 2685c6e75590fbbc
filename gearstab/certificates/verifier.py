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
positive definite if R P R^T has a dominant diagonal for some R: the inverse of a Cholesky factor in floating point.

**Not covered**: how A_s and f_s, doubles taken exactly, came from gears; what lies between pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat, ctx

from gearstab.certificates.choices import coordinates

Array = np.ndarray

PRECISION, DEGREE, GENTLE = 64, 4, 0.1
"""Bits of the midpoints; degree of the Taylor polynomials, sum of |B| below which it is 2."""
LONGEST, MOST, ENDLESS = 0.4, 16, 1000.0
"""Sum of |B|, and number, beyond which a part ends: radii grow with each segment. Sum of |B| of too long a piece."""


@dataclass(frozen=True)
class Flow:
    """A of each state; of each segment its state and f_s; cycles N; form Q, None where something is damped."""

    generators: Sequence[arb_mat]
    states: Sequence[int]
    fractions: Sequence[float]
    cycles: float
    form: arb_mat | None


@dataclass(frozen=True)
class Certificate:
    """A claim for low <= Omega <= high: growth if outside = k > 0, else stability; rate r, 0 for Theorem 2; coordinates
    X_1 ``(m, m)``; separators, the zeros of p.
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
    turn, start = 2 * arb.pi() * arb(flow.cycles), exact(piece.coordinates)
    shortest, longest = turn / arb(piece.high), turn / arb(piece.low)
    middle = ((shortest + longest) / 2).mid()
    half = (longest - middle).max(middle - shortest).upper()
    try:
        # In coordinates of X_1; segments that are alike once.
        back, keys = start.inv(), [*zip(flow.states, flow.fractions, strict=True)]
        own = [back * generator * start for generator in flow.generators]
        slopes = {(s, f): own[s] * (half * arb(f)) for s, f in keys}
        total = sum((_size(slopes[key]) for key in keys), arb(0))
        if not total < ENDLESS:
            return False
        flows = {(s, f): (own[s] * (middle * arb(f))).exp() for s, f in slopes}
        proof, degree = _grows_or_decays if piece.rate else _keeps_a_form, DEGREE if total > GENTLE else 2
        return proof(flow, piece, [flows[key] for key in keys], [slopes[key] for key in keys], degree)
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
        return False


def _grows_or_decays(flow: Flow, piece: Certificate, flows: list[arb_mat], slopes: list[arb_mat], degree: int) -> bool:
    """Theorem 1, from the end of the period to its beginning."""
    signs = np.where(np.arange(slopes[0].nrows()) < piece.outside, 1.0, -1.0)
    form, rate = exact(np.diag(signs)), arb(piece.rate)
    here = [exact(x) for x in coordinates([near(step) for step in flows], flow.fractions, signs, piece.rate)]
    back = [x.inv() for x in here]
    terms, share, span, count = [form], arb(0), arb(0), 0  # of a part
    for s in reversed(range(len(flows))):
        slope = back[s] * slopes[s] * here[s]
        terms = _pulled_back(terms, back[(s + 1) % len(back)] * flows[s] * here[s], slope, degree)
        share, span, count = share + arb(flow.fractions[s]), span + _size(slope), count + 1
        if s == 0 or count == MOST or span > LONGEST:
            if not _definite_throughout([terms[0] - form * rate**share, *terms[1:]]):
                return False
            terms, share, span, count = [form], arb(0), arb(0), 0
    return True


def _pulled_back(terms: list[arb_mat], step: arb_mat, slope: arb_mat, degree: int) -> list[arb_mat]:
    """exp(z B)^T P(z) exp(z B), P = step^T terms(z) step, as a polynomial."""
    moved, rest = [step.transpose() * term * step for term in terms], _remainder(slope)
    found = moved + [0 * slope] * (degree + 1 - len(moved))
    for order in range(1, degree + 1):
        share = slope / order
        products = [term * share for term in moved[: degree + 1 - order]]
        moved = [product + product.transpose() for product in products]
        for k, term in enumerate(moved):
            found[k + order] = found[k + order] + term
    return [*found[:-1], rest.transpose() * found[-1] * rest]


def _keeps_a_form(flow: Flow, piece: Certificate, flows: list[arb_mat], slopes: list[arb_mat], degree: int) -> bool:
    """Theorem 2."""
    if flow.form is None:
        return False
    start, unit = exact(piece.coordinates), exact(np.eye(len(piece.coordinates)))
    form, period = start.transpose() * flow.form * start, [unit]
    for step, slope in zip(flows, slopes, strict=True):
        terms = [step]
        for k in range(1, degree + 1):
            terms.append(terms[-1] * slope / k)
        period = _product([*terms[:-1], terms[-1] * _remainder(slope)], period, degree)
    turned, inverse = [form * term for term in period], form.inv()
    total = [term - inverse * other.transpose() for term, other in zip(period, turned, strict=True)]
    found = [term + term.transpose() for term in turned]
    for zero in piece.separators:
        found = _product(found, [total[0] - unit * arb(zero), *total[1:]], degree)
    return _definite_throughout([term * (1 if found[0][0, 0] > 0 else -1) for term in found])


def _remainder(slope: arb_mat) -> arb_mat:
    """All exp(u z B), 0 <= u <= 1, |z| <= 1."""
    m, radius = slope.nrows(), (_size(slope).exp() - 1).abs_upper()
    return exact(np.eye(m)) + arb_mat(m, m, [arb(0, radius)] * (m * m))


def _product(a: list[arb_mat], b: list[arb_mat], degree: int) -> list[arb_mat]:
    """Of two polynomials on [-1, 1], what is of higher degree joined to the last coefficient."""
    found = [0 * a[0]] * (min(degree, len(a) + len(b) - 2) + 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            term = left * right if i + j <= degree else left * right * arb(0, 1)
            found[min(i + j, degree)] = found[min(i + j, degree)] + term
    return found


def _definite_throughout(terms: list[arb_mat]) -> bool:
    """Whether a polynomial with symmetric coefficients, of degree 2 or more, is positive definite on [-1, 1]."""
    constant, linear, square = terms[0], terms[1], terms[2]
    for k, term in enumerate(terms[3:], start=1):
        square = square + term * (arb(0, 1) if k % 2 else (arb(0, 1) + 1) / 2)
    for bernstein in (constant - linear + square, constant - square, constant + linear + square):
        middle = near(bernstein)
        lower = exact(np.linalg.inv(np.linalg.cholesky(0.5 * (middle + middle.T))))
        turned = (lower * bernstein * lower.transpose()).tolist()
        if not all(2 * row[i] > sum(map(abs, row), arb(0)) for i, row in enumerate(turned)):
            return False
    return True


def _size(matrix: arb_mat) -> arb:
    """The norm that is the root of the sum of squares, from above."""
    return (matrix.transpose() * matrix).trace().sqrt().upper()


def exact(matrix: Array) -> arb_mat:
    """Doubles as they are."""
    return arb_mat(matrix.tolist())


def near(matrix: arb_mat) -> Array:
    """Doubles near the midpoints."""
    return np.array([float(value) for value in matrix.entries()]).reshape(matrix.nrows(), matrix.ncols())
