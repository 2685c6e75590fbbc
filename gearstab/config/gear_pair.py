"""The section ``system`` of a gear pair."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from gearstab.config.fields import Choice, Mass
from gearstab.config.mesh import Mesh
from gearstab.config.system import System


class GearPair(System):
    """A gear pair on rigid shafts: one degree of freedom, the dynamic transmission error."""

    mesh_names: ClassVar[tuple[str, ...]] = ("mesh",)

    kind: Literal["gear_pair"] = Field(title="kind of system", description="A gear pair on rigid shafts.")
    formulation: Annotated[str, Choice("formulation", ("classical",), ("energy_conserving", "rigid_kinematic"))] = (
        Field(default="classical", title="formulation", description="classical: mesh stiffness as a function of time.")
    )
    equivalent_mass: Mass = Field(
        title="equivalent mass", description="m = 1/(r1^2/J1 + r2^2/J2), along the line of action (kg)."
    )
    meshes: tuple[Mesh] = Field(title="meshes", description="Exactly one tooth mesh.")

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int:
        return 1
