"""Histories of systems that are driven, or whose stiffness and damping vary in any way: period by period.

The states at the beginning of all common periods follow from x -> M x + b; then every interval between edges is treated
for all periods at once, with the maps from its beginning to the samples in it. Of a large system whose functions vary
smoothly such a map costs far more than one motion does: a few periods are then followed by a Runge-Kutta method.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearstab.propagation.equation import Equation, Excitation, excitation
from gearstab.propagation.first_order import FirstOrder, bases
from gearstab.propagation.intervals import SteadyPoints, followed, intervals
from gearstab.response.steady import period_map, resolution
from gearstab.system import Array, GearSystem

FEW = 4
"""Periods that are followed one by one, state by state, instead of by the map to each sample."""
MAPS = 2e4
"""Following one motion for as many periods as m^3 over this costs what the maps of one period cost: a period of 41
intervals at m = 72 takes 0.1 s, its maps some 2 s."""
ON_A_JUMP = 1e-9
"""A sample closer to a jump than this part of the sampling step is taken as lying on it, with the stiffness just after;
position and velocity do not jump, so that only the force and the energy depend on it."""


@dataclass(frozen=True)
class Driven:
    """A single system at one mesh frequency, ready to be followed.

    whole: the equation at any mesh frequency, of all modes, rigid-body ones included. omega: Omega.
    tolerance: where functions vary smoothly, of the map over a period, relative.
    """

    whole: Equation
    omega: float
    tolerance: float

    @cached_property
    def points(self) -> SteadyPoints:
        """The operating point."""
        return SteadyPoints.of(self.whole, np.zeros(1, dtype=int), np.array([self.omega]))

    @property
    def drive(self) -> Excitation:
        """Coefficients and excitation."""
        return self.points.excitation

    @property
    def basis(self) -> FirstOrder:
        """The first-order form at this mesh frequency."""
        return self.points.basis

    @cached_property
    def resolved(self) -> SteadyPoints:
        """The operating point with as many Magnus steps as the tolerance asks for."""
        if self.drive.exact:
            return self.points
        steps = resolution(self.points.equation, self.points.at, self.points.omega, self.tolerance)
        return replace(self.points, steps=steps)

    @property
    def period(self) -> float:
        """The common period."""
        return 2 * np.pi * self.drive.cycles / self.omega

    def state(self, displacement: Array, velocity: Array) -> Array:
        """x ``(m,)`` from q and dq/dt ``(n,)``."""
        n = self.basis.size // 2
        # The modal matrix is square: all modes are there.
        position = np.linalg.solve(self.basis.outlet[0, :, :n], displacement)
        return np.concatenate([position, np.linalg.solve(self.basis.speed[0, :, n:], velocity)])

    def physical(self, x: Array) -> tuple[Array, Array]:
        """q and dq/dt ``(..., n)``."""
        return x @ self.basis.outlet[0].T, x @ self.basis.speed[0].T

    def history(self, start: Array, samples: int, grid: int) -> Array:
        """x at all samples, ``(samples, m)``, ``grid`` of them in a common period; start: x at t = 0."""
        periods = max(1, -(-samples // grid))
        if not self.drive.exact and periods * MAPS <= len(start) ** 3:
            return self._followed(start, samples, grid, periods)
        columns = np.empty((len(start), periods))
        columns[:, 0] = start
        if periods > 1:
            matrix, shift = (part[0] for part in period_map(self.resolved))
            for k in range(1, periods):
                columns[:, k] = matrix @ columns[:, k - 1] + shift
        table = np.full((grid, len(start), periods), np.nan)
        for (_, inside, fractions), interval in zip(
            self._samples(min(samples, grid), grid), intervals(self.resolved), strict=False
        ):
            if periods <= FEW:
                for k in range(periods):
                    states = interval.through(columns[None, :, k], fractions)
                    table[inside, :, k] = [x[0] for x in states] if len(inside) else 0.0
            else:
                for sample, (p, push) in zip(inside, interval.at(fractions), strict=True):
                    table[sample] = p[0] @ columns + push[0][:, None]
            p, push = interval.across()
            columns = p[0] @ columns + push[0][:, None]
        return np.moveaxis(table, -1, 0).reshape(grid * periods, -1)[:samples]

    def _followed(self, start: Array, samples: int, grid: int, periods: int) -> Array:
        """The same, one interval after the other from the first to the last sample."""
        table, x = np.empty((samples, len(start))), start
        for k in range(periods):
            for q, inside, fractions in self._samples(min(grid, samples - k * grid), grid):
                states, x = followed(self.points, q, x, fractions)
                table[k * grid + inside] = states
        return table

    def _samples(self, samples: int, grid: int) -> Iterator[tuple[int, Array, Array]]:
        """Intervals of a common period: number, which of its first samples lie in it, and at which fractions of it."""
        edges = self.points.edges[0] * grid
        first = first_sample(edges)
        for q in self.points.equation.occupied:
            if first[q] >= samples:
                break
            inside = np.arange(first[q], min(first[q + 1], samples))
            yield q, inside, np.clip((inside - edges[q]) / (edges[q + 1] - edges[q]), 0.0, 1.0)

    def momentary(self, grid: int) -> tuple[Array, Array]:
        """``(grid, meshes)``, the mesh stiffnesses and the transmission errors at the samples of a common period."""
        return self.points.equation.momentary(np.arange(grid) / grid, ON_A_JUMP / grid)


def driven(system: GearSystem, mesh_frequency: float, tolerance: float = 1e-9) -> Driven:
    """Prepare a single system. tolerance: where functions vary smoothly, of the map over a period, relative.

    Raises ValueError without a common period.
    """
    (form,) = bases(system, whole=True)
    return Driven(Equation(form, excitation(system)), float(mesh_frequency), tolerance)


def first_sample(edges: Array) -> Array:
    """The first sample at or after each edge; both in sampling steps."""
    return np.ceil(edges - ON_A_JUMP).astype(int)
