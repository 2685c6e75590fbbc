"""Mass, moment of inertia and radii of the rotors of a train, and the hands of their helices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gearstab.gears.geometry import transverse_angle
from gearstab.system import Array
from gearstab.systems.kinematics import TrainError

HANDS = ("right", "left")
"""Hands of helices."""
STEEL = {"young": 206.8e9, "poisson": 0.3, "density": 7850.0, "shear": 80e9}


def is_gear(rotor: dict[str, Any]) -> bool:
    """Whether a rotor has teeth."""
    return rotor.get("teeth") is not None


def moves(support: Any) -> bool:
    """Return whether a rotor with this support moves in its plane: it has a lateral stiffness."""
    return support is not None and support.stiffness is not None


def slides(support: Any) -> bool:
    """Return whether a rotor with this support moves along its axis: it has an axial stiffness."""
    return support is not None and support.axial_stiffness is not None


def turns(support: Any, held: bool) -> bool:
    """Return whether a rotor has a rotation: all but held ones without a torsional support."""
    return not held or (support is not None and support.torsional_stiffness is not None)


def number(value: Any, default: float = 0.0) -> Array:
    """Return a number, which may be an array of batch shape, or the default for None."""
    return np.asarray(default if value is None else value, dtype=float)


def pitch_radius(rotor: dict[str, Any]) -> Array:
    """m_t z/2."""
    return 0.5 * number(rotor.get("module")) / np.cos(number(rotor.get("helix_angle"))) * float(rotor["teeth"])


def base_radius(rotor: dict[str, Any]) -> Array:
    """R_b = (m_t z/2) cos alpha_t."""
    alpha, beta = number(rotor.get("pressure_angle")), number(rotor.get("helix_angle"))
    return pitch_radius(rotor) * np.cos(np.vectorize(transverse_angle, otypes=[float])(alpha, beta))


def other(hand: str) -> str:
    """Return the opposite hand."""
    return HANDS[1 - HANDS.index(hand)]


def hands(rotors: Sequence[dict[str, Any]], mates: Sequence[tuple[int, int, bool]]) -> list[str]:
    """Return the hand of every rotor: as given by ``hand`` or a negative helix angle, else such as meshes.

    mates: numbers of two gears in mesh, and whether their hands are equal. The first gear of which nothing follows is
    right-handed. Raises TrainError for a right hand with a negative angle.
    """
    found: dict[int, str] = {}
    for k, rotor in enumerate(rotors):
        negative, hand = np.any(number(rotor.get("helix_angle")) < 0), rotor.get("hand")
        if negative and hand == "right":
            message = "is right, and the helix_angle is negative, that of a left-handed gear"
            raise TrainError(("rotors", k, "hand"), message, "remove one of the two, or change it")
        if negative or hand is not None:
            found[k] = "left" if negative else str(hand)
    for k in range(len(rotors)):
        while spread := {
            b: found[a] if equal else other(found[a])
            for one, two, equal in mates
            for a, b in ((one, two), (two, one))
            if a in found and b not in found
        }:
            found |= spread
        found.setdefault(k, "right")
    return [found[k] for k in range(len(rotors))]


def _disc(rotor: dict[str, Any], density: Array | float) -> tuple[Array, Array]:
    """(mass, sum of both radii squared) of a disc of the face width with a bore, of an internal gear of its rim."""
    outer = number(rotor.get("body_radius")) if rotor.get("body_radius") is not None else pitch_radius(rotor)
    inner = number(rotor.get("bore_radius"))
    if rotor.get("internal") and rotor.get("bore_radius") is not None:
        outer = inner if rotor.get("body_radius") is None else outer
        inner = pitch_radius(rotor)
    mass = np.pi * density * number(rotor.get("face_width")) * (outer**2 - inner**2)
    return mass, outer**2 + inner**2


def mass(rotor: dict[str, Any], density: Array | float) -> Array:
    """Return the mass as given, or that of a disc of radius ``body_radius`` (the pitch radius without) and
    ``bore_radius``.
    """
    return number(rotor.get("mass")) if rotor.get("mass") is not None else _disc(rotor, density)[0]


def inertia(rotor: dict[str, Any], density: Array | float) -> Array:
    """Return the inertia as given, or m (R^2 + R_i^2)/2 of that disc."""
    if rotor.get("inertia") is not None:
        return number(rotor.get("inertia"))
    solid, squares = _disc(rotor, density)
    return 0.5 * solid * squares
