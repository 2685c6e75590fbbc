"""Speed of the carrier, in whose turning frame the coordinates of a planetary gear are written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.document.tree import Document
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import Flag, Ratio, Section, optional
from gearstab.config.model.reading import known, told
from gearstab.config.model.units import Quantity
from gearstab.rotation import Rotation
from gearstab.system import Array
from gearstab.systems.planetary.phasing import Turning

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


def rotations(p: Any, mass: Array, frame: Array, carrier: int) -> tuple[Rotation, ...]:
    """Return the rotation of the frame of a section ``system``; none where the carrier does not turn.

    A point that the frame carries along moves by q' + W J q, so that the kinetic energy gives

        M q'' + W (M J - J^T M) q' - W^2 J^T M J q,   J = m [[0, -1], [1, 0]]

    mass: M. frame: J, with m = 1 of translations and m of a ring's deflection of m waves: the ring is at rest, and its
    deflection passes the frame. carrier: position of u_c, on which ``pin_preload`` acts: a planet's bearing carries the
    centrifugal force of the planet, and this force turns with the pin. Without it no rotation is free.

    Damping acts between bodies and the frame, so that it turns with the carrier.

    Sources: Lin & Parker 1999 (J. Vib. Acoust. 121, 316-321), without the preload, which is derived here.
    """
    given, teeth = p.carrier_speed or CarrierSpeed(), p.teeth
    ratio = given.speed_ratio
    if given.from_teeth and teeth and (moving := Turning.of(p, int(teeth.sun), int(teeth.ring))):
        ratio = moving.carrier
    if not ratio and not np.any(0.0 if given.speed is None else given.speed):
        return ()
    speed, back = np.asarray(0.0 if given.speed is None else given.speed, dtype=float), frame.T
    rotation = Rotation(ratio, speed, gyroscopic=mass @ frame - back @ mass, centripetal=-back @ mass @ frame)
    if not p.pin_preload:
        return (rotation,)
    # W^2 m_p k_p/(k_p - W^2 m_p) of each planet.
    own, bearing = (np.asarray(section.planet, dtype=float) for section in (p.masses, p.supports))
    place = np.zeros(frame.shape)
    place[carrier, carrier] = float(p.planets)
    return (replace(rotation, preload=own[..., None, None] * place, softening=own / bearing),)
