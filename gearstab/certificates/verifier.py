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
every period, and |x|^2 >= V/|X_1^-1|^2 with it.

X_1, k and r are the certificate. The other X_i are chosen here, in floating point, as any choice proves what it proves:
X_1^-1 Phi X_1 is a matrix that keeps J times a self-adjoint one, D; X_(s+1) = exp(f_s A_s T) X_s D^(-f_s) spreads
the growth of V evenly over the period. Where much decays over it, -V is what a Lyapunov equation makes of X_1.

**Theorem 2.** Let Q be skew, nonsingular and A_s^T Q + Q A_s = 0 for all s (nothing is damped), W = Phi + Phi^-1 and p
a real polynomial. Then H = (Q Phi + (Q Phi)^T) p(W) is symmetric and Phi^T H Phi = H. If H is definite, all solutions
are bounded, also for all A_s near enough that keep Q (strong stability). *Proof.* x^T Q y of two solutions is constant:
Phi^T Q Phi = Q, so that Q Phi^-1 = Phi^T Q = -(Q Phi)^T and Q W = W^T Q. Hence H = Q (Phi - Phi^-1) p(W) is symmetric,
and Phi^T Q = Q Phi^-1 gives the second claim. x^T H x is the same at t = 0, T, 2T, ... and bounds |x|.

The zeros of p, the *separators*, are the certificate, with coordinates X_1 in which H is looked at. There is such a p
if and only if the multipliers e^(i theta) are none of +-1 and equal ones have equal Krein signatures: p changes its
sign between the values 2 cos(theta) of the two kinds.

**From a period to a piece.** T = T_0 + h z, -1 <= z <= 1, and exp(f A T) = exp(f A T_0) exp(z B), B = h f A. The rest
of a Taylor polynomial of degree p is its term of degree p times an average of exp(u z B), 0 <= u <= 1 (of a form:
between two of them), whose entries differ from those of the unit matrix by exp(|B|) - 1 at most: the last
coefficient is a ball. So is in the end what is of higher degree than 2. On [-1, 1] c_0 + c_1 z + c_2 z^2 is a convex
combination of its Bernstein coefficients c_0 - c_1 + c_2, c_0 - c_2, c_0 + c_1 + c_2, and definite if they are. P is
positive definite if R P R^T has a dominant diagonal for some R: the inverse of a Cholesky factor in floating point.

**Not covered**: how A_s and f_s, doubles taken exactly, came from gears; what lies between pieces. How A_s follows from
M, C_s, K_s is said in :mod:`gearstab.certificates.equations`. This file needs python-flint and NumPy only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from math import ceil

import numpy as np
from flint import arb, arb_mat, ctx

Array = np.ndarray

PRECISION = 96
"""Bits of the midpoints."""
DEGREE, CONSERVATIVE = 4, 6
"""Degree of the Taylor polynomials of Theorem 1 and 2."""
GRADED, DOUBLINGS = 1e6, 10
"""Condition of Phi beyond which its slow directions drown the others; periods, as a power of 2, of a sweep backwards,
which they do not disturb."""
LONGEST, MOST, FINEST = 0.7, 16, 1000.0
"""Sum of |B|, and number, up to which segments are one part: radii of balls grow with each by a small factor. Parts
into which a segment is cut at most."""


@dataclass(frozen=True)
class Flow:
    """A_s of each segment, s numbered from 0; fractions f_s; cycles N; form Q, None for systems with damping."""

    generators: Sequence[arb_mat]
    fractions: Sequence[float]
    cycles: float
    form: arb_mat | None


