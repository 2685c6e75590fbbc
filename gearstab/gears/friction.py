"""Sliding friction between the teeth: coefficients, kinematics, and the periodic functions they make of a mesh.

With the pinion's and the wheel's rotation counted as in the mesh deflection g^T q, g = (r_b1, -r_b2; n, -n), the
sliding velocity at the contact s is h(s)^T q', h = (s, -(L -+ s); t, -t), t being n turned by 90 degrees in the
pinion's positive sense. Friction adds to the left side of the equations of motion, for every pair p of teeth in
contact,

    sigma mu h(s_p) (k_p g^T q + c_p g^T q'),    sigma = sign of the sliding velocity.

As h(s) = u + s v, u = (0, -L; t, -t), v = (1, +-1; 0, 0) (+ external), two scalar functions of the phase carry it:
sum sigma mu k_p with u and sum sigma mu k_p s_p with v. A rigid rotation has g^T q = 0 and so feels no friction.

Sources: Vaishya & Singh 2001 (J. Sound Vib. 243, 525-545); He, Cho & Singh 2008 (J. Sound Vib. 309, 843-851).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gearstab.errors import NotPossible
from gearstab.gears.mesh_stiffness import DEGREE, PLAIN, StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair
from gearstab.gears.stress import contact_pressure
from gearstab.waveforms.base import stiff_fraction
from gearstab.waveforms.tooth import Piecewise, nodes, through

Array = np.ndarray

# b1..b9 of Xu & Kahraman 2007.
XU_KAHRAMAN = (-8.916465, 1.03303, 1.036077, -0.354068, 2.812084, -0.100601, 0.752755, -0.390958, 0.620305)
LEAST_SLIDING = 0.01  # of the rolling velocity, below which Benedict & Kelley's logarithm is not followed


@dataclass(frozen=True)
class ContactState:
    """State of one contact of teeth; arrays of a common shape, of magnitudes but for ``slide_roll``.

    Parameters
    ----------
    sliding: u1 - u2, m/s, with its sign.
    entrainment: (u1 + u2)/2, m/s.
    radius: equivalent radius of curvature, m.
    pressure: largest Hertz pressure, Pa.
    load: normal force per face width, N/m.
    """

    sliding: Array
    entrainment: Array
    radius: Array
    pressure: Array
    load: Array

    @property
    def slide_roll(self) -> Array:
        """SR = (u1 - u2)/[(u1 + u2)/2]."""
        return self.sliding / self.entrainment


class FrictionLaw(Protocol):
    """A friction coefficient that depends on the state of the contact."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """The slide-roll ratios, other than 0, at which the coefficient is not smooth; here none."""
        return ()

    def coefficient(self, contact: ContactState) -> Array:
        """mu >= 0, of the contact's shape."""
        ...


@dataclass(frozen=True)
class ConstantFriction(FrictionLaw):
    """Coulomb's: mu is ``level`` everywhere."""

    level: float

    def __post_init__(self) -> None:
        _positive(self, "level", zero=True)

    def coefficient(self, contact: ContactState) -> Array:
        return np.full(np.shape(contact.sliding), self.level)


@dataclass(frozen=True)
class Lubricated(FrictionLaw):
    """A law of teeth in oil.

    Parameters
    ----------
    viscosity: nu, dynamic viscosity of the oil at the inlet, cP.
    roughness: S, of the surfaces, um.
    """

    viscosity: float
    roughness: float

    def __post_init__(self) -> None:
        _positive(self, "viscosity")
        _positive(self, "roughness", zero=True)


@dataclass(frozen=True)
class XuKahraman(Lubricated):
    """Regression of computed thermal elastohydrodynamic contacts.

        mu = exp(f) P^b2 |SR|^b3 V^b6 nu^b7 R^b8,   f = b1 + b4 |SR| P log10 nu + b5 exp(-|SR| P log10 nu) + b9 exp(S)

    with P in GPa, V the entrainment velocity in m/s, R in m.

    roughness: root mean square.

    Source: Xu & Kahraman 2007 (J. Mech. Des. 129, 58-68).
    """

    def coefficient(self, contact: ContactState) -> Array:
        b1, b2, b3, b4, b5, b6, b7, b8, b9 = XU_KAHRAMAN
        sr, p = np.abs(contact.slide_roll), contact.pressure * 1e-9
        heat = sr * p * np.log10(self.viscosity)
        f = b1 + b4 * heat + b5 * np.exp(-heat) + b9 * np.exp(self.roughness)
        lubricant = contact.entrainment**b6 * self.viscosity**b7 * contact.radius**b8
        return np.exp(f) * p**b2 * sr**b3 * lubricant


