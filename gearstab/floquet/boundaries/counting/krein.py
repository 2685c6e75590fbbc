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
the integers). W is exact, from a Morse index (:mod:`~gearstab.floquet.boundaries.counting.points`): each theta is
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
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting import pairs
from gearstab.floquet.boundaries.counting.pairs import KreinSpectrum, MultiplierPair
from gearstab.floquet.boundaries.counting.points import LARGEST, Propagation, exact, propagate
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.kernel.decision import ON_CIRCLE
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

ROUNDING = 1e-14
"""Error of a multiplier on the circle per size of M."""
MIXED = 0.1
"""A multiplier off the circle has kappa = 0, one of a definite cluster that rounding moved off it has |kappa| of
order 1 (for |u|^2 + |v|^2 = 1)."""
MIRROR = 1e-10
"""Offset that lays several real pairs out as mirror images around +-1."""
TIE = 1e-12
"""Tolerance of angles in the count of collisions: a pair off the circle counts as met."""


@dataclass(frozen=True)
class Verdicts:
    """What P points tell.

    stable: ``(P,)`` bool.
    begun, ended: ``(P,)`` int64, both C where stable.
    known: ``(P,)`` bool, whether begun and ended are right: not where M is too large or signs are lost in rounding.
    real: ``(2, P)`` int64, meetings so far at +1 and at -1 (right where stable); C less these is twice the number of
    others. soon, since: ``(P,)``: cycles until the next event and since the last one at present speeds, see
    :func:`_times`. ahead, behind: the pairs that meet next and that met last; on unstable points both are the pair
    off the circle.
    """

    stable: Array
    begun: Array
    ended: Array
    known: Array
    real: Array
    ahead: MultiplierPair
    behind: MultiplierPair
    soon: Array
    since: Array
    crowded: Array
    crowding: Array


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


def evaluate(pattern: Pattern, row: Array, cycle: Array) -> Verdicts:
    """Verdicts at points (row, 1/Omega in the pattern's units), ``(P,)`` each."""
    points = propagate(pattern, row, cycle)
    matrix = np.where(points.finite[:, None, None], points.matrix, 2 * np.eye(2 * pattern.size))
    found = spectrum(matrix)
    outside = np.abs(found.values) > 1
    chosen = np.where(found.off, outside, found.sign > 0)
    stable = points.finite & ~found.off.any(axis=1)
    n = pattern.size
    # One of each pair of mirror images, n in all; if not, signs are lost in rounding.
    known = (
        points.finite
        & (chosen.sum(axis=1) == n)
        & ((found.off & outside).sum(axis=1) == (found.off & ~outside).sum(axis=1))
    )
    order = np.argsort(~chosen, axis=1, kind="stable")[:, :n]
    phase = np.take_along_axis(np.angle(found.values) % (2 * np.pi), order, axis=1)
    is_off = np.take_along_axis(found.off, order, axis=1)
    real = is_off & (np.take_along_axis(found.values.imag, order, axis=1) == 0)
    winding, sure = _winding(points, phase, is_off, real)
    begun = 2 * n * winding + _meetings(phase, real)
    ended = begun - is_off.sum(axis=1)
    ahead, behind = pairs.nearest(matrix, points.energy, found, order, phase, is_off)
    times = _times(pattern, points, found, order, phase, is_off, ahead)
    at_real = np.stack([winding, winding + (phase > np.pi).sum(axis=1)])
    return Verdicts(stable, begun, ended, known & sure, at_real, ahead, behind, *times)


def opened(pattern: Pattern, row: Array, cycle: Array) -> tuple[Array, Array]:
    """delta and |b| ``(2, P)`` of the pair of each class that is off the circle, as :func:`evaluate` has them at
    unstable points, without anything else; NaN where there is none.
    """
    matrix, found, _ = _spectra(pattern, row, cycle)
    every = np.broadcast_to(np.arange(2 * pattern.size), found.values.shape)
    outside = found.off & (np.abs(found.values) > 1)
    detuning, coupling, _ = pairs.least_off(matrix, np.zeros_like(matrix), found, every, outside, np.arange(len(row)))
    return detuning, coupling


def stable_at(pattern: Pattern, row: Array, cycle: Array) -> Array:
    """Whether points are stable, as :func:`evaluate` has it, ``(P,)``, without anything else."""
    _, found, finite = _spectra(pattern, row, cycle)
    return np.asarray(finite & ~found.off.any(axis=1))


def _spectra(pattern: Pattern, row: Array, cycle: Array) -> tuple[Array, KreinSpectrum, Array]:
    """(monodromy matrix, its multipliers, whether it is small enough); the unit matrix where it is not."""
    matrix, scale = kernel.current().monodromy(exact(pattern), row, 1 / cycle)
    finite = (scale == 0) & (np.abs(matrix).max(axis=(1, 2)) < LARGEST)
    matrix = np.where(finite[:, None, None], matrix, np.eye(2 * pattern.size))
    return matrix, spectrum(matrix), finite


