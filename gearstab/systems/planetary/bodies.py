"""Sections of a planetary gear: its bodies and supports, its meshes, and the teeth that these follow from."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, cast

from pydantic import Field

from gearstab.config.model.fields import (
    Choice,
    Length,
    Mass,
    Number,
    Quantity,
    Section,
    Stiffness,
    ToothCount,
    Turns,
    Whole,
    optional,
)
from gearstab.systems.parts.mesh import StiffnessOfTeeth, ToothMesh
from gearstab.systems.planetary.phasing import DRIVES, RULES

HARMONICS = 12
"""Default of J. Natural frequencies converge as J^-3: of a gear as in Parker (2009, Table 1) with 3 to 8 planets
the first nine are within 4e-5 of their limits with 8, 1.1e-5 with 12, 4e-6 with 16 and 2e-6 with 20, relative."""
MOST_HARMONICS = 200

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
