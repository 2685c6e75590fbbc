"""Parts of a planetary gear: sections of its bodies, meshes, teeth and carrier speed, and how they turn and lag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import tau
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from pydantic import Field

from gearstab.config.document import Document
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import (
    Choice,
    Flag,
    Length,
    Mass,
    Number,
    Quantity,
    Ratio,
    Section,
    Stiffness,
    ToothCount,
    Turns,
    Whole,
    optional,
)
from gearstab.config.model.reading import known, told
from gearstab.system import Array
from gearstab.systems.kinematics import MeshMotion, Relation, solve
from gearstab.systems.mesh import StiffnessOfTeeth, ToothMesh
from gearstab.systems.planetary.planets import angles_of

HARMONICS = 12
"""Default of J. Natural frequencies converge as J^-3: of a gear as in Parker (2009, Table 1) with 3 to 8 planets
the first nine are within 4e-5 of their limits with 8, 1.1e-5 with 12, 4e-6 with 16 and 2e-6 with 20, relative."""
MOST_HARMONICS = 200
SENSES = ("counter-clockwise", "clockwise")
RULES = {"entry": "from entry to entry", "pitch_point": "from pitch point to pitch point"}
"""Between what the ring's mesh of a planet lags its sun's mesh."""
DRIVES = ("sun", "planet")
"""Which of both gears drives in the sun's meshes."""
FROM_TEETH = "from_teeth"
"""Written in place of the speed of the carrier: as the teeth, input and fixed body say."""

Support = Annotated[float, Field(ge=0), Quantity("N/m")]
BodyForce = Annotated[float, Quantity("N", entry=True)]
PressureAngle = Annotated[float, Field(gt=-1.5, lt=1.5), Quantity("rad")]


class Ring(Section):
    """The ring gear: a rigid body, or a thin ring that bends in its plane without stretching."""

    kind: Annotated[str, Choice("kind of ring", ("rigid", "elastic"))] = Field(title="kind of ring")
    """rigid, or elastic: it bends in its plane (Parker 2009)."""
    harmonics: Annotated[int, Field(ge=2, le=MOST_HARMONICS), Whole] = Field(
        default=HARMONICS, title="harmonics of the ring's deflection"
    )
    """J: the elastic deflection has 2 to J waves around an elastic ring."""
    bending_stiffness: Stiffness | None = optional("bending stiffness of the ring")
    """k_bend = E J/(R^3 (1 - nu^2)) of an elastic ring (N/m)."""


class Masses(Section):
    """Masses of the bodies."""

    ring: Mass | None = optional("mass of the ring")
    """m_r (kg); from gears without."""
    carrier: Mass | None = optional("mass of the carrier")
    """m_c, for planar motion (kg)."""
    sun: Mass | None = optional("mass of the sun")
    """m_s, for planar motion (kg)."""
    planet: Mass | None = optional("mass of a planet")
    """m_p, of each planet (kg); from gears without."""


class Inertias(Section):
    """Moments of inertia over squared base radii, of the carrier over that of the planets' centres."""

    ring: Mass | None = optional("inertia of the ring")
    """I_r/r_r^2 (kg); m_r/cos^2 of the ring's pressure angle, a thin rim at the pitch radius, without."""
    carrier: Mass | None = optional("inertia of the carrier")
    """I_c/r_c^2, r_c where the planets' centres are (kg); required."""
    sun: Mass | None = optional("inertia of the sun")
    """I_s/r_s^2 (kg); from gears without."""
    planet: Mass | None = optional("inertia of a planet")
    """I_p/r_p^2, of each planet (kg); from gears without."""


