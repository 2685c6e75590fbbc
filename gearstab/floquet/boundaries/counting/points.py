"""Monodromy matrices and Morse indices at scattered points (row, mesh frequency) of one pattern.

The search asks for a handful of points of every row at a time, so that here the points, not the frequencies of one
row, run along the arrays. The product of segments is the one of :mod:`gearstab.floquet.kernel.numpy_kernel`.

The *Morse index* N(theta) is the number of negative eigenvalues of the quadratic form int |u'|^2 - u^H K(t) u dt over
one common period T with u(T) = exp(i theta) u(0). It is an exact integer of the path of matrices over the period,
which the monodromy matrix alone cannot give. On the pieces between the jumps of K the form is reduced to the
displacements at the jumps, as in the algorithm of Wittrick & Williams (1971, Q. J. Mech. Appl. Math. 24, 263-284):

    N(theta) = sum over segments and modes of floor(w t/pi) + sum over inner jumps of s(D B^-1 + w cot w t)
               + s(B^-1 A + D B^-1 - exp(i theta) B^-1 - exp(-i theta) B^-T),

where [[A, B], [C, D]] propagates from t = 0 to the jump (in the last term over the whole period), the middle sum is
over the jumps inside the period, w and t belong to the segment that follows, and s counts negative eigenvalues.
Source for N(theta) as index of a periodic problem: Bott 1956 (Comm. Pure Appl. Math. 9, 171-206); Long 2002, Index
Theory for Symplectic Paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

LARGEST = 1e6
"""Entries of M above this leave less than ten digits to multipliers on the unit circle."""
LOST = 1e8
"""The same within the period: a symplectic matrix of this size is singular to sixteen digits, and signs of what is
solved with it are those of rounding errors."""
LONGEST = 300.0
"""Hyperbolic angles are cut here: exp(300) is far beyond LARGEST and far from overflow."""


@dataclass(frozen=True)
class Propagation:
    """Propagation over a common period at P points.

    matrix: ``(P, 2n, 2n)``, M in the modes of the first segment.
    energy: ``(P, 2n, 2n)``, E with z^H E z = the mean over the period of |u'|^2 + u^H K u along the solution that
    starts at z. antiperiodic, periodic: ``(P,)``, the Morse indices N(pi) and N(0). finite: ``(P,)``, whether M is
    small enough for what is computed from it.
    """

    matrix: Array
    energy: Array
    antiperiodic: Array
    periodic: Array
    finite: Array


@dataclass(frozen=True)
class Resolved(Pattern):
    """A pattern of few segments and, of the same rows, one of many that gives the monodromy matrices."""

    fine: Pattern | None = None

    def subset(self, index: Array) -> Pattern:
        """Some of the rows, by position, of both."""
        part = super().subset(index)
        vars(part)["fine"] = None if self.fine is None else self.fine.subset(index)
        return part

    def without_damping(self) -> Pattern:
        """The same rows and coordinates without any damping, of both."""
        free = super().without_damping()
        vars(free)["fine"] = None if self.fine is None else self.fine.without_damping()
        return free


def exact(pattern: Pattern) -> Pattern:
    """The pattern that gives the monodromy matrices."""
    return pattern.fine if isinstance(pattern, Resolved) and pattern.fine is not None else pattern


def propagate(pattern: Pattern, row: Array, cycle: Array) -> Propagation:
    """Propagate rows ``(P,)`` of a conservative pattern over periods T = 2 pi N cycle.

    cycle: ``(P,)``, 1/Omega in the pattern's units.
    """
    found, fine = _along(pattern, row, cycle), exact(pattern)
    if fine is pattern:
        return found
    matrix, scale = kernel.current().monodromy(fine, row, 1 / cycle)
    finite = (scale == 0) & (np.abs(matrix).max(axis=(1, 2)) < LARGEST)
    turn = first_modes(pattern, row)
    both = np.zeros_like(matrix)
    n = pattern.size
    both[:, :n, :n] = both[:, n:, n:] = turn
    energy = np.swapaxes(both, -1, -2) @ found.energy @ both
    return Propagation(matrix, energy, found.antiperiodic, found.periodic, finite)


def first_modes(pattern: Pattern, row: Array) -> Array:
    """``(P, n, n)``: from the modes in which the monodromy matrices stand to those of the pattern's first segment."""
    own, other = (p.modes[row, p.states[0]] for p in (pattern, exact(pattern)))
    return np.asarray(np.swapaxes(own, -1, -2) @ other)


