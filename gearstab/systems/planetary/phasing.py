"""Mesh phases of a planetary gear: given, or from its tooth numbers."""

from __future__ import annotations

from fractions import Fraction
from math import tau
from typing import Any

import numpy as np

from gearstab.system import Array
from gearstab.systems.planetary.angles import angles_of


def lags(p: dict[str, Any], planets: int) -> dict[str, list[Array]]:
    """Lag of every mesh as a fraction of the mesh period: gamma_sn of the suns', gamma_rn = gamma_sn + gamma_sr.

    Parameters: ``phases`` (``sun`` gamma_s1..gamma_sN, all 0 unless given, ``sun_ring`` gamma_sr, 0) or ``teeth`` (see
    :func:`phases_of`), where ``phases`` may still give ``sun_ring``. Source: Parker 2009, below (8).
    """
    phases = p.get("phases") or {}
    sun, sun_ring = phases.get("sun"), phases.get("sun_ring")
    if p.get("teeth") is not None:
        found, lag = phases_of(p["teeth"], planets)
        sun, sun_ring = list(map(float, found)), float(lag) if sun_ring is None else sun_ring
        if p.get("angles") is not None:
            psi, z_s, places = angles_of(p), int(p["teeth"]["sun"]), int(p["teeth"]["sun"] + p["teeth"]["ring"])
            sun = [z_s * np.rint((angle - psi[0]) * places / tau) % places / places for angle in psi]
    first = [np.asarray(value, dtype=float) for value in (sun or [0.0] * planets)]
    between = np.asarray(0.0 if sun_ring is None else sun_ring, dtype=float)
    return {"sun": first, "ring": [value + between for value in first]}


def phases_of(teeth: dict[str, int], planets: int) -> tuple[list[Fraction], Fraction]:
    """gamma_s1..gamma_sN and gamma_sr from the tooth numbers.

        gamma_sn = (n - 1) z_s/N (mod 1),   gamma_sr = 0 for odd z_p, 1/2 for even z_p

    of equally spaced planets; gamma_sn = z_s psi_n/2 pi of one at the angle psi_n from the first. It holds for planets
    that turn clockwise while numbered counterclockwise. gamma_sr is the lag between the passages of the pitch points: a
    planet touches the sun and the ring with opposite flanks half a turn apart, z_p/2 pitches, and the flanks of a tooth
    as thick as its gap are half a pitch apart. It is that between the stiffness waves if contact begins equally long
    before the pitch point on both meshes (else give ``phases.sun_ring``).

    Source: Parker 2009, "Parametric instabilities for in-phase meshes", for gamma_sn; Parker & Lin 2004 (J. Mech. Des.
    126, 365-370) for the definitions; gamma_sr derived here for standard teeth.
    """
    sun = [Fraction(n * teeth["sun"], planets) % 1 for n in range(planets)]
    return sun, Fraction(teeth["planet"] + 1, 2) % 1


def cycles(driving: str, fixed: str, z_s: float, z_r: float) -> float:
    """Return how many teeth mesh in a turn of the driving body, where one of sun, carrier and ring is fixed.

    Relative to the carrier the gears turn as in an ordinary train, and the mesh frequency is

        Omega = z_s |w_s - w_c| = z_r |w_r - w_c|,    z_s (w_s - w_c) = -z_r (w_r - w_c)

    Source: Willis' equation; Parker & Lin 2004 (J. Mech. Des. 126, 365-370).
    """
    if "carrier" in (driving, fixed):
        # Sun against carrier: the sun's teeth; ring against carrier: the ring's.
        return z_r if "ring" in (driving, fixed) else z_s
    return z_s * z_r / (z_s + z_r)
