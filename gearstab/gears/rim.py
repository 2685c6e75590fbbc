"""Deflection of a circular body under a tooth: an annulus clamped on one circle and loaded on the other.

A tooth passes a force and a moment to the root circle as normal stress that is linear over its foot, and as uniform
normal and shear stress; the displacement of the middle of the foot and the slope there count. Sainsot, Velex & Duverger
2004 solved the annulus clamped at its bore and fitted polynomials to it (see :mod:`.compliance`), which do not hold for
an internal gear: its rim is clamped outside. Here it is solved by Muskhelishvili's potentials, phi and psi,

    2 mu (u_x + i u_y) = kappa phi - z conj(phi') - conj(psi),    phi + z conj(phi') + conj(psi) = i int (X + i Y) ds,

in powers of z, harmonic by harmonic: those of the orders m and 2 - m go together. Plane strain, kappa = 3 - 4 nu.

Source: Muskhelishvili 1953, *Some Basic Problems of the Mathematical Theory of Elasticity*, chapter 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log

import numpy as np

Array = np.ndarray

FADED = 1e-17
"""Part of a harmonic at the clamped circle from which on it is that of an infinite body."""
PARTS_OF_A_FOOT = 2000.0
"""Harmonics times half the angle of the foot, which leave an error of some 1e-5."""


@dataclass(frozen=True)
class FootCompliance:
    """Coefficients L, M, P and P Q of the deflection of a foot of the length s and of the face width b.

        F cos^2 beta/(E b) [L (u/s)^2 + M u/s + P + P Q tan^2 beta]

    along a force F that crosses the tooth's axis at the height u over the foot, inclined by beta against its normal.
    """

    bending: float
    coupling: float
    shear: float
    normal: float


@lru_cache(maxsize=4096)
def foot_compliance(root: float, clamped: float, half_angle: float, poisson: float) -> FootCompliance:
    """Solve the annulus between the root circle and the clamped one, inside or outside of it, for one foot.

    root, clamped: radii, m; half_angle: of the foot, rad.
    """
    outwards = 1 if root > clamped else -1
    order = np.arange(1, ceil(PARTS_OF_A_FOOT / half_angle))
    k = np.concatenate([-order[::-1], [0], order]).astype(float)
    inner = np.where(k == 0, 1.0, k)
    even = np.where(k == 0, 1.0, np.sin(inner * half_angle) / (inner * half_angle)) / (2 * np.pi * root)
    odd = np.sin(inner * half_angle) - inner * half_angle * np.cos(inner * half_angle)
    odd = np.where(k == 0, 0.0, 1.5 / (root**2 * half_angle**3) * odd / inner**2 / (2 * np.pi))
    solve = _Annulus(root, clamped, poisson)
    # Radial stress of the moment rises with the angle, so that it turns clockwise.
    sheared, pressed, bent = (solve.middle(k, c) for c in (1j * even, even + 0j, -2j * odd))
    length, scale = 2 * root * half_angle, 1 + poisson  # E u = (1 + nu) 2 mu u
    return FootCompliance(
        bending=-scale * bent[2] * length**2,
        coupling=outwards * scale * (sheared[2] - bent[1]) * length,
        shear=scale * sheared[1],
        normal=scale * pressed[0],
    )


@dataclass(frozen=True)
class _Annulus:
    """Loaded at ``root``, clamped at ``clamped``."""

    root: float
    clamped: float
    poisson: float

    def middle(self, k: Array, stress: Array) -> tuple[float, float, float]:
        """2 mu times radial and tangential displacement, and rotation, at the angle 0.

        stress: harmonics k of radial plus i times tangential stress. Sums are smoothed by Lanczos's factors.
        """
        m = k + 1
        moved = self._displacements(m, stress) * np.sinc(k / (k[-1] + 1))
        total, slope = np.sum(moved), np.sum(1j * k * moved)
        return float(total.real), float(total.imag), float(total.imag - slope.real) / self.root

    def _displacements(self, m: Array, stress: Array) -> Array:
        """Harmonics m of 2 mu (u_x + i u_y) on the root circle."""
        a, b, kappa = self.root, self.clamped, 3 - 4 * self.poisson
        outwards = 1 if a > b else -1
        force = outwards * a * stress / np.where(m == 0, 1.0, m)
        zero = int(np.flatnonzero(m == 0)[0])
        net = outwards * a * complex(stress[zero]) / (1 + kappa)
        # Those of an infinite body, which differ from 1 and 2 - m on by what reaches the clamped circle.
        rising = m > 1
        found = np.where(rising == (outwards > 0), kappa, -1.0) * force
        first, second = force[zero + 1], force[zero + 2]
        swell = np.linalg.solve([[(kappa - 1) * b, -1 / b], [2 * a, 1 / a]], [0.0, first.real])
        turn = np.linalg.solve([[(kappa + 1) * b, -1 / b], [0.0, 1 / a]], [0.0, first.imag])
        found[zero + 1] = (kappa - 1) * a * swell[0] - swell[1] / a + 1j * ((kappa + 1) * a * turn[0] - turn[1] / a)
        rim = np.array([[kappa * b**2, -(b**-2.0)], [a**2, a**-2.0]], dtype=complex)
        power, inverse = np.linalg.solve(rim, [np.conj(net), second - np.conj(net)])
        found[zero + 2] = kappa * power * a**2 - inverse / a**2 - np.conj(net)
        found[zero] = 2 * np.conj(power) * (b**2 - a**2) + 2 * kappa * net * log(a / b)
        last = min(ceil(log(FADED) / log(min(a, b) / max(a, b))), int(m[-1]) - 2)
        order = np.arange(3, last + 1)
        above, below = zero + order, zero + 2 - order
        found[above], found[below] = self._coupled(order.astype(float), force[above], force[below])
        return found

    def _coupled(self, m: Array, force: Array, mate: Array) -> tuple[Array, Array]:
        """Displacements of the harmonics m and 2 - m on the root circle, from their forces."""
        a, b, kappa = self.root, self.clamped, 3 - 4 * self.poisson
        large, small, zero = max(a, b), min(a, b), np.zeros_like(m)

        def rows(r: float) -> tuple[list[Array], ...]:
            """Rows of forces and displacements at the radius r over a_m, conj a_2-m, conj b_-m and b_m-2, scaled."""
            grows, fades = (r / large) ** m, (small / r) ** (m - 2)
            falls, mates = (small / r) ** m, (r / large) ** (m - 2)
            message = [kappa * grows, (m - 2) * fades, -falls, zero]
            hint = [-m * grows, kappa * fades, zero, -mates]
            return [grows, (2 - m) * fades, falls, zero], [m * grows, fades, zero, mates], message, hint

        here, there = rows(a), rows(b)
        matrix = np.moveaxis(np.array([here[0], here[1], there[2], there[3]]), -1, 0)
        given = np.stack([force, np.conj(mate), 0 * force, 0 * force], axis=-1)
        solved = np.linalg.solve(matrix.astype(complex), given[..., None])[..., 0]
        moved, mates = (np.einsum("km,mk->m", np.array(here[row]), solved) for row in (2, 3))
        return moved, np.conj(mates)
