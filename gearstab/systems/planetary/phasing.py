"""Mesh phases of a planetary gear, how its members turn, and the speed of the carrier, the frame of its coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import tau
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.document import Document
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import Flag, Quantity, Ratio, Section, optional
from gearstab.config.model.reading import known, told
from gearstab.system import Array
from gearstab.systems.kinematics import MeshMotion, Relation, solve
from gearstab.systems.planetary.planets import angles_of

SENSES = ("counter-clockwise", "clockwise")
RULES = {"entry": "from entry to entry", "pitch_point": "from pitch point to pitch point"}
"""Between what the ring's mesh of a planet lags its sun's mesh."""
DRIVES = ("sun", "planet")
"""Which of both gears drives in the sun's meshes."""


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
    apart. Waves begin at the entry of teeth: :class:`gearstab.gears.planet_set.PlanetSet` has that lag, and that of
    profile-shifted teeth.

    Source: Parker 2009, "Parametric instabilities for in-phase meshes", for gamma_sn; Parker & Lin 2004 (J. Mech. Des.
    126, 365-370) for the definitions; gamma_sr derived here for standard teeth.
    """
    sun = [Fraction(-planets_turn * n * teeth.sun, planets) % 1 for n in range(planets)]
    return sun, Fraction(teeth.planet + 1, 2) % 1


FROM_TEETH = "from_teeth"
"""Written in place of the speed: as the teeth, input and fixed body say."""


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
