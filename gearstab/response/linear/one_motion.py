"""One motion through an interval in which functions vary smoothly, by the Runge-Kutta method of order 8 of Dormand &
Prince (Hairer, Norsett & Wanner 1993, section II.5).

It follows a vector, where maps (:mod:`~gearstab.response.linear.intervals`) follow a matrix.
"""

from __future__ import annotations

import numpy as np

from gearstab.response.linear.intervals import SteadyPoints
from gearstab.system import Array

RELATIVE = 1e-11
"""Error of a step as a part of the state. That of 20 periods of 41 intervals, m = 72, is 2e-12."""
INSIDE = 1e-9
"""How near to its edges an interval is looked at, as a part of its width: functions may jump there."""


def followed(points: SteadyPoints, q: int, x: Array, fractions: Array) -> tuple[Array, Array]:
    """The states ``(X, m)`` of one operating point at ascending fractions of interval ``q``, and that at its end, from
    x ``(m,)`` at its beginning; NaN where the motion outgrew double precision.
    """
    begin, width = points.edges[0, q], points.edges[0, q + 1] - points.edges[0, q]
    basis, drive, omega = points.basis, points.excitation, points.omega[0]
    scale = float(width * points.period[0])
    rates = omega * drive.force_of_rates

    def slope(s: float, state: Array) -> Array:
        tau = np.array([[begin + width * min(max(s, INSIDE), 1.0 - INSIDE)]])
        values = drive.varying(tau)[:, 0]
        force = ((drive.force(values) + rates) @ drive.z(tau)[0, 0])[0]
        moved = basis.constant[0] @ state + basis.inlet[0] @ force
        for value, part in zip(drive.split(values)[1][0], basis.parts[0], strict=True):
            moved += value * (part @ state)
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
