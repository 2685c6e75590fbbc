"""Bodies of a gearbox: sections of rotors, supports, shafts and material; masses, inertias, radii and hands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.model.conflicts import Conflict, within
from gearstab.config.model.fields import (
    Choice,
    Flag,
    Inertia,
    Length,
    Mass,
    NameText,
    NonNegative,
    NonNegativeLength,
    Number,
    Positive,
    Quantity,
    Section,
    Stiffness,
    ToothCount,
    TorsionalStiffness,
    optional,
)
from gearstab.gears.geometry import transverse_angle
from gearstab.system import Array
from gearstab.systems.kinematics import TrainError
from gearstab.systems.mesh import Named

HANDS = ("right", "left")
"""Hands of helices."""
STEEL = {"young": 206.8e9, "poisson": 0.3, "density": 7850.0, "shear": 80e9}


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


PressureAngle = Annotated[float, Field(gt=0, lt=0.7853), Quantity("rad")]
Pressure = Annotated[float, Field(gt=0), Quantity("Pa")]

HelixAngle = Annotated[float, Field(gt=-1.0472, lt=1.0472), Quantity("rad")]

OF_TEETH = ("module", "pressure_angle", "addendum", "dedendum", "helix_angle", "face_width")
"""Defaults of all gears of a train."""


class Support(Section):
    """Springs that hold the centre of a rotor, the same in both directions, its rotation, or its place on the axis."""

    stiffness: Stiffness | None = optional("lateral stiffness")
    """Lateral stiffness of shaft and bearings together (N/m); without, the centre does not move."""
    torsional_stiffness: TorsionalStiffness | None = optional("torsional stiffness of the support")
    """Between rotor and housing (N m/rad); a held member of a planetary set has no rotation without."""
    axial_stiffness: Stiffness | None = optional("axial stiffness of the support")
    """Along the axis (N/m), which helical teeth push it along; without, it does not move there."""
    damping_ratio: NonNegative = Field(default=0.0, title="damping ratio of the support")
    """zeta, c = 2 zeta sqrt(k m) (1)."""

    def conflicts(self) -> Iterator[Conflict]:
        """At least one of the springs."""
        if self.stiffness is None and self.torsional_stiffness is None and self.axial_stiffness is None:
            hint = "add stiffness or axial_stiffness (N/m), or torsional_stiffness (N m/rad)"
            yield ("stiffness",), "missing", "is missing", hint


class Teeth(Section):
    """Basic profile and width of gears."""

    module: Length | None = None
    """m, of helical gears the normal module (m)."""
    pressure_angle: PressureAngle | None = None
    """alpha of the rack; in rad, or with a unit: "20 deg"."""
    helix_angle: HelixAngle | None = None
    """beta on the reference circle ("20 deg"); negative of a left-handed gear, spur without."""
    addendum: Positive | None = None
    """h_a/m; 1 without (1)."""
    dedendum: Positive | None = None
    """h_f/m; 1.25 without (1)."""
    face_width: Length | None = None
    """b (m)."""


class Rotor(Teeth, Named):
    """A rigid body that turns: a gear, which has teeth, or a plain inertia."""

    teeth: ToothCount | None = optional("number of teeth")
    """z; a rotor without teeth is no gear."""
    hand: Annotated[str, Choice("hand", HANDS)] | None = optional("hand of the helix")
    """right or left; without, such as meshes with the other gears."""
    internal: Flag = Field(default=False, title="internal gear")
    """A ring with teeth inside."""
    profile_shift: Number | None = None
    """x, in modules (1); 0 without, or such as closes the backlash in a planetary set."""
    inertia: Inertia | None = optional("moment of inertia")
    """J (kg m^2); that of a disc of the face width and body_radius without."""
    mass: Mass | None = None
    """Mass of a supported rotor (kg); that of the same disc without."""
    body_radius: Length | None = optional("radius of the body")
    """Radius of the disc (m); the pitch radius without."""
    bore_radius: NonNegativeLength | None = optional("radius of the bore")
    """Radius of the bore (m); without, the disc is solid and the teeth stand on a body of bore 0.4 root radii. Of an
    internal gear, where its rim is held outside; the rim is rigid without."""
    support: Support | None = optional("lateral support")
    """With it the rotor moves in its plane too."""

    def conflicts(self) -> Iterator[Conflict]:
        """Inertia, and mass where it is supported, of what is no disc; teeth where there is what belongs to them."""
        yield from within(self, "support", Support.conflicts)
        geared = self.teeth is not None
        if not geared and self.body_radius is None:
            if self.inertia is None:
                hint = "add inertia (kg m^2), or face_width and body_radius of its disc"
                yield ("inertia",), "missing", "is missing", hint
            if (moves(self.support) or slides(self.support)) and self.mass is None:
                yield ("mass",), "missing", "is missing", "add mass (kg), or face_width and body_radius of its disc"
        if not geared:
            for key in (*OF_TEETH[:-1], "profile_shift", "internal", "hand"):
                if self[key] not in (None, False):
                    yield (key,), "not_applicable", "belongs to a gear", "give the rotor teeth, or remove it"


class Shaft(Named):
    """A torsional spring between two rotors that turn at the same speed."""

    between: Annotated[list[NameText], Field(min_length=2, max_length=2)] = Field(title="ends of the shaft")
    """Names of its two rotors."""
    stiffness: TorsionalStiffness | None = optional("torsional stiffness")
    """k (N m/rad); or give diameter and length."""
    diameter: Length | None = None
    """d of a round shaft (m)."""
    bore: NonNegativeLength | None = None
    """Diameter of the hole of a hollow shaft (m)."""
    length: Length | None = None
    """l of a round shaft (m)."""
    damping_ratio: NonNegative = Field(default=0.0, title="damping ratio of the shaft")
    """zeta, c = 2 zeta sqrt(k J_e), J_e = J1 J2/(J1 + J2) (1)."""

    def conflicts(self) -> Iterator[Conflict]:
        """A stiffness, or the dimensions that give it."""
        if self.stiffness is None and self.diameter is None and self.length is None:
            yield ("stiffness",), "missing", "is missing", "add stiffness (N m/rad), or diameter and length"
            return
        for key in ("diameter", "length"):
            if self.stiffness is not None and self[key] is not None:
                yield (key,), "already_given", "stiffness is given already", "keep one of stiffness and the dimensions"
            elif self.stiffness is None and self[key] is None:
                yield (key,), "missing", "is missing", f"add {key}, or give stiffness instead"


class Material(Section):
    """Material of gears and shafts; default steel."""

    young: Pressure | None = optional("Young's modulus")
    """E (Pa); 206.8 GPa without."""
    poisson: Annotated[float, Field(gt=-1, lt=0.5), Quantity()] | None = optional("Poisson's ratio")
    """nu (1); 0.3 without."""
    density: Annotated[float, Field(gt=0), Quantity("kg/m^3")] | None = None
    """rho (kg/m^3); 7850 without."""
    shear: Pressure | None = optional("shear modulus of shafts")
    """G (Pa); 80 GPa without."""


def line_of_action(
    position: Array | float, pressure_angle: Array | float, sense: int, internal: int | None = None
) -> tuple[Array, Array]:
    """n, the direction in which the driver pushes the driven gear.

        external gears     psi + sense (90 deg - phi_w)
        internal driven    psi + 180 deg + sense (90 deg - phi_w)
        internal driver    psi + sense (90 deg + phi_w)

    The flank of the external gear is pushed towards its own centre; where one gear is internal, both centres lie on the
    same side of the pitch point. Turning the whole train as one body leaves the teeth alone: r_b1 w_1 - r_b2 w_2 +
    n . (u_1 - u_2) = 0.

    position: psi, from the centre of the driver to that of the driven gear, rad.
    sense: 1 where the driver turns counter-clockwise, -1 where clockwise.
    internal: 0 where the driver is internal, 1 where the driven gear is.
    """
    right, phi = 0.5 * np.pi, np.asarray(pressure_angle)
    turn = np.pi if internal == 1 else 0.0
    angle = np.asarray(position) + turn + sense * (right + phi if internal == 0 else right - phi)
    return np.cos(angle), np.sin(angle)
