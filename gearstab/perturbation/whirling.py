"""First-order tongues of systems whose motions are no real modes: with gyroscopic, circulatory or unsymmetric matrices.

With the mean system x' = A(Omega) x, A r_p = lambda_p r_p, l_p^T A = lambda_p l_p^T, l_p^T r_q = delta_pq and
lambda_p = -a_p + i w_p, and with the harmonics F_j exp(i nu t) + c.c. of what varies, sum_j f_j(t) P_j, the amplitudes
of two motions near nu = w_p + w_q + sigma follow

    A_p' = (-a_p - i sigma/2) A_p + G conj(A_q),    conj(A_q)' = H A_p + (-a_q + i sigma/2) conj(A_q),
    G = sum_j F_j l_p^T P_j conj(r_q),    H = sum_j conj(F_j) conj(l_q)^T P_j r_p,

and near nu = w_p - w_q the same with A_q, r_q and l_q for their conjugates. These are the amplitude equations of
:mod:`gearstab.perturbation.unsymmetric`. Nothing here takes damping as small, as the theory of real modes does.

Without damping GH = |B|^2/(S_p S_q), S_p = phi_p^H (2 w_p M - i W G) phi_p: sums are resonant where the signatures of
both motions, the signs of S, are equal, differences where they are not.

Where speeds of rotation follow the mesh frequency, nu = r Omega, the root solves r Omega = w_p(Omega) +- w_q(Omega),
and half-widths in Omega are those in nu over |r - d(w_p +- w_q)/dOmega|, d lambda_p/dOmega = l_p^T (dA/dOmega) r_p.

Sources: Lin & Parker 2002 for multiple scales; Yakubovich & Starzhinskii 1975, Linear Differential Equations with
Periodic Coefficients, for signatures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.perturbation.damped import product_pair
from gearstab.perturbation.tongues import ParametricExcitation
from gearstab.perturbation.tongues import harmonics as harmonics_of_terms
from gearstab.perturbation.unsymmetric import groups
from gearstab.propagation.elastic import ElasticRows, mean_levels, single_rows
from gearstab.propagation.schedule import acting
from gearstab.roots import RootBrackets, narrowed
from gearstab.system import Array, GearSystem

SPEEDS, LOWEST = 600, 1e-4
"""Mesh frequencies at which roots are looked for, and the lowest of them, as a part of the highest."""
DOUBLINGS = 8
"""Doublings of the highest mesh frequency, where natural frequencies rise with it."""
CLOSE = 1e-14
"""How closely a root is enclosed, relatively."""
ENTRIES_AT_ONCE = 2**21
"""Entries of the matrices of roots that are treated together: 16 MB, and as much for their vectors."""
ROUNDING = 1e-11
"""Parts of the largest exponent, or of the terms of a sum, below which rates and couplings are rounding."""
EQUAL = 1e-8
"""Natural frequencies that differ by less than this part are one."""


Wanted = tuple[ParametricExcitation, int, int, bool]
"""An excitation, two modes p <= q from 1, and whether their difference is meant."""


@dataclass(frozen=True)
class RowTongues:
    """Tongues of one row in the order in which they were asked for, ``(T,)`` each.

    root, middle, half_width: in Omega; threshold as of :class:`~gearstab.perturbation.tongues.Tongues`. Where there is
    no root all are NaN. grows: ``(n,)``, which modes grow by themselves at every mesh frequency that was looked at.
    oscillates: ``(n,)``, which modes do anywhere.
    """

    root: Array
    middle: Array
    half_width: Array
    threshold: Array
    grows: Array
    oscillates: Array


def whirling_rows(system: GearSystem) -> list[MeanRow]:
    """Return the mean systems of all rows of the flattened batch."""
    return [MeanRow(system, *own) for own in zip(single_rows(system), mean_levels(system), strict=True)]


class MeanRow:
    """One row of a system whose mean goes with the mesh frequency."""

    def __init__(self, system: GearSystem, own: ElasticRows, level: Array) -> None:
        self.system, self.row, self.form, self.level = system, int(own.form.rows[0]), own.form, level
        self.rate, self.rigid_exponents = float(own.form.rate[0]), own.rigid_exponents[0]
        self.held = own.form.by_speed is None

    def matrices(self, omega: Array) -> Array:
        """A ``(K, m, m)`` at mesh frequencies ``(K,)``, in units of the rate."""
        levels = np.broadcast_to(self.level, (len(omega), 1, len(self.level)))
        return self.form.generator(levels, omega[:, None])[:, 0]

    def frequencies(self, omega: Array) -> tuple[Array, Array]:
        """(w ``(K, n)`` ascending, 0 of what does not oscillate, the growth ``(K, n)`` of these motions), 1/time."""
        values = np.concatenate([np.linalg.eigvals(part) for part in self._parts(omega)])
        frequency, growth = np.zeros((2, len(omega), self.system.size))
        for k, own in enumerate(values):
            upper = own[own.imag > 0]
            upper = upper[np.argsort(upper.imag, kind="stable")]
            real = np.sort(np.append(own[own.imag == 0].real, self.rigid_exponents / self.rate))[::-1][::2]
            first = self.system.size - len(upper)
            frequency[k, first:], growth[k, first:] = upper.imag, upper.real
            # Of two real exponents the larger one tells the growth.
            growth[k, :first] = real[:first]
        growth[np.abs(growth) <= ROUNDING * np.abs(values).max(axis=1, initial=0.0)[:, None]] = 0.0
        return frequency * self.rate, growth * self.rate

    def _parts(self, omega: Array) -> list[Array]:
        step = max(1, ENTRIES_AT_ONCE // max(1, self.form.size**2))
        return [self.matrices(omega[k : k + step]) for k in range(0, len(omega), step)]

    def tongues(self, wanted: Sequence[Wanted]) -> RowTongues:
        """Find the roots, then what is unstable around each."""
        ratio = np.array([float(force.ratio) for force, *_ in wanted])
        speeds = self._speeds(ratio)
        frequency, growth = self.frequencies(speeds)
        root = self._roots(wanted, ratio, speeds, frequency)
        found = np.full((3, len(wanted)), np.nan)
        step = max(1, ENTRIES_AT_ONCE // max(1, self.form.size**2))
        there = np.flatnonzero(np.isfinite(root))
        forces = {id(force): force for force, *_ in wanted}
        parts = {key: self._harmonics(force) for key, force in forces.items()}
        for begin in range(0, len(there), step):
            part = there[begin : begin + step]
            for k, motions in zip(part, self._motions(root[part]), strict=True):
                found[:, k] = self._tongue(wanted[k], parts[id(wanted[k][0])], root[k], motions)
        missing = np.isnan(found[2])
        root = np.where(missing, np.nan, root)
        middle, half, threshold = found
        grows, oscillates = np.asarray((growth > 0).all(axis=0)), np.asarray((frequency > 0).any(axis=0))
        return RowTongues(root, middle, half, threshold, grows, oscillates)

    def _speeds(self, ratio: Array) -> Array:
        if self.held or not len(ratio):
            return np.ones(1)
        top, least = 2 * self.frequencies(np.full(1, 1e-12))[0].max() / ratio.min(), ratio.min()
        for _ in range(DOUBLINGS):
            if least * top > 2 * self.frequencies(np.full(1, top))[0].max():
                break
            top *= 2
        return np.geomspace(LOWEST, 1.0, SPEEDS) * top

    def _roots(self, wanted: Sequence[Wanted], ratio: Array, speeds: Array, frequency: Array) -> Array:
        """The lowest Omega ``(T,)`` at which nu meets the sum or difference of two frequencies, NaN without one."""
        p, q = np.array([(p - 1, q - 1) for _, p, q, _ in wanted], dtype=int).reshape(-1, 2).T
        sign = np.where([difference for *_, difference in wanted], -1.0, 1.0)

        def sums(w: Array, index: Array | slice) -> Array:
            """Sums of frequencies ``(..., n)``; NaN where a mode does not oscillate."""
            one, other = (np.take_along_axis(w, np.atleast_1d(of[index])[..., None], axis=-1)[..., 0] for of in (q, p))
            return np.where((one > 0) & (other > 0), one + sign[index] * other, np.nan)

        if self.held:
            every = sums(np.broadcast_to(frequency, (len(wanted), frequency.shape[1])), slice(None))
            return np.where(every > 0, every, np.nan) / ratio
        places, ends = [], []
        for k in range(len(wanted)):
            excess = ratio[k] * speeds - sums(frequency, np.full(len(speeds), k))
            change = np.flatnonzero((excess[:-1] * excess[1:] <= 0) & (excess[1:] != 0))
            if len(change):
                places.append((k, change[0]))
                ends.append(excess[change[0] : change[0] + 2])
        own, at = np.array(places, dtype=int).reshape(-1, 2).T

        def excess_at(which: Array, omega: Array) -> Array:
            return np.asarray(ratio[own[which]] * omega - sums(self.frequencies(omega)[0], own[which]))

        bracket = RootBrackets(speeds[at], speeds[at + 1], *np.array(ends).reshape(-1, 2).T)
        root = np.full(len(wanted), np.nan)
        root[own] = narrowed(excess_at, bracket, CLOSE * speeds[at]).best
        return root

    def _motions(self, omega: Array) -> list[Pairing]:
        values, right = np.linalg.eig(self.matrices(omega))
        left = np.linalg.inv(right)
        slope = np.broadcast_to(self.form.speed_slope(omega[:, None])[:, 0] if not self.held else 0.0, right.shape)
        return [Pairing.of(*own, self.rate, self.system.size) for own in zip(values, right, left, slope, strict=True)]

    @staticmethod
    def _tongue(
        one: Wanted, parts: list[tuple[complex, Array]], root: float, motions: Pairing
    ) -> tuple[float, float, float]:
        """(middle, half-width, threshold) in Omega; NaN where another pair of the same frequencies carries it."""
        force, p, q, difference = one
        P, Q = motions.group(p - 1), motions.group(q - 1)
        if P[0] != p - 1 or Q[0] != q - 1:
            return np.nan, np.nan, np.nan
        if difference:
            P, Q = Q, P
        rate = float(force.ratio) - (motions.slope(P) + (-1 if difference else 1) * motions.slope(Q))
        there, size = motions.coupling(P, Q, parts, not difference)
        back, size_back = motions.coupling(Q, P, parts, not difference, conjugate=True)
        shift, half, threshold = resonance_of(
            there, back, size, size_back, motions.rates(P), motions.rates(Q), difference
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            return root + shift / rate, half / abs(rate), threshold

    def _harmonics(self, force: ParametricExcitation) -> list[tuple[complex, Array]]:
        """(F_j, P_j in 1/time) of all that excites at a frequency."""
        system, row, number = self.system, np.array([self.row]), 0
        matrices = self.form.parts[0] * self.rate
        found: list[tuple[complex, Array]] = []
        for i, s in force.parts:
            mesh = system.meshes[i]
            a, b = (system.flat(np.asarray(v))[self.row] for v in mesh.waveform.fourier(s))
            wave = (b - 1j * a) * np.exp(-2j * np.pi * s * system.flat(mesh.lag)[self.row])
            found.append((complex(system.flat(mesh.amplitude)[self.row] * wave), matrices[i]))
        of_terms = {j: own for j, *own in harmonics_of_terms(system, force.ratio, row)}
        number = len(system.meshes)
        for j, term in enumerate(system.terms):
            for on_velocity, _ in acting(term):
                if j in of_terms:
                    found.append((complex(of_terms[j][on_velocity][0]), matrices[number]))
                number += 1
        return found


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
