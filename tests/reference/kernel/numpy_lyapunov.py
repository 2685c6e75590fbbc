"""Radii of Lyapunov functions in NumPy: the theory in floquet/kernel/c_points.py, no more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearstab.floquet.kernel.c_points import (
    BISECTIONS,
    DOUBLINGS,
    FARTHEST,
    LARGEST,
    LEAST,
    LONGEST,
    NEGLIGIBLE,
    PART,
    PIECES,
    SECURE,
    UNKNOWNS,
)
from gearstab.floquet.kernel.c_points import stein as by_vectors
from gearstab.floquet.kernel.chain import Chain
from gearstab.system import Array

SAME = 1e-8
"""Difference of two exponents of a segment below which they count as equal."""


def radii(chain: Chain, row: Array, cycle: Array, growth: Array) -> Array:
    """``(P, 2)``: by which part all periods may be longer, and shorter, and as many multipliers are outside the unit
    circle as at the points (row, 1/Omega) ``(P,)``; 0 where nothing is proved.

    growth: ``(P,)``, the largest ln |lambda|.
    """
    period, radius = chain.period(cycle), np.zeros((len(row), 2))
    rate = np.where(growth < 0, -PART * growth / period, 0.0)
    for chosen, solution in ((growth < 0, doubled), (growth >= 0, stein)):
        k = np.flatnonzero(chosen & chain.sound[row])
        if len(k) == 0:
            continue
        sweep = Sweep(chain, row[k], period[k], rate[k])
        with np.errstate(all="ignore"):
            radius[k] = sweep.tested(solution(*sweep.equation()))
    return radius


def exponential(values: Array, duration: Array) -> Array:
    """exp(A t) ``(P, m, m)`` in real modal coordinates, of eigenvalues ``(P, m)``."""
    return _blocks(np.exp(values * duration[:, None]), values)


def _blocks(numbers: Array, values: Array) -> Array:
    """``(P, m, m)`` of numbers ``(P, m)`` a and blocks [[a, b], [-b, a]], b > 0 where ``values`` have it."""
    result = np.zeros((*numbers.shape, numbers.shape[1]))
    each = np.arange(numbers.shape[1])
    result[:, each, each] = numbers.real
    result[:, each[:-1], each[1:]] = np.where(values.imag[:, :-1] > 0, numbers.imag[:, :-1], 0.0)
    result[:, each[1:], each[:-1]] = -result[:, each[:-1], each[1:]]
    return result


def _pairs(values: Array) -> Array:
    """``(P, m, m)``: what takes real modal coordinates into complex ones, columns 1, i and 1, -i of each pair."""
    result = np.zeros((*values.shape, values.shape[1]), dtype=complex)
    each = np.arange(values.shape[1])
    upper, lower = values.imag > 0, values.imag < 0
    result[:, each, each] = np.where(lower, -1j, 1.0)
    result[:, each[1:], each[:-1]] = np.where(upper[:, :-1], 1j, 0.0)
    result[:, each[:-1], each[1:]] = np.where(lower[:, 1:], 1.0, 0.0)
    return result


def _transposed(matrix: Array) -> Array:
    return np.swapaxes(matrix, -1, -2)


def doubled(matrix: Array, loss: Array) -> Array:
    """P - M^T P M = D ``(P, m, m)`` where all multipliers are inside, by doubling: P = sum (M^T)^k D M^k."""
    total = loss
    for _ in range(DOUBLINGS):
        if not np.any(np.abs(matrix) > NEGLIGIBLE):
            break
        total = total + _transposed(matrix) @ total @ matrix
        matrix = matrix @ matrix
    return 0.5 * (total + _transposed(total))


def stein(matrix: Array, loss: Array) -> Array:
    """P - M^T P M = D ``(P, m, m)`` for multipliers on both sides of the unit circle; NaN where there is no solution.

    Small ones as linear equations for the entries of P, which multiple multipliers do not disturb.
    """
    m = matrix.shape[-1]
    if m * (m + 1) // 2 > UNKNOWNS:
        return by_vectors(matrix, loss)
    i, j = np.triu_indices(m)
    product = matrix[:, i[None, :], i[:, None]] * matrix[:, j[None, :], j[:, None]]
    product = product + np.where(i != j, matrix[:, j[None, :], i[:, None]] * matrix[:, i[None, :], j[:, None]], 0.0)
    result = np.empty_like(loss)
    result[:, i, j] = np.linalg.solve(np.eye(len(i)) - product, loss[:, i, j, None])[..., 0]
    result[:, j, i] = result[:, i, j]
    return result


class Sweep:
    """Steps backwards through a period at points ``(P,)``."""

    def __init__(self, chain: Chain, row: Array, period: Array, rate: Array) -> None:
        self.chain, self.row, self.period, self.rate = chain, row, period, rate

    def steps(self) -> Iterator[tuple[int, int, Array, Array]]:
        """(segment, piece of it, F, length ``(P,)``, 0 at points without that piece) of all pieces, the last first.

        A short piece loses little: P and Y hardly differ, and both conditions are much the same.
        """
        chain, row = self.chain, self.row
        for s in range(len(chain.states) - 1, -1, -1):
            values = chain.values[row, chain.states[s]]
            whole = chain.fractions[row, s] * self.period
            loss = 2 * np.abs(values.real).max(axis=1) * np.abs(whole)
            pieces = np.maximum(1.0, np.ceil(np.minimum(loss / LONGEST, PIECES)))
            most = int(pieces.max())
            for k in range(most - 1, -1, -1):
                length = np.where(pieces > k, whole / pieces, 0.0)
                step = exponential(values, length)
                yield s, k, chain.change[row, chain.index[s]] @ step if k == most - 1 else step, length

    def added(self, segment: int, length: Array, before: Array) -> Array:
        """P_i from Y_i."""
        size = np.abs(length)[:, None, None]
        weight = self.chain.weight[self.row, self.chain.states[segment]]
        return np.exp(2 * self.rate[:, None, None] * size) * before + size * weight

    def equation(self) -> tuple[Array, Array]:
        """exp(beta T) M and D."""
        m = self.chain.size
        matrix, loss = np.broadcast_to(np.eye(m), (len(self.row), m, m)), np.zeros((len(self.row), m, m))
        for segment, _, step, length in self.steps():
            matrix = matrix @ step * np.exp(self.rate * np.abs(length))[:, None, None]
            loss = self.added(segment, length, _transposed(step) @ loss @ step)
        return matrix, loss

    def tested(self, start: Array) -> Array:
        """The radii ``(P, 2)`` of the Lyapunov function that begins a period with ``start``."""
        radius = np.full((2, len(self.row)), LARGEST if self.chain.slope is None else FARTHEST)
        matrix, each = start, np.arange(self.chain.size)
        for segment, piece, step, length in self.steps():
            before = _transposed(step) @ matrix @ step
            # The period before begins with the same P.
            matrix = start if segment == piece == 0 else self.added(segment, length, before)
            values = self.chain.values[self.row, self.chain.states[segment]]
            loss = matrix - before
            loss[:, each, each] -= self.chain.rounding * np.abs(matrix).max(axis=(1, 2))[:, None]
            there = length != 0
            generator, bent = self.stretched(segment, values, length)
            for form in (matrix, before):
                rise = form @ generator
                rise = rise + _transposed(rise)
                more = (bent * np.linalg.norm(form, axis=(1, 2)))[:, None, None] * np.eye(self.chain.size)
                for k, sign in enumerate((1.0, -1.0)):
                    radius[k, there] = _largest(loss[there], (sign * rise + more)[there], radius[k, there])
        return radius.T

    def stretched(self, segment: int, values: Array, length: Array) -> tuple[Array, Array]:
        """F^-1 dF/d eta ``(P, m, m)`` of pieces of a segment, and FARTHEST times twice the size of its derivative."""
        chain, state = self.chain, self.chain.states[segment]
        generator = length[:, None, None] * _blocks(values, values)
        if chain.slope is None or chain.bend is None:
            return generator, np.zeros(len(length))
        slope = length[:, None, None] * chain.slope[self.row, state]
        turn = _pairs(values)
        back = _transposed(turn.conj()) / np.where(values.imag != 0, 2.0, 1.0)[:, :, None]
        growth = length[:, None] * values
        apart = growth[:, None, :] - growth[:, :, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.where(np.abs(apart) < SAME, 1.0, np.expm1(apart) / apart)
        averaged = (turn @ (mean * (back @ slope @ turn)) @ back).real
        size = np.linalg.norm(slope, axis=(1, 2)) * np.exp(np.ptp(growth.real, axis=1))
        bend = np.abs(length) * chain.bend[self.row, state] * np.exp(np.ptp(growth.real, axis=1))
        return generator - averaged, 2 * FARTHEST * SECURE * (bend + 4 * size + size**2)


def _largest(loss: Array, rise: Array, radius: Array) -> Array:
    """The largest radius ``(P,)``, at most what is given, with Q > radius E; 0 where Q itself is not positive."""
    failed = np.flatnonzero(~_positive(loss - radius[:, None, None] * rise))
    if len(failed) == 0:
        return radius
    loss, rise = loss[failed], rise[failed]
    high = radius[failed]
    low = 0.5 * high
    while True:
        bad = ~_positive(loss - low[:, None, None] * rise) & (low > 0)
        if not bad.any():
            break
        high = np.where(bad, low, high)
        low = np.where(bad, np.where(low > LARGEST * LEAST, 0.5 * low, 0.0), low)
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        good = _positive(loss - middle[:, None, None] * rise)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    result = radius.copy()
    result[failed] = low
    return result


def _positive(matrix: Array) -> Array:
    """Which symmetric matrices ``(P, m, m)`` are positive definite, by Cholesky's pivots."""
    work = np.moveaxis(matrix, 0, -1).copy()  # all points side by side
    good = np.ones(len(matrix), dtype=bool)
    for k in range(len(work)):
        pivot, column = work[k, k], work[k + 1 :, k]
        good &= pivot > 0
        work[k + 1 :, k + 1 :] -= column[:, None] * (column / np.where(good, pivot, 1.0))
    return good
