"""Forms P that are carried backwards along a period, in floating point: any choice proves what it proves.

-P' = A^T P + P A + Q, A of one mesh frequency: Q is what x^T P x loses. In coordinates of the mean system's modes Q is
twice the damping of each, so that P is near the unit matrix, the energy, where little couples modes. Within a segment P
is known at points that are the closer the nearer its end is, where all that the jump excites still rings, and is a
cubic polynomial between two of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

Array = np.ndarray
Key = tuple[int, float]

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
