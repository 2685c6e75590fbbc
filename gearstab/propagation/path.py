"""The mesh frequency over time: straight from knot to knot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.system import Array


@dataclass(frozen=True)
class Path:
    """Omega(t), linear between knots: time ``(K,)`` from 0 on, ascending, and mesh_frequency ``(K,)``, positive.

    The phase of the first mesh is theta(t) = int_0^t Omega dt', in radians.
    """

    time: Array
    mesh_frequency: Array

    @classmethod
    def ramp(cls, low: float, high: float, rate: float) -> Path:
        """Return the ramp through a whole range at a rate: upwards, or downwards where the rate is negative."""
        first, last = (low, high) if rate > 0 else (high, low)
        return cls(np.array([0.0, (high - low) / abs(rate)]), np.array([first, last]))

    @cached_property
    def rate(self) -> Array:
        """``(K - 1,)``, dOmega/dt between the knots."""
        return np.asarray(np.diff(self.mesh_frequency) / np.diff(self.time))

    @cached_property
    def phase(self) -> Array:
        """``(K,)``, theta at the knots."""
        middle = 0.5 * (self.mesh_frequency[1:] + self.mesh_frequency[:-1])
        return np.concatenate([[0.0], np.cumsum(middle * np.diff(self.time))])

    @property
    def range(self) -> tuple[float, float]:
        """The least and the greatest mesh frequency."""
        return float(self.mesh_frequency.min()), float(self.mesh_frequency.max())

    def moment(self, phase: Array) -> Array:
        """Return the times at which the phase has given values.

        t = t_k + 2 x/(Omega_k + sqrt(Omega_k^2 + 2 r x)), x = theta - theta_k: without cancellation at any rate r.
        """
        k = self._piece(phase)
        beyond = phase - self.phase[k]
        return np.asarray(self.time[k] + 2 * beyond / (self.mesh_frequency[k] + self._speed(k, beyond)))

    def durations(self, phase: Array, lengths: Array) -> Array:
        """Return how long it takes from each of the phases ``(S + 1,)`` to the next; lengths ``(S,)``: their distances.

        2 (theta_b - theta_a)/(Omega_a + Omega_b): differences of moments would be off by the rounding of the latter.
        """
        k = self._piece(0.5 * (phase[1:] + phase[:-1]))
        first, last = (self._speed(k, end - self.phase[k]) for end in (phase[:-1], phase[1:]))
        whole = (phase[:-1] >= self.phase[k]) & (phase[1:] <= self.phase[k + 1])
        return np.where(whole, 2 * lengths / (first + last), np.diff(self.moment(phase)))

    def _piece(self, phase: Array) -> Array:
        return np.clip(np.searchsorted(self.phase, phase, side="right") - 1, 0, len(self.rate) - 1)

    def _speed(self, piece: Array, beyond: Array) -> Array:
        return np.sqrt(np.maximum(self.mesh_frequency[piece] ** 2 + 2 * self.rate[piece] * beyond, 0.0))

    def phase_at(self, time: Array) -> Array:
        """Return theta(t)."""
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.rate) - 1)
        since = time - self.time[k]
        return np.asarray(self.phase[k] + since * (self.mesh_frequency[k] + 0.5 * self.rate[k] * since))

    def rate_at(self, time: Array) -> Array:
        """Return dOmega/dt."""
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.rate) - 1)
        return np.asarray(self.rate[k])

    def knots(self, low: float, high: float) -> Array:
        """Return the times at which the rate changes between two others."""
        return self.time[(self.time > low) & (self.time < high)]

    def speed_at(self, time: Array) -> Array:
        """Return Omega(t)."""
        return np.interp(time, self.time, self.mesh_frequency)
