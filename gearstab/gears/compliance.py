"""Compliance of a tooth and stiffness of one pair of teeth along the path of contact.

A tooth is a cantilever from its root circle, of thickness 2 x(y), loaded normal to its flank at (x_c, y_c); beta is the
angle of the force to the normal of the tooth's axis, y the height above the root, of an internal tooth inwards. With
D = y_c cos beta - x_c sin beta:

    bending      int (D - y cos beta)^2 / (E I) dy,   I = 2 b x^3/3
    shear        1.2 cos^2 beta int dy / (G A),       A = 2 b x
    axial        sin^2 beta int dy / (E A)
    foundation   cos^2 beta/(E b) [L (u_f/s_f)^2 + M u_f/s_f + P (1 + Q tan^2 beta)],   u_f = y_c - x_c tan beta - r_f
    contact      4 (1 - nu^2) / (pi E b), of a pair (for equal materials)

Sources: Yang & Lin 1987 (J. Mech. Transm. Autom. Des. 109, 189-196) and Tian 2004 for the beam, with the true fillet
here; Sainsot, Velex & Duverger 2004 (J. Mech. Des. 126, 748-752) for the foundation. They solved an annulus clamped at
its bore and fitted polynomials to it, which do not hold for an internal gear: its rim is clamped outside, and solved
here, see :func:`foot_compliance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log, pi, sqrt

import numpy as np

from gearstab.gears.geometry import NODES, Gear, ToothProfile, flank, tooth_profile
from gearstab.gears.pair import Pair

Array = np.ndarray

SHEAR_FACTOR = 1.2  # of a rectangular section
# A, B, C, D, E, F of L, M, P, Q = A/t^2 + B h^2 + C h/t + D/t + E h + F, with t = theta_f and h = r_f/r_bore.
FOUNDATION = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
FOUNDATION_RANGE = (1.4, 7.0)  # of h, over which those polynomials were fitted


@dataclass(frozen=True)
class ToothCompliance:
    """Parts of the deflection per unit force of one tooth, m/N, each of the shape of the contact points."""

    bending: Array
    shear: Array
    axial: Array
    foundation: Array

    @property
    def total(self) -> Array:
        return self.bending + self.shear + self.axial + self.foundation


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2


def _moments(x: Array, height: Array, weight: Array) -> Array:
    """Integrals of 1/x^3, height/x^3, height^2/x^3 and 1/x over the height, ``(4, ...)``."""
    cube = weight / x**3
    return np.stack([np.sum(f, axis=-1) for f in (cube, cube * height, cube * height**2, weight / x)])


@lru_cache(maxsize=4096)
def _fillet_moments(profile: ToothProfile) -> Array:
    """The integrals over the fillet, which every contact point shares; heights from the tooth's root."""
    nodes, weights = _gauss()
    span = profile.fillet_end - pi / 2
    x, y, _, rate = profile.fillet(pi / 2 + span * nodes)
    return _moments(x, y - _root_height(profile), weights * span * rate)


def _root_height(profile: ToothProfile) -> float:
    return float(profile.fillet(pi / 2)[1])


@dataclass(frozen=True)
class Cantilever:
    """Foot of a tooth: its height y_f above the gear's centre, where the involute begins above it, its half angle.

    fillet: integrals over the fillet, as of ``_moments``; zeros of an internal tooth, whose involute goes down to the
    root circle.
    """

    foot: float
    form_roll: float
    half_angle: float
    fillet: Array

    @classmethod
    def of(cls, gear: Gear) -> Cantilever:
        if not gear.internal:
            profile = tooth_profile(gear)
            fillet = _fillet_moments(profile)
            return cls(_root_height(profile), profile.form_roll, profile.root_half_angle, fillet)
        roll = sqrt((gear.root_radius / gear.base_radius) ** 2 - 1)
        x, y, _, _ = flank(gear, roll)
        return cls(float(y), roll, float(np.arctan2(x, y)), np.zeros(4))

    def moments(self, gear: Gear, roll: Array) -> Array:
        """Integrals over the tooth from its foot up to each contact point."""
        nodes, weights = _gauss()
        span = (roll - self.form_roll)[..., None]
        x, y, _, rate = flank(gear, self.form_roll + span * nodes)
        along = _moments(x, gear.sign * (y - self.foot), gear.sign * weights * span * rate)
        return self.fillet.reshape((4,) + (1,) * roll.ndim) + along


