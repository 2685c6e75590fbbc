"""Boundaries of a tongue from the second-order amplitude equations of two groups of modes.

Near nu = w_P + w_Q + sigma the parts of the solution in resonance are P at w_P + x and Q at -(w_Q + sigma - x). With
everything else eliminated to second order (:mod:`gearstab.perturbation.response`), and with terms in x^2 replaced by
what first order says of them, they obey, scaled to equal energies,

    x a = [i D_P - D_P^2/(2 w_P) + A A^H/(2 w_P) - E_P] a + F b
    (sigma - x) b = [-i D_Q - D_Q^2/(2 w_Q) + A^H A/(2 w_Q) - E_Q] b + F' a
    F  = G (1 - sigma/(2 w_P)) + i (D_P G - G D_Q)/(2 w_P) - J
    F' = G^H (1 - sigma/(2 w_Q)) + i (G^H D_P - D_Q G^H)/(2 w_Q) + J^H

    A = B/(2 sqrt(w_P w_Q))         direct coupling
    G = (B - T)/(2 sqrt(w_P w_Q))   direct coupling less that through all other modes and products of harmonics
    E = S/(2 w)                     shift of the natural frequency by the same
    J                               the same as T through damping between modes of different frequency
    D = Phi^T C Phi/2               damping, of each group

B is of first order in epsilon, T and E of second; D counts as first order. Unstable where an x has a negative imaginary
part. For one mode each the boundaries are

    sigma = -[|A|^2 + mu_P^2]/(2 w_P) - [|A|^2 + mu_Q^2]/(2 w_Q) - E_P - E_Q +- h

h being the half-width of first order (:mod:`gearstab.perturbation.damped`) with G for A: 2 |G| without damping. The
root thus shifts, always downwards by the tongue's own width (the boundaries curve) and either way by E; and the tongue
opens by T where B vanishes. For Mathieu's equation these are the series of a_n and b_n to the order q^2 (McLachlan
1947, section 2.151). The elimination is a Lyapunov-Schmidt reduction; its general form here was derived anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.grouping import Columns
from gearstab.perturbation.damped import BISECTIONS, outermost, single_pair, undamped
from gearstab.system import Array

DEFECTIVE = 1e-6
"""Where two equal real x meet, rounding parts them by the square root of the rounding error, 1e-8 of the matrix."""
INSIDE = 10.0 ** -np.arange(3.0, 10.0)
"""How far inside an edge, as parts of the region, the instability is looked for."""
UNDAMPED = 1e-12
"""A rate of damping below this part of the largest one is rounding."""
SAMPLES = 256
"""Detunings at which a group with damping, or with parts that do not act on each other, is looked at."""


@dataclass(frozen=True)
class Reduced(Columns):
    """The amplitude equations of pairs of groups with P and Q modes, ``(rows, pairs)`` in front of all arrays.

    frequency_p, frequency_q: w. first, second: B and T over 2 sqrt(w_P w_Q) ``(P, Q)``. shift_p, shift_q: E, Hermitian.
    half_width: h of first order. damping_p, damping_q: D, symmetric. skew: J.
    """

    frequency_p: Array
    frequency_q: Array
    first: Array
    second: Array
    shift_p: Array
    shift_q: Array
    half_width: Array
    damping_p: Array
    damping_q: Array
    skew: Array

    @property
    def coupling(self) -> Array:
        """G."""
        return np.asarray(self.first - self.second)

    @property
    def single(self) -> bool:
        """Whether it is one mode against one."""
        return self.first.shape[-2:] == (1, 1)


def adjoint(matrix: Array) -> Array:
    """The conjugate transpose of the last two dimensions."""
    return np.asarray(np.conj(np.swapaxes(matrix, -1, -2)))


def edges(problem: Reduced) -> tuple[Array, Array]:
    """The boundaries sigma ``(rows, pairs)``, lower and upper.

    NaN where damping closes the tongue, infinite where it has no end (one mode of two is damped). A tongue of width
    zero has both at its shifted root.
    """
    if problem.single:
        return _single(problem)
    damped = problem.damping_p.any() or problem.damping_q.any()
    return _general(problem) if damped else _hermitian(problem)


def second_threshold(problem: Reduced) -> Array:
    """The least factor on every epsilon at which a tongue between damped modes opens, ``(rows, pairs)``.

    The smallest f > 0 with |f B - f^2 T| = 2 sqrt(mu_P mu_Q w_P w_Q), for one mode each; infinite where there is none.
    """
    first, second = problem.first[..., 0, 0], problem.second[..., 0, 0]
    mu_p, mu_q = _rates(problem)
    product = np.maximum(mu_p * mu_q, 0.0)
    # In powers of f: |B|^2 f^2 - 2 Re(B conj T) f^3 + |T|^2 f^4 - mu_P mu_Q, with f in units that make all terms alike.
    size = np.abs(first) + np.sqrt(np.abs(second) * np.sqrt(product))
    unit = np.divide(np.sqrt(product), size, out=np.full(size.shape, np.inf), where=size > 0)
    some = np.isfinite(unit) & (product > 0) & np.isfinite(first)
    # B f and T f^2 over sqrt(mu_P mu_Q) for f = unit; neither is above 1, however small the excitation.
    one, two = first[some] / size[some], (second[some] / size[some]) * (np.sqrt(product[some]) / size[some])
    found = np.where(
        product > 0, np.inf, np.where((np.abs(first) + np.abs(second) > 0) | (mu_p + mu_q == 0), 0.0, np.inf)
    )
    found[some] = _least_root(one, two) * unit[some]
    return np.where((mu_p < 0) | (mu_q < 0), 0.0, found)


def _least_root(one: Array, two: Array) -> Array:
    """The least f > 0 with |f one - f^2 two| = 1; infinite where there is none."""
    # With f = 1/u: u^4 - |one|^2 u^2 + 2 Re(one conj two) u - |two|^2 = 0: the largest u.
    square, mixed, last = np.abs(one) ** 2, 2 * (one * np.conj(two)).real, np.abs(two) ** 2
    companion = np.zeros((len(one), 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[:, 0, 3], companion[:, 1, 3], companion[:, 2, 3] = last, -mixed, square
    roots = np.linalg.eigvals(companion) if len(one) else np.zeros((0, 4))
    real = np.where(np.abs(roots.imag) <= DEFECTIVE * np.abs(roots), roots.real, 0.0).max(axis=-1, initial=0.0)
    return np.divide(1.0, real, out=np.full(real.shape, np.inf), where=real > 0)


def _rates(problem: Reduced) -> tuple[Array, Array]:
    """mu of one mode each."""
    return problem.damping_p[..., 0, 0], problem.damping_q[..., 0, 0]


def _single(problem: Reduced) -> tuple[Array, Array]:
    """The closed form of the module's text."""
    g = np.abs(problem.coupling[..., 0, 0])
    mu_p, mu_q = _rates(problem)
    half, threshold = single_pair(2 * g, mu_p, mu_q)
    half = np.where((half == 0) & (threshold > 0), np.nan, half)
    bend = np.abs(problem.first[..., 0, 0]) ** 2
    center = -(bend + mu_p**2) / (2 * problem.frequency_p) - (bend + mu_q**2) / (2 * problem.frequency_q)
    center = center - problem.shift_p[..., 0, 0].real - problem.shift_q[..., 0, 0].real
    turned = 2 * (problem.coupling * np.conj(problem.skew))[..., 0, 0].imag
    product = mu_p * mu_q
    center = center + np.divide(turned * (mu_p - mu_q), 2 * product, out=np.zeros(g.shape), where=product > 0)
    return center - half, center + half


