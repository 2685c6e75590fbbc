"""Sections of the meshes of a planetary gear: stiffness, phases, and the teeth that these follow from."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, cast

from pydantic import Field

from gearstab.config.model.fields import NonNegative, Quantity, Section, Stiffness, ToothCount, Turns
from gearstab.systems.parts.mesh import ToothMesh


class PlanetaryMesh(ToothMesh):
    """The meshes of the sun, or of the ring, with the planets: all alike but for their phases."""

    single_pair_stiffness: Stiffness | None = Field(
        default=None,
        title="measured stiffness of a pair",
        description="With gears: in contact at the pitch point (N/m); the ring's teeth are not computed and need it.",
    )
    double_contact_factor: Annotated[float, Field(gt=0.5, le=1), Quantity()] | None = Field(
        default=None,
        title="double contact factor",
        description="With gears: stiffness of two pairs over the sum of theirs (1); 1 without.",
    )
    variation: NonNegative | None = Field(
        default=None,
        title="measured variation",
        description="With gears: (max k - min k)/mean k of the mesh stiffness (1).",
    )

    misplaced: ClassVar[dict[str, str]] = {
        "name": "the meshes are called sun1, sun2, ... and ring1, ring2, ...",
        "lag": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phase": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
        "phasing": "give the lags in phases: sun: one per planet, sun_ring: of the ring's meshes",
    }


class Meshes(Section):
    """Both kinds of meshes."""

    sun: PlanetaryMesh = Field(title="sun's meshes", description="Each planet with the sun.")
    ring: PlanetaryMesh = Field(title="ring's meshes", description="Each planet with the ring.")


class Phases(Section):
    """Mesh phases, as lags in periods of the mesh."""

    sun: list[Turns] | None = Field(
        default=None,
        title="phase of a sun's mesh",
        description="gamma_sn, one per planet, of the waves of the sun's meshes (1); all 0, in phase, without.",
    )
    sun_ring: Turns | None = Field(
        default=None,
        title="phase of the ring's meshes",
        description="gamma_sr: the ring's mesh of a planet lags its sun's mesh by this (1); 0 or from teeth without.",
    )


Teeth = Annotated[ToothCount, Field(ge=4)]


class ToothNumbers(Section):
    """Tooth numbers, from which the mesh phases follow."""

    sun: Teeth = Field(title="teeth of the sun", description="z_s.")
    planet: Teeth = Field(title="teeth of a planet", description="z_p.")
    ring: Teeth = Field(
        default=cast(Any, None),  # from the others
        title="teeth of the ring",
        description="z_r = z_s + 2 z_p, without too; (z_s + z_r)/planets is an integer for equal angles.",
    )