def _times(
    pattern: Pattern,
    points: Propagation,
    found: KreinSpectrum,
    order: Array,
    phase: Array,
    off: Array,
    pair: MultiplierPair,
) -> tuple[Array, Array, Array, Array]:
    """Cycles until the next and since the last event at the present speeds, and since the last and until the next
    one at which a third multiplier can be.

    Stable points: a meeting of a positive multiplier with the mirror image of another; unstable ones: the return of
    the pair nearest to the circle, and its departure. Infinite for n < 3, where no third multiplier can disturb the
    count.
    """
    n, per_cycle, stable = phase.shape[1], 2 * np.pi * pattern.cycles, ~off.any(axis=1)
    if n < 3:
        never = np.full(len(phase), np.inf)
        return never, never, never, never
    vectors = np.take_along_axis(found.vectors, order[:, None, :], axis=2)
    action = np.take_along_axis(found.sign, order, axis=1)
    mean = np.einsum("pik,pik->pk", vectors.conj(), points.energy @ vectors).real
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = mean / action * per_cycle
        total = (phase[:, :, None] + phase[:, None, :]) % (2 * np.pi)
        rate = speed[:, :, None] + speed[:, None, :]
        meeting = [gap / rate for gap in (2 * np.pi - total, total)]
        half = np.sqrt(np.maximum(pair.coupling**2 - 0.25 * pair.detuning**2, 0.0))
        # delta and b come with a factor sinh(g)/g for a pair that grows by exp(g).
        shrink = np.where(half > 0, np.arcsinh(half) / half, 1.0) / (pair.slope * per_cycle)
        leaving = [
            np.nanmin(np.append(d * shrink, np.full((1, len(phase)), np.inf), axis=0), axis=0)
            for d in (2 * pair.coupling - pair.detuning, 2 * pair.coupling + pair.detuning)
        ]
        third = _third(phase, speed, off)
    different = ~np.tri(n, dtype=bool)
    soon, since = (np.where(stable, m[:, different].min(axis=1), d) for m, d in zip(meeting, leaving, strict=True))
    crowding, crowded = (
        np.where(stable, np.maximum(m, third).min(axis=(1, 2)), np.maximum(d, third.min(axis=(1, 2))))
        for m, d in zip(meeting, leaving, strict=True)
    )
    return soon, since, crowded, crowding


def _third(phase: Array, speed: Array, off: Array) -> Array:
    """Cycles ``(P, n, n)`` within which a third multiplier, or its mirror image, can be where the i-th or the j-th is
    now; at unstable points only of those on the circle where one off it is. For a pair off the circle no speed is
    known, and that of the third stands for it.
    """
    n = phase.shape[1]
    apart = np.minimum(
        *(np.abs((phase[:, :, None] + sign * phase[:, None, :] + np.pi) % (2 * np.pi) - np.pi) for sign in (-1, 1))
    )
    known = np.where(off, 0.0, speed)
    mixed = np.asarray(off.any(axis=1))[:, None, None]
    reach = apart / (np.where(off[:, :, None], known[:, None, :], known[:, :, None]) + known[:, None, :])
    wrong = mixed & ~(off[:, :, None] & ~off[:, None, :])
    reach = np.where(wrong | np.eye(n, dtype=bool), np.inf, reach)
    both = np.minimum(reach[:, :, None, :], reach[:, None, :, :])
    each = np.arange(n)
    both[:, each, :, each] = both[:, :, each, each] = np.inf
    return np.asarray(both.min(axis=-1))


def _winding(points: Propagation, phase: Array, off: Array, real: Array) -> tuple[Array, Array]:
    """W from the Morse index whose theta is farther from all multipliers, and whether it is a whole number."""
    n = phase.shape[1]
    at_minus_one = real & (np.abs(phase - np.pi) < 1)
    at_one = real & ~at_minus_one
    upper = (phase > np.pi) & ~real
    # Twice W.
    from_pi = points.antiperiodic - 2 * upper.sum(axis=1) - at_minus_one.sum(axis=1)
    from_zero = points.periodic - n + at_one.sum(axis=1)
    gap_pi = np.where(real, np.inf, np.abs(phase - np.pi)).min(axis=1)
    gap_zero = np.where(real, np.inf, np.minimum(phase, 2 * np.pi - phase)).min(axis=1)
    twice = np.where((from_pi == from_zero) | (gap_pi > gap_zero), from_pi, from_zero)
    return twice // 2, twice % 2 == 0


def _meetings(phase: Array, real: Array) -> Array:
    """sum_(i, j) floor((phi_i + phi_j)/2 pi), pairs off the circle as met.

    Several pairs on the same side of the real axis may still come back as complex ones, at mirrored angles around
    +-1: for the least number of meetings they are laid out so.
    """
    phase = np.where(real, np.where(np.abs(phase - np.pi) < 1, np.pi, 0.0), phase)
    for p in np.flatnonzero(real.sum(axis=1) > 1):
        for place in (0.0, np.pi):
            members = np.flatnonzero(real[p] & (phase[p] == place))
            phase[p, members] = place + MIRROR * (np.arange(len(members)) - 0.5 * (len(members) - 1))
    total = phase[:, :, None] + phase[:, None, :] + TIE
    return np.floor(total / (2 * np.pi)).sum(axis=(1, 2)).astype(np.int64)
