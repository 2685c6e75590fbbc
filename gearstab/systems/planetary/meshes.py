"""Sections of the meshes of a planetary gear: stiffness, phases, and the teeth that these follow from."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, cast

from pydantic import Field

from gearstab.config.model.fields import Choice, Length, Number, Section, ToothCount, Turns, optional
from gearstab.systems.parts.mesh import StiffnessOfTeeth, ToothMesh
from gearstab.systems.planetary.phasing import DRIVES, RULES


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
