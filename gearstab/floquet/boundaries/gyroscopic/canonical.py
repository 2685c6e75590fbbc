"""Undamped systems with matrices that act with speeds of rotation, as Hamiltonian systems.

With u in the modes of the mean system, u'' + g u' + K(t) u = 0 has the momentum p = u' + g u/2. In the coordinates z =
(w^(1/2) u, w^(-1/2) p) it is canonical, dz/dt = A z with J A symmetric, if and only if g is skew and K(t) symmetric,
whatever the speeds are; J then does not depend on them. The monodromy matrix is symplectic, P^T J P = J.

Source: Yakubovich & Starzhinskii 1975, ch. III; with p as in the Legendre transform of a gyroscopic Lagrangian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.kernel.chain import TINY, Following
from gearstab.propagation.magnus import expm
from gearstab.system import Array

SYMMETRIC = 1e-11
"""Part of the largest entry by which J A may depart from symmetry: rounding in the modes of the mean system."""
ENTRIES_AT_ONCE = 2**19
"""Entries of the generators of the points that are treated together: 8 MB."""


@dataclass(frozen=True)
class CanonicalPeriods:
    """Common periods of r rows in S segments, with canonical monodromy matrices at any mesh frequency.

    cycles: N; the common period is N 2 pi/Omega. fractions ``(r, S)``, states ``(S,)``: how long which state lasts.
    following: the generators of the states.
    """

    cycles: float
    fractions: Array
    states: Array
    following: Following

    @property
    def size(self) -> int:
        """2n."""
        return self.following.form.size

    @property
    def rate(self) -> Array:
        """``(r,)``, the unit of 1/time."""
        return self.following.form.rate

    def hamiltonian(self, row: Array, mesh_frequency: Array) -> Array:
        """``(P,)``: whether J A is symmetric in all states at points."""
        n = self.size // 2
        if self.size % 2 or self.following.form.elastic != n:
            return np.zeros(len(row), dtype=bool)
        matrix = self.following.matrices(row, mesh_frequency)
        turn, back = self._turns(matrix)
        matrix = turn[:, None] @ matrix @ back[:, None]
        form = np.concatenate([matrix[..., n:, :], -matrix[..., :n, :]], axis=-2)
        error = np.abs(form - np.swapaxes(form, -1, -2)).max(axis=(1, 2, 3))
        return np.asarray(error <= SYMMETRIC * np.abs(form).max(axis=(1, 2, 3)))

    def monodromy(self, row: Array, cycle: Array) -> tuple[Array, Array]:
        """P ``(P, 2n, 2n)`` at points (row, 1/Omega) ``(P,)``, 1/Omega in units of 1/rate, and dP/d ln(1/Omega)."""
        step = max(1, ENTRIES_AT_ONCE // (len(self.states) * self.size**2))
        parts = [self._monodromy(row[k : k + step], cycle[k : k + step]) for k in range(0, max(len(row), 1), step)]
        whole = np.concatenate(parts)
        return whole.real.copy(), whole.imag / TINY

    def _monodromy(self, row: Array, cycle: Array) -> Array:
        """P + i TINY dP/d ln(1/Omega): the derivative of an analytic function by an imaginary step is exact."""
        moved = cycle * (1 + 1j * TINY)
        matrix = self.following.matrices(row, self.rate[row] / moved)
        time = self.fractions[row] * (2 * np.pi * self.cycles * moved)[:, None]
        steps = matrix[:, self.states] * time[:, :, None, None]
        flows = expm(steps.reshape(-1, self.size, self.size)).reshape(steps.shape)
        product = flows[:, 0]
        for k in range(1, len(self.states)):
            product = flows[:, k] @ product
        turn, back = self._turns(matrix)
        return np.asarray(turn @ product @ back)

    def _turns(self, matrix: Array) -> tuple[Array, Array]:
        """What takes x = (w u, u') into z, and back, ``(P, 2n, 2n)``, from the generators ``(P, D, 2n, 2n)``."""
        n = self.size // 2
        weight = np.einsum("pii->pi", matrix[:, 0, :n, n:])
        half = -0.5 * matrix[:, 0, n:, n:]
        turn, back = np.zeros((2, *matrix[:, 0].shape), dtype=matrix.dtype)
        each, root = np.arange(n), np.sqrt(weight)
        turn[:, each, each] = turn[:, n + each, n + each] = 1 / root
        turn[:, n:, :n] = half / root[:, :, None] / weight[:, None, :]
        back[:, each, each] = back[:, n + each, n + each] = root
        back[:, n:, :n] = -half / root[:, None, :]
        return turn, back
