"""The flank of a tooth, and the fillet of an external one as a rack with rounded tip cuts it.

The tooth stands on the axis x = 0 of its own frame, y pointing outwards from the gear's centre; the half angle of the
tooth at the radius r is that between its axis and its flank. The rounding of the rack's tip, a circle of radius
rho about a point at the depth h below the pitch line, touches the fillet where the normal, inclined by gamma to the
pitch line, passes through the pitch point; the fillet is followed in gamma, from pi/2 at the root circle to alpha,
where the rack's straight flank takes over.

Sources: Colbourne 1987, *The Geometry of Involute Gears*; Litvin & Fuentes 2004, *Gear Geometry and Applied Theory*.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi, sin, sqrt, tan

import numpy as np

from gearstab.errors import NotPossible
from gearstab.gears.geometry import Gear

Array = np.ndarray

NODES = 40  # of Gauss quadrature on the fillet and on the flank, both analytic: rounding is reached with about 25
SCAN = 400  # points on which the end of an undercut fillet is bracketed


@dataclass(frozen=True)
class ToothProfile:
    """Fillet and involute of one external gear.

    Parameters
    ----------
    gear: external.
    fillet_end: gamma where the involute begins; alpha unless undercut.
    form_roll: tan of the profile angle there, the involute's roll angle.
    undercut: whether the fillet cuts into the involute.
    """

    gear: Gear
    fillet_end: float
    form_roll: float
    undercut: bool

    @property
    def form_radius(self) -> float:
        """Radius at which the fillet ends and the involute begins."""
        return self.gear.base_radius * sqrt(1 + self.form_roll**2)

    @property
    def tip_roll(self) -> float:
        """tan of the profile angle at the tip."""
        return sqrt((self.gear.tip_radius / self.gear.base_radius) ** 2 - 1)

    @property
    def root_half_angle(self) -> float:
        """Half the angle of the tooth at the root circle, where the fillet begins."""
        x, y, _, _ = _fillet(self.gear, pi / 2)
        return float(np.arctan2(x, y))

    def fillet(self, gamma: Array | float) -> tuple[Array, Array, Array, Array]:
        """(x, y, dx/dgamma, dy/dgamma) on the fillet."""
        return _fillet(self.gear, gamma)

    def involute(self, roll: Array | float) -> tuple[Array, Array, Array, Array]:
        """(x, y, dx/droll, dy/droll) on the involute; roll = tan of the profile angle."""
        return flank(self.gear, roll)

    def outline(self, points: int = 60) -> tuple[Array, Array]:
        """(x, y) along one side of the tooth, root to tip, ``points`` each on the fillet and on the involute."""
        low = self.fillet(np.linspace(pi / 2, self.fillet_end, points))
        high = self.involute(np.linspace(self.form_roll, self.tip_roll, points))
        return np.concatenate([low[0], high[0]]), np.concatenate([low[1], high[1]])


def flank(gear: Gear, roll: Array | float) -> tuple[Array, Array, Array, Array]:
    """(x, y, dx/droll, dy/droll) on the involute of an external or internal tooth; roll = tan of the profile angle."""
    roll = np.asarray(roll, dtype=float)
    # The string unwound by ``roll`` leaves the base circle at the angle ``turn`` to the tooth's axis.
    turn, rb, along = gear.base_half_angle - gear.sign * roll, gear.base_radius, gear.sign * roll
    s, c = np.sin(turn), np.cos(turn)
    return rb * (s + along * c), rb * (c - along * s), rb * roll * s, rb * roll * c


def _fillet(gear: Gear, gamma: Array | float) -> tuple[Array, Array, Array, Array]:
    gamma = np.asarray(gamma, dtype=float)
    alpha, r = gear.transverse_angle, gear.radius
    rho = gear.rounding * gear.module
    centre_depth = gear.dedendum * gear.module - rho  # of the rounding below the rack's reference line
    side = pi * gear.transverse_module / 4 - centre_depth * tan(alpha) - rho / cos(alpha)
    depth = centre_depth - gear.profile_shift * gear.module
    # In the frame of the space between two teeth, with the rack's rounding ``ahead`` of the pitch point.
    ahead, ahead_rate = depth / np.tan(gamma), -depth / np.sin(gamma) ** 2
    u, v = ahead + rho * np.cos(gamma), r - depth - rho * np.sin(gamma)
    u_rate, v_rate = ahead_rate - rho * np.sin(gamma), -rho * np.cos(gamma)
    turn, turn_rate = pi / gear.teeth + (ahead - side) / r, ahead_rate / r
    s, c = np.sin(turn), np.cos(turn)
    x, y = s * v - c * u, c * v + s * u
    return x, y, s * v_rate - c * u_rate + y * turn_rate, c * v_rate + s * u_rate - x * turn_rate


@lru_cache(maxsize=4096)
def tooth_profile(gear: Gear) -> ToothProfile:
    """The profile that the rack cuts, undercut or not.

    Raises NotPossible for an internal gear (no rack cuts it), and where the cut leaves no involute below the tip.
    """
    if gear.internal:
        raise NotPossible("an internal gear has no fillet cut by a rack")
    alpha = gear.transverse_angle
    straight = gear.straight_depth - gear.profile_shift
    roll = tan(alpha) - straight * gear.module / (gear.radius * sin(alpha) * cos(alpha))
    end, undercut = alpha, roll < -1e-12
    if undercut:
        end, roll = _undercut(gear)
    profile = ToothProfile(gear, end, max(roll, 0.0), undercut)
    if not profile.form_radius < gear.tip_radius:
        raise NotPossible(f"a gear of {gear.teeth} teeth cut so deep has no involute below its tip")
    return profile


def _undercut(gear: Gear) -> tuple[float, float]:
    """(gamma, roll) where an undercut fillet, followed from the root, first comes out on the involute."""

    def gap(gamma: Array | float) -> Array:
        x, y, _, _ = _fillet(gear, gamma)
        radius, half = np.hypot(x, y), np.arctan2(x, y)
        roll = np.sqrt(np.maximum((radius / gear.base_radius) ** 2 - 1, 0.0))
        flank = gear.base_half_angle - (roll - np.arctan(roll))
        return np.where(radius < gear.base_radius, -1.0, half - flank)

    gamma = np.linspace(pi / 2, gear.transverse_angle, SCAN)
    outside = np.flatnonzero(gap(gamma) > 0)
    if not len(outside) or outside[0] == 0:
        raise NotPossible(f"the cut of a gear of {gear.teeth} teeth leaves no flank")
    from scipy.optimize import brentq

    found = brentq(lambda g: float(gap(g)), gamma[outside[0]], gamma[outside[0] - 1], xtol=1e-15)
    radius = float(np.hypot(*_fillet(gear, found)[:2]))
    return found, sqrt(max((radius / gear.base_radius) ** 2 - 1, 0.0))