def _hermitian(problem: Reduced) -> tuple[Array, Array]:
    """Groups without damping.

    From above, sigma reaches the boundary where for the first time an x of P meets one of Q:

        sigma = min over x > A of the largest eigenvalue of C + x + F^H (x - A)^-1 F

    a convex function of x. Parts that do not act on each other may meet without an instability; then the detunings in
    between are looked at one by one.
    """
    coupling = problem.coupling
    turn = 0.25 * (1 / problem.frequency_p + 1 / problem.frequency_q)[..., None, None]
    own, other = _own(problem)
    half = 2 * undamped(coupling.reshape(-1, *coupling.shape[-2:])).reshape(problem.frequency_p.shape)[..., None, None]
    upper = _first_meeting(own, other, coupling * (1 - turn * half))
    lower = -_first_meeting(-own, -other, coupling * (1 + turn * half))
    middle = 0.5 * (lower + upper)
    closed = half[..., 0, 0] == 0
    lower, upper = np.where(closed, middle, lower), np.where(closed, middle, upper)
    doubtful = ~closed & ~(_unstable_inside(problem, lower, upper) & _unstable_inside(problem, upper, lower))
    if doubtful.any():
        floor = DEFECTIVE * half[doubtful, 0, 0]
        found = _outermost(problem.chosen(doubtful), lower[doubtful], upper[doubtful], floor)
        lower[doubtful], upper[doubtful] = np.where(np.isnan(found), (lower[doubtful], upper[doubtful]), found)
    return lower, upper


def _own(problem: Reduced) -> tuple[Array, Array]:
    """A A^H/(2 w) - E of both groups."""
    first, w_p, w_q = problem.first, problem.frequency_p[..., None, None], problem.frequency_q[..., None, None]
    return first @ adjoint(first) / (2 * w_p) - problem.shift_p, adjoint(first) @ first / (2 * w_q) - problem.shift_q


def _unstable_inside(problem: Reduced, edge: Array, other: Array) -> Array:
    """Whether there are unstable detunings by ``edge`` on the side of ``other``, however narrow their part."""
    floor = DEFECTIVE * 2 * np.linalg.norm(problem.coupling, axis=(-2, -1))
    found = np.zeros(edge.shape, dtype=bool)
    for part in INSIDE:
        left = ~found
        if left.any():
            some = problem.chosen(left)
            found[left] = _growth(some, (edge + part * (other - edge))[left]) > floor[left]
    return found


