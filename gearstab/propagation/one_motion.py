"""One motion through an interval in which functions vary smoothly, by the Runge-Kutta method of order 8 of Dormand &
Prince (Hairer, Norsett & Wanner 1993, section II.5).

It follows a vector, where maps (:mod:`~gearstab.propagation.intervals`) follow a matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearstab.propagation.equation import INSIDE
from gearstab.propagation.intervals import SteadyPoints
from gearstab.system import Array

RELATIVE = 1e-11
"""Error of a step as a part of the state. That of 20 periods of 41 intervals, m = 72, is 2e-12."""

DEGREES = (16, 32, 64)
"""Degrees of polynomials that approximate what varies in an interval, each tried where the one before is not enough."""
RESOLVED = 1e-14
"""Size of the last coefficients of such a polynomial, as a part of the largest."""


def followed(points: SteadyPoints, q: int, x: Array, fractions: Array) -> tuple[Array, Array]:
    """The states ``(X, m)`` of one operating point at ascending fractions of interval ``q``, and that at its end, from
    x ``(m,)`` at its beginning; NaN where the motion outgrew double precision.
    """
    basis, momentary = points.basis, _quickly(_Momentary(points, q))
    scale = float(np.diff(points.edges[0, q : q + 2])[0] * points.period[0])
    generators = np.concatenate([basis.constant, basis.parts[0]]).reshape(-1, len(x))
    count = 1 + basis.parts.shape[1]

    def slope(s: float, state: Array) -> Array:
        values = momentary(np.array([s]))[0]
        moved = values[:count] @ (generators @ state).reshape(count, -1) + values[count:]
        return np.asarray(scale * moved)

    # SciPy's integrators take a third of a second to import.
    from scipy.integrate import solve_ivp

    size = np.abs(x).max() + np.abs(slope(0.0, x)).max()
    found = np.full((len(fractions) + 1, len(x)), np.nan)
    if np.isfinite(size):
        asked = np.append(fractions[fractions < 1.0], 1.0)
        least = max(RELATIVE * size, np.finfo(float).tiny)
        motion = solve_ivp(slope, (0.0, 1.0), x, "DOP853", asked, rtol=RELATIVE, atol=least)
        found[: motion.y.shape[1]] = motion.y.T
        if motion.success:
            found[len(asked) - 1 :] = motion.y[:, -1]
    return found[:-1], found[-1]


@dataclass(frozen=True)
class _Momentary:
    """Return the functions that vary in an interval: 1, the functions in A, then the force on x, ``(X, 1 + J + m)`` at
    fractions.
    """

    points: SteadyPoints
    q: int

    def __call__(self, fractions: Array) -> Array:
        points, drive = self.points, self.points.excitation
        begin, end = points.edges[0, self.q : self.q + 2]
        tau = begin + (end - begin) * np.clip(fractions, INSIDE, 1.0 - INSIDE)
        values = drive.varying(tau[None])[0]
        constant, rates = points.equation.forces(values[:, None])
        force = (constant[:, 0] + points.omega[0] * rates[0]) @ drive.z(tau)[..., None]
        return np.concatenate([np.ones((len(tau), 1)), drive.split(values)[1], force[..., 0]], axis=1)


def _quickly(momentary: _Momentary) -> Callable[[Array], Array]:
    """The same by polynomials of Chebyshev, which take a fifth of the time, where these are as exact."""
    for degree in DEGREES:
        k = np.arange(degree)
        angle = np.pi * (k + 0.5) / degree
        values = momentary(0.5 + 0.5 * np.cos(angle))
        coefficients = 2 / degree * np.cos(k[:, None] * angle) @ values
        coefficients[0] /= 2
        size = np.abs(coefficients).max(axis=0)
        if np.all(np.abs(coefficients[-4:]) <= RESOLVED * size):
            break
    else:
        return momentary
    kept = coefficients[: 1 + int(np.flatnonzero(np.any(np.abs(coefficients) > RESOLVED * size, axis=1)).max())]
    orders = np.arange(len(kept))
    return lambda fractions: np.cos(orders * np.arccos(np.clip(2 * fractions[:, None] - 1, -1.0, 1.0))) @ kept
