"""The compiled kernel at scattered points (row, 1/Omega) of damped chains and generators, one period at each.

Around a point a Lyapunov function comes with a radius (:func:`radii`): a proof that no multiplier crosses the unit
circle near its mesh frequency.

Theorem. Let a period consist of segments x' = A_i x of length h_i, F_i = exp(A_i h_i), and let all lengths be stretched
alike by 1 + eta, as they are when Omega falls to Omega/(1 + eta). Let symmetric P_0, ..., P_S = P_0 be given, Y_i =
F_i^T P_(i+1) F_i, Q_i = P_i - Y_i, and E_i(X) = h_i (X A_i + A_i^T X). If for all i

    Q_i > eta' E_i(X)    for X = P_i and X = Y_i,

at eta' = eta and at 0, then M(eta)^T P_0 M(eta) < P_0 for the monodromy matrix M of all stretchings between 0 and eta.

Proof. Stretched, a segment is F_i exp(eta h_i A_i). Along z' = h_i A_i z, 0 <= s <= eta, let V(s) = z^T X(s) z with
X(s) = P_i - (s/eta) Q_i, from P_i to Y_i. V' = z^T (E_i(X(s)) - Q_i/eta) z is negative for eta > 0, as X(s) lies
between P_i and Y_i and E_i is linear (for eta < 0 likewise, s running down). Hence z^T exp(..)^T Y_i exp(..) z < z^T
P_i z, segment by segment. The conditions are linear in eta: what holds at 0 and at eta holds between.

M^T P M < P allows no multiplier on the unit circle (M v = lambda v, |lambda| = 1 would give v^H P v < v^H P v), so that
the number of multipliers outside is the same for all these mesh frequencies: none, if it is none at one of them. P is
positive definite then; where k multipliers are outside it has k negative eigenvalues, and the theorem proves that the
whole stretch is *unstable*.

How P is found. The loss Q is chosen, q_i = |h_i| Theta + (exp(2 beta h_i) - 1) Y_i with the rate Theta at which damping
takes action (:mod:`~gearstab.floquet.kernel.chain`) and, where all multipliers are inside, a part beta of the growth
rate, which keeps P small where one of them is near the circle. This is M'^T P_0 M' - P_0 = -D with M' = exp(beta T) M,
solved by doubling, P = sum (M'^T)^k D M'^k, or, where multipliers are outside, as a linear system.

In floating point. What is tested is the matrices as they are computed: a step from P_(i+1) to Y_i, and Q_i = P_i - Y_i
with the P_i that the next step really starts from, P_0 = P_S included. Only the rounding errors of one segment at a
time are not covered by that; ``rounding`` times the largest entry of P is subtracted from Q for them. This is no
interval arithmetic.

Where A_i changes with the mesh frequency, as speeds of rotation W follow it, F_i(eta) = exp(Z(eta)) with Z = h_i (1 +
eta) A_i(W/(1 + eta)), and h_i A_i gives way to

    G_i = F_i^-1 dF_i/deta = int_0^1 exp(-u Z) Z' exp(u Z) du,    Z' = h_i (A_i - D_i),    D_i = dA_i/d ln Omega:

the proof is the same, with V running from s = eta down to 0, but for the dependence of G_i on eta. With d_u = exp(-u Z)
h_i D_i exp(u Z), which in real modal coordinates is about as large as h_i D_i, and d its mean over u,

    dG_i/deta = (Z'' transported) + 2 d - d_0 - d_1 + O(|d|^2);

what bounds it, times the largest radius, is taken from Q_i too.

The radius grows with damping, to about one damping ratio at epsilon = 0.3, and falls with the distance to an edge.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab import ckernel
from gearstab.floquet.kernel.c_kernel import LANES, contiguous, damped_arguments, whole_numbers
from gearstab.floquet.kernel.chain import Chain
from gearstab.floquet.kernel.damped import Generators, real_modes
from gearstab.floquet.kernel.threads import in_threads
from gearstab.system import Array

LARGEST = 0.5
"""The largest radius that is asked for."""
LEAST = 2.0**-40
"""Part of LARGEST below which a radius is none."""
BISECTIONS = 4
"""Bisections of a radius on a logarithmic scale, between halvings: it is found within 2^(1/16)."""
PART = 0.4
"""Part of the slowest decay that is built into P."""
LONGEST = 1.0
"""Decay of the action in a piece of a segment, at most."""
PIECES = 64.0
"""Most pieces of a segment."""
DOUBLINGS = 60
NEGLIGIBLE = 1e-9
"""Entries of M'^k below this add nothing to P."""