def _first_meeting(own: Array, other: Array, coupling: Array) -> Array:
    """min over x > A of the largest eigenvalue of C + x + F^H (x - A)^-1 F ``(...)``."""
    values, vectors = np.linalg.eigh(own)
    turned = adjoint(vectors) @ coupling
    reach = np.linalg.norm(coupling, axis=(-2, -1))
    low, high = np.zeros(reach.shape), reach + np.where(reach > 0, 0.0, 1.0)
    top = values[..., -1]
    largest = np.zeros(reach.shape)
    for _ in range(BISECTIONS):
        step = 0.5 * (low + high)
        gap = step[..., None] + (top[..., None] - values)
        moved = other + adjoint(turned) @ (turned / gap[..., None])
        levels, shapes = np.linalg.eigh(moved)
        shape = shapes[..., -1]
        slope = 1 - np.sum(np.abs((turned @ shape[..., None])[..., 0] / gap) ** 2, axis=-1)
        largest = levels[..., -1] + top + step
        low, high = np.where(slope < 0, step, low), np.where(slope < 0, high, step)
    return largest


def _matrix(problem: Reduced, sigma: Array) -> Array:
    """The matrix whose eigenvalues are x ``(..., P + Q, P + Q)``."""
    g, w_p, w_q = problem.coupling, problem.frequency_p[..., None, None], problem.frequency_q[..., None, None]
    detuning = sigma[..., None, None]
    own, other = _own(problem)
    right, left = g * (1 - detuning / (2 * w_p)), adjoint(g) * (1 - detuning / (2 * w_q))
    d_p, d_q = problem.damping_p, problem.damping_q
    own = own + 1j * d_p - d_p @ d_p / (2 * w_p)
    other = other - 1j * d_q - d_q @ d_q / (2 * w_q)
    right = right + 0.5j * (d_p @ g - g @ d_q) / w_p - problem.skew
    left = left + 0.5j * (adjoint(g) @ d_p - d_q @ adjoint(g)) / w_q + adjoint(problem.skew)
    lower = np.concatenate([-left, detuning * np.eye(other.shape[-1]) - other], axis=-1)
    return np.concatenate([np.concatenate([own, right], axis=-1), lower], axis=-2)


def _growth(problem: Reduced, sigma: Array) -> Array:
    """The largest rate of growth, -Im x."""
    return np.asarray((-np.linalg.eigvals(_matrix(problem, sigma)).imag).max(axis=-1))


def _general(problem: Reduced) -> tuple[Array, Array]:
    """Groups with damping: the outermost changes of the sign of the growth."""
    norm = 2 * np.linalg.norm(problem.coupling, axis=(-2, -1))
    least, most = _extremes(problem)
    # As for one mode each, |sigma| is below (mu_P + mu_Q)/(2 sqrt(mu_P mu_Q)) |G|; where a direction is undamped, first
    # order knows whether there is an end.
    wide = np.divide(most, least, out=np.zeros(norm.shape), where=least > 0)
    reach = np.where(least > 0, norm * np.maximum(wide, 1.0), 2 * problem.half_width)
    lower, upper = np.where(np.isinf(reach), -np.inf, np.nan), np.where(np.isinf(reach), np.inf, np.nan)
    some = np.isfinite(reach) & (norm > 0)
    if some.any():
        part = problem.chosen(some)
        slack = np.linalg.norm(part.shift_p, axis=(-2, -1)) + np.linalg.norm(part.shift_q, axis=(-2, -1))
        slack = slack + norm[some] ** 2 * (1 / part.frequency_p + 1 / part.frequency_q)
        floor = np.where(least[some] > 0, 0.0, DEFECTIVE * norm[some])
        lower[some], upper[some] = _outermost(part, -reach[some] - slack, reach[some] + slack, floor)
    return lower, upper


def _extremes(problem: Reduced) -> tuple[Array, Array]:
    """The least and the greatest rate of damping of any direction of the groups; what is rounding is 0."""
    rates = np.concatenate([np.linalg.eigvalsh(d) for d in (problem.damping_p, problem.damping_q)], axis=-1)
    least, most = rates.min(axis=-1), rates.max(axis=-1)
    return np.where(least > UNDAMPED * most, least, 0.0), most


def _outermost(problem: Reduced, lower: Array, upper: Array, floor: Array) -> tuple[Array, Array]:
    """The outermost ends of the unstable detunings between two, ``(pairs,)``; NaN where all samples are stable.

    floor: the growth that counts as instability.
    """

    def grows(sigma: Array) -> Array:
        return _growth(problem, sigma) > floor

    points = lower + (upper - lower) * ((np.arange(SAMPLES + 2) - 0.5) / SAMPLES)[:, None]
    unstable = np.stack([grows(point) for point in points])
    first, last = outermost(points, unstable, grows)
    some = unstable.any(axis=0)
    return np.where(some, first, np.nan), np.where(some, last, np.nan)