@dataclass(frozen=True)
class BenedictKelley(Lubricated):
    """mu = 0.0127 1.13/(1.13 - S) log10[29700 W/(nu |V_s| V_r^2)], W in N/mm, V_r = u1 + u2.

    The logarithm grows without bound at the pitch point; |V_s| counts as at least a hundredth of V_r. Never below 0.

    roughness: S < 1.13, arithmetic mean.

    Source: Benedict & Kelley 1961 (ASLE Trans. 4, 59-70), in SI units as He, Cho & Singh 2008.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.roughness < 1.13:
            raise NotPossible(f"roughness must lie below 1.13 um, not {self.roughness}")

    @property
    def kinks(self) -> tuple[float, ...]:
        return (-2 * LEAST_SLIDING, 2 * LEAST_SLIDING)

    def coefficient(self, contact: ContactState) -> Array:
        rolling = 2 * contact.entrainment
        sliding = np.maximum(np.abs(contact.sliding), LEAST_SLIDING * rolling)
        argument = 29700 * contact.load * 1e-3 / (self.viscosity * sliding * rolling**2)
        return np.maximum(0.0127 * 1.13 / (1.13 - self.roughness) * np.log10(np.maximum(argument, 1.0)), 0.0)


def _positive(owner: object, name: str, zero: bool = False) -> None:
    value = getattr(owner, name)
    if not (value >= 0 if zero else value > 0):
        raise NotPossible(f"{name} must be positive{' or 0' if zero else ''}, not {value}")


def sliding_sign(pair: Pair, s: Array | float) -> Array:
    """sigma at the contact s: -1 before the pitch point, 1 behind it, for a driving wheel the other way round."""
    return (-1.0 if pair.wheel_drives else 1.0) * np.sign(np.asarray(s) - pair.pitch_point)


def sliding_contact(pair: Pair, slide_roll: float) -> float:
    """s where the slide-roll ratio has this value, between -2 and 2; 0 is the pitch point."""
    velocities = (1 + slide_roll / 2) / (1 - slide_roll / 2)  # u1/u2
    return velocities * pair.length / (pair.ratio + pair.wheel.sign * velocities)


def contact_state(pair: Pair, s: Array | float, pinion_speed: float, force: Array | float) -> ContactState:
    """Velocities, curvature and pressure at the contact s under the normal force, at |pinion_speed| rad/s."""
    s = np.asarray(s, dtype=float)
    first = abs(pinion_speed) * s
    second = abs(pinion_speed) / pair.ratio * pair.wheel_arm(s)
    return ContactState(
        sliding=first - second,
        entrainment=(first + second) / 2,
        radius=1 / pair.curvature(s),
        pressure=contact_pressure(pair, s, force),
        load=np.asarray(force) / pair.face_width,
    )


@dataclass(frozen=True)
class MeshFriction:
    """The periodic functions of one mesh's friction; phase as of its stiffness, edges at entry, exit and pitch point.

    Parameters
    ----------
    length: L of u = (0, -L; t, -t), m.
    wheel_sign: of v = (1, wheel_sign; 0, 0).
    share, share_arm: sum sigma mu k_p/k and sum sigma mu s_p k_p/k, m: times the mesh stiffness k, with u g^T and
        v g^T, in K(t), and times the mesh damping in C(t); times a mesh force F, with -u and -v, the external force
        that friction is under that force.
    """

    length: float
    wheel_sign: int
    share: Piecewise
    share_arm: Piecewise

    def directions(self, t: Array) -> tuple[Array, Array]:
        """(u, v) in the coordinates (theta_1, theta_2, displacement of pinion, of wheel) for the unit vector t."""
        t, zero = np.asarray(t, dtype=float), np.zeros_like(t)
        u = np.concatenate([np.array([0.0, -self.length]), t, -t])
        return u, np.concatenate([np.array([1.0, float(self.wheel_sign)]), zero, zero])


def mesh_friction(
    pair: Pair, friction: FrictionLaw, pinion_speed: float, force: float, model: StiffnessModel = PLAIN
) -> MeshFriction:
    """The friction of a mesh at the pinion's speed (rad/s) under the mean mesh force (N, normal to the teeth).

    The coefficients are those of the static load shares. Raises NotPossible for a speed or force that is not positive,
    for helical teeth, and as :func:`~gearstab.gears.mesh_stiffness.mesh_stiffness`.
    """
    if not abs(pinion_speed) > 0 or not force > 0:
        message = f"friction needs a turning pinion and a positive force, not {pinion_speed} rad/s and {force} N"
        raise NotPossible(message)
    if pair.overlap_ratio > 0:
        hint = "remove friction, or make the gears of the mesh spur"
        raise NotPossible("friction between helical teeth is not computed", hint)
    c = pair.contact_ratio
    kinks = [pair.phase(sliding_contact(pair, ratio)) for ratio in friction.kinks]
    edges = np.sort([0.0, stiff_fraction(c), pair.pitch_phase, *kinks])

    degrees = np.shape(mesh_stiffness(pair, model).curve.coefficients)[-1] - 1
    x = nodes(edges, max(DEGREE, degrees))
    s, k = contact_stiffness(pair, x, model)
    share = k / np.sum(k, axis=-1)[..., None]
    carrying = share > 0
    # A pair out of contact counts as one at the pitch point, where every model is finite.
    state = contact_state(
        pair, np.where(carrying, s, pair.pitch_point), pinion_speed, force * np.where(carrying, share, 1.0)
    )
    resisting = sliding_sign(pair, s) * friction.coefficient(state) * share
    return MeshFriction(
        length=pair.length,
        wheel_sign=pair.wheel.sign,
        share=through(edges, np.sum(resisting, axis=-1)),
        share_arm=through(edges, np.sum(resisting * s, axis=-1)),
    )
