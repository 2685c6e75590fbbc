"""A planet between a sun and an internal ring at one centre distance: profile shifts, and the lag between its meshes.

Sources: ISO 21771 (2007) for the shifts; Parker & Lin 2004 (J. Mech. Des. 126, 365-370) for the definition of the lag;
its formulas derived here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import acos, cos, pi, tan

from gearstab.errors import NotPossible
from gearstab.gears.geometry import involute, transverse_angle
from gearstab.gears.pair import Pair

OVERLAP = 1e-3
"""Modules that flanks may overlap: tables of gears round profile shifts to three digits."""
DIGITS = 12
"""Decimals of a lag: teeth whose lag is 0 or 1/2 then have exactly that, so that the jumps of their waves coincide."""


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
