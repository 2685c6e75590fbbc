"""Two-stage gear trains with three or four gears (Lin & Parker 2002, Fig. 1)."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from gearstab.config.document import Document
from gearstab.config.model.conflicts import Conflict, wrong_length
from gearstab.config.model.fields import ExactRatio, Mass, Quantity, Teeth, optional
from gearstab.mesh import MachineElement
from gearstab.system import Array, GearSystem
from gearstab.systems.assembly import Assembly, Coordinates, Element, MeshElement
from gearstab.systems.base import START_MESH, Start, System
from gearstab.systems.forcing import Load
from gearstab.systems.mesh import NamedToothMesh, SecondMesh

COORDINATES = ("x1", "x2", "x3")
"""Rotations along the lines of action."""


class TwoStage(System):
    """Three or four gears with two meshes on an elastic input shaft (Lin & Parker 2002, Fig. 1)."""

    mesh_names: ClassVar[tuple[str, ...]] = ("first", "second")

    start: ClassVar[Start | None] = Start(
        "A two-stage train on an input shaft: coordinates along the lines of action",
        {
            "kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 1.0e8, "tooth_ratio": "3/5",
            "damping_ratio": 0.01,
            "meshes": [{"name": "first", **START_MESH}, {"name": "second", **START_MESH, "phasing": 0.0}],
        },
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 100000.0, "num": 401}, "rad/s, of the first mesh"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of both meshes"),
        },
    )  # fmt: skip

    kind: Literal["two_stage"] = Field(title="kind of system")
    """Two meshes in a row, three or four gears."""
    inertias: tuple[Mass, Mass, Mass] = Field(title="equivalent mass")
    """Equivalent masses [m1, m2, m3], inertias over squared base radii (kg)."""
    input_shaft_stiffness: Annotated[float, Field(ge=0), Quantity("N/m")]
    """k0, along the line of action (N/m); 0 leaves the train free to rotate."""
    tooth_ratio: ExactRatio = Fraction(1)
    """R = Z2/Z4 = Omega_1/Omega_2, exact: 1 (three gears; the default), 0.6 or "3/5"; from teeth where they are given.
"""
    teeth: tuple[Teeth, Teeth, Teeth, Teeth] | None = optional("numbers of teeth")
    """[Z1, Z2, Z4, Z3] along the train: the input gear, both gears of the middle shaft (of three gears the same number
    twice), the output gear. For tooth_ratio and input_speed."""
    meshes: tuple[NamedToothMesh, SecondMesh]
    """The first and the second tooth mesh."""
    load: Load | None = None
    """Constant forces along the lines of action, one per coordinate (N)."""

    def size(self) -> int:
        return 3

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """The tooth ratio that the teeth give."""
        ratio = _ratio(document.data["system"].get("teeth"))
        if ratio is not None:
            document.fill(("system", "tooth_ratio"), str(ratio), document.where(("system", "teeth")))
        return super().complete(document, source)

    def conflicts(self) -> Iterator[Conflict]:
        """A load of one number per coordinate."""
        yield from super().conflicts()
        yield from wrong_length(self, "load", 3)
        ratio = _ratio(self.teeth)
        if ratio is not None and self.tooth_ratio != ratio:
            message = f"is not that of the teeth, Z2/Z4 = {ratio}"
            yield ("tooth_ratio",), "inconsistent", message, "remove it, or change the teeth"

    def equations(self) -> GearSystem:
        """Three rotations measured along the lines of action, an input shaft and two meshes.

            M = diag(m1, m2, m3),  K0 = diag(k0, 0, 0),  g_1 = (1, 1, 0),  g_2 = (0, 1, 1)

        Parameters: ``inertias`` m1..m3, ``input_shaft_stiffness`` k0, ``tooth_ratio`` R = Z2/Z4 = Omega_1/Omega_2 (a
        Fraction; 1 for three gears), ``meshes``; ``phasing`` h of the second mesh is a *lead* by h of its own period;
        ``load``: constant forces, one per coordinate.

        Source: Lin & Parker 2002, (1), (2) and section 3.2.
        """
        first, second = self.meshes
        phasing = np.asarray(second.phasing, dtype=float)
        elements = [Element({x: 1.0}, mass=mass) for x, mass in zip(COORDINATES, self.inertias, strict=True)]
        elements.append(
            Element({"x1": 1.0}, stiffness=self.input_shaft_stiffness, name="input shaft", part=MachineElement.SHAFT)
        )
        meshes = (
            MeshElement(first, {"x1": 1.0, "x2": 1.0}),
            MeshElement(second, {"x2": 1.0, "x3": 1.0}, 1 / self.tooth_ratio, -phasing),
        )
        load = None if self.load is None else dict(zip(COORDINATES, self.load, strict=True))
        return Assembly(Coordinates(dict.fromkeys(COORDINATES, "m")), elements, meshes).system(self, load)


def _ratio(teeth: Any) -> Fraction | None:
    """Return Z2/Z4 of numbers of teeth, None where they are none."""
    if not isinstance(teeth, list | tuple):
        return None
    z = [number for number in teeth if type(number) is int and number > 0]
    return Fraction(z[1], z[2]) if len(z) == 4 == len(teeth) else None
