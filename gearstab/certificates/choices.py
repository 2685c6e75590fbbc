"""Coordinates and forms that are chosen in floating point: any choice proves what it proves.

**Coordinates** X_i at the beginnings of the segments of a period, in those of X_1. Phi D^-1 keeps J for a D that J
makes self-adjoint; X_i = Phi_(i-1) ... Phi_1 D^(-f), f the share of the period gone by, spreads the growth of V evenly
over the period. Where much decays over it, slow directions drown the others: -V is then what a Lyapunov equation makes
of the unit matrix, by sweeps backwards, which they do not disturb.

**Forms** P that are carried backwards along a period. -P' = A^T P + P A + Q, A of one mesh frequency: Q is what x^T P x
loses. In coordinates of the mean system's modes Q is twice the damping of each, so that P is near the unit matrix, the
energy, where little couples modes. Within a segment P is known at points that are the closer the nearer its end is,
where all that the jump excites still rings, and is a cubic polynomial between two of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import matrix_balance

Array = np.ndarray
Key = tuple[int, float]

GRADED, SWEPT = 1e6, 10
"""Condition of Phi beyond which Lyapunov's equation is solved; periods, as a power of 2, of a sweep."""


def coordinates(
    propagators: Array, shares: Array, signs: Array, rate: float, start: Array, decay: Array
) -> list[Array]:
    """``(m, m)`` at the beginning of every part, from the propagators of all and their shares of the period."""
    gone = [start]
    for propagator in propagators:
        gone.append(propagator @ gone[-1])
    whole = np.linalg.solve(start, gone[-1])
    if (signs < 0).all() and np.linalg.cond(whole) > GRADED:
        return _swept(propagators, shares, decay)
    growth = whole.T @ (signs[:, None] * whole) - rate * np.diag(signs)
    inner = np.linalg.inv(np.linalg.cholesky(0.5 * (growth + growth.T)))
    values, basis = np.linalg.eigh(inner @ np.diag(signs) @ inner.T)
    # D^2 = J Phi^T J Phi = vectors diag(squared) vectors^-1.
    vectors, squared = inner.T @ basis, rate + 1 / values
    back, gone_by = np.linalg.inv(vectors), np.cumsum([0.0, *shares])
    return [gone[s] @ ((vectors * squared ** (-0.5 * gone_by[s])) @ back) for s in range(len(propagators))]


def _swept(propagators: Array, shares: Array, decay: Array) -> list[Array]:
    """X_s = P_s^(-1/2), P_s = e^(2 b f_s) F_s^T P_(s+1) F_s + f_s W, F_s of the part.

    b: half the slowest decay in a period; W: twice the decay of each coordinate, which is the slowest at least, less b.
    """
    whole = np.eye(len(decay))
    for flow in propagators:
        whole = flow @ whole
    slow = -0.5 * np.log(np.maximum(np.abs(np.linalg.eigvals(whole)).max(), np.finfo(float).tiny))
    decay = np.maximum(decay, 2 * slow)

    def swept(form: Array) -> list[Array]:
        forms = [form]
        for flow, f in zip(propagators[::-1], shares[::-1], strict=True):
            forms.append(np.exp(2 * slow * f) * flow.T @ forms[-1] @ flow + f * np.diag(2 * (decay - slow)))
        return forms[:0:-1]

    form, power = swept(np.zeros_like(whole))[0], np.exp(slow) * whole
    for _ in range(SWEPT):
        form, power = form + power.T @ form @ power, power @ power
    return [np.linalg.inv(np.linalg.cholesky(0.5 * (p + p.T))).T for p in swept(form)]


REAL = 1e-12
"""Imaginary part, relative to the modulus, below which an eigenvalue is real."""
PARALLEL = 1e5
"""Condition beyond which eigenvectors are no coordinates."""
BALANCING = 5
"""Rounds of balancing the lengths of eigenvectors."""


def modal(generators: Array, share: Array) -> Array:
    """Real coordinates ``(m, m)`` of the eigenvectors of the mean of generators ``(D, m, m)``, in balance; where these
    are nearly parallel, the given coordinates in other units.
    """
    mean = np.tensordot(share, generators, 1)
    scale = matrix_balance(mean, permute=False)[1]
    values, vectors = np.linalg.eig(mean)
    pairs = values.imag > REAL * np.abs(values)
    own = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
    modes = balanced(vectors[:, own], pairs[own], generators, share)
    return modes if np.linalg.cond(modes / np.diag(scale)[:, None]) < PARALLEL else scale


def balanced(vectors: Array, pairs: Array, generators: Array, share: Array) -> Array:
    """Real coordinates of eigenvectors, of such lengths that what couples two of them is alike both ways."""
    owner = np.repeat(np.arange(len(pairs)), 1 + pairs)
    first = np.searchsorted(owner, np.arange(len(pairs)))
    columns = np.empty((len(vectors), len(owner)))
    columns[:, first], columns[:, first[pairs] + 1] = vectors.real, vectors[:, pairs].imag
    try:
        inner = np.linalg.solve(columns, generators @ columns)
    except np.linalg.LinAlgError:
        return columns
    own = (owner == np.arange(len(pairs))[:, None]).astype(float)
    size = own @ np.tensordot(share, inner**2, 1) @ own.T
    np.fill_diagonal(size, 0.0)
    length, coupled = np.ones(len(pairs)), size.any(axis=0) & size.any(axis=1)
    for _ in range(BALANCING):
        into, out = length**-2 @ size, size @ length**2
        length[coupled] = np.sqrt(length[coupled]) * (out[coupled] / into[coupled]) ** 0.125
    return (columns * length[owner]).astype(np.float32).astype(float)