@dataclass(frozen=True)
class Certificate:
    """What is claimed for low <= Omega <= high, and why: growth if outside = k > 0, else stability.

    rate: r, or 0 where Theorem 2 is meant. coordinates: X_1 ``(m, m)``. separators: zeros of p.
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
    m, coordinates = flow.generators[0].nrows(), np.asarray(piece.coordinates, dtype=float)
    numbers = np.concatenate([[piece.low, piece.high, piece.rate], coordinates.ravel(), piece.separators])
    if coordinates.shape != (m, m) or not np.isfinite(numbers).all() or not 0 < piece.low <= piece.high:
        return False
    if not 0 <= piece.outside <= m or not (piece.rate >= 1 if piece.outside else 0 <= piece.rate <= 1):
        return False
    turn = 2 * arb.pi() * arb(flow.cycles)
    shortest, longest = turn / arb(piece.high), turn / arb(piece.low)
    middle = ((shortest + longest) / 2).mid()
    half = _largest([longest - middle, middle - shortest])
    try:
        return (_grows_or_decays if piece.rate else _keeps_a_form)(flow, piece, exact(coordinates), middle, half)
    except (ZeroDivisionError, np.linalg.LinAlgError):  # a matrix that may be singular
        return False


def _grows_or_decays(flow: Flow, piece: Certificate, start: arb_mat, middle: arb, half: arb) -> bool:
    """Theorem 1."""
    signs = np.where(np.arange(start.nrows()) < piece.outside, 1.0, -1.0)
    form, rate = exact(np.diag(signs)), arb(piece.rate)
    # Long segments in shorter ones.
    generators: list[arb_mat] = []
    segments: list[arb_mat] = []
    fractions: list[float] = []
    back = start.inv()
    for generator, f in zip(flow.generators, flow.fractions, strict=True):
        size = float(_norm(back * generator * start) * half * f) / LONGEST
        if not size < FINEST:
            return False
        times = max(1, ceil(size))
        own = generator * (arb(f) / times)
        generators, segments = generators + [own] * times, segments + [(own * middle).exp()] * times
        fractions += [f / times] * times
    moved = start
    for segment in segments:
        moved = (segment * moved).mid()
    whole = near(back * moved)
    if piece.outside == 0 and np.linalg.cond(whole) > GRADED:
        here = _swept(start, segments, [generator * middle for generator in generators], fractions, whole)
        start, most = here[0], 2
    else:
        spread, here, most = _spread(whole, signs, piece.rate), [start], MOST
        for segment, f in zip(segments[:-1], fractions, strict=False):
            here.append((segment * here[-1] * exact(spread(f))).mid())
    slopes = [x.inv() * (generator * half) * x for x, generator in zip(here, generators, strict=True)]
    lengths = [arb(0), *map(_norm, slopes)]
    terms, share, span, there, count = [form], arb(0), arb(0), start, 0
    for s in reversed(range(len(segments))):
        terms = _pulled_back(terms, there.inv() * segments[s] * here[s], slopes[s], lengths[s + 1])
        share, span, there, count = share + arb(fractions[s]), span + lengths[s + 1], here[s], count + 1
        if s == 0 or count == most or span + lengths[s] > LONGEST:
            if not _definite_throughout([terms[0] - form * rate**share, *terms[1:]]):
                return False
            terms, share, span, count = [form], arb(0), arb(0), 0
    return True


def _pulled_back(terms: list[arb_mat], step: arb_mat, slope: arb_mat, size: arb) -> list[arb_mat]:
    """exp(z B)^T P(z) exp(z B), P = step^T terms(z) step, as a polynomial."""
    moved = [step.transpose() * term * step for term in terms]
    found = moved + [arb_mat(slope.nrows(), slope.nrows())] * (DEGREE + 1 - len(moved))
    for order in range(1, DEGREE + 1):
        products = [term * slope for term in moved[: DEGREE + 1 - order]]
        moved = [(product + product.transpose()) / order for product in products]
        for k, term in enumerate(moved):
            found[k + order] = found[k + order] + term
    rest = _remainder(slope, size)
    return [*found[:-1], rest.transpose() * found[-1] * rest]


def _keeps_a_form(flow: Flow, piece: Certificate, start: arb_mat, middle: arb, half: arb) -> bool:
    """Theorem 2."""
    if flow.form is None or piece.outside:
        return False
    unit, back, form = _unit(start.nrows()), start.inv(), start.transpose() * flow.form * start
    period = [unit]
    for generator, f in zip(flow.generators, flow.fractions, strict=True):
        own = back * (generator * arb(f)) * start
        slope = own * half
        terms = [(own * middle).exp()]
        for k in range(1, CONSERVATIVE + 1):
            terms.append(terms[-1] * slope / k)
        terms[-1] = terms[-1] * _remainder(slope, _norm(slope))
        period = _product(terms, period)
    turned, inverse = [form * term for term in period], form.inv()
    total = [term - inverse * other.transpose() for term, other in zip(period, turned, strict=True)]
    found = [term + term.transpose() for term in turned]
    for zero in piece.separators:
        found = _product(found, [total[0] - unit * arb(zero), *total[1:]])
    sign = 1 if found[0][0, 0] > 0 else -1
    return _definite_throughout([term * sign for term in found])


def _spread(whole: Array, signs: Array, rate: float) -> Callable[[float], Array]:
    """f -> D^-f, where ``whole`` is a matrix that keeps J times D: D^2 = J whole^T J whole."""
    growth = whole.T @ (signs[:, None] * whole) - rate * np.diag(signs)
    inner = np.linalg.inv(np.linalg.cholesky(0.5 * (growth + growth.T)))
    values, basis = np.linalg.eigh(inner @ np.diag(signs) @ inner.T)
    vectors, squared = inner.T @ basis, rate + 1 / values
    back = np.linalg.inv(vectors)
    return lambda f: (vectors * squared ** (-0.5 * f)) @ back


def _swept(
    start: arb_mat, segments: Sequence[arb_mat], exponents: Sequence[arb_mat], fractions: Sequence[float], whole: Array
) -> list[arb_mat]:
    """X_s = P_s^(-1/2) by sweeps backwards, P_s = e^(2 b f_s) F_s^T P_(s+1) F_s + f_s W, F_s of the segment.

    b: half the slowest decay in a period; W: twice the decay of the mean system, less b.
    """
    back = start.inv()
    flows = [near(back * segment * start) for segment in segments]
    decay = -np.sum([np.diag(near(back * exponent * start)) for exponent in exponents], axis=0)
    slow = 0.5 * min(decay.min(), -np.log(np.abs(np.linalg.eigvals(whole)).max()))

    def swept(form: Array) -> list[Array]:
        forms = [form]
        for flow, f in zip(reversed(flows), reversed(fractions), strict=True):
            forms.append(np.exp(2 * slow * f) * flow.T @ forms[-1] @ flow + f * np.diag(2 * (decay - slow)))
        return forms[:0:-1]

    form, power = swept(np.zeros_like(whole))[0], np.exp(slow) * whole
    for _ in range(DOUBLINGS):
        form, power = form + power.T @ form @ power, power @ power
    return [(start * exact(np.linalg.inv(np.linalg.cholesky(0.5 * (p + p.T))).T)).mid() for p in swept(form)]


def _remainder(slope: arb_mat, size: arb) -> arb_mat:
    """All exp(u z B), 0 <= u <= 1, |z| <= 1, |B| <= size."""
    m = slope.nrows()
    return _unit(m) + arb_mat(m, m, [arb(0, (size.exp() - 1).abs_upper())] * (m * m))


def _norm(matrix: arb_mat) -> arb:
    m = matrix.nrows()
    return _largest([sum((abs(matrix[i, j]) for j in range(m)), arb(0)) for i in range(m)])


def _product(a: list[arb_mat], b: list[arb_mat]) -> list[arb_mat]:
    """Of two polynomials on [-1, 1], what is of higher degree joined to the last coefficient."""
    found = [arb_mat(a[0].nrows(), b[0].ncols()) for _ in range(min(CONSERVATIVE, len(a) + len(b) - 2) + 1)]
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            k = i + j
            found[min(k, CONSERVATIVE)] += left * right if k <= CONSERVATIVE else left * right * arb(0, 1)
    return found


def _definite_throughout(terms: list[arb_mat]) -> bool:
    """Whether a polynomial with symmetric coefficients, of degree 2 or more, is positive definite on [-1, 1]."""
    constant, linear, square = terms[0], terms[1], terms[2]
    for k, term in enumerate(terms[3:], start=1):
        square = square + term * (arb(0, 1) if k % 2 else (arb(0, 1) + 1) / 2)
    # Its Bernstein coefficients.
    return all(map(_definite, (constant - linear + square, constant - square, constant + linear + square)))


def _definite(matrix: arb_mat) -> bool:
    """Whether every symmetric matrix in a ball is positive definite."""
    middle = near(matrix)
    lower = exact(np.linalg.inv(np.linalg.cholesky(0.5 * (middle + middle.T))))
    turned, m = lower * matrix * lower.transpose(), matrix.nrows()
    return all(turned[i, i] > sum((abs(turned[i, j]) for j in range(m) if j != i), arb(0)) for i in range(m))


def _largest(balls: Sequence[arb]) -> arb:
    """A number that no |ball| exceeds; NaN if one is."""
    return reduce(arb.max, [abs(ball) for ball in balls]).upper()


def _unit(m: int) -> arb_mat:
    return exact(np.eye(m))


def exact(matrix: Array) -> arb_mat:
    """Doubles as they are."""
    return arb_mat(matrix.shape[0], matrix.shape[1], [arb(value) for value in matrix.ravel().tolist()])


def near(matrix: arb_mat) -> Array:
    """Doubles near the midpoints."""
    return np.array([float(value) for value in matrix.entries()]).reshape(matrix.nrows(), matrix.ncols())