def _along(pattern: Pattern, row: Array, cycle: Array) -> Propagation:
    """:func:`propagate` on the pattern's own segments, none of which runs backwards."""
    kernel.record("numpy")
    n = pattern.size
    frequency = pattern.squared_frequency[row]
    duration = 2 * np.pi * pattern.cycles * pattern.fractions[row].T * cycle
    x = np.zeros((len(row), 2 * n, 2 * n))
    index = np.zeros(len(row), dtype=np.int64)
    energy = np.zeros_like(x)
    diagonal, lost = np.arange(n), np.zeros(len(row), dtype=bool)
    for s, state in enumerate(pattern.states):
        squared = frequency[:, state]
        cosine, over, times, turns = _rotation(squared, duration[s])
        index += turns
        fraction = pattern.fractions[row, s][:, None]
        if s == 0:
            x[:, diagonal, diagonal], x[:, diagonal, n + diagonal] = cosine, over
            x[:, n + diagonal, diagonal], x[:, n + diagonal, n + diagonal] = times, cosine
            energy[:, diagonal, diagonal], energy[:, n + diagonal, n + diagonal] = squared * fraction, fraction
        else:
            inner = _solve_right(x[:, n:, n:], x[:, :n, n:])
            inner[:, diagonal, diagonal] += cosine / over
            index += negative(inner)
            weighted = np.concatenate([squared[:, :, None] * x[:, :n], x[:, n:]], axis=1)
            energy += fraction[:, :, None] * (np.swapaxes(x, -1, -2) @ weighted)
            position = cosine[:, :, None] * x[:, :n] + over[:, :, None] * x[:, n:]
            x[:, n:] = times[:, :, None] * x[:, :n] + cosine[:, :, None] * x[:, n:]
            x[:, :n] = position
        if len(pattern.states) > 1:
            turn = pattern.change(s)[row]
            x = np.concatenate([turn @ x[:, :n], turn @ x[:, n:]], axis=1)
        large = ~(np.abs(x).max(axis=(1, 2)) < LOST)
        if large.any():
            lost |= large
            x[large] = _quarter_turn(n)
    finite = ~lost & (np.abs(x).max(axis=(1, 2)) < LARGEST)
    a, b, d = x[:, :n, :n], x[:, :n, n:], x[:, n:, n:]
    inverse = _solve_right(np.broadcast_to(np.eye(n), b.shape), b)
    both = inverse @ a + d @ inverse
    across = inverse + np.swapaxes(inverse, -1, -2)
    return Propagation(x, energy, index + negative(both + across), index + negative(both - across), finite)


def _rotation(squared: Array, duration: Array) -> tuple[Array, Array, Array, Array]:
    """cos w t, sin(w t)/w, -w sin w t ``(P, n)`` for w^2 ``(P, n)`` of either sign, and sum_modes floor(w t/pi)
    ``(P,)``.
    """
    w = np.sqrt(np.abs(squared))
    angle = w * duration[:, None]
    half_turns = np.floor(angle / np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    times = -w * sine
    if np.any(squared <= 0):
        below = squared < 0
        # Only the entries below zero are used: the others may be as large as they like.
        bounded = np.minimum(np.where(below, angle, 0.0), LONGEST)
        cosine = np.where(below, np.cosh(bounded), cosine)
        sine = np.where(below, np.sinh(bounded), sine)
        times = np.where(below, w * sine, times)
        half_turns = np.where(squared > 0, half_turns, 0.0)
        w = np.where(squared == 0, 1.0, w)
        sine = np.where(squared == 0, duration[:, None], sine)
    return cosine, sine / w, times, half_turns.sum(axis=1).astype(np.int64)


def _solve_right(a: Array, b: Array) -> Array:
    """A B^-1 for stacks of matrices. A singular B is moved by as much as rounding moves it."""
    left, right = np.swapaxes(b, -1, -2), np.swapaxes(a, -1, -2)
    try:
        found = np.linalg.solve(left, right)
    except np.linalg.LinAlgError:
        size = np.finfo(float).eps * np.abs(left).max(axis=(-1, -2), keepdims=True) + np.finfo(float).tiny
        found = np.linalg.solve(left + size * np.eye(b.shape[-1]), right)
    return np.swapaxes(found, -1, -2)


def _quarter_turn(n: int) -> Array:
    """A matrix with which a point that is lost goes on harmlessly."""
    zero, one = np.zeros((n, n)), np.eye(n)
    return np.block([[zero, one], [-one, zero]])


def negative(matrix: Array) -> Array:
    """The number of negative eigenvalues of symmetric ``(P, n, n)``, by pivots of L D L^T (Sylvester's law of inertia).

    Without pivoting: a tiny pivot spoils the factors but not the signs, unless it is zero to rounding.
    """
    work = 0.5 * (matrix + np.swapaxes(matrix, -1, -2))
    count = np.zeros(len(work), dtype=np.int64)
    for k in range(work.shape[-1]):
        pivot = work[:, k, k]
        pivot = np.where(pivot == 0, np.finfo(float).tiny, pivot)
        count += pivot < 0
        column = work[:, k + 1 :, k]
        work[:, k + 1 :, k + 1 :] -= column[:, :, None] * (column / pivot[:, None])[:, None, :]
    return count
