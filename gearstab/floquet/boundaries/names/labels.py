"""Which modes and which frequency of excitation make a region unstable.

At epsilon = 0 a tongue is rooted where w_p + w_q = nu, nu = (M/N) Omega with the common period N 2 pi/Omega. How (p,
q, M) are carried on to finite epsilon: inside a tongue the growing Floquet solution is

    u(t) = exp(g t/T) sum_k c_k exp(i w_k t),    w_k = (psi + 2 pi k)/T,

and its Krein form vanishes. In the coordinates of the mean modes the form is the sum of the *actions* w_k |c_(k,
p)|^2 of all modes and frequencies, so that positive and negative frequencies balance. At epsilon = 0 there is one of
each, mode p at +w_p and mode q at -w_q, and their frequencies differ by nu: M = k - k'. At finite epsilon the largest
action of each sign takes their place. This is exact as long as one part carries more than half of its sign's action:
parts are continuous in epsilon, and two cannot exceed one half. Beyond that, and where tongues have merged, each row
distributes the roots over its regions, each once, so that the sum of the shares is greatest: a region has as many
roots of each class (meetings at +1: p = q, M even; at -1: p = q, M odd; elsewhere: p < q) as its meetings say, and a
root is preferred where the number of collisions of its class since T = 0 says that it is its turn. (The nearest root
w_p + w_q = nu, in contrast, is wrong as soon as tongues have shifted by their distance.) The phase of a multiplier
alone cannot tell: it is defined modulo 2 pi and is passed on where two positive multipliers avoid each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array

BAND = 1.25
"""Frequencies up to this times the largest natural frequency of any state are looked at."""


@dataclass(frozen=True, order=True)
class Root:
    """Where a tongue is rooted: modes p <= q of the elastic coordinates, from 0, and M = nu N/Omega."""

    p: int
    q: int
    cycles: int


def nearest_sum(turns: Array) -> tuple[int, int, int]:
    """(p, q, cycles) of the sum of two of the turns ``(n,)`` a common period that is nearest to a whole number of them,
    of equally near ones the least.
    """
    p, q = np.triu_indices(len(turns))
    total = turns[p] + turns[q]
    cycles = np.maximum(np.rint(total), 1)
    # Equally near is what agrees to six digits: the middle of an interval is no better known.
    best = np.lexsort((cycles, np.round(np.abs(total / cycles - 1), 6)))[0]
    return int(p[best]), int(q[best]), int(cycles[best])


Shares = dict[Root, float]
"""How much of the action of an unstable solution a root accounts for, at most 1."""

LEADING = 5
"""Parts of each sign that are looked at,"""
LEAST = 1e-3
"""unless they carry less than this of the action of their sign."""


def leading_roots(action: Array) -> Shares:
    """Pairs of the leading positive and negative parts of ``(n, K)``; the share is the smaller one of the two."""
    found: Shares = {}
    flat = action.ravel()
    order = np.argsort(flat)
    positive, negative = flat[flat > 0].sum(), flat[flat < 0].sum()
    for up in order[::-1][:LEADING]:
        for down in order[:LEADING]:
            if flat[up] <= LEAST * positive or flat[down] >= LEAST * negative:
                continue
            (p, k), (q, j) = divmod(int(up), action.shape[1]), divmod(int(down), action.shape[1])
            root = Root(min(p, q), max(p, q), k - j)
            found[root] = max(found.get(root, 0.0), float(min(flat[up] / positive, flat[down] / negative)))
    return found