FARTHEST = 1 / 32
"""The largest radius that is asked for where generators change with the mesh frequency."""
SECURE = 1.5
"""Factor by which what bounds the second derivative grows within that radius: (1 - FARTHEST)^-4 is 1.14."""
UNKNOWNS = 80
"""Most unknowns of a linear system for P that is set up; larger P are found from the eigenvectors of M."""


def moduli(chain: Chain, row: Array, cycle: Array, limit: int | None = None) -> Array:
    """ln |lambda| of all multipliers, descending, ``(P, m)``, at points (row, 1/Omega) ``(P,)``."""
    logs = np.empty((len(row), chain.size))
    given, where = _of_chain(chain), (whole_numbers(row), contiguous(cycle))

    def part(first: int, last: int) -> None:
        ckernel.library.moduli(ckernel.simd(), *given, first, last, len(row), *where, logs)

    in_threads(part, len(row), float(len(chain.states) * chain.size**3), limit)
    left = np.flatnonzero(np.isnan(logs).any(axis=1) | ~chain.sound[row])
    if len(left):
        matrix, scale = products(chain, row[left], cycle[left])
        with np.errstate(divide="ignore"):
            logs[left] = -np.sort(-np.log(np.abs(np.linalg.eigvals(matrix))) - scale[:, None], axis=1)
    return logs


def products(chain: Chain, row: Array, cycle: Array, limit: int | None = None) -> tuple[Array, Array]:
    """Return products of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, over exp(scale); scale ``(P,)``.

    In the coordinates of the states; in those of the generators where these go with the mesh frequency or a state has
    no eigenvectors.
    """
    matrix, scale = _products(_of_chain(chain), row, cycle, limit)
    left = np.flatnonzero(~chain.sound[row])
    if len(left):
        given = _scattered(chain.cycles, chain.fractions, chain.states, chain.generator)
        matrix[left], scale[left] = _products(given, row[left], cycle[left], limit)
    return matrix, scale


