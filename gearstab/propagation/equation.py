"""The equation x' = A x + B z of rows of a system, between the edges of its schedule."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.propagation.excitation import Excitation
from gearstab.propagation.first_order import FirstOrder
from gearstab.propagation.schedule import distinct
from gearstab.propagation.segment import States
from gearstab.system import Array

ON_A_JUMP = 1e-12
"""A moment closer to a jump than this part of the common period is taken as lying on it."""
INSIDE = 1e-9
"""How near to its edges an interval is looked at, as a part of its width: functions may jump there."""


@dataclass(frozen=True)
class Equation:
    """x' = A x + (B_0 + Omega B_1) z(tau): the first-order form of rows, and what drives these rows."""

    form: FirstOrder
    drive: Excitation

    @property
    def edges(self) -> Array:
        """``(r, Q + 1)``, between which everything is smooth, in parts of the common period."""
        return self.drive.schedule.edges

    @cached_property
    def occupied(self) -> Array:
        """Numbers of the intervals that some row has."""
        return np.flatnonzero(np.any(np.diff(self.edges, axis=1) > 0, axis=0))

    def values(self, tau: Array) -> Array:
        """``(X, r, J)``, the varying functions at the times ``(X, r)``."""
        return np.swapaxes(self.drive.varying(tau.T), 0, 1)

    @cached_property
    def middles(self) -> Array:
        """``(Q, r, J)``, the varying functions in the middle of every interval."""
        return self.values(0.5 * (self.edges[:, 1:] + self.edges[:, :-1]).T)

    @cached_property
    def states(self) -> States:
        """The states of A in intervals in which nothing varies."""
        inner = self.drive.split(self.middles[self.occupied])[1]
        which, first = distinct(np.swapaxes(inner, 0, 1))
        of = np.zeros(self.edges.shape[1] - 1, dtype=int)
        of[self.occupied] = which
        return States(of, self.form.generator(inner[first]))

    def inputs(self, values: Array) -> tuple[Array, Array, Array]:
        """A ``(X, r, m, m)``, B_0 ``(X, r, m, L)`` and B_1 ``(r, m, L)`` for values ``(X, r, J)``."""
        return self.form.generator(values), *self.forces(values)

    def forces(self, values: Array) -> tuple[Array, Array]:
        """B_0 ``(X, r, m, L)`` and B_1 ``(r, m, L)`` for values ``(X, r, J)``."""
        return self.form.inlet @ self.drive.force(values), self.form.inlet @ self.drive.force_of_rates

    @cached_property
    def borders(self) -> Array:
        """Edges of the intervals that the first row has, from 0 to 1."""
        edges = self.edges[0]
        return np.append(edges[:-1][np.diff(edges) > 0], 1.0)

    def momentary(self, part: Array, slack: float = ON_A_JUMP) -> tuple[Array, Array]:
        """``(X, meshes)``: mesh stiffnesses and transmission errors of the first row at parts of the common period.

        Forces that the teeth of a mesh exert, over its stiffness, are transmission errors too.

        Just after the jump for a part that is on one, or before it by no more than the slack.
        """
        inside = part - np.floor(part)
        k = np.clip(np.searchsorted(self.borders, inside + slack, side="right") - 1, 0, len(self.borders) - 2)
        begin, end = self.borders[k], self.borders[k + 1]
        # Just inside, where a function that jumps at an edge still has the value of the interval.
        inner = np.clip(inside, begin + INSIDE * (end - begin), end - INSIDE * (end - begin))
        at = 0.5 * (begin + end) if self.drive.exact else inner
        varying = self.drive.varying(np.broadcast_to(at, (len(self.edges), len(at))))[0]
        stiffness, _, others = self.drive.split(varying)
        exerted = others @ self.drive.exerted.T
        # A mesh without stiffness at a moment, or a weak tooth that does not carry, exerts nothing.
        errors = exerted / np.where(exerted == 0, 1.0, stiffness)
        return stiffness, self.drive.z(part) @ self.drive.errors[0].T + errors

    def at_speeds(self, at: Array, speed: Array) -> Equation:
        """Return a row for each of the speeds ``(K,)`` that rows ``at`` (K,) have."""
        return Equation(self.form.at_speeds(at, speed), self.drive.subset(at))
