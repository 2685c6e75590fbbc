"""Undamped systems with matrices that act with speeds of rotation, as Hamiltonian systems.

With u in the modes of the mean system, u'' + g u' + K(t) u = 0 has the momentum p = u' + g u/2. In the coordinates z =
(w^(1/2) u, w^(-1/2) p) it is canonical, dz/dt = A z with J A symmetric, if and only if g is skew and K(t) symmetric,
whatever the speeds are; J then does not depend on them. The monodromy matrix is symplectic, P^T J P = J.

A rigid-body motion v b that is free at every speed enters by its velocity r' only, and its momentum v.(M q' + W G q)
is conserved; the other multipliers are those of the system in which it is zero, with the same canonical coordinates.

Source: Yakubovich & Starzhinskii 1975, ch. III; with p as in the Legendre transform of a gyroscopic Lagrangian.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.damped import Generators
from gearstab.system import Array

SYMMETRIC = 1e-11
"""Part of the largest entry by which J A may depart from symmetry: rounding in the modes of the mean system."""
MOST_STATES = 64
"""Most states that are looked at for that: more than functions that vary."""
STEP = 1e-5
"""Relative step of the derivative, which is right to about its square."""


@dataclass(frozen=True)
class CanonicalPeriods:
    """Common periods of r rows in S segments, with canonical monodromy matrices at any mesh frequency.

    cycles: N; the common period is N 2 pi/Omega. fractions ``(r, S)``, states ``(S,)``: how long which state lasts.
    generator: of x = (w u, u', ..), ``(r, D, m, m)``. elastic: n, the number of coordinates u.
    """

    cycles: float
    fractions: Array
    states: Array
    generator: Generators
    elastic: int

    def hamiltonian(self, omega: Array) -> Array:
        """``(r,)``: whether J A is symmetric in all states at mesh frequencies ``(r, P)``."""
        # A is affine in what varies: states in general position tell of all.
        some = np.unique(np.linspace(0, self.generator.matrix.shape[1] - 1, MOST_STATES).astype(int))
        generator = replace(self.generator, matrix=self.generator.matrix[:, some])
        n, matrix = self.elastic, generator.at(omega)
        shape = matrix.shape
        matrix = matrix.reshape(-1, *shape[2:])
        turn, back = self._turns(matrix[:, 0])
        whole = matrix @ back[:, None]
        # What is left out has to stay what the rest makes it.
        size = np.abs(matrix).max(axis=(1, 2, 3))
        left = np.abs(whole - back[:, None] @ turn[:, None] @ whole).max(axis=(1, 2, 3), initial=0.0)
        matrix = turn[:, None] @ whole
        form = np.concatenate([matrix[..., n:, :], -matrix[..., :n, :]], axis=-2)
        error = np.abs(form - np.swapaxes(form, -1, -2)).max(axis=(1, 2, 3))
        symmetric = (error <= SYMMETRIC * np.abs(form).max(axis=(1, 2, 3))) & (left <= SYMMETRIC * size)
        return np.asarray(symmetric.reshape(shape[:2]).all(axis=1))

    def monodromy(self, row: Array, cycle: Array) -> Array:
        """P ``(P, 2n, 2n)`` at points (row, 1/Omega) ``(P,)``."""
        product = c_points.exponentials(self.cycles, self.fractions, self.states, self.generator, row, cycle)
        matrix = self.generator.subset(row).at(1 / np.asarray(cycle)[:, None])[:, 0, 0]
        turn, back = self._turns(matrix)
        return np.asarray(turn @ product @ back)

    def with_slope(self, row: Array, cycle: Array) -> tuple[Array, Array]:
        """P and dP/d ln(1/Omega)."""
        count, rows = len(row), np.repeat(row, 3)
        every = self.monodromy(rows, np.repeat(cycle, 3) * np.tile(np.exp([-STEP, 0.0, STEP]), count))
        before, here, after = np.moveaxis(every.reshape(count, 3, *every.shape[1:]), 1, 0)
        return here, (after - before) / (2 * STEP)

    def radians(self, omega: Array) -> Array:
        """``(r,)``: of the fastest motion of any state over a period at Omega = 1, from states at Omega ``(r,)``."""
        values = np.linalg.eigvals(self.generator.at(omega[:, None])[:, 0])
        return np.asarray(2 * np.pi * self.cycles * np.abs(values).max(axis=(1, 2)))

    def _turns(self, matrix: Array) -> tuple[Array, Array]:
        """Matrices that take x into z ``(P, 2n, m)``, and back, from generators ``(P, m, m)`` of one state."""
        n, m = self.elastic, matrix.shape[-1]
        weight, gyroscopic = np.einsum("pii->pi", matrix[:, :n, n : 2 * n]), -matrix[:, n : 2 * n, n : 2 * n]
        root, each = np.sqrt(weight), np.arange(n)
        turn, back = np.zeros((len(matrix), 2 * n, m)), np.zeros((len(matrix), m, 2 * n))
        turn[:, each, each] = turn[:, n + each, n + each] = 1 / root
        turn[:, n:, :n] = 0.5 * gyroscopic / root[:, :, None] / weight[:, None, :]
        back[:, each, each] = back[:, n + each, n + each] = root
        back[:, n : 2 * n, :n] = -0.5 * gyroscopic / root[:, None, :]
        if m > 2 * n:
            # The rigid-body velocity at which the momentum d.u' + r' + h.u is zero, with the free motion (d, 1).
            free = -np.swapaxes(matrix[:, :n, 2 * n :], 1, 2) / weight[:, None, :]
            held = (free @ gyroscopic - matrix[:, 2 * n :, n : 2 * n]) / weight[:, None, :]
            back[:, 2 * n :] = -held @ back[:, :n] - free @ back[:, n : 2 * n]
        return turn, back