class Supports(Section):
    """Stiffness of the supports; a body without one is free."""

    carrier: Support = Field(default=0.0, title="support of the carrier")
    """k_c, in every direction of the plane (N/m)."""
    sun: Support = Field(default=0.0, title="support of the sun")
    """k_s, in every direction of the plane (N/m)."""
    planet: Support | None = optional("planet bearing")
    """k_p, between each planet and the carrier, in every direction, for planar motion (N/m)."""
    carrier_rotation: Support = Field(default=0.0, title="rotational support of the carrier")
    """k_cu, torsional stiffness over r_c^2 (N/m)."""
    sun_rotation: Support = Field(default=0.0, title="rotational support of the sun")
    """k_su, torsional stiffness over r_s^2 (N/m)."""
    ring: Support | None = optional("support of the ring")
    """k_r of a rigid ring, in every direction of the plane (N/m)."""
    ring_rotation: Support | None = optional("rotational support of the ring")
    """k_ru of a rigid ring, torsional stiffness over r_r^2 (N/m)."""
    ring_radial: Support = Field(default=0.0, title="radial foundation of the ring")
    """k_rbs R: radial stiffness per radian of the ring's circumference (N/m)."""
    ring_tangential: Support = Field(default=0.0, title="tangential foundation of the ring")
    """k_rus R: tangential stiffness per radian of the ring's circumference (N/m)."""


class PressureAngles(Section):
    """Pressure angles; negative ones for load on the other flanks."""

    sun: PressureAngle | None = optional("pressure angle of the sun's meshes")
    """alpha_s; in rad, or with a unit: "24.6 deg"."""
    ring: PressureAngle | None = optional("pressure angle of the ring's meshes")
    """alpha_r; in rad, or with a unit: "24.6 deg"."""


class BodyLoad(Section):
    """Constant torques on the bodies on the axis, over their base radius, of the carrier over that of the planets."""

    ring: BodyForce = Field(default=0.0, title="load of the ring")
    """Torque on the ring over r_r (N)."""
    carrier: BodyForce = Field(default=0.0, title="load of the carrier")
    """Torque on the carrier over r_c (N)."""
    sun: BodyForce = Field(default=0.0, title="load of the sun")
    """Torque on the sun over r_s (N)."""


class PlanetaryMesh(ToothMesh, StiffnessOfTeeth):
    """The meshes of the sun, or of the ring, with the planets: all alike but for their phases."""

    misplaced: ClassVar[dict[str, str]] = {
        "name": "the meshes are called sun1, sun2, ... and ring1, ring2, ...",
        "lag": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phase": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phasing": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
    }


class Meshes(Section):
    """Both kinds of meshes."""

    sun: PlanetaryMesh = Field(title="sun's meshes")
    """Each planet with the sun."""
    ring: PlanetaryMesh = Field(title="ring's meshes")
    """Each planet with the ring."""


class Phases(Section):
    """Mesh phases, as lags in periods of the mesh."""

    sun: list[Turns] | None = optional("phase of a sun's mesh")
    """gamma_sn, one per planet, of the waves of the sun's meshes (1); all 0, in phase, without."""
    sun_ring: Turns | None = optional("phase of the ring's meshes")
    """gamma_sr: the ring's mesh of a planet lags its sun's mesh by this (1); 0 or from teeth without."""
    rule: Annotated[str, Choice("rule", tuple(RULES))] | None = optional("rule of the ring's lag")
    """With teeth: gamma_sr from entry to entry, the default with gears, or from pitch_point to pitch_point, without."""
    drives: Annotated[str, Choice("driving gear", DRIVES)] | None = optional("driving gear")
    """With teeth: which gear drives in the sun's meshes; it follows from input and fixed without."""


Teeth = Annotated[ToothCount, Field(ge=4)]


class ProfileShifts(Section):
    """Profile shifts, in modules; positive ones push the flanks outwards, on the ring too."""

    sun: Number | None = optional("profile shift of the sun")
    """x_s (1)."""
    planet: Number | None = optional("profile shift of a planet")
    """x_p (1)."""
    ring: Number | None = optional("profile shift of the ring")
    """x_r; gear programs often print its negative (1)."""


class TipRadii(Section):
    """Radii of the tips."""

    sun: Length | None = optional("tip radius of the sun")
    """r_as (m)."""
    planet: Length | None = optional("tip radius of a planet")
    """r_ap (m)."""
    ring: Length | None = optional("tip radius of the ring")
    """r_ar, inside (m)."""


