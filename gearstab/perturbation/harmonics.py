"""The Fourier coefficients of all meshes on the common grid of their frequencies, for sums over all harmonics.

Meshes of commensurate frequencies r_i Omega = N_i b Omega form a *family* of base frequency b Omega: every harmonic of
theirs is a whole number k of it. Meshes of other families share no frequency with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from gearstab.mesh import Mesh
from gearstab.perturbation.tongues import ParametricExcitation
from gearstab.system import Array, GearSystem, shared_period

HIGHEST = 2048
"""Highest harmonic of a mesh that is summed. For a wave with jumps the terms fall as s^-4, so that what remains is
1/(3 HIGHEST^3) = 4e-11 of the first term, of which all but a hundredth is estimated."""

ROUNDING = 1e-13
"""Couplings below this part of the terms they are the sum of are rounding and count as zero."""

ROWS = 16
"""Rows of Fourier coefficients that are multiplied at a time, so that they stay in the processor's cache."""

SMALL_QUOTIENT = 64
"""Mesh frequencies given as decimals are one family where their quotient is a fraction with no greater denominator."""


@dataclass(frozen=True)
class Family:
    """Meshes of commensurate frequencies.

    base: b. exact: whether b is a rational number. members: numbers (from 0) of the meshes. cycles: their N_i = r_i/b.
    """

    base: float
    exact: bool
    members: tuple[int, ...]
    cycles: tuple[int, ...]

    def holds(self, excitation: ParametricExcitation) -> bool:
        """Whether the frequency of an excitation is a multiple of the base frequency."""
        if excitation.parts:
            return excitation.parts[0][0] in self.members
        return self.exact and isinstance(excitation.ratio, Fraction)

    def number(self, excitation: ParametricExcitation) -> int:
        """k of an excitation."""
        return round(float(excitation.ratio) / self.base)

    def lattice(self, first: int, last: Sequence[int]) -> Array:
        """All k = +- s N_i with |k| > ``first`` and s <= ``last`` of each mesh, ascending."""
        found = [n * np.arange(first // n + 1, s + 1) for n, s in zip(self.cycles, last, strict=True)]
        positive = np.unique(np.concatenate(found))
        return np.concatenate([-positive[::-1], positive])

    def excites(self, k: Array) -> Array:
        """Whether a k is a harmonic of any member."""
        return np.asarray(np.any([k % cycles == 0 for cycles in dict.fromkeys(self.cycles)], axis=0))

    def near(self, position: Array, cycles: int) -> tuple[Array, Array]:
        """The multiples of ``cycles`` around a position."""
        below = (cycles * np.floor(position / cycles)).astype(np.int64)
        return below, below + cycles


def families(system: GearSystem) -> tuple[Family, ...]:
    """All meshes, each in one family."""
    ratios = [mesh.frequency_ratio for mesh in system.meshes]
    gathered: list[list[tuple[int, Fraction]]] = []
    for i, ratio in enumerate(ratios):
        for family in gathered:
            quotient = _quotient(ratio, ratios[family[0][0]])
            if quotient is not None:
                family.append((i, quotient))
                break
        else:
            gathered.append([(i, Fraction(1))])
    result = []
    for family in gathered:
        period, cycles = shared_period([quotient for _, quotient in family])
        reference = ratios[family[0][0]]
        base, exact = float(reference / period), isinstance(reference, Fraction)
        result.append(Family(base, exact, tuple(i for i, _ in family), cycles))
    return tuple(result)


def _quotient(ratio: Fraction | float, other: Fraction | float) -> Fraction | None:
    """ratio/other where that is rational, else None."""
    if isinstance(ratio, Fraction) and isinstance(other, Fraction):
        return ratio / other
    if isinstance(ratio, Fraction) or isinstance(other, Fraction):
        return None
    quotient = Fraction(ratio / other).limit_denominator(SMALL_QUOTIENT)
    return quotient if abs(float(quotient) * other - ratio) <= 4 * np.finfo(float).eps * ratio else None


def table(mesh: Mesh, highest: int) -> Array:
    """z_s = (b_s - i a_s) exp(-2 pi i s lag) for s = 0 ... ``highest``, ``(..., highest + 1)``, zero at s = 0."""
    batch = np.broadcast_shapes(mesh.waveform.batch, np.shape(mesh.lag))
    found = np.zeros((highest + 1, *batch), dtype=complex)
    for s in range(1, highest + 1):
        a, b = mesh.waveform.fourier(s)
        found[s] = np.asarray(b) - 1j * np.asarray(a)
    order = np.arange(highest + 1).reshape(-1, *(1,) * len(batch))
    # Whole turns are taken off before the product rounds.
    turns = order * np.mod(np.asarray(mesh.lag, dtype=float), 1.0)
    return np.moveaxis(found * np.exp(-2j * np.pi * np.mod(turns, 1.0)), 0, -1)


@dataclass(frozen=True)
class Excited:
    """The variable stiffness of some rows, in modal coordinates: V = sum_k B(k) exp(i k b Omega t) over all families.

        B(k) = sum_i z_i(k) alpha_i delta_i delta_i^T,    alpha_i = epsilon_i k_gi

    strength: alpha ``(rows, meshes)``. deflection: delta ``(rows, n, meshes)``.
    tables: z_s of every mesh ``(rows, S_i + 1)``, see :func:`table`.
    """

    strength: Array
    deflection: Array
    tables: tuple[Array, ...]

    @cached_property
    def highest(self) -> tuple[int, ...]:
        """Up to which harmonic each mesh is known."""
        return tuple(z.shape[-1] - 1 for z in self.tables)

    def rows(self, rows: slice) -> Excited:
        return Excited(self.strength[rows], self.deflection[rows], tuple(z[rows] for z in self.tables))

    def coefficients(self, family: Family, k: Array) -> Array:
        """z_i(k) of the members ``(rows, members, k)``; zero where k is no harmonic of the mesh."""
        found = np.zeros((len(self.strength), len(family.members), len(k)), dtype=complex)
        for m, (i, cycles) in enumerate(zip(family.members, family.cycles, strict=True)):
            order, rest = np.divmod(k, cycles)
            known = (rest == 0) & (np.abs(order) <= self.highest[i])
            for sign in (-1, 1):
                where = np.flatnonzero(known & (sign * order > 0))
                value = self.tables[i][:, np.abs(order[where])]
                found[:, m, where] = np.conj(value) if sign < 0 else value
        return found

    def matrices(self, family: Family, k: Array, modes: Array | slice = slice(None)) -> Array:
        """B(k)_pr of all modes r and some modes p ``(rows, p, k, n)``; symmetric in the two."""
        members = list(family.members)
        z = self.coefficients(family, k) * self.strength[:, members, None]
        delta = self.deflection[:, :, members]
        sides = delta[:, modes, None, :] * np.swapaxes(z, -1, -2)[:, None]
        return sides @ np.swapaxes(delta, -1, -2)[:, None]

    def moments(self, family: Family, first: int, shift: int, powers: int) -> Array:
        """sum_(|k| > first) conj z_i(k) z_j(k + shift) k^-(2 + q) ``(rows, members, members, powers)``, q from 0 on."""
        key = family, first, shift, powers
        if key not in self._moments:
            self._moments[key] = self._sums(*key)
        return self._moments[key]

    @cached_property
    def _moments(self) -> dict[tuple[Family, int, int, int], Array]:
        return {}

    def _sums(self, family: Family, first: int, shift: int, powers: int) -> Array:
        members = range(len(family.members))
        total = np.zeros((len(self.strength), len(members), len(members), powers), dtype=complex)
        for m in members:
            for j in members:
                i, cycles = family.members[m], family.cycles[m]
                last = [cycles * self.highest[i], family.cycles[j] * self.highest[family.members[j]]]
                k = cycles * np.arange(-self.highest[i], self.highest[i] + 1)
                k = k[(np.abs(k) > first) & ((k + shift) % family.cycles[j] == 0) & (np.abs(k + shift) <= last[1])]
                if len(k):
                    weights = self._weights(k, first, min(last), powers)
                    total[:, m, j] = self._products(
                        i, k // cycles, family.members[j], (k + shift) // family.cycles[j], weights
                    )
        return total

    def _products(self, i: int, order: Array, j: int, other: Array, weights: Array) -> Array:
        """sum conj z_i(s) z_j(t) times weights ``(k, powers)``, s = ``order`` and t = ``other``, ``(k,)`` each."""
        found = []
        for start in range(0, len(self.strength), ROWS):
            some = slice(start, start + ROWS)
            one, two = (self.tables[mesh][some, np.abs(s)] for mesh, s in ((i, order), (j, other)))
            # conj z_i z_j, with z at -s the conjugate of z at s.
            one[:, order > 0] = np.conj(one[:, order > 0])
            two[:, other < 0] = np.conj(two[:, other < 0])
            found.append((one * two) @ weights)
        return np.concatenate(found)

    @staticmethod
    def _weights(k: Array, first: int, end: int, powers: int) -> Array:
        """k^-(2 + q) ``(k, powers)``; for what is beyond ``end``, a part of the last half again.

        Where the products of Fourier coefficients fall as k^-2, all that follows is the 1/(2^(3 + q) - 1)-th part of
        the terms between end/2 and end; where they alternate or fall faster, both are negligible.
        """
        q = np.arange(powers)
        weights: Array = k[:, None].astype(float) ** -(2.0 + q)
        if 2 * first <= end:
            half = (2 * np.abs(k) > end) & (np.abs(k) <= end)
            weights[half] *= 1 + 1 / (2.0 ** (3 + q) - 1)
        return weights

    def element(self, family: Family, k: Array, p: Array) -> Array:
        """|B(k)_pr|, for a k of each row, pair and mode r: k ``(rows, pairs, n)``, p ``(pairs,)``."""
        total, size = np.zeros(k.shape, dtype=complex), np.zeros(k.shape)
        row = np.arange(len(k))[:, None, None]
        for i, cycles in zip(family.members, family.cycles, strict=True):
            order, rest = np.divmod(np.abs(k), cycles)
            known = (rest == 0) & (order <= self.highest[i])
            z = self.tables[i][row, np.where(known, order, 0)]
            delta = self.deflection[:, :, i]
            part = np.where(k < 0, np.conj(z), z) * self.strength[:, i, None, None]
            part = part * delta[:, p, None] * delta[:, None, :]
            total += part
            size += np.abs(part)
        return np.where(np.abs(total) > ROUNDING * size, np.abs(total), 0.0)
