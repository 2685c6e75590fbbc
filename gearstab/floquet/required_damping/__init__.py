"""How much damping makes a system stable: the damping at which the growth rate falls to zero, point by point.

With C = z C1, C1 either the damping of equal modal damping ratios of one, in the modes of the mean system at rest, or
the damping that was given,

    growth(z) = max Re (characteristic exponents) = 0

is solved for z, in each part of the system that the meshes do not couple by itself; the largest of all parts is
required. The growth rate need not fall with z: where two modes of different decay are coupled, damping may widen a
combination tongue (see :mod:`gearstab.perturbation.damped`). Therefore z is scanned at levels z_max/2^k
first; what is returned is the *largest* zero, beyond which all levels up to z_max are stable, and points where a lower
level was stable too are marked. In a primary tongue of first order, Omega = 2 w_p + d of half-width s in Omega,

    z = sqrt(s^2 - d^2)/(2 w_p).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.dispatch import in_modes
from gearstab.floquet.required_damping.growth import DAMPING_RATIO, FACTOR, GrowthByDamping, growths, scalable
from gearstab.floquet.segments.reduction import reduce
from gearstab.floquet.stability import DAMPED_ON_CIRCLE
from gearstab.system import Array, GearSystem

__all__ = ["FLAGS", "required_damping", "scalable"]


FLAGS = {"not_monotone": 1, "beyond": 2, "failed": 4, "rigid_body": 8}
"""Bits of ``status``: a smaller damping was stable too, the largest zero is given; more than the largest one is
required; no finite growth rate; the damping that the system has makes a rigid-body mode grow, which no damping ratio of
the elastic modes can prevent."""

LARGEST = {DAMPING_RATIO: 0.5, FACTOR: 100.0}
"""Where the search ends by default."""
LEVELS = 11
"""Damping levels that are tried besides zero: the lowest is a thousandth of the largest."""
ROUNDS = 100
"""Steps of the root finding at most; every third one halves the bracket."""


@dataclass(frozen=True)
class RequiredDamping:
    """value: ``(rows, P)``, the modal damping ratio (or factor on the given damping) from which on the system is
    stable; 0 where it is stable without, NaN where the search found none. status: ``(rows, P)`` int16, bits of FLAGS.
    """

    value: Array
    status: Array


def required_damping(
    system: GearSystem,
    mesh_frequency: Array,
    of: str = DAMPING_RATIO,
    largest: float | None = None,
    tolerance: float = 1e-6,
) -> RequiredDamping:
    """The damping that stabilises every row of a system at every mesh frequency of the first mesh.

    Parameters
    ----------
    system: any batch shape, with a common period.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``.
    of: ``damping_ratio``: one ratio for all modes of the mean system, in place of the damping that it has; ``factor``:
        on that damping, the symmetric part of C and of terms along one direction. What is skew, friction, and what acts
        with a speed of rotation, rotating damping included, stay as they are.
    largest: damping at which the search ends.
    tolerance: of the value, relative. It is rounded up, so that the growth there is no larger than its rounding error.

    Raises ValueError for a factor on no damping, NotPossible where there is no common period.
    """
    omega = system.operating_points(mesh_frequency)
    value, status = np.zeros(omega.shape), np.zeros(omega.shape, dtype=np.int16)
    levels = np.append(0.0, (largest or LARGEST[of]) * 0.5 ** np.arange(LEVELS - 1, -1, -1))
    for by_damping in growths(system, of, omega, levels[1]):
        index = by_damping.rows
        found, flags = _Search(by_damping).zeros(levels, tolerance)
        # NaN, nothing found, prevails.
        value[index] = np.maximum(value[index], found)
        status[index] |= flags
    if not in_modes(system):
        return RequiredDamping(value, status)
    driven = _driven(system)
    status[driven] |= FLAGS["rigid_body"]
    if of == DAMPING_RATIO:
        value[driven] = np.nan
    return RequiredDamping(value, status)


def _driven(system: GearSystem) -> Array:
    """``(rows,)`` bool: where the damping of the system feeds a rigid-body mode."""
    result = np.zeros(system.rows, dtype=bool)
    for elastic in reduce(system):
        result[elastic.rows] = elastic.rigid_driven
    return result


@dataclass(frozen=True)
class _Search:
    """Rows whose growth is known over the damping."""

    by_damping: GrowthByDamping

    def zeros(self, levels: Array, tolerance: float) -> tuple[Array, Array]:
        """(largest zero, status) ``(r, P)`` from ascending levels of which the first is zero."""
        growth = np.stack([self.by_damping.at_level(level) for level in levels])
        unstable = growth > 0
        count = len(levels)
        last = count - 1 - np.argmax(unstable[::-1], axis=0)
        last = np.where(unstable.any(axis=0), last, -1)
        status = np.where(unstable.sum(axis=0) < last + 1, FLAGS["not_monotone"], 0).astype(np.int16)
        beyond, failed = last == count - 1, ~np.isfinite(growth).all(axis=0)
        status[beyond] |= FLAGS["beyond"]
        status[failed] |= FLAGS["failed"]
        value = np.where(beyond | failed, np.nan, 0.0)
        rows, points = np.nonzero((last >= 0) & ~beyond & ~failed)
        step = self.by_damping.at_once
        for i in range(0, len(rows), step):
            row, point = rows[i : i + step], points[i : i + step]
            low = last[row, point]
            ends = np.stack([levels[low], levels[low + 1]])
            values = np.stack([growth[low, row, point], growth[low + 1, row, point]])
            # The kernel rounds the growth at a zero either way: half of the tolerance is kept for that.
            found = self.refined(row, self.by_damping.omega[row, point], ends, values, 0.5 * tolerance)
            value[row, point] = np.minimum(found * (1 + 0.5 * tolerance), levels[low + 1])
        return value, status

    def refined(self, row: Array, omega: Array, ends: Array, values: Array, tolerance: float) -> Array:
        """Return the zeros ``(N,)`` of points in brackets ``(2, N)`` of values > 0 and <= 0: their last stable ends.

        Source: Illinois method, with halving in between. A growth below DAMPED_ON_CIRCLE is none only where the stable
        end decays no more than that, as a mode without damping does; elsewhere the zero is that of the growth itself.
        """
        floor = np.where(values[1] < -2 * DAMPED_ON_CIRCLE, DAMPED_ON_CIRCLE, 0.0)
        (low, high), (f_low, f_high) = ends.copy(), values + floor
        side = np.zeros(len(row))
        for step in range(ROUNDS):
            active = np.flatnonzero(high - low > tolerance * high)
            if len(active) == 0:
                break
            a, b, f_a, f_b = low[active], high[active], f_low[active], f_high[active]
            x = 0.5 * (a + b) if step % 3 == 2 else b - f_b * (b - a) / (f_b - f_a)
            # A zero at an end of the bracket is approached from inside, by half of what is left to gain.
            margin = 0.5 * tolerance * b
            x = np.clip(x, a + margin, b - margin)
            f = self.by_damping.at_points(row[active], omega[active], x) + floor[active]
            above = f > 0
            # An end that stays twice running counts half, so that the secant crosses over to it.
            stays = side[active] == np.where(above, 1, -1)
            f_high[active] = np.where(above, np.where(stays, 0.5 * f_b, f_b), f)
            f_low[active] = np.where(above, f, np.where(stays, 0.5 * f_a, f_a))
            low[active], high[active] = np.where(above, x, a), np.where(above, b, x)
            side[active] = np.where(above, 1, -1)
        return high