class ToothNumbers(Section):
    """Tooth numbers, from which the mesh phases follow; with gears, what else the teeth depend on."""

    sun: Teeth = Field(title="teeth of the sun")
    """z_s."""
    planet: Teeth = Field(title="teeth of a planet")
    """z_p."""
    ring: Teeth = Field(default=cast(Any, None), title="teeth of the ring")
    """z_r, z_s + 2 z_p without; others by profile shift. (z_s + z_r)/planets is whole for equal angles."""
    centre_distance: Length | None = None
    """a, with gears: of planet and axis (m); that of the profile shifts of sun and planet, else m (z_s + z_r)/4
    without."""
    profile_shift: ProfileShifts | None = optional("profile shifts")
    """With gears (1); such as close the backlash at the centre distance without."""
    tip_radius: TipRadii | None = optional("tip radii")
    """With gears (m); of addendum and profile shift without, on sun and planets cut back for clearance."""


@dataclass(frozen=True)
class Turning:
    """Speeds over that of the input, and where the power goes.

    cycles: teeth that mesh in a turn of the input. planets_turn: 1 where planets turn counter-clockwise on the carrier,
    -1 clockwise. sun_drives: whether power goes from the sun to the planets, seen from the carrier. torque: sign of
    the torque on the sun, counter-clockwise positive. carrier: W_c/Omega, counter-clockwise positive.

    Source: Willis' equation, z_s (w_s - w_c) = -z_p (w_p - w_c) = -z_r (w_r - w_c), and virtual work, which makes the
    torques on sun, ring and carrier go as z_s : z_r : -(z_s + z_r).
    """

    cycles: Fraction
    planets_turn: int
    sun_drives: bool
    torque: int
    carrier: Fraction

    @classmethod
    def of(cls, p: Any, z_s: float | Fraction, z_r: float | Fraction) -> Turning | None:
        """Return the motion of a section ``system``; None where its ``input`` and ``fixed`` are not two bodies."""
        shares = {"sun": Fraction(z_s), "ring": Fraction(z_r), "carrier": -Fraction(z_s) - Fraction(z_r)}
        driving, held = p.input, p.fixed
        if driving == held:
            return None
        # Through the planets, sun and ring turn against each other, seen from the carrier.
        through = MeshMotion(("sun", "ring"), (shares["sun"], shares["ring"]), False, ("teeth",), "carrier")
        rules = [Relation({driving: 1}, ("input",), 1), Relation({held: 1}, ("fixed",)), through.relation]
        speeds = solve(shares, rules)
        ahead = through.relative(speeds)
        sense, cycles = -1 if p.sense == SENSES[1] else 1, through.frequency(speeds)
        relative = sense * (1 if ahead > 0 else -1)
        given = None if p.phases is None else p.phases.drives
        sun_drives = given == "sun" if given else (ahead > 0) == (shares[driving] > 0)
        torque = relative if sun_drives else -relative
        return cls(cycles, -relative, sun_drives, torque, sense * speeds["carrier"] / cycles)


def lags(p: Any, planets: int) -> dict[str, list[Array]]:
    """Lag of every mesh as a fraction of the mesh period: gamma_sn of the suns', gamma_rn = gamma_sn + gamma_sr.

    Parameters: ``phases`` (``sun`` gamma_s1..gamma_sN, all 0 unless given, ``sun_ring`` gamma_sr, 0) or ``teeth`` (see
    :func:`phases_of`), where ``phases`` may still give ``sun_ring``. Source: Parker 2009, below (8).
    """
    sun, sun_ring = (None, None) if p.phases is None else (p.phases.sun, p.phases.sun_ring)
    if (teeth := p.teeth) is not None:
        moving = Turning.of(p, int(teeth.sun), int(teeth.ring))
        turn = -1 if moving is None else moving.planets_turn
        found, lag = phases_of(teeth, planets, turn)
        sun, sun_ring = list(map(float, found)), float(lag) if sun_ring is None else sun_ring
        if p.angles is not None:
            psi, z_s, places = angles_of(p.planets, p.angles), int(teeth.sun), int(teeth.sun + teeth.ring)
            sun = [-turn * z_s * np.rint((angle - psi[0]) * places / tau) % places / places for angle in psi]
    first = [np.asarray(value, dtype=float) for value in (sun or [0.0] * planets)]
    between = np.asarray(0.0 if sun_ring is None else sun_ring, dtype=float)
    return {"sun": first, "ring": [value + between for value in first]}