def _products(given: tuple[Any, ...], row: Array, cycle: Array, limit: int | None = None) -> tuple[Array, Array]:
    """The same by the arguments of the C function."""
    segments, m = given[0][1], given[0][4]
    matrix, scale = np.empty((len(row), m, m)), np.empty(len(row))
    where = whole_numbers(row), contiguous(cycle)

    def part(first: int, last: int) -> None:
        of_points = LANES * first, min(LANES * last, len(row)), len(row)
        ckernel.library.products(ckernel.simd(), *given, *of_points, *where, matrix, scale)

    # Points that go through the period side by side take no longer than one.
    in_threads(part, -(-len(row) // LANES), float(LANES * segments * m**3), limit)
    return matrix, scale


def exponentials(
    cycles: float, fractions: Array, states: Array, generator: Generators, row: Array, cycle: Array
) -> Array:
    """Products of the exponentials of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, not scaled.

    fractions ``(r, S)``, states ``(S,)``: as of a pattern.
    """
    matrix, scale = _products(_scattered(cycles, fractions, states, generator), row, cycle)
    with np.errstate(over="ignore"):
        return matrix * np.exp(scale)[:, None, None]


def chained(
    cycles: float, fractions: Array, states: Array, values: Array, vectors: Array, inverse: Array, row: Array,
    cycle: Array,
) -> Array:  # fmt: skip
    """Products of all segments ``(P, m, m)`` at points (row, 1/Omega) ``(P,)``, not scaled.

    values ``(r, D, m)``, vectors and their inverse ``(r, D, m, m)``: of well-conditioned states. fractions ``(r, S)``,
    states ``(S,)``: as of a pattern.
    """
    values, basis, inverse = real_modes(values, vectors, inverse)
    count, following = values.shape[1], np.roll(states, -1)
    pairs, index = np.unique(following * count + states, return_inverse=True)
    change = inverse[:, pairs // count] @ basis[:, pairs % count]
    matrix, scale = _products(damped_arguments(cycles, values, fractions, states, change, index), row, cycle)
    first = states[0]
    return basis[row, first] @ (matrix * np.exp(scale)[:, None, None]) @ inverse[row, first]


def radii(chain: Chain, row: Array, cycle: Array, growth: Array, limit: int | None = None) -> Array:
    """``(P, 2)``: by which part all periods may be longer, and shorter, and as many multipliers are outside the unit
    circle as at the points (row, 1/Omega) ``(P,)``; 0 where nothing is proved.

    growth: ``(P,)``, the largest ln |lambda|.
    """
    chain, row = chain.at(row, cycle, slopes=True)
    radius, m = np.zeros((len(row), 2)), chain.size
    slopes = (np.empty(0), np.empty(0)) if chain.slope is None or chain.bend is None else (chain.slope, chain.bend)
    given = (*_of_chain(chain), contiguous(chain.weight), settings(chain), *map(contiguous, slopes))

    def proved(which: Array, equation: Array, reads: bool) -> Array:
        found = np.empty((len(which), 2))
        where = (whole_numbers(row[which]), contiguous(cycle[which]), contiguous(growth[which]))

        def part(first: int, last: int) -> None:
            of_points = first, last, len(which)
            ckernel.library.radii(ckernel.simd(), *given, *of_points, *where, found, equation, int(reads))

        # Roughly: it decides only from how many points on threads pay.
        in_threads(part, len(which), 10.0 * len(chain.states) * m**3, limit)
        return found

    by_vectors = chain.sound[row] & (growth >= 0) & (m * (m + 1) // 2 > UNKNOWNS)
    plain, left = np.flatnonzero(chain.sound[row] & ~by_vectors), np.flatnonzero(by_vectors)
    radius[plain] = proved(plain, np.empty(0), False)
    if len(left):
        equation = np.empty((len(left), 2, m, m))
        proved(left, equation, False)
        with np.errstate(all="ignore"):
            equation[:, 1] = stein(equation[:, 0], equation[:, 1])
        radius[left] = proved(left, equation, True)
    return np.nan_to_num(radius)


def _scattered(cycles: float, fractions: Array, states: Array, generator: Generators) -> tuple[Any, ...]:
    """Any generators, of which each point makes exponentials, as the C functions for scattered points take them."""
    rows, count, m = generator.matrix.shape[:3]
    by_speed, laws = np.empty((rows, 0, m, m)), np.empty((rows, 0, 3))
    if generator.by_speed is not None and generator.laws is not None:
        by_speed, laws = generator.by_speed, generator.laws
    numbers = (rows, len(states), count, count, m, by_speed.shape[1], float(cycles))
    unused, order = np.zeros((rows, count, m)), np.ascontiguousarray(states, dtype=np.int64)
    return (
        numbers,
        unused,
        unused,
        contiguous(fractions),
        order,
        order,
        *map(contiguous, (generator.matrix, by_speed, laws)),
    )


def _of_chain(chain: Chain) -> tuple[Any, ...]:
    if chain.following is not None:
        parts = chain.fractions[:, chain.span], chain.states[chain.span]
        return _scattered(chain.cycles, *parts, chain.following)
    return damped_arguments(chain.cycles, chain.values, chain.fractions, chain.states, chain.change, chain.index)


def settings(chain: Chain) -> tuple[float | int, ...]:
    """Return the numbers that the compiled kernel needs."""
    largest = LARGEST if chain.slope is None else FARTHEST
    numbers = (PART, LONGEST, PIECES, chain.rounding, largest, LEAST, NEGLIGIBLE)
    return (*numbers, BISECTIONS, DOUBLINGS, UNKNOWNS, 2 * FARTHEST * SECURE)


def stein(matrix: Array, loss: Array) -> Array:
    """P - M^T P M = D ``(P, m, m)`` from the eigenvectors of M; NaN where these are nearly dependent."""
    values, vectors = np.linalg.eig(matrix)
    sound = np.linalg.cond(vectors) < 1 / np.finfo(float).eps
    vectors = np.where(sound[:, None, None], vectors, np.nan)
    inverse = np.linalg.inv(vectors)
    part = vectors.conj().swapaxes(-1, -2) @ loss @ vectors
    part = part / (1 - values.conj()[:, :, None] * values[:, None, :])
    return (inverse.conj().swapaxes(-1, -2) @ part @ inverse).real
