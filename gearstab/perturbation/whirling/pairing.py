"""Motions of a mean system at one speed, and the two of them that an excitation makes unstable together.

The amplitude equations are those of :mod:`gearstab.perturbation.whirling.rows`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.perturbation.damped import product_pair
from gearstab.perturbation.unsymmetric import groups
from gearstab.system import Array

ROUNDING = 1e-11
"""Parts of the largest exponent, or of the terms of a sum, below which rates and couplings are rounding."""
EQUAL = 1e-8
"""Natural frequencies that differ by less than this part are one."""


@dataclass(frozen=True)
class Pairing:
    """The n motions at one mesh frequency: exponents and slopes in 1/time, vectors ``(m, n)`` and ``(n, m)``.

    By ascending frequency; those that do not oscillate, first, have no vectors.
    """

    exponent: Array
    right: Array
    left: Array
    derivative: Array

    @classmethod
    def of(cls, values: Array, right: Array, left: Array, slope: Array, rate: float, n: int) -> Pairing:
        """Motions, n of them, from eigenvalues, vectors and the slope of a matrix ``(m, m)`` in units of the rate."""
        upper = np.flatnonzero(values.imag > 0)
        upper = upper[np.argsort(values[upper].imag, kind="stable")]
        first, m = n - len(upper), len(values)
        exponent, derivative = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
        every, inverse = np.zeros((m, n), dtype=complex), np.zeros((n, m), dtype=complex)
        exponent[first:], every[:, first:], inverse[first:] = values[upper], right[:, upper], left[upper]
        derivative[first:] = np.einsum("pi,ij,jp->p", left[upper], slope, right[:, upper])
        small = np.abs(exponent.real) <= ROUNDING * np.abs(values).max(initial=0.0)
        return cls(rate * np.where(small, 1j * exponent.imag, exponent), every, inverse, rate * derivative)

    def group(self, p: int) -> list[int]:
        """Return the motions of the frequency of motion p."""
        w = self.exponent.imag
        first = last = p
        while first > 0 and w[first] - w[first - 1] <= EQUAL * w[first]:
            first -= 1
        while last + 1 < len(w) and w[last + 1] - w[last] <= EQUAL * w[last + 1]:
            last += 1
        return list(range(first, last + 1))

    def slope(self, group: list[int]) -> float:
        """dw/dOmega, the mean of a group."""
        return float(self.derivative[group].imag.mean())

    def rates(self, group: list[int]) -> Array:
        """-a ``(k,)``, with what parts a frequency from the mean one of the group as its imaginary part."""
        own = self.exponent[group]
        return np.asarray(own - 1j * own.imag.mean())

    def coupling(
        self,
        rows: list[int],
        columns: list[int],
        parts: list[tuple[complex, Array]],
        sums: bool,
        conjugate: bool = False,
    ) -> tuple[Array, Array]:
        """G ``(p, q)``, or with ``conjugate`` H, and the sum of the sizes of its terms."""
        left, right = self.left[rows], self.right[:, columns]
        if sums:
            left, right = (left.conj(), right) if conjugate else (left, right.conj())
        total, size = np.zeros((2, len(rows), len(columns)), dtype=complex)
        for factor, matrix in parts:
            total += (np.conj(factor) if conjugate else factor) * (left @ matrix @ right)
            size += np.abs(factor) * (np.abs(left) @ np.abs(matrix) @ np.abs(right))
        size = size.real
        total[np.abs(total) <= ROUNDING * size] = 0.0
        return total, size


def resonance_of(
    there: Array, back: Array, size: Array, size_back: Array, rates_p: Array, rates_q: Array, difference: bool
) -> tuple[float, float, float]:
    """(shift, half-width, threshold) in nu of two groups from G ``(p, q)``, H ``(q, p)``, the sizes of their terms and
    -a of their motions.
    """
    product = there @ back
    noise = ROUNDING * (np.abs(there) @ size_back + size @ np.abs(back)).max(initial=0.0)
    free = not (rates_p.any() or rates_q.any())
    if free or product.size == 1:
        # Without damping the eigenvalues of GH tell all; there is growth at any detuning where one of them is not real.
        values = np.linalg.eigvals(product) if product.size > 1 else product.ravel()
        values = np.where(np.abs(values.imag) <= noise, values.real, values)
        shift, half, threshold = product_pair(values, -rates_p[0].real, -rates_q[0].real)
        widest = int(np.argmax(np.nan_to_num(half, posinf=np.inf)))
        if difference and not np.isinf(half[widest]) and np.all(values == 0):
            return 0.0, 0.0, np.inf
        return float(shift[widest]), float(half[widest]), float(threshold[widest])
    level = np.maximum(size.max(initial=0.0), size_back.max(initial=0.0))
    conjugated = rates_q if difference else rates_q.conj()
    given = (there[None], back[None], np.diag(rates_p)[None], np.diag(conjugated)[None], np.array([ROUNDING * level]))
    shift, half, threshold = groups(*given)
    return float(shift[0]), float(half[0]), float(threshold[0])
