"""Sections of the bodies of a planetary gear: ring, masses, inertias, supports, pressure angles and loads."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from gearstab.config.model.fields import Choice, Mass, Section, Stiffness, Whole, optional
from gearstab.config.model.units import Quantity

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