TERMS, SMALL, DOUBLINGS = 10, 0.25, 14
"""Terms of a series; size of a matrix up to which it is summed; periods, as a power of 2, after which nothing is left.
"""
COARSE, FINE, LEAST, DEEPEST, AT_ONCE = 100.0, 8.0, 1e-3, 12, 2**19
"""Scales of steps; least damping ratio that they go by; halvings of a segment at most; numbers of P at once."""
UNDAMPED = 1e-3
"""Part of the largest loss that a mode without damping of its own has."""


class Carried:
    """P of a period. generators ``(D, m, m)``: A of each state times the period, in coordinates of the mean modes.

    ends ``(S + 1, m, m)``: P at the beginning of each segment and at the end of the last, where it is the first again.
    """

    def __init__(self, generators: Array, states: Sequence[int], fractions: Sequence[float]) -> None:
        self.generators, self.keys = generators, [*zip(states, fractions, strict=True)]
        loss = -2 * np.diag(np.tensordot(np.bincount(states, fractions), generators, 1))
        self.loss = np.diag(np.where(loss > 0, loss, UNDAMPED * loss.max()))
        self.values = np.linalg.eigvals(generators)
        steps = {key: self._increments(key, 0)[0] for key in set(self.keys)}
        whole = np.eye(len(loss))
        for key in self.keys:
            whole = steps[key][0] @ whole
        form, power = self._swept(np.zeros_like(whole), steps)[0], whole
        for _ in range(DOUBLINGS):
            form, power = form + power.T @ form @ power, power @ power
        self.ends = self._swept(form, steps)
        self.ends[-1] = self.ends[0]
        self.largest, self.scale = float(np.abs(self.ends).max()), COARSE

    def _swept(self, form: Array, steps: dict[Key, tuple[Array, Array]]) -> Array:
        found = np.empty((len(self.keys) + 1, *form.shape))
        found[-1] = form
        for k in range(len(self.keys) - 1, -1, -1):
            found[k] = _back(found[k + 1], steps[self.keys[k]])
        return found

    def _increments(self, key: Key, levels: int) -> list[tuple[Array, Array]]:
        """exp(A), and what Q makes of P = 0, over a segment, a half of it, a quarter, ..., 2^-levels of it."""
        generator = self.generators[key[0]] * key[1]
        size = np.linalg.norm(generator) / SMALL
        halvings = max(levels, int(np.ceil(np.log2(size))) if size > 1 else 0)
        a, term = generator * 2.0**-halvings, self.loss * (key[1] * 2.0**-halvings)
        flow, power, gain = np.eye(len(a)), np.eye(len(a)), term
        for order in range(1, TERMS):
            power, half = power @ a / order, term @ a / (order + 1)
            term = half + half.T
            flow, gain = flow + power, gain + term
        found = [(flow, gain)]
        for _ in range(halvings):
            flow, gain = flow @ flow, gain + flow.T @ gain @ flow
            found.append((flow, gain))
        return found[: -levels - 2 : -1]

    def _levels(self, key: Key) -> list[int]:
        """Halvings of a segment that steps from its end to its beginning are long.

        What rings at w with the damping ratio d, from the end on, is off by (w h)^3 in a step h, which d outweighs.
        """
        values = self.values[key[0]] * key[1]
        fast, lost = 2 * np.abs(values) + np.finfo(float).tiny, -2 * values.real
        ratio = np.cbrt(np.maximum(lost / fast, LEAST) * self.scale / self.largest) / fast
        found, at, waiting = [], 0.0, [0]
        while waiting:
            level = waiting.pop()
            longest = (ratio * np.exp(np.clip(lost * at / 3, 0.0, 200.0))).min()
            if level < DEEPEST and 2.0**-level > longest:
                waiting += [level + 1, level + 1]
            else:
                found.append(level)
                at += 2.0**-level
        return found

    def inside(self, key: Key, where: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Yield some of the segments ``where`` of one sort, ``(K,)``, the parts of a segment that the steps are long,
        ``(J,)``, and the Bernstein coefficients of P on each, ``(J, 4, K, m, m)``; from the last step to the first.
        """
        levels = self._levels(key)
        increments, lengths = self._increments(key, max(levels)), 2.0 ** -np.array(levels)
        count = -(-4 * len(levels) * len(where) * self.loss.size // AT_ONCE)
        for some in np.array_split(where, count) if count > 1 else [where]:
            forms = [self.ends[some + 1]]
            for level in levels[:-1]:
                forms.append(_back(forms[-1], increments[level]))
            nodes = np.array([*forms, self.ends[some]])
            half = nodes @ (self.generators[key[0]] * key[1])
            third = lengths[:, None, None, None] / 3
            slopes = half + np.swapaxes(half, -1, -2) + self.loss * key[1]
            first, last = nodes[1:], nodes[:-1]
            yield some, lengths, np.stack([first, first - third * slopes[1:], last + third * slopes[:-1], last], axis=1)


def _back(form: Array, increments: tuple[Array, Array]) -> Array:
    flow, gain = increments
    found = flow.T @ form @ flow + gain
    return np.asarray(0.5 * (found + np.swapaxes(found, -1, -2)))
