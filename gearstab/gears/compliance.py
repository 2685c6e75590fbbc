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
here; Sainsot, Velex & Duverger 2004 (J. Mech. Des. 126, 748-752) for the foundation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt

import numpy as np

from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair
from gearstab.gears.profile import NODES, ToothProfile, flank, tooth_profile
from gearstab.gears.rim import foot_compliance

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
