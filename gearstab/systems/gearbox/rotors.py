"""Mass and moment of inertia of the rotors of a train."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import Array

STEEL = {"young": 206.8e9, "poisson": 0.3, "density": 7850.0, "shear": 80e9}


def is_gear(rotor: dict[str, Any]) -> bool:
    """Whether a rotor has teeth."""
    return rotor.get("teeth") is not None


def moves(rotor: dict[str, Any]) -> bool:
    """Whether a rotor has a lateral support, and so moves in its plane."""
    return (rotor.get("support") or {}).get("stiffness") is not None


def turns(rotor: dict[str, Any], held: bool) -> bool:
    """Whether a rotor has a rotation: all but held ones without a torsional support."""
    return not held or (rotor.get("support") or {}).get("torsional_stiffness") is not None


def number(p: Any, key: str, default: float = 0.0) -> Array:
    """A number of the section, which may be an array of batch shape."""
    value = p.get(key)
    return np.asarray(default if value is None else value, dtype=float)


def pitch_radius(rotor: dict[str, Any]) -> Array:
    """m z/2."""
    return 0.5 * number(rotor, "module") * float(rotor["teeth"])


def base_radius(rotor: dict[str, Any]) -> Array:
    """R_b = (m z/2) cos alpha."""
    return pitch_radius(rotor) * np.cos(number(rotor, "pressure_angle"))


def _disc(rotor: dict[str, Any], density: Array | float) -> tuple[Array, Array]:
    """(mass, square of the sum of both radii squared) of a disc of the face width with a bore."""
    outer = number(rotor, "body_radius") if rotor.get("body_radius") is not None else pitch_radius(rotor)
    inner = number(rotor, "bore_radius")
    mass = np.pi * density * number(rotor, "face_width") * (outer**2 - inner**2)
    return mass, outer**2 + inner**2


def mass(rotor: dict[str, Any], density: Array | float) -> Array:
    """Return the mass as given, or that of a disc of radius ``body_radius`` (the pitch radius without) and
    ``bore_radius``.
    """
    return number(rotor, "mass") if rotor.get("mass") is not None else _disc(rotor, density)[0]


def inertia(rotor: dict[str, Any], density: Array | float) -> Array:
    """Return the inertia as given, or m (R^2 + R_i^2)/2 of that disc."""
    if rotor.get("inertia") is not None:
        return number(rotor, "inertia")
    solid, squares = _disc(rotor, density)
    return 0.5 * solid * squares
