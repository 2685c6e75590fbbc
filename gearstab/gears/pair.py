"""Two gears in mesh: operating pressure angle, path of contact, contact ratio, and what a designer should know of them.

A planet is in mesh with a sun and an internal ring at one centre distance: profile shifts, and the lag between its
meshes.

Sources: ISO 21771 (2007); Colbourne 1987, *The Geometry of Involute Gears*; Parker & Lin 2004 (J. Mech. Des. 126,
365-370) for the definition of the lag, whose formulas are derived here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import acos, asin, cos, degrees, pi, sin, sqrt, tan

import numpy as np

from gearstab.errors import NotPossible
from gearstab.gears.geometry import Gear, inverse_involute, involute, tooth_profile, transverse_angle
from gearstab.waveforms.base import wrapped

Array = np.ndarray

LEAST_TOP_LAND = 0.3  # modules: Dudley 1962, Gear Handbook, for hardened teeth
LEAST_CLEARANCE = 0.1  # modules, between a tip and the root of its mate
ROUNDING = 1e-9  # relative to the module: below it a limit counts as met

CENTRE = 'change centre_distance, with its unit ("160 mm"), or the teeth'
"""Remedy for gears at a wrong distance."""
OVERLAP = 1e-3
"""Modules that flanks may overlap: tables of gears round profile shifts to three digits."""
DIGITS = 12
"""Decimals of a lag: teeth whose lag is 0 or 1/2 then have exactly that, so that the jumps of their waves coincide."""


@dataclass(frozen=True)
class Notice:
    """A condition that a designer should know: its ``number`` and ``limit``, and its part, pinion, wheel or pair.

    undercut: profile shift, and the least that keeps the involute whole (modules).
    interference: s where the tip of this gear would first touch its mate, and the tangent point it passes (metres).
    fillet_contact: the radius where contact begins, and that where this gear's fillet ends (metres).
    top_land, tip_clearance: modules.   contact_ratio: below 1.   backlash: negative (metres).
    trochoid_interference, trimming: of the tips of an internal pair, an angle that must not be negative (radians).
    """

    name: str
    part: str
    number: float
    limit: float

    def __str__(self) -> str:
        return f"{self.part}: {self.name.replace('_', ' ')} {self.number:.5g} (limit {self.limit:.5g})"


@dataclass(frozen=True)
class Pair:
    """Two gears in mesh; s is the distance along the line of action from T1, where it touches the pinion's base circle.

    Parameters
    ----------
    pinion, wheel: the pinion external; the wheel external or internal. Either may be the larger.
    centre_distance: metres; None: of the mesh without backlash.
    wheel_drives: contact then runs from the pinion's tip towards its root.

    Raises NotPossible for gears that cannot mesh: hands of helical gears are opposite, with an internal wheel equal.
    """

    pinion: Gear
    wheel: Gear
    centre_distance: float | None = None
    wheel_drives: bool = False

    def __post_init__(self) -> None:
        one, two = self.pinion, self.wheel
        if one.internal:
            raise NotPossible("the pinion must be an external gear")
        if wrong := _helices(one, two):
            raise NotPossible(*wrong)
        if abs(one.base_pitch / two.base_pitch - 1) > 1e-9:
            pitches = " and ".join(f"{gear.base_pitch:.6g} m of {gear.teeth} teeth" for gear in (one, two))
            raise NotPossible(f"the base pitches differ: {pitches}", "give both gears one module and pressure angle")
        if two.internal and two.teeth <= one.teeth:
            raise NotPossible(f"an internal gear needs more teeth than its pinion, not {two.teeth} with {one.teeth}")
        if self.centre_distance is not None and not self.centre_distance > self._bases:
            message = f"centre_distance {self.centre_distance:.6g} m must exceed {self._bases:.6g} m, base to base"
            raise NotPossible(message, CENTRE)
        if not self.path[1] > self.path[0]:
            raise NotPossible(f"the teeth do not reach each other at the centre distance {self.centre:.6g} m", CENTRE)

    @property
    def _bases(self) -> float:
        return self.wheel.base_radius + self.wheel.sign * self.pinion.base_radius

    @cached_property
    def pressure_angle(self) -> float:
        """alpha_w in operation: of the centre distance, or such that the teeth just fill the pitch."""
        if self.centre_distance is not None:
            return acos(self._bases / self.centre_distance)
        one, two = self.pinion, self.wheel
        # s_w1 + s_w2 = p_w, with s_w = 2 r_w (theta_b -+ inv alpha_w) and r_w proportional to z.
        excess = one.teeth * one.base_half_angle + two.teeth * two.base_half_angle - pi
        inv = excess / (one.teeth + two.sign * two.teeth)
        if not inv >= 0:
            raise NotPossible(
                f"no centre distance closes the backlash of profile shifts {one.profile_shift:g} and "
                f"{two.profile_shift:g}: give centre_distance"
            )
        return inverse_involute(inv)

    @property
    def centre(self) -> float:
        """a = (r_b2 +- r_b1)/cos alpha_w."""
        return self._bases / cos(self.pressure_angle) if self.centre_distance is None else self.centre_distance

    @property
    def pitch_radii(self) -> tuple[float, float]:
        """Radii of the pitch circles in operation, r_w = r_b/cos alpha_w."""
        c = cos(self.pressure_angle)
        return self.pinion.base_radius / c, self.wheel.base_radius / c

    @property
    def ratio(self) -> float:
        """z2/z1."""
        return self.wheel.teeth / self.pinion.teeth

    @property
    def base_pitch(self) -> float:
        """p_b, the distance of two contacts along the line of action."""
        return self.pinion.base_pitch

    @property
    def face_width(self) -> float:
        """Common to both."""
        return min(self.pinion.face_width, self.wheel.face_width)

    @cached_property
    def length(self) -> float:
        """L = a sin alpha_w = T1 T2."""
        return self.centre * sin(self.pressure_angle)

    @property
    def overlap_ratio(self) -> float:
        """eps_beta = b tan beta_b/p_b, base pitches of contact from one face to the other; 0 of spur gears."""
        return self.face_width * abs(tan(self.pinion.base_helix)) / self.base_pitch

    @property
    def total_contact_ratio(self) -> float:
        """eps_alpha + eps_beta."""
        return self.contact_ratio + self.overlap_ratio

    @property
    def pitch_point(self) -> float:
        """s of the pitch point, r_b1 tan alpha_w."""
        return self.pinion.base_radius * tan(self.pressure_angle)

    def wheel_arm(self, s: Array | float) -> Array:
        """Distance of the contact from T2, L - s, of an internal wheel L + s."""
        return self.length - self.wheel.sign * np.asarray(s)

    @cached_property
    def tip_contacts(self) -> tuple[float, float]:
        """s where the wheel's and the pinion's tip cross the line of action, if nothing stood in the way."""
        pinion = sqrt(self.pinion.tip_radius**2 - self.pinion.base_radius**2)
        wheel = sqrt(max(self.wheel.tip_radius**2 - self.wheel.base_radius**2, 0.0))
        return self.wheel.sign * (self.length - wheel), pinion

    @cached_property
    def path(self) -> tuple[float, float]:
        """(s_A, s_E), the path of contact, from the wheel's tip to the pinion's, clipped at the tangent points."""
        first, last = self.tip_contacts
        return max(first, 0.0), last if self.wheel.internal else min(last, self.length)

    @property
    def contact_ratio(self) -> float:
        """eps_alpha = (s_E - s_A)/p_b of the transverse section, of the clipped path with operating values."""
        return (self.path[1] - self.path[0]) / self.base_pitch

    def phase(self, s: float) -> float:
        """The phase of the mesh cycle, in [0, 1), at which a contact passes s; 0 is the entry of a pair."""
        travelled = self.path[1] - s if self.wheel_drives else s - self.path[0]
        return (travelled / self.base_pitch) % 1.0

    @property
    def pitch_phase(self) -> float:
        """The phase at which a contact passes the pitch point."""
        return self.phase(self.pitch_point)

    def contacts(self, x: Array | float) -> tuple[Array, Array]:
        """s of every pair that may be in contact at the phases x (in mesh periods), and which of them are.

        Shapes ``(..., N)`` with N = floor(c) + 1; the last index counts pairs from the one that entered last.
        """
        phase = wrapped(np.asarray(x, dtype=float))[..., None] + np.arange(int(self.contact_ratio) + 1)
        travelled = phase * self.base_pitch
        s = self.path[1] - travelled if self.wheel_drives else self.path[0] + travelled
        return s, phase < self.contact_ratio

    @property
    def tip_clearances(self) -> tuple[float, float]:
        """Clearances of the pinion's tip at the wheel's root, and of the wheel's tip at the pinion's root, metres."""
        one, two, sign = self.pinion, self.wheel, self.wheel.sign
        return (
            sign * (self.centre - two.root_radius) - one.tip_radius,
            sign * (self.centre - two.tip_radius) - one.root_radius,
        )

    @property
    def backlash(self) -> float:
        """Along the line of action, metres: what the centre distance leaves between the flanks."""
        one, two = self.pinion, self.wheel
        inv = involute(self.pressure_angle)
        thick = one.teeth * (one.base_half_angle - inv) + two.teeth * (two.base_half_angle - two.sign * inv)
        return (pi - thick) * self.base_pitch / pi

    def curvature(self, s: Array | float) -> Array:
        """1/rho_1 + 1/rho_2 of the flanks, 1/m (1/rho_2 < 0 on an internal wheel); infinite at T1 and T2."""
        with np.errstate(divide="ignore"):
            return 1 / np.asarray(s, dtype=float) + self.wheel.sign / self.wheel_arm(s)

    @cached_property
    def notices(self) -> tuple[Notice, ...]:
        """The conditions that this pair violates; empty for a sound one."""
        return (*_gear_notices(self), *_path_notices(self), *_fit_notices(self), *_internal_notices(self))


def _helices(one: Gear, two: Gear) -> tuple[str, str] | None:
    """Message and remedy for helices that do not fit together."""
    angles = [abs(degrees(gear.helix_angle)) for gear in (one, two)]
    if abs(angles[0] - angles[1]) > 1e-7:
        message = f"the helix angles differ: {angles[0]:.6g} and {angles[1]:.6g} deg"
        return message, "give both gears the same helix_angle"
    if angles[0] > 0 and (one.helix_angle > 0) != (two.helix_angle * two.sign < 0):
        hands = ["right" if gear.helix_angle > 0 else "left" for gear in (one, two)]
        rule = "opposite hands" if two.sign > 0 else "the same hand, as one of them is internal"
        message = f"helical gears in mesh must have {rule}, not {hands[0]} and {hands[1]}"
        return message, "change hand, or the sign of a helix_angle"
    return None


def _parts(pair: Pair) -> tuple[tuple[str, Gear], ...]:
    return (("pinion", pair.pinion), ("wheel", pair.wheel))


def _gear_notices(pair: Pair) -> list[Notice]:
    found = []
    for part, gear in _parts(pair):
        if not gear.internal and tooth_profile(gear).undercut:
            found.append(Notice("undercut", part, gear.profile_shift, gear.least_shift))
        if gear.top_land < LEAST_TOP_LAND * gear.module:
            found.append(Notice("top_land", part, gear.top_land / gear.module, LEAST_TOP_LAND))
    return found


def _path_notices(pair: Pair) -> list[Notice]:
    small = ROUNDING * pair.pinion.module
    (wheel_tip, pinion_tip), (first, last) = pair.tip_contacts, pair.path
    found = []
    if wheel_tip < -small:
        found.append(Notice("interference", "wheel", wheel_tip, 0.0))
    if not pair.wheel.internal and pinion_tip > pair.length + small:
        found.append(Notice("interference", "pinion", pinion_tip, pair.length))
    for part, gear, arm in (("pinion", pair.pinion, first), ("wheel", pair.wheel, pair.length - last)):
        if gear.internal:
            continue
        radius, form = sqrt(gear.base_radius**2 + arm**2), tooth_profile(gear).form_radius
        if radius < form - small:
            found.append(Notice("fillet_contact", part, radius, form))
    if pair.total_contact_ratio < 1:
        found.append(Notice("contact_ratio", "pair", pair.total_contact_ratio, 1.0))
    return found


def _fit_notices(pair: Pair) -> list[Notice]:
    module, small = pair.pinion.module, ROUNDING * pair.pinion.module
    found = [
        Notice("tip_clearance", part, clearance / module, LEAST_CLEARANCE)
        for (part, _), clearance in zip(_parts(pair), pair.tip_clearances, strict=True)
        if clearance < LEAST_CLEARANCE * module - small
    ]
    if pair.backlash < -small:
        found.append(Notice("backlash", "pair", pair.backlash, 0.0))
    return found


def _internal_notices(pair: Pair) -> list[Notice]:
    """Tips of an internal pair that meet off the line of action, and those that bar radial assembly."""
    if not pair.wheel.internal or pair.wheel.tip_radius <= pair.wheel.base_radius:
        return []
    one, two, a = pair.pinion, pair.wheel, pair.centre
    tip1, tip2 = one.tip_radius, two.tip_radius
    inv1 = involute(one.profile_angle(tip1)) - involute(pair.pressure_angle)
    inv2 = involute(two.profile_angle(tip2)) - involute(pair.pressure_angle)
    found = []
    if abs(tip2 - tip1) < a:  # the tip circles cross
        turn1 = acos((tip2**2 - tip1**2 - a**2) / (2 * a * tip1)) + inv1
        turn2 = acos((tip2**2 - tip1**2 + a**2) / (2 * a * tip2)) + inv2
        room = turn1 / pair.ratio - turn2
        if room < 0:
            found.append(Notice("trochoid_interference", "pair", room, 0.0))
    cosines = one.base_radius / tip1 * tip2 / two.base_radius
    side1 = (1 - cosines**2) / (1 - 1 / pair.ratio**2)
    side2 = (1 / cosines**2 - 1) / (pair.ratio**2 - 1)
    if 0 <= side1 <= 1 and 0 <= side2 <= 1:
        room = (asin(sqrt(side1)) + inv1) / pair.ratio - (asin(sqrt(side2)) + inv2)  # angles of the wheel
        if room < 0:
            found.append(Notice("trimming", "pair", room, 0.0))
    return found


@dataclass(frozen=True)
class PlanetSet:
    """A planet in mesh with a sun and a ring.

    sun, ring: sun and planet, planet and ring, at one centre distance; the wheels of both drive, or both pinions.

    Raises NotPossible where flanks overlap.
    """

    sun: Pair
    ring: Pair

    def __post_init__(self) -> None:
        for name, pair in (("sun", self.sun), ("ring", self.ring)):
            if pair.backlash < -OVERLAP * pair.pinion.module:
                raise NotPossible(
                    f"the teeth of planet and {name} overlap by {-pair.backlash:.4g} m at the centre distance "
                    f"{pair.centre:.6g} m",
                    "change centre_distance or profile_shift, or leave out the one that the others give",
                )

    @property
    def pitch_lag(self) -> float:
        """Return gamma_sr between the passages of the pitch points, in mesh periods from 0 to 1.

            gamma_sr = (z_p - 1)/2 - [4 x_p tan alpha_n + z_p (2 inv alpha_t - inv alpha_ws - inv alpha_wr)]/2 pi

        where the sun drives the planet, and the negative of it where the planet drives the sun: then the planet carries
        on its other flanks. Between both contacts it turns by half a turn less the halves of its teeth on both pitch
        circles in operation. (z_p + 1)/2 of standard teeth.
        """
        planet, at_sun, at_ring = self.sun.wheel, self.sun.pressure_angle, self.ring.pressure_angle
        alpha, z = planet.pressure_angle, planet.teeth
        halves = 4 * planet.profile_shift * tan(alpha)
        halves += z * (2 * involute(planet.transverse_angle) - involute(at_sun) - involute(at_ring))
        lag = (z - 1) / 2 - halves / (2 * pi)
        return _of_period(-lag if self.sun.wheel_drives else lag)

    @property
    def entry_lag(self) -> float:
        """Return gamma_sr between the entries of the teeth, where waves of the mesh stiffness begin.

        gamma_sr + (q_s - q_r)/p_b, with the lengths q from entry to pitch point along the lines of action.
        """
        return _of_period(self.pitch_lag + self.sun.pitch_phase - self.ring.pitch_phase)


def _of_period(lag: float) -> float:
    """The lag from 0 up to 1, to DIGITS."""
    return round(lag % 1, DIGITS) % 1


def halfway(module: float, sun: int, ring: int) -> float:
    """Return m_t (z_s + z_r)/4, halfway between the centre distances of standard teeth, which may differ, in metres."""
    return module * (sun + ring) / 4


def closing_shifts(
    teeth: Mapping[str, int],
    module: float,
    alpha: float,
    centre: float,
    given: Mapping[str, float],
    helix_angle: float = 0.0,
) -> dict[str, float]:
    """Return the profile shifts x of sun, planet and ring that leave no backlash at a centre distance (m).

        x_s + x_p = (z_s + z_p) (inv alpha_ws - inv alpha_t)/(2 tan alpha),
        x_r - x_p = (z_r - z_p) (inv alpha_wr - inv alpha_t)/(2 tan alpha)

    module, alpha: of the normal section. given: those that are known; of others sun and planet have equal shares.
    Raises NotPossible at a distance at which base circles touch.
    """

    alpha_t = transverse_angle(alpha, helix_angle)

    def closing(z: int) -> float:
        standard = module / cos(helix_angle) * z / 2
        base = standard * cos(alpha_t)
        if abs(centre - standard) < 1e-12 * standard:
            return 0.0
        if not centre > base:
            hint = "give another centre_distance"
            raise NotPossible(f"centre_distance {centre:.6g} m must exceed {base:.6g} m, base to base", hint)
        return z * (involute(acos(base / centre)) - involute(alpha_t)) / (2 * tan(alpha))

    both, between = closing(teeth["sun"] + teeth["planet"]), closing(teeth["ring"] - teeth["planet"])
    if "planet" in given:
        planet = given["planet"]
    elif "sun" in given:
        planet = both - given["sun"]
    else:
        planet = given["ring"] - between if "ring" in given else both / 2
    return {"sun": both - planet, "planet": planet, "ring": planet + between, **given}