def tooth_compliance(gear: Gear, roll: Array | float, face_width: float | None = None) -> ToothCompliance:
    """Compliance of a tooth loaded at involute points, given by roll angle (tan of the transverse profile angle).

    A point below the end of an undercut fillet counts as on the involute continued. An internal tooth has involute
    flanks down to its root circle, from which it rises inwards. ``face_width``: None for the gear's.
    """
    roll = np.asarray(roll, dtype=float)
    b = gear.face_width if face_width is None else face_width
    tooth = Cantilever.of(gear)
    x, y, _, _ = flank(gear, roll)
    beta = roll - gear.sign * gear.base_half_angle
    cos, sin = np.cos(beta), np.sin(beta)
    flat = tooth.moments(gear, roll)
    arm = gear.sign * (y - tooth.foot) * cos - x * sin
    bending = 1.5 / (gear.young * b) * (arm**2 * flat[0] - 2 * arm * cos * flat[1] + cos**2 * flat[2])
    shear_modulus = gear.young / (2 * (1 + gear.poisson))
    return ToothCompliance(
        bending=bending,
        shear=SHEAR_FACTOR * cos**2 * flat[3] / (2 * shear_modulus * b),
        axial=sin**2 * flat[3] / (2 * gear.young * b),
        foundation=_foundation(gear, tooth.half_angle, x, y, beta) / b,
    )


def _foundation(gear: Gear, theta: float, x: Array, y: Array, beta: Array) -> Array:
    if gear.internal:
        return _rim(gear, theta, x, y, beta)
    h = (
        min(max(gear.root_radius / gear.bore, FOUNDATION_RANGE[0]), FOUNDATION_RANGE[1])
        if gear.bore
        else FOUNDATION_RANGE[1]
    )
    terms = np.array([1 / theta**2, h**2, h / theta, 1 / theta, h, 1.0])
    big_l, big_m, big_p, big_q = FOUNDATION @ terms
    u = (y - x * np.tan(beta) - gear.root_radius) / (2 * gear.root_radius * theta)
    return np.cos(beta) ** 2 / gear.young * (big_l * u**2 + big_m * u + big_p * (1 + big_q * np.tan(beta) ** 2))


def _rim(gear: Gear, theta: float, x: Array, y: Array, beta: Array) -> Array:
    """Deflection of the rim of an internal gear, clamped at its given outer radius; rigid without one."""
    if gear.bore_radius is None:
        return np.zeros(np.shape(x))
    foot = foot_compliance(gear.root_radius, gear.bore_radius, theta, gear.poisson)
    tangent = np.tan(beta)
    u = (gear.root_radius - y - x * tangent) / (2 * gear.root_radius * theta)
    inner = foot.bending * u**2 + foot.coupling * u + foot.shear + foot.normal * tangent**2
    return np.cos(beta) ** 2 / gear.young * inner


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

    A tooth passes a force and a moment to the root circle as normal stress that is linear over its foot, and as uniform
    normal and shear stress; the displacement of the middle of the foot and the slope there count. With Muskhelishvili's
    potentials, phi and psi,

        2 mu (u_x + i u_y) = kappa phi - z conj(phi') - conj(psi), phi + z conj(phi') + conj(psi) = i int (X + i Y) ds,

    in powers of z, harmonic by harmonic: those of the orders m and 2 - m go together. Plane strain, kappa = 3 - 4 nu.

    root, clamped: radii, m; half_angle: of the foot, rad.

    Source: Muskhelishvili 1953, *Some Basic Problems of the Mathematical Theory of Elasticity*, chapter 5.
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


def contact_compliance(pair: Pair) -> float:
    """Return the compliance of the Hertz contact of one pair, 2/(pi b) [(1 - nu1^2)/E1 + (1 - nu2^2)/E2] (Yang & Sun
    1985), m/N.
    """
    parts = sum((1 - gear.poisson**2) / gear.young for gear in (pair.pinion, pair.wheel))
    return 2 * parts / (pi * pair.face_width)


def pair_stiffness(pair: Pair, s: Array | float, foundation: bool = True) -> Array:
    """Stiffness of one pair of teeth in contact at the distance s from T1, N/m, of the shape of s.

    Of helical gears that of the transverse section, along its line of action.
    """
    s = np.asarray(s, dtype=float)
    compliance = np.full(s.shape, contact_compliance(pair))
    for gear, arm in ((pair.pinion, s), (pair.wheel, pair.wheel_arm(s))):
        tooth = tooth_compliance(gear, arm / gear.base_radius, pair.face_width)
        compliance = compliance + tooth.total - (0.0 if foundation else tooth.foundation)
    return 1 / compliance
