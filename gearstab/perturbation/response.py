"""Second-order couplings: what all harmonics and all modes that are not in resonance do to those that are.

A mode p that vibrates at w forces, through the harmonic k of the stiffness, every mode r at w + k beta, beta = b Omega,
and these act back. Eliminating them (a Schur complement of Hill's equations in the frequency domain) leaves, to second
order,

    S_pq(w; n) = sum_k sum_r conj B(k)_pr B(k + n)_rq / (w_r^2 - (w + k beta)^2)

n = 0 is a shift of frequency, n != 0 a coupling of p at w with q at w - n beta through products of harmonics. The terms
in resonance, k = -n with r in the other group, are left out: they are what the reduced problem keeps. The terms
fall as k^-4 for waves with jumps and faster for others. They are added up to a k at which 3.5 (w + w_r) < k beta, and
beyond that as a power series in 1/k whose coefficients are sums of Fourier coefficients alone, once for all modes:

    1/(w_r^2 - (w + k beta)^2) = -(k beta)^-2 sum_q c_q k^-q,    c_q = -2 x c_(q-1) - (x^2 - y^2) c_(q-2)

with x = w/beta, y = w_r/beta, so that the whole is right to about 1e-10 of its terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.perturbation.harmonics import HIGHEST, ROUNDING, Excited, Family
from gearstab.system import Array

POWERS = 12
"""Terms of the series in 1/k."""
LEAST = 32
"""Harmonics of the slowest mesh that are always added one by one."""
FACTOR = 3.5
"""The series starts where k beta is this many times w + w_r: 13 * 3.5^-12 of the rest of 1e-5 remains."""
HALF = 0.5
"""Modes so stiff that they would need more harmonics than there are (see LONGEST) have no series beyond this part."""
LONGEST, SHORTEST = HIGHEST, 256
WORK = 3e7
"""Modes of a large system are often a thousand times faster than its meshes and hardly deflect them. The harmonics
added one by one are limited to WORK/(pairs x modes), between these two; what is left out is below 1e-7 of the terms."""
AT_ONCE = 2_000_000
"""Terms kept in memory at a time."""
COINCIDENT = 1e-9
"""A denominator below this part of its two terms is a resonance that is not part of the reduced problem: it is left out
here, and reported by the estimate of the error."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of modes whose second-order coupling is wanted.

    p, q: modes from 0, ``(pairs,)``. frequency: w ``(rows, pairs)``. unit: Omega ``(rows, pairs)``.
    number: n. meeting, resonant: the modes ``(pairs, n)`` in resonance at k = -``meeting``, None if the family is not
    the one that the excitation belongs to.
    """

    p: Array
    q: Array
    frequency: Array
    unit: Array
    number: int
    meeting: int | None
    resonant: Array

    def some(self, rows: slice, which: Array) -> Pairs:
        frequency, unit = self.frequency[rows][:, which], self.unit[rows][:, which]
        return Pairs(self.p[which], self.q[which], frequency, unit, self.number, self.meeting, self.resonant[which])


def limit(pairs: int, modes: int) -> int:
    """Up to which harmonic of the slowest mesh terms are added one by one at most."""
    return int(np.clip(WORK / (pairs * modes), SHORTEST, LONGEST))


def second_order_coupling(
    excited: Excited, family: Family, squared: Array, pairs: Pairs, longest: int
) -> tuple[Array, Array]:
    """S_pq, exactly zero where only rounding is left, and the sum of the magnitudes of its terms, ``(rows, pairs)``.

    squared: w_r^2 ``(rows, n)``; 0 for rigid-body modes, which take no part.
    """
    total = np.zeros(pairs.frequency.shape, dtype=complex)
    size = np.zeros(total.shape)
    reach = _reach(family, squared, pairs)
    slowest = max(family.cycles)
    for level in np.unique(reach):
        last = slowest * min(int(level), longest)
        which = np.flatnonzero(reach == level)
        moments = excited.moments(family, last, pairs.number, POWERS)
        for rows, some in _chunks(excited, family, which, last, squared.shape[-1]):
            part, own, here = pairs.some(rows, some), excited.rows(rows), np.ix_(np.arange(len(squared))[rows], some)
            total[here], size[here] = _direct(own, family, squared[rows], part, last)
            total[here] += _rest(own, family, squared[rows], part, last, moments[rows])
    total[np.abs(total) <= ROUNDING * size] = 0.0
    return total, size


def _reach(family: Family, squared: Array, pairs: Pairs) -> Array:
    """How many harmonics of the slowest mesh each pair needs, a power of two ``(pairs,)``."""
    top = np.sqrt(np.abs(squared).max(axis=-1, initial=0.0))
    position = (pairs.frequency + top[:, None]) / (family.base * pairs.unit)
    needed = np.maximum(LEAST, FACTOR * position.max(axis=0) / max(family.cycles))
    return np.asarray(2 ** np.ceil(np.log2(needed)).astype(int))


def _chunks(excited: Excited, family: Family, which: Array, last: int, n: int) -> list[tuple[slice, Array]]:
    """Rows and pairs to take at a time."""
    count = 2 * sum(last // cycles for cycles in family.cycles)
    rows = len(excited.strength)
    # As many rows as fit with a few pairs, then as many pairs as fit with these rows.
    step = max(1, int(AT_ONCE / (count * n * max(n, min(len(which), 8)))))
    width = max(1, int(AT_ONCE / (count * n * min(step, rows))))
    return [
        (slice(k, min(k + step, rows)), which[j : j + width])
        for k in range(0, rows, step)
        for j in range(0, len(which), width)
    ]


def _direct(excited: Excited, family: Family, squared: Array, pairs: Pairs, last: int) -> tuple[Array, Array]:
    """The terms with |k| <= ``last`` one by one: their sum, and the sum of their magnitudes."""
    k = family.lattice(0, [last // n for n in family.cycles])
    k = k[family.excites(k + pairs.number)]
    receptance = _receptance(squared, pairs, k, family.base)
    p, own = np.unique(pairs.p, return_inverse=True)
    q, other = np.unique(pairs.q, return_inverse=True)
    left = excited.matrices(family, k, p)
    if pairs.number == 0 and np.array_equal(pairs.p, pairs.q):
        terms = receptance * (left.real**2 + left.imag**2)[:, own]
        return terms.sum(axis=(-2, -1)), np.abs(terms).sum(axis=(-2, -1))
    right = excited.matrices(family, k + pairs.number, q)
    terms = receptance * np.conj(left[:, own]) * right[:, other]
    return terms.sum(axis=(-2, -1)), np.abs(terms).sum(axis=(-2, -1))


def _receptance(squared: Array, pairs: Pairs, k: Array, base: float) -> Array:
    """1/(w_r^2 - (w + k beta)^2) ``(rows, pairs, k, n)``, 0 for what takes no part."""
    beta = (base * pairs.unit)[..., None]
    driving = (pairs.frequency[..., None] + k * beta)[..., None] ** 2
    own = squared[:, None, None, :]
    difference = own - driving
    usable = (np.abs(difference) > COINCIDENT * (np.abs(own) + driving)) & (own != 0)
    found = np.divide(1.0, difference, out=np.zeros(difference.shape), where=usable)
    if pairs.meeting is not None:
        found[:, :, k == -pairs.meeting] *= ~pairs.resonant[:, None, :]
    return found


def _rest(excited: Excited, family: Family, squared: Array, pairs: Pairs, last: int, moments: Array) -> Array:
    """The terms with |k| > ``last`` by the series in 1/k."""
    members = list(family.members)
    beta = family.base * pairs.unit
    x = (pairs.frequency / beta)[..., None]
    y2 = squared[:, None, :] / (beta**2)[..., None]
    shape = np.broadcast_shapes(x.shape, y2.shape)
    coefficient, before = np.ones(shape), np.zeros(shape)
    sides = excited.deflection[:, :, members] * excited.strength[:, None, members]
    weight = np.zeros((*shape, len(members), len(members)), dtype=complex)
    for q in range(POWERS):
        weight += coefficient[..., None, None] * moments[:, None, None, :, :, q]
        coefficient, before = -2 * x * coefficient - (x**2 - y2) * before, coefficient
    known = (x + np.sqrt(np.abs(y2)) <= HALF * last) & (squared[:, None, :] != 0)
    delta = excited.deflection[:, :, members]
    inner = np.einsum("rni,rpnij,rnj->rpnij", delta, weight, delta, optimize=False)
    inner = np.where(known[..., None, None], inner, 0.0).sum(axis=2)
    both = np.einsum("rpi,rpij,rpj->rp", sides[:, pairs.p], inner, sides[:, pairs.q])
    return -both / beta**2


def nearest_resonance(
    excited: Excited, family: Family, own: Array, alike: Array, group: Array, pairs: Pairs, nu: Array
) -> tuple[Array, Array, Array]:
    """The modes r and harmonic k outside the reduced problem that mix most with the group of modes of each pair.

    own: w_r ``(rows, n)``, 0 for what takes no part. alike: ``(n, n)``, which modes have equal frequencies: their
    couplings with the group ``(pairs, P)`` are taken together, whatever their basis.
    Returns (strength, distance, motion), ``(rows, pairs)`` each: g = |B(k)_pr|/(2 sqrt(w w_r)), the distance of
    w + k beta from +-w_r, and how fast it changes with nu in the tongue, 1/2 + |k beta|/nu; (0, 1, 1) where there is
    none. The ratio g/distance is the amplitude of r beside that of p. nu: ``(rows, pairs)``, at the root.
    """
    beta = (family.base * pairs.unit)[..., None]
    w, own = pairs.frequency[..., None], own[:, None, :]
    best = np.zeros((4, *pairs.frequency.shape))
    best[2:] = 1.0
    for cycles in dict.fromkeys(family.cycles):
        for sign in (-1.0, 1.0):
            for k in family.near((sign * own - w) / beta, cycles):
                distance = np.abs(sign * own - (w + k * beta))
                strength = np.sqrt(sum(excited.element(family, k, p) ** 2 for p in group.T) @ alike)
                absent = (k == 0) | (own == 0)
                if pairs.meeting is not None:
                    absent |= (k == -pairs.meeting) & pairs.resonant
                strength = np.divide(strength, 2 * np.sqrt(w * own), out=np.zeros(k.shape), where=~absent)
                motion = 0.5 + np.abs(k) * beta / nu[..., None]
                ratio = np.where(strength > 0, strength / np.maximum(distance, np.finfo(float).tiny), 0.0)
                r = np.argmax(ratio, axis=-1)[..., None]
                found = np.stack([np.take_along_axis(a, r, -1)[..., 0] for a in (ratio, strength, distance, motion)])
                best = np.where(found[0] > best[0], found, best)
    return best[1], best[2], best[3]
