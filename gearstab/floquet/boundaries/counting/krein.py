"""How many collisions of multipliers lie below a period: an integer that no tongue, however narrow, can hide from.

Theory. In the elastic system u'' + K u = 0, K a fixed function of t/T, let the period T = 2 pi N/Omega vary. A
multiplier lambda = exp(i phi) on the unit circle with eigenvector (u, v) has the *Krein sign* of kappa = 2 Im u^H v.
For a Floquet solution on the circle

    kappa dphi/dT = (1/T) int_0^T (|u'|^2 + u^H K u) dt = (2/T) int_0^T |u'|^2 dt > 0,

since int u^H K u = int |u'|^2 follows from u'' = -K u by parts. Hence multipliers of positive sign move
counterclockwise and those of negative sign clockwise as T grows, whether or not K(t) is positive (for K > 0: Krein
1955; Gelfand & Lidskii 1955; Yakubovich & Starzhinskii 1975, ch. III). Only two multipliers of opposite signs can
leave the circle, and when such a pair comes back its positive member is ahead. With the phases Theta_1..Theta_n of
the positive multipliers, continued from T = 0, every meeting of the i-th with the mirror image of the j-th is a jump
of floor((Theta_i + Theta_j)/2 pi), and

    C = sum_(i, j) floor((Theta_i + Theta_j)/2 pi)

grows by 1 with a meeting at lambda = +-1 (i = j) and by 2 with a meeting elsewhere (and its complex conjugate). **Two
stable points with different C have a tongue or a contact of width zero between them.** Theta_i is ambiguous where two
positive multipliers pass each other, but C is not: with Theta_i = phi_i + 2 pi k_i, 0 <= phi_i < 2 pi,

    C = 2 n W + sum_(i, j) floor((phi_i + phi_j)/2 pi),    W = sum_i k_i,

depends on the phases of M and on the total winding W alone (the fundamental group of the symplectic group is that of
the integers). W is exact, from a Morse index (see below): each theta is
passed once by every positive multiplier upwards and by every negative one downwards, so that (Bott)

    N(theta) = sum_i floor((Theta_i - theta)/2 pi) + floor((Theta_i + theta)/2 pi) + 1;
    N(0) = 2 W + n,    N(pi) = 2 W + 2 #{phi_i > pi}.

Unstable points have two such integers, *begun* and *ended*: a pair off the circle counts as sitting on it at its
angle, as met for the one and as not met for the other. Their difference is the number of multipliers outside the
circle. Where a pair enters the instability, begun rises, where it returns to the circle, ended.

One gap remains for n >= 3: a pair that is off the circle does not interact with a third multiplier on it and may
overtake it, with or against the direction of its motion; against it, floor falls by what the meeting has added. Equal
C then excludes a tongue only if no three multipliers come together between the two points. That is tested with the
speeds of the phases, which the formula above gives exactly: a bracket is empty only if, from one of its ends, no pair
could have met inside at its present speed; two unstable ends belong to one tongue only if, seen from one of them,
its pair cannot have left the tongue; and between a stable and an unstable point there is one edge only if, from one
of them, no third multiplier could have been where two meet or part.

The *Morse index* N(theta) is the number of negative eigenvalues of the quadratic form int |u'|^2 - u^H K(t) u dt over
one common period T with u(T) = exp(i theta) u(0). It is an exact integer of the path of matrices over the period,
which the monodromy matrix alone cannot give. It is asked for at few points. At a point between two of them it follows
from monotony: each N(theta) never falls, and neither does the sum of all Theta_i, which tells W unless it has grown by
a whole turn (pairs off the circle, at phi and -phi or at +-1, add a multiple of pi to it). On the pieces between the
jumps of K the form is reduced to the displacements at the jumps, as in the algorithm of Wittrick & Williams (1971,
Q. J. Mech. Appl. Math. 24, 263-284):

    N(theta) = sum over segments and modes of floor(w t/pi) + sum over inner jumps of s(D B^-1 + w cot w t)
               + s(B^-1 A + D B^-1 - exp(i theta) B^-1 - exp(-i theta) B^-T),

where [[A, B], [C, D]] propagates from t = 0 to the jump (in the last term over the whole period), the middle sum is
over the jumps inside the period, w and t belong to the segment that follows, and s counts negative eigenvalues.
Source for N(theta) as index of a periodic problem: Bott 1956 (Comm. Pure Appl. Math. 9, 171-206); Long 2002, Index
Theory for Symplectic Paths.

The search is compiled (ckernel/boundaries): index.c has the index, letters.c and brackets.c the counts;
enclosing/enclose.c finds stretches without any collision from a few N(theta).
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.boundaries.counting import pairs
from gearstab.floquet.boundaries.counting.pairs import KreinSpectrum
from gearstab.floquet.boundaries.counting.points import LARGEST, exact
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel.decision import ON_CIRCLE
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

ROUNDING = 1e-14
"""Error of a multiplier on the circle per size of M."""
MIXED = 0.1
"""A multiplier off the circle has kappa = 0, one of a definite cluster that rounding moved off it has |kappa| of
order 1 (for |u|^2 + |v|^2 = 1)."""


def spectrum(matrix: Array) -> KreinSpectrum:
    """Multipliers of ``(P, 2n, 2n)`` with their Krein signs.

    A pair that is off the circle by rounding alone and one that truly is are told apart by the distance to the mirror
    image 1/conj(lambda): the truly unstable pair are mirror images of each other, while the error of a nearly double
    multiplier on the circle is far smaller than the distance of the two. This agrees with
    :mod:`gearstab.floquet.kernel.decision` and resolves the last 1e-10 around an edge, where the definiteness of a
    nearly defective pair is below that rule's threshold.
    """
    values, vectors = np.linalg.eig(matrix)
    values, vectors = values.astype(complex), vectors.astype(complex)
    n = values.shape[-1] // 2
    sign = 2 * np.einsum("pik,pik->pk", vectors[:, :n].conj(), vectors[:, n:]).imag
    image = 1 / values.conj()
    distance = np.abs(values[:, None, :] - image[:, :, None])
    own = np.abs(values - image)
    each = np.arange(2 * n)
    distance[:, each, each] = np.inf
    mirror = distance.argmin(axis=-1)
    other = distance.min(axis=-1)
    size = np.abs(matrix).max(axis=(1, 2))[:, None]
    excess = np.abs(np.log(np.abs(values)))
    off = (excess > np.maximum(ON_CIRCLE, ROUNDING * size)) & (other < own) & (np.abs(sign) < MIXED)
    return KreinSpectrum(values, vectors, sign, off, np.where(off, mirror, each))


def opened(pattern: Pattern, row: Array, cycle: Array) -> tuple[Array, Array]:
    """delta and |b| ``(2, P)`` of the pair of each class that is off the circle; NaN where there is none."""
    matrix, found, _ = _spectra(pattern, row, cycle)
    return pairs.least_off(matrix, found)


def about_to_meet(pattern: Pattern, row: Array, cycle: Array, place: Array) -> tuple[Array, Array]:
    """delta and |b| ``(P,)`` of the pair on the circle that is nearest to a meeting at +1 (place 0), at -1 (1) or
    elsewhere (2), ``(P,)``; NaN at points where anything is off the circle or signs are lost in rounding.
    """
    matrix, found, finite = _spectra(pattern, row, cycle)
    n = pattern.size
    positive = found.sign > 0
    known = finite & ~found.off.any(axis=1) & (positive.sum(axis=1) == n)
    order = np.argsort(~positive, axis=1, kind="stable")[:, :n]
    phase = np.take_along_axis(np.angle(found.values), order, axis=1)
    total = np.abs((phase[:, :, None] + phase[:, None, :] + np.pi) % (2 * np.pi) - np.pi)
    itself, side = np.eye(n, dtype=bool), np.where(place == 0, 1.0, -1.0)[:, None]
    other = np.where(itself, (np.cos(phase) * side < 0)[:, :, None], True)
    apart = np.where(np.where((place == 2)[:, None, None], itself, other), np.inf, total).reshape(len(row), -1)
    best = apart.argmin(axis=1)
    each = np.arange(len(row))
    first = found.vectors[each, :, order[each, best // n]]
    second = found.vectors[each, :, order[each, best % n]].conj()
    detuning, coupling = np.where(known & np.isfinite(apart[each, best]), pairs.reduced(matrix, first, second), np.nan)
    return detuning, coupling


def stable_at(pattern: Pattern, row: Array, cycle: Array) -> Array:
    """Whether points are stable, ``(P,)``."""
    _, found, finite = _spectra(pattern, row, cycle)
    return np.asarray(finite & ~found.off.any(axis=1))


def _spectra(pattern: Pattern, row: Array, cycle: Array) -> tuple[Array, KreinSpectrum, Array]:
    """(monodromy matrix, its multipliers, whether it is small enough); the unit matrix where it is not."""
    matrix, scale = kernel.monodromy(exact(pattern), row, 1 / cycle)
    finite = (scale == 0) & (np.abs(matrix).max(axis=(1, 2)) < LARGEST)
    matrix = np.where(finite[:, None, None], matrix, np.eye(2 * pattern.size))
    return matrix, spectrum(matrix), finite
