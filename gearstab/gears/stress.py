"""Load sharing, stress at the root of the teeth and pressure between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, sin

import numpy as np

from gearstab.gears.geometry import Gear, tooth_profile
from gearstab.gears.mesh_stiffness import PLAIN, StiffnessModel, contact_stiffness
from gearstab.gears.pair import Pair

Array = np.ndarray

TANGENT = pi / 6  # of the critical section's tangent to the tooth's axis
STEP = 1e-5  # of the fillet's parameter, for its curvature: 1e-9 relative


def load_shares(pair: Pair, x: Array | float, model: StiffnessModel = PLAIN) -> tuple[Array, Array]:
    """(s, share) of every pair of spur teeth at the phases x, ``(..., N)`` each; shares add up to 1."""
    s, k = contact_stiffness(pair, x, model)
    return s, k / np.sum(k, axis=-1, keepdims=True)


@dataclass(frozen=True)
class CriticalSection:
    """Where a tangent at 30 degrees to the tooth's axis touches the fillet (ISO 6336-3).

    Parameters
    ----------
    thickness: s_Fn, of the tooth there.
    height: of the section above the gear's centre.
    radius: rho_F, of the fillet's curvature there.
    """

    thickness: float
    height: float
    radius: float


@lru_cache(maxsize=4096)
def critical_section(gear: Gear) -> CriticalSection:
    """Return the critical section of an external gear's tooth. Where the whole fillet is steeper, its end on the
    involute counts.
    """
    from scipy.optimize import brentq

    profile = tooth_profile(gear)

    def lean(gamma: float) -> float:
        _, _, dx, dy = profile.fillet(gamma)
        return float(dx * cos(TANGENT) + dy * sin(TANGENT))

    gammas = np.linspace(pi / 2, profile.fillet_end, 64)
    _, _, dx, dy = profile.fillet(gammas)
    # Followed from the root, x falls faster than y rises, then slower; d/dgamma runs the other way.
    steep = np.flatnonzero(dx * cos(TANGENT) + dy * sin(TANGENT) < 0)
    if len(steep) and steep[0] > 0:
        gamma = brentq(lean, gammas[steep[0]], gammas[steep[0] - 1], xtol=1e-14)
    else:
        gamma = profile.fillet_end
    x, y, dx, dy = profile.fillet(gamma)
    after, before = profile.fillet(gamma + STEP), profile.fillet(gamma - STEP)
    ddx, ddy = (after[2] - before[2]) / (2 * STEP), (after[3] - before[3]) / (2 * STEP)
    return CriticalSection(2 * float(x), float(y), float(np.hypot(dx, dy) ** 3 / abs(dx * ddy - dy * ddx)))


def root_stress_factors(gear: Gear, roll: Array | float) -> tuple[Array, Array]:
    """Form factor Y_F and stress correction factor Y_S for a load at the involute points of the given roll angles.

        Y_F = 6 (h_F/m) cos beta / [(s_Fn/m)^2 cos alpha]
        Y_S = (1.2 + 0.13 L) q_s^[1/(1.21 + 2.3/L)],    L = s_Fn/h_F,   q_s = s_Fn/(2 rho_F)

    h_F is the height over the critical section at which the force crosses the tooth's axis. A load that crosses it
    below the section does not bend it: both factors are 0. Y_S was fitted for 1 <= q_s < 8.

    Source: ISO 6336-3:2006, method B; there for the load at the outer point of single pair contact.
    """
    section, roll = critical_section(gear), np.asarray(roll, dtype=float)
    beta = roll - gear.base_half_angle
    arm = gear.base_radius / np.cos(beta) - section.height
    bends = arm > 0
    arm = np.where(bends, arm, 1.0)
    form = 6 * arm * gear.module * np.cos(beta) / (section.thickness**2 * cos(gear.pressure_angle))
    slender = section.thickness / arm
    notch = section.thickness / (2 * section.radius)
    correction = (1.2 + 0.13 * slender) * notch ** (1 / (1.21 + 2.3 / slender))
    return np.where(bends, form, 0.0), np.where(bends, correction, 0.0)


def root_stress(
    gear: Gear, roll: Array | float, force: Array | float, face_width: float | None = None, notch: bool = True
) -> Array:
    """Stress at the root of a tooth that carries the normal force F, Pa; NaN for an internal or a helical gear.

    With ``notch``, that of ISO 6336-3, sigma_F0 = F cos alpha/(b m) Y_F Y_S. Without, the nominal stress on the loaded
    side of the same section, bending less compression: F [6 h_F cos beta/s_Fn^2 - sin beta/s_Fn]/b.
    """
    roll = np.asarray(roll, dtype=float)
    if gear.internal or gear.helix_angle:
        return np.full(np.broadcast_shapes(roll.shape, np.shape(force)), np.nan)
    form, correction = root_stress_factors(gear, roll)
    b = gear.face_width if face_width is None else face_width
    bending = cos(gear.pressure_angle) / gear.module * form
    if not notch:
        compression = np.sin(roll - gear.base_half_angle) / critical_section(gear).thickness
        return np.asarray(force) / b * (bending - compression)
    return np.asarray(force) / b * bending * correction


def mesh_root_stress(
    pair: Pair, x: Array | float, force: Array | float, model: StiffnessModel = PLAIN, notch: bool = True
) -> tuple[Array, Array]:
    """Root stress (Pa) of pinion and wheel, of every pair of teeth at the phases x, ``(..., N)`` each.

    ``force``: of the mesh, N, of the shape of x, or one that broadcasts against it; a dynamic mesh force may be given.
    ``notch``: as in :func:`root_stress`.
    """
    s, share = load_shares(pair, x, model)
    carried = np.asarray(force)[..., None] * share
    s = np.clip(s, *pair.path)
    arms = ((pair.pinion, s), (pair.wheel, pair.wheel_arm(s)))
    pinion, wheel = (root_stress(gear, arm / gear.base_radius, carried, pair.face_width, notch) for gear, arm in arms)
    return pinion, wheel


def contact_pressure(pair: Pair, s: Array | float, force: Array | float) -> Array:
    """Largest Hertz pressure between two teeth, sqrt[F/(pi b) (1/rho_1 + 1/rho_2)/sum((1 - nu^2)/E)], Pa.

    Source: Johnson 1985, *Contact Mechanics*, (4.45). Infinite at a tangent point.
    """
    parts = sum((1 - gear.poisson**2) / gear.young for gear in (pair.pinion, pair.wheel))
    return np.sqrt(np.asarray(force) / (pi * pair.face_width) * pair.curvature(s) / parts)
