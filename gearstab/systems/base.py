"""The contract of a kind of system, and the keys of the section ``system`` that every kind has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field

from gearstab.config.document import Document, Path, sequence
from gearstab.config.model import Axis, Grid
from gearstab.config.model.conflicts import (
    Conflict,
    at_most_one,
    items,
    plain_number,
    repeated_names,
    within,
    within_each,
)
from gearstab.config.model.fields import Choice, Flag, NonNegative, Section, optional
from gearstab.config.model.reading import told
from gearstab.system import Array, GearSystem
from gearstab.systems import feasibility
from gearstab.systems.forcing import Damping
from gearstab.systems.mesh import ToothMesh

if TYPE_CHECKING:
    from gearstab.systems.gearbox.train import Train
    from gearstab.systems.respond import PairRespond, Respond


@dataclass(frozen=True)
class Start:
    """A configuration to start from: title, section ``system``, section ``sweep`` with a remark on each axis."""

    title: str
    system: dict[str, Any]
    sweep: dict[str, tuple[Any, str]]


START_MESH = {"mean_stiffness": 2.0e8, "epsilon": 0.2, "contact_ratio": 1.6}
"""Mesh of spur gears of steel, some centimetres wide, in N/m."""


class System(Section):
    """The section ``system`` of a kind: its fields are the keys, and its methods all that other rooms ask of a kind.

    A kind must override ``equations`` and ``size``; everything else has a default that fits a linear system given by
    numbers alone. Values of a section that was not checked may be wrong (:mod:`gearstab.config.model.reading`).
    ``raw`` is the section as written.
    """

    mesh_names: ClassVar[tuple[str, ...]] = ()
    """Default mesh names; further meshes are mesh1, mesh2, ..."""

    needs_units: ClassVar[bool] = False
    """Whether numbers of its own, of materials say, are in SI units."""
    start: ClassVar[Start | None] = None
    """Text that ``gearstab init`` prints; a kind without one is not offered there."""

    damping_ratio: NonNegative | None = optional("modal damping ratio")
    """Damping ratio of every mode of the mean system (1); or give damping."""
    damping: Damping | None = None
    """Other forms of damping; or give damping_ratio."""
    units: Annotated[str, Choice("system of units", ("SI", "none"))] = "SI"
    """SI, or none: the numbers have no units, and results say none."""
    allow_negative_stiffness: Flag = Field(default=False, title="negative stiffness allowed")
    """Admit variations that make a mesh's softer level zero or negative, as no teeth can be."""

    def build(self) -> GearSystem:
        """Build the gear system; with ``units: none`` nothing in it has a unit."""
        system = self.equations()
        return replace(system, dimensionless=("mass", "length", "time")) if self.units == "none" else system

    def equations(self) -> GearSystem:
        """Return the equations of motion; any number of the section may be an array of batch shape, as of an axis."""
        raise NotImplementedError

    def with_files(self, contents: Mapping[str, Array]) -> Self:
        """Return the section with what the files named in it hold."""
        return self

    def size(self) -> int | None:
        """Number of coordinates, None where it cannot be told."""
        raise NotImplementedError

    @classmethod
    def respond_model(cls) -> type[Respond | PairRespond]:
        """Return the section ``respond`` of this kind."""
        from gearstab.systems.respond import Respond

        return Respond

    def turning(self) -> Sequence[bool] | None:
        """Return which coordinates are rotations in rad, others being displacements in m; None if it is unknown."""
        return [False] * (self.size() or 0)

    def turning_meshes(self) -> bool:
        """Whether mesh deflections are angles, so that mesh stiffnesses are torsional."""
        return False

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """Write out what may be written in short, in the section as written; here the names of meshes.

        Returns what files named in it hold, by key. Problems are reported. source: path of the configuration.
        """
        for i in range(len(sequence(document.data["system"].get("meshes")))):
            name = cls.mesh_names[i] if i < len(cls.mesh_names) else f"mesh{i + 1}"
            document.fill(("system", "meshes", i, "name"), name, document.where(("system", "meshes", i)))
        return {}

    @classmethod
    def expand_path(cls, parts: list[str]) -> list[str]:
        """Return the whole path of a parameter that may be named in short."""
        return parts

    def train(self) -> Train | None:
        """Return the train whose teeth the system is computed from; None where no teeth are known."""
        return None

    def mesh_places(self) -> Iterator[tuple[Path, ToothMesh]]:
        """Yield the place of every mesh in the section, and the mesh."""
        yield from ((("meshes", key), mesh) for key, mesh in items(getattr(self, "meshes", None)))

    def mesh_conflicts(self, mesh: Any) -> Iterator[Conflict]:
        """Yield the contradictions in a mesh."""
        yield from mesh.conflicts()

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """Report what cannot exist somewhere on the grid, or at the base values where a response asks for them."""
        feasibility.check_mesh_levels(document, grid)
        feasibility.check_symmetric(document, grid.system)

    def dependent(self, varied: set[Path]) -> Self:
        """Return the section of a design with the numbers that follow from what varies. varied: paths of that."""
        return self

    def assembled(self) -> bool:
        """Whether a design can be put together, where numbers that are right each by itself may not fit."""
        return True

    @classmethod
    def variant(cls, raw: dict[str, Any]) -> type[System]:
        """The model that the keys of a section call for, where a kind has several."""
        return cls

    def cycles_of_input(self) -> float | None:
        """Cycles of the first mesh in a turn of the input, None where no teeth are known; here z of the first gear."""
        teeth: Any = getattr(self, "teeth", None)
        first = plain_number(teeth[0]) if isinstance(teeth, list | tuple) and teeth else None
        return first if first is not None and first > 0 else None

    def summary(self) -> dict[str, str]:
        """Return further lines of ``gearstab info`` about the kind, by their headings."""
        return {}

    def doubts(self) -> Iterator[tuple[Path, str, str]]:
        """Yield what is right and hardly meant: path, message and remedy, apart from unusual numbers."""
        yield from ()

    def follow_speed(self) -> list[Path]:
        """Numbers of the system that are the speed of the input too."""
        return []

    def held_frequency(self) -> float | None:
        """Return the mesh frequency at which alone the numbers of the system hold; None where they hold at any."""
        return None

    def unfit(self, axes: Sequence[Axis], methods: Sequence[str]) -> Iterator[Conflict]:
        """Methods that do not apply; the paths are below ``methods``."""
        swept = any(item.path[-1] == "backlash" for axis in axes for item in axis.assignments)
        given = any(mesh.backlash for _, mesh in self.mesh_places())
        if swept and not given and "response" in methods:
            hint = "give the mesh backlash in system too"
            yield ("response",), "not_applicable", "an axis sets backlash where no mesh has any", hint

    def conflicts(self) -> Iterator[Conflict]:
        """Yield the contradictions in the section."""
        yield from at_most_one(self, ("damping_ratio", "damping"))
        yield from within(self, "damping", lambda damping: damping.conflicts(told(self.size)))
        yield from within_each(self, "meshes", self.mesh_conflicts)
        yield from repeated_names(self, "meshes", "mesh")
