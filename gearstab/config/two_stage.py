"""The section ``system`` of a two-stage gear train."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from gearstab.config.forcing import Load, wrong_load
from gearstab.config.mesh import Conflict, Mesh, SecondMesh
from gearstab.config.model.fields import ExactRatio, Mass, Quantity
from gearstab.config.system import System


class TwoStage(System):
    """Three or four gears with two meshes on an elastic input shaft (Lin & Parker 2002, Fig. 1)."""

    mesh_names: ClassVar[tuple[str, ...]] = ("first", "second")

    kind: Literal["two_stage"] = Field(title="kind of system", description="Two meshes in a row, three or four gears.")
    inertias: tuple[Mass, Mass, Mass] = Field(
        title="equivalent mass", description="Equivalent masses [m1, m2, m3], inertias over squared base radii (kg)."
    )
    input_shaft_stiffness: Annotated[float, Field(ge=0), Quantity("N/m")] = Field(
        title="input shaft stiffness",
        description="k0, along the line of action (N/m); 0 leaves the train free to rotate.",
    )
    tooth_ratio: ExactRatio = Field(
        default=Fraction(1),
        title="tooth ratio",
        description='R = Z2/Z4 = Omega_1/Omega_2, exact: 1 (three gears; the default), 0.6 or "3/5".',
    )
    meshes: tuple[Mesh, SecondMesh] = Field(title="meshes", description="The first and the second tooth mesh.")
    load: Load | None = Field(
        default=None, title="load", description="Constant forces along the lines of action, one a coordinate (N)."
    )

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int:
        return 3

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """A load of one number a coordinate."""
        yield from super().conflicts(raw)
        yield from wrong_load(raw.get("load"), 3)
