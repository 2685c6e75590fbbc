"""Which two motions of the mean system, at the speed of a region, the mesh makes unstable together.

Where speeds of rotation act the modes are complex, change with the mesh frequency, and carry energies of either sign.
The growing Floquet solution is taken apart into the motions exp(i w_p t) and exp(-i w_p t) of the mean system at that
mesh frequency, by left and right vectors, and each amplitude, which varies with the common period, into harmonics. Its
two leading parts are a motion of positive and one of negative *action* (the Krein form of a motion times its squared
amplitude; without dissipation all actions add up to zero). If they are p at +w_p and q at -w_q the region is a sum, w_p
+ w_q = nu; if both frequencies have one sign it is a difference, which needs motions of opposite signatures, or a
system without symmetry, where both may have one. nu = M Omega/N with M the distance of the two harmonics.

Motions are numbered by ascending frequency *at that speed*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.damped.scan import halves
from gearstab.floquet.boundaries.intervals import Intervals
from gearstab.floquet.boundaries.names.harmonics import LONGEST, SAMPLES, sampled
from gearstab.floquet.boundaries.names.labels import BAND
from gearstab.floquet.kernel.chain import Chain
from gearstab.system import Array

PLACES = 0.5, 0.1, 0.9
"""Where in an interval its motions are looked for, the leading one first; alone where no other has most of it."""
LEADING = 6
"""Parts of the solution that are looked at."""
CLEAR = 0.5
"""The share from which on a pair is named besides the leading one."""
NO_GROWTH = 1e-11
"""Growth of the mean system, over the largest exponent, that is rounding."""


@dataclass(frozen=True, order=True)
class WhirlRoot:
    """Motions p <= q, counted from 0 among all modes, M cycles a common period, and whether they are a difference. A
    motion that grows by itself has no cycles.
    """

    p: int
    q: int
    cycles: int
    difference: bool = False


def named(chain: Chain, intervals: Intervals, size: int) -> list[tuple[WhirlRoot, ...]]:
    """The roots of each interval, the leading one first; size: n, rigid-body modes included."""
    found: list[tuple[WhirlRoot, ...]] = []
    for row, start, stop in zip(intervals.row, intervals.start, intervals.stop, strict=True):
        places = start + np.array(PLACES) * (stop - start)
        every = [_roots(chain, int(row), float(cycle), size) for cycle in places]
        own = [max(shares, key=lambda root: (round(shares[root], 3), -root.cycles, root)) for shares in every]
        clear = [root for root, shares in zip(own, every, strict=True) if shares[root] > CLEAR]
        found.append(tuple(dict.fromkeys([own[0], *clear])))
    return found


def _roots(chain: Chain, row: int, cycle: float, size: int) -> dict[WhirlRoot, float]:
    """The pairs of leading parts of the fastest growing solution, with the smaller share of the two."""
    own, each = chain.at(np.array([row]), np.array([cycle]))
    mean = np.einsum("s,sij->ij", own.fractions[each[0]], own.generator.matrix[each[0], own.states])
    exponents, right, action = _motions(mean, own.frequencies.shape[1])
    # Motions that do not oscillate come first.
    number = size - len(exponents) // 2 + np.arange(len(exponents)) // 2
    values = np.linalg.eigvals(mean)
    fastest = values[values.real.argmax()]
    if fastest.real > NO_GROWTH * np.abs(values).max():
        swinging = np.abs(exponents - fastest).argmin() if fastest.imag else -1
        by_itself = int(number[swinging]) if fastest.imag else max(size - len(exponents) // 2 - 1, 0)
        return {WhirlRoot(by_itself, by_itself, 0): 1.0}
    period = float(own.period(np.array([cycle]))[0])
    fast = np.abs(own.values[each[0]].imag).max() * period / (2 * np.pi)
    count = int(min(2 ** np.ceil(np.log2(max(2 * SAMPLES * BAND * fast, 16))), LONGEST))
    first, second, scale = halves(own, each, np.array([cycle]))
    multipliers, vectors = np.linalg.eig((second @ first)[0])
    best = np.abs(multipliers).argmax()
    logs = np.log(multipliers[best].astype(complex)) + scale
    state = own.basis[each[0], own.states[0]] @ vectors[:, best]
    motion = sampled(own, each, np.array([period]), state[None], logs, count, own.size)[0]
    amplitude = np.linalg.pinv(right) @ motion
    weight = np.abs(np.fft.fft(amplitude, axis=1) / count) ** 2 * action[:, None]
    harmonic = np.rint(np.fft.fftfreq(count, 1 / count)).astype(int)
    return _pairs(weight, harmonic, exponents.imag, number) or _nearest(exponents.imag, number, chain.cycles, cycle)


def _motions(mean: Array, n: int) -> tuple[Array, Array, Array]:
    """Exponents ``(k,)`` of the oscillating motions of a mean system, by ascending frequency, each before its complex
    conjugate, right vectors ``(m, k)`` of an action of size 1, and the signs of these; n: elastic coordinates.
    """
    values, vectors = np.linalg.eig(mean)
    upper = np.flatnonzero(values.imag > 0)
    upper = upper[np.argsort(values[upper].imag, kind="stable")]
    exponents = np.stack([values[upper], values[upper].conj()], axis=1).ravel()
    right = np.stack([vectors[:, upper], vectors[:, upper].conj()], axis=2).reshape(len(mean), -1)
    weight, damping = np.diagonal(mean[:n, n : 2 * n]), -mean[n : 2 * n, n : 2 * n]
    u = right[:n] / weight[:, None]
    momentum = right[n : 2 * n] + 0.25 * (damping - damping.T) @ u
    action = 2 * np.sum(u.conj() * momentum, axis=0).imag
    right = right / np.sqrt(np.maximum(np.abs(action), np.finfo(float).tiny))
    return exponents, right, np.sign(action)


def _pairs(weight: Array, harmonic: Array, frequency: Array, number: Array) -> dict[WhirlRoot, float]:
    """Pairs of the leading parts; weight ``(k, count)``: signed actions."""
    found: dict[WhirlRoot, float] = {}
    flat = np.abs(weight).ravel()
    order = np.argsort(-flat, kind="stable")[:LEADING]
    total = np.abs(weight).sum()
    for place, i in enumerate(order):
        for other in order[place + 1 :]:
            (a, k), (b, j) = divmod(int(i), len(harmonic)), divmod(int(other), len(harmonic))
            cycles = int(harmonic[k] - harmonic[j])
            opposite = weight[a, k] * weight[b, j] < 0
            difference = bool(frequency[a] * frequency[b] > 0)
            if a == b or not cycles or not (opposite or difference):
                continue
            p, q = sorted((int(number[a]), int(number[b])))
            if p == q and difference:
                continue
            root = WhirlRoot(p, q, abs(cycles), difference)
            found[root] = max(found.get(root, 0.0), 2 * float(min(flat[i], flat[other]) / total))
    return found


def _nearest(frequency: Array, number: Array, common: float, cycle: float) -> dict[WhirlRoot, float]:
    """The sum of frequencies that is nearest to a multiple of the mesh frequency."""
    own, modes = frequency[::2], number[::2]
    p, q = np.triu_indices(len(own))
    turns = (own[p] + own[q]) * common * cycle
    cycles = np.maximum(np.rint(turns), 1)
    best = int(np.argmin(np.round(np.abs(turns / cycles - 1), 6)))
    return {WhirlRoot(int(modes[p[best]]), int(modes[q[best]]), int(cycles[best])): 0.0}