def phases_of(teeth: Any, planets: int, planets_turn: int = -1) -> tuple[list[Fraction], Fraction]:
    """gamma_s1..gamma_sN and gamma_sr from the tooth numbers.

        gamma_sn = -sigma (n - 1) z_s/N (mod 1),   gamma_sr = 0 for odd z_p, 1/2 for even z_p

    of equally spaced planets; gamma_sn = -sigma z_s psi_n/2 pi of one at the angle psi_n from the first. planets_turn:
    sigma, 1 for planets that turn counter-clockwise on the carrier, as they are numbered, -1 for clockwise. gamma_sr is
    the lag between the passages of the pitch points of standard teeth: a planet touches the sun and the ring with
    opposite flanks half a turn apart, z_p/2 pitches, and the flanks of a tooth as thick as its gap are half a pitch
    apart. Waves begin at the entry of teeth: :class:`gearstab.gears.pair.PlanetSet` has that lag, and that of
    profile-shifted teeth.

    Source: Parker 2009, "Parametric instabilities for in-phase meshes", for gamma_sn; Parker & Lin 2004 (J. Mech. Des.
    126, 365-370) for the definitions; gamma_sr derived here for standard teeth.
    """
    sun = [Fraction(-planets_turn * n * teeth.sun, planets) % 1 for n in range(planets)]
    return sun, Fraction(teeth.planet + 1, 2) % 1


class CarrierSpeed(Section):
    """W_c, counter-clockwise positive as planets are numbered: a part of the mesh frequency, or held."""

    speed_ratio: Annotated[Fraction, Ratio(signed=True)] | None = optional("speed ratio of the carrier")
    """W_c/Omega, exact: "1/99"; or in short; 0: at rest."""
    speed: Annotated[float, Quantity("rad/s")] | None = optional("speed of the carrier")
    """W_c, held whatever the mesh frequency (rad/s, "30 rpm")."""
    from_teeth: Flag = Field(default=False, title="speed from the teeth")
    """W_c/Omega of teeth, input and fixed; or in short."""

    @classmethod
    def complete(cls, document: Document, raw: dict[str, Any]) -> None:
        """Write out what is written in short, a ratio or FROM_TEETH."""
        short, path = raw.get("carrier_speed"), ("system", "carrier_speed")
        if short is not None and not isinstance(short, dict):
            key, value = ("from_teeth", True) if short == FROM_TEETH else ("speed_ratio", short)
            document.put(path, {key: value}, document.where(path))

    def conflicts(self, gear: Any) -> Iterator[Conflict]:
        """One speed, of a gear whose bodies move in the plane and whose elastic ring does not turn."""
        if told(lambda: self.speed_ratio == 0 and self.speed is None and not self.from_teeth):
            return  # a carrier that does not turn: nothing depends on it, whatever the gear
        if not self.from_teeth:
            yield from exactly_one(self, ("speed_ratio", "speed"))
        elif not gear.teeth:
            yield (), "needs_other", "needs the numbers of teeth", "add teeth, or give the ratio"
        if gear.motion != "planar":
            hint = "remove it, or take motion: planar"
            yield (), "not_applicable", "acts on translations, and bodies only rotate", hint
        yield from known(self._turning(gear))
        if gear.pin_preload and gear.supports.planet == 0:
            hint = "give supports.planet, or set pin_preload: false"
            yield (), "inconsistent", "no bearing keeps the planets from flying off", hint

    def _turning(self, gear: Any) -> Iterator[Conflict]:
        if gear.ring.kind == "elastic" and gear.fixed != "ring":
            message = "an elastic ring that turns is stretched by its own speed, which is not modelled"
            yield (), "not_applicable", message, "take fixed: ring, or a rigid ring"


def speed_of(p: Any) -> tuple[Fraction | None, Array]:
    """Return the speed of the carrier of a section ``system`` over that of the mesh, and a speed that is held."""
    given, teeth = p.carrier_speed or CarrierSpeed(), p.teeth
    ratio = given.speed_ratio
    if given.from_teeth and teeth and (moving := Turning.of(p, int(teeth.sun), int(teeth.ring))):
        ratio = moving.carrier
    return ratio, np.asarray(0.0 if given.speed is None else given.speed, dtype=float)
