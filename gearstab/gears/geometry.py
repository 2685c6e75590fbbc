"""Involute geometry of one gear, spur or helical, external or internal: what the drawing says, and its teeth as cut.

Lengths are metres, angles radians; what the rack gives is in normal modules. Radii, arcs and angles of the involute are
those of the transverse section, where a helical gear is a spur gear of the module m_n/cos beta with the same heights.

Sources: ISO 21771 (2007); Colbourne 1987, *The Geometry of Involute Gears*; Litvin & Fuentes 2004, *Gear Geometry and
Applied Theory*.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import acos, atan, cos, pi, sin, sqrt, tan

import numpy as np

from gearstab.errors import NotPossible

Array = np.ndarray


def involute(angle: float) -> float:
    """Inv alpha = tan alpha - alpha."""
    return tan(angle) - angle


def inverse_involute(value: float) -> float:
    """The angle whose involute is ``value`` >= 0, to rounding (Newton's method from a starting value below or near it).

    Raises NotPossible for a negative value: no pressure angle has it.
    """
    if not value >= 0:
        raise NotPossible(f"no pressure angle has the involute {value:.6g}: it must not be negative")
    angle = min((3 * value) ** (1 / 3), 1.4)
    for _ in range(60):
        step = (tan(angle) - angle - value) / max(tan(angle) ** 2, 1e-300)
        angle = min(max(angle - step, angle / 4), (angle + pi / 2) / 2)
        if abs(step) < 1e-16:
            break
    return angle


MOST_HELIX = pi / 3
"""Helix angle (radians) beyond any cylindrical gear's."""


def transverse_angle(pressure_angle: float, helix_angle: float) -> float:
    """alpha_t of the transverse section, tan alpha_t = tan alpha_n/cos beta."""
    return pressure_angle if helix_angle == 0 else atan(tan(pressure_angle) / cos(helix_angle))


@dataclass(frozen=True)
class Gear:
    """One gear, cut by a rack of the given basic profile (an internal gear: conjugate to one so cut).

    Parameters
    ----------
    teeth: z > 0, also of an internal gear.
    module, face_width: m (normal to the teeth, m_n), b in metres.
    pressure_angle: alpha of the rack (normal, alpha_n), radians.
    helix_angle: beta on the reference circle, radians: positive of a right-handed gear, negative of a left-handed one.
    profile_shift: x in modules; positive pushes the flanks outwards, also on an internal gear.
    addendum, dedendum: h_aP, h_fP of the rack in modules.
    rack_tip_radius: rho_fP in modules; None: the largest that leaves the addendum line of the mate untouched,
        c/(1 - sin alpha) with c = dedendum - addendum, or a full rounding where that is smaller. A circle of this
        radius rounds the tip in the transverse section too. An internal gear has sharp roots.
    tip_shortening: in modules, taken off the tip.
    bore_radius: metres, where the body is held; of an internal gear, the outside of its rim. None: 0.4 root radii, and
        a rigid rim of an internal gear, whose body ends at 1.2.
    young, poisson, density: of the material; steel.

    Raises NotPossible for what can be no gear.
    """

    teeth: int
    module: float
    pressure_angle: float = pi / 9
    profile_shift: float = 0.0
    addendum: float = 1.0
    dedendum: float = 1.25
    rack_tip_radius: float | None = None
    tip_shortening: float = 0.0
    face_width: float = 0.02
    bore_radius: float | None = None
    young: float = 206.8e9
    poisson: float = 0.3
    density: float = 7850.0
    internal: bool = False
    helix_angle: float = 0.0

    def __post_init__(self) -> None:
        if self.teeth < 3 or self.teeth != int(self.teeth):
            raise NotPossible(f"teeth must be a whole number of at least 3, not {self.teeth}")
        for name in ("module", "face_width", "young", "density"):
            if not getattr(self, name) > 0:
                raise NotPossible(f"{name} must be positive, not {getattr(self, name)}")
        if not 0 < self.pressure_angle < pi / 4:
            raise NotPossible(f"pressure_angle must lie between 0 and 45 degrees, not {self.pressure_angle * 180 / pi}")
        if not abs(self.helix_angle) < MOST_HELIX:
            raise NotPossible(f"helix_angle must lie within 60 degrees, not {self.helix_angle * 180 / pi}")
        if not -1 < self.poisson < 0.5:
            raise NotPossible(f"poisson must lie between -1 and 0.5, not {self.poisson}")
        if not self.height > 0:
            raise NotPossible(f"the tip (radius {self.tip_radius:.6g} m) does not rise above the root")
        if not self.internal and not self.tip_radius > self.base_radius:
            raise NotPossible(f"no involute: the tip (radius {self.tip_radius:.6g} m) lies inside the base circle")
        if not self.root_radius > 0:
            message = f"the root radius {self.root_radius:.6g} m is not positive: too few teeth or too deep a cut"
            raise NotPossible(message)
        if not self.full_rounding >= 0:
            raise NotPossible(f"a rack of this pressure angle has no tooth as deep as dedendum {self.dedendum} modules")
        if not self.rounding >= 0 or self.rounding > self.full_rounding * (1 + 1e-12):
            message = f"rack_tip_radius must lie between 0 and {self.full_rounding:.6g} modules (full rounding)"
            raise NotPossible(message)
        if not self.top_land > 0:
            thickness = self.top_land / self.module
            raise NotPossible(f"pointed teeth: at the tip they would be {thickness:.4g} modules thick")
        inside, outside = (self.root_radius, self.bore) if self.internal else (self.bore, self.root_radius)
        if not 0 <= inside < outside:
            side = "outside of" if self.internal else "inside"
            message = f"bore_radius {self.bore:.6g} m must lie {side} the root circle, {self.root_radius:.6g} m"
            raise NotPossible(message)

    @property
    def sign(self) -> int:
        """1 where radii grow from root to tip, -1 for an internal gear."""
        return -1 if self.internal else 1

    @property
    def transverse_module(self) -> float:
        """m_t = m_n/cos beta."""
        return self.module / cos(self.helix_angle)

    @property
    def transverse_angle(self) -> float:
        """alpha_t: see :func:`transverse_angle`."""
        return transverse_angle(self.pressure_angle, self.helix_angle)

    @property
    def base_helix(self) -> float:
        """beta_b, tan beta_b = tan beta cos alpha_t, with the sign of beta."""
        return atan(tan(self.helix_angle) * cos(self.transverse_angle))

    @property
    def radius(self) -> float:
        """Radius of the reference circle, r = m_t z/2."""
        return self.transverse_module * self.teeth / 2

    @property
    def base_radius(self) -> float:
        """r_b = r cos alpha_t."""
        return self.radius * cos(self.transverse_angle)

    @property
    def tip_radius(self) -> float:
        """r_a = r + m (x + h_a - k), internal r + m (x - h_a + k)."""
        return self.radius + self.module * (self.profile_shift + self.sign * (self.addendum - self.tip_shortening))

    @property
    def root_radius(self) -> float:
        """r_f = r + m (x - h_f), internal r + m (x + h_f)."""
        return self.radius + self.module * (self.profile_shift - self.sign * self.dedendum)

    @property
    def height(self) -> float:
        """Height of the tooth, from root to tip."""
        return self.sign * (self.tip_radius - self.root_radius)

    @property
    def bore(self) -> float:
        """The radius at which the body is held: of the bore, or of the outside of the rim."""
        default = 1.2 if self.internal else 0.4
        return default * self.root_radius if self.bore_radius is None else self.bore_radius

    @property
    def base_pitch(self) -> float:
        """p_b = pi m_t cos alpha_t, the distance of two pairs along the transverse line of action."""
        return pi * self.transverse_module * cos(self.transverse_angle)

    @property
    def full_rounding(self) -> float:
        """The largest rounding the tip of the rack has room for, in modules: that of a tip without flat."""
        alpha = self.pressure_angle
        return (pi / 4 - self.dedendum * tan(alpha)) * cos(alpha) / (1 - sin(alpha))

    @property
    def rounding(self) -> float:
        """rho_fP in modules, as given or by default (see the class)."""
        if self.rack_tip_radius is not None:
            return self.rack_tip_radius
        return min(max(self.dedendum - self.addendum, 0.0) / (1 - sin(self.pressure_angle)), self.full_rounding)

    @property
    def base_half_angle(self) -> float:
        """Half the angle of the tooth where its involutes meet the base circle, s/2r + inv alpha_t (internal: -)."""
        return pi / (2 * self.teeth) + self.sign * (
            2 * self.profile_shift * tan(self.pressure_angle) / self.teeth + involute(self.transverse_angle)
        )

    def profile_angle(self, radius: float) -> float:
        """alpha(r) of the involute, cos alpha(r) = r_b/r. Raises NotPossible inside the base circle."""
        if radius < self.base_radius * (1 - 1e-12):
            raise NotPossible(f"radius {radius:.6g} m lies inside the base circle, {self.base_radius:.6g} m")
        return acos(min(self.base_radius / radius, 1.0))

    def thickness(self, radius: float) -> float:
        """Return the thickness of the tooth along the arc of that radius, between its involutes; negative beyond their
        point.
        """
        return 2 * radius * (self.base_half_angle - self.sign * involute(self.profile_angle(radius)))

    @property
    def top_land(self) -> float:
        """Thickness at the tip, metres."""
        return self.thickness(max(self.tip_radius, self.base_radius))

    @property
    def least_shift(self) -> float:
        """The profile shift below which the rack undercuts, x = h - r sin^2(alpha_t)/m; h: depth of its straight flank.

        With the usual rounding h = h_aP and x = (17.097 - z)/17.097 at 20 degrees. Not for internal gears.
        """
        return self.straight_depth - self.radius / self.module * sin(self.transverse_angle) ** 2

    @property
    def straight_depth(self) -> float:
        """Depth below the reference line, in modules, to which the flank of the rack is straight."""
        return self.dedendum - self.rounding * (1 - sin(self.transverse_angle))


NODES = 40  # of Gauss quadrature on the fillet and on the flank, both analytic: rounding is reached with about 25
SCAN = 400  # points on which the end of an undercut fillet is bracketed


@dataclass(frozen=True)
class ToothProfile:
    """Fillet, as a rack with rounded tip cuts it, and involute of one external gear.

    The tooth stands on the axis x = 0 of its own frame, y pointing outwards from the gear's centre; the half angle of
    the tooth at the radius r is that between its axis and its flank. The rounding of the rack's tip, a circle of radius
    rho about a point at the depth h below the pitch line, touches the fillet where the normal, inclined by gamma to the
    pitch line, passes through the pitch point; the fillet is followed in gamma, from pi/2 at the root circle to alpha,
    where the rack's straight flank takes over.

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
