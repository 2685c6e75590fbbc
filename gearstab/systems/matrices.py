"""Any linear model from elsewhere: matrices and one direction vector for each mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, StrictStr

from gearstab.config.document import Document, Path, sequence, value_at
from gearstab.config.model import Grid, matrix, vector
from gearstab.config.model.conflicts import (
    Conflict,
    at_most_one,
    no_direction,
    repeated_names,
    within_each,
    wrong_length,
)
from gearstab.config.model.fields import NUMBER, ByCoordinate, Choice, NameText, Quantity, also, optional
from gearstab.config.model.files import DataFileError
from gearstab.config.model.reading import WRONG, constructed, told
from gearstab.config.model.units import UnitError, to_si
from gearstab.system import Array, GearSystem
from gearstab.systems import feasibility
from gearstab.systems.base import START_MESH, Start, System
from gearstab.systems.feasibility import check_axes
from gearstab.systems.forcing import Damping, Force, Load, OneAsWell, not_square, with_damping, with_forcing
from gearstab.systems.matrix_parts import (
    OF_ROTATION,
    OPTIONAL,
    REQUIRED,
    MatrixFiles,
    RotationSection,
    Term,
    antisymmetric_terms,
    check_rotation,
    check_shapes,
    default_names,
    periodic_terms,
    read_market,
    read_matrices,
    rotations,
    write_out,
)
from gearstab.systems.mesh import MatrixMesh, build_mesh

UNITS = ("m", "rad")
TOLD = {"mass": "kg m^2", "stiffness": "N m"}
"""Matrix -> unit of a diagonal entry that belongs to a rotation."""
MassEntry = Annotated[float, Quantity("kg", ("kg m", "kg m^2"), entry=True)]
StiffnessEntry = Annotated[float, Quantity("N/m", ("N", "N m"), entry=True)]


ROWS = {"type": "array", "items": {"type": "array", "items": NUMBER}, "description": "C, one row per coordinate."}
"""The damping matrix by itself, as mass and stiffness are."""
CoordinateUnits = Annotated[list[Annotated[str, Choice("unit of a coordinate", UNITS)]], OneAsWell()]


class Matrices(System):
    """Any linear model from elsewhere: M q'' + (C + W G) q' + (K0 + W H + W^2 K + sum k_i(t) g_i g_i^T) q = 0."""

    start: ClassVar[Start | None] = Start(
        "A model from elsewhere: two inertias and two gears on shafts, as matrices",
        {
            "kind": "matrices", "coordinates": ["motor", "pinion", "gear", "load"], "coordinate_units": "rad",
            "mass": [[0.02, 0, 0, 0], [0, 0.002, 0, 0], [0, 0, 0.05, 0], [0, 0, 0, 0.4]],
            "stiffness": [
                [1.0e4, -1.0e4, 0, 0], [-1.0e4, 1.0e4, 0, 0], [0, 0, 5.0e4, -5.0e4], [0, 0, -5.0e4, 5.0e4],
            ],
            "damping_ratio": 0.01,
            "meshes": [{"name": "mesh", "direction": [0, 0.034, -0.102, 0], **START_MESH}],
        },
        {
            "mesh_frequency": ({"start": 500.0, "stop": 30000.0, "num": 301}, "rad/s"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of the mesh"),
        },
    )  # fmt: skip

    kind: Literal["matrices"] = Field(title="kind of system")
    """A model given as matrices."""
    mass: list[list[MassEntry]] | None = optional("mass matrix")
    """M, one row per coordinate (kg, or kg m^2 of a rotation); symmetric, positive definite."""
    stiffness: list[list[StiffnessEntry]] | None = optional("stiffness matrix")
    """K0, everything but the meshes (N/m, or N m/rad of a rotation); unsymmetric of some bearings."""
    file: StrictStr | None = optional("file of matrices")
    """A .npz, .h5 or .mat file of mass, stiffness and optionally damping, beside the configuration."""
    files: MatrixFiles | None = optional("files of matrices")
    """Matrix Market files (.mtx) instead, one for each of mass, stiffness and optionally damping."""
    coordinates: list[NameText] | None = None
    """Names of the coordinates; q1, q2, ... without."""
    coordinate_units: CoordinateUnits | None = optional("units of the coordinates")
    """m, or rad of rotations: one for all coordinates, or a list of them; m without."""
    damping: Damping | None = Field(default=None, json_schema_extra=also(ROWS))
    """The damping matrix, or other forms of damping; or give damping_ratio."""
    deflection_unit: Annotated[str, Choice("unit of a mesh deflection", UNITS)] = Field(
        default="m", title="unit of the mesh deflections"
    )
    """m, or rad of meshes whose stiffness is in N m/rad."""
    meshes: list[MatrixMesh] = Field(min_length=1)
    """At least one tooth mesh."""
    terms: list[Term] = Field(default=[])
    """Further periodic or constant parts a u v^T of the stiffness and damping matrix, of any symmetry."""
    rotation: Annotated[list[RotationSection], OneAsWell()] = Field(default=[])
    """Speeds of rotation with gyroscopic, centripetal and circulatory matrices; one, or a list of them."""
    load: Annotated[Load, ByCoordinate()] | None = None
    """Constant forces, one per coordinate (N, or N m of a rotation)."""
    forces: list[Force] = Field(default=[])
    """Periodic external forces."""

    def size(self) -> int | None:
        mass: Any = self.mass
        return None if mass is None else len(mass) or None

    def turning(self) -> list[bool] | None:
        given = self.coordinate_units or ["m"]
        return [unit == "rad" for unit in (given * (self.size() or 1) if len(given) == 1 else given)]

    def turning_meshes(self) -> bool:
        return self.deflection_unit == "rad"

    @classmethod
    def _read_files(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """Return mass, stiffness and damping of files, and matrices of rotation."""
        system = document.data["system"]
        if isinstance(system.get("file"), dict):
            system["files"] = system.pop("file")
            document.move(("system", "file"), ("system", "files"))
        given = system.get("files")
        names = given if isinstance(given, dict) else {"": system.get("file")}
        contents: dict[str, Array] = {}
        for key, name in names.items():
            place: Path = ("system", "files", key) if key else ("system", "file")
            if key not in ("", *REQUIRED, *OPTIONAL) or not isinstance(name, str):
                continue
            try:
                contents |= {key: read_market(source.parent / name)} if key else read_matrices(source.parent / name)
                check_shapes(contents if "mass" in contents else {})
            except DataFileError as error:
                document.report(place, "file", str(error), error.hint, value=name)
                return {}
        for key in contents:
            for other in (key, "damping_ratio") if key == "damping" else (key,):
                if system.get(other) is not None:
                    message = f"the file {names.get(key, names.get(''))} has {key} already"
                    document.report(("system", other), "already_given", message, "keep one of the two")
        kept = [key for key in OF_ROTATION if key in contents]
        if kept and not system.get("rotation"):
            message = f"the file holds {' and '.join(kept)}, and no speed of rotation is given"
            document.report(("system",), "missing", message, 'add rotation: {speed_ratio: ".."}, or speed')
        return contents

    @classmethod
    def expand_path(cls, parts: list[str]) -> list[str]:
        """``damping.0.1`` is an entry of ``damping.matrix``."""
        entry = parts[0] == "damping" and len(parts) == 3 and parts[1].isdecimal()
        return ["damping", "matrix", *parts[1:]] if entry else parts

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """Matrices that no system has, too."""
        feasibility.check_mesh_levels(document, grid)
        check_axes(document, grid)
        check_rotation(document, grid.system)
        if feasibility.check_symmetric(document, grid.system, [("mass",)]):
            feasibility.check_definite(document, feasibility.numbers_only(grid))

    def doubts(self) -> Iterator[tuple[Path, str, str]]:
        """Matrices written entry by entry that are not symmetric: bearings are, and so are misprints."""
        for path in (("stiffness",), ("damping", "matrix")):
            rows = value_at(self, path)
            if isinstance(rows, list) and np.any(difference := feasibility.asymmetry(values := matrix(rows))):
                i, j, entries = feasibility.worst_entry(values, difference)
                remedy = "make them equal unless bearings or rotation make them differ"
                yield (*path, i, j), f"is not symmetric: {entries}", remedy

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """Vectors by coordinate, the damping matrix by itself, and units of coordinates that their inertias tell."""
        super().complete(document, source)
        raw, contents = document.data["system"], cls._read_files(document, source)
        size = len(contents["mass"]) if "mass" in contents else len(sequence(raw.get("mass"))) or None
        write_out(document, raw, size)
        for name, kind, inner in (("damping", list, "matrix"), ("rotation", dict, 0), ("coordinate_units", str, 0)):
            if isinstance(raw.get(name), kind):
                document.nest(("system", name), inner)
        turning = [any(_told(raw.get(name), (k, k), unit) for name, unit in TOLD.items()) for k in range(size or 0)]
        if raw.get("coordinate_units") is None and any(turning):
            units = ["rad" if turns else "m" for turns in turning]
            document.put(("system", "coordinate_units"), units, document.where(("system", "mass")))
        meshes, levels = sequence(raw.get("meshes")), ("mean_stiffness", "max_stiffness")
        angles = [_told(mesh, (key,), "N m") for mesh in meshes for key in levels]
        units = sequence(raw.get("coordinate_units")) or ["m"]
        if raw.get("deflection_unit") is None and all(unit == "rad" for unit in units) and any(angles):
            document.put(("system", "deflection_unit"), "rad", document.where(("system", "meshes")))
        return contents

    def conflicts(self) -> Iterator[Conflict]:
        """Shapes that agree, names that differ; the matrices themselves are checked as numbers."""
        yield from super().conflicts()
        size = told(self.size)
        yield from at_most_one(self, ("file", "files"))
        yield from wrong_length(self, "load", size)
        yield from within_each(self, "terms", lambda term: term.conflicts(size))
        yield from repeated_names(self, "terms", "term")
        of_file = self.file is not None or self.files is not None
        yield from within_each(self, "rotation", lambda part: part.conflicts(size, of_file))
        yield from within_each(self, "forces", lambda force: force.conflicts(size))
        for name in ("mass", "stiffness"):
            rows = getattr(self, name)
            if rows is None and self.file is None and self.files is None:
                remedy = f"add {name}, or file: the name of a .npz, .h5 or .mat file with it"
                yield (), "missing", f"{name} is missing", remedy
            elif rows is not None and not len(rows) and size is None:
                yield (name,), "missing", "has no rows", "give one row per coordinate"
            else:
                yield from not_square(self, name, size)
        yield from wrong_length(self, "coordinates", size)
        if size is not None:
            hint = "let the mesh move at least one coordinate"
            yield from within_each(self, "meshes", lambda mesh: no_direction(mesh, "direction", size, hint))
        units = self.coordinate_units
        if units is not None and size is not None and len(units) not in (1, size):
            hint = f"give {size}, one per coordinate, or one for all"
            yield ("coordinate_units",), "wrong_count", f"has {len(units)} entries", hint
        for key in ("coordinate_units", "deflection_unit"):
            if self.units == "none" and getattr(self, key) not in (None, "m", ["m"]):
                yield (key,), "not_applicable", "is given for a model without units", "remove it, or units: none"
        names = self.coordinates or ()
        if len(set(names)) < len(names):
            yield ("coordinates",), "repeated_name", "two coordinates have the same name", "give each a name of its own"

    def with_files(self, contents: Mapping[str, Array]) -> Self:
        held: dict[str, Any] = {name: contents[name] for name in REQUIRED if name in contents}
        if "damping" in contents:
            held["damping"] = Damping.model_construct(matrix=contents["damping"])
        if self.rotation is not WRONG and self.rotation:
            turned = {name: contents[name] for name in OF_ROTATION if name in contents}
            held["rotation"] = [self.rotation[0].model_copy(update=turned), *self.rotation[1:]]
        return self.model_copy(update=held)

    def equations(self) -> GearSystem:
        """M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = f(t).

        Parameters: ``mass``, ``stiffness`` (K0, without meshes) as nested numbers or arrays, damping (antisymmetric
        parts of both become terms), ``meshes`` with
        ``direction`` g_i, ``frequency_ratio`` Omega_i/Omega (a Fraction) and ``lag`` (in periods of the mesh), ``load``
        and ``forces`` (:func:`~gearstab.systems.forcing.with_forcing`) and ``terms``
        (:func:`~gearstab.systems.matrix_parts.periodic_terms`); ``coordinate_units`` (one for all, or one for each
        coordinate) and ``deflection_unit``, m or rad.
        """
        mass, meshes = matrix(cast(Any, self.mass)), []
        for mesh in self.meshes:
            lag = np.asarray(mesh.lag, dtype=float)
            meshes.append(build_mesh(mesh, vector(mesh.direction), mesh.frequency_ratio, lag))
        names = tuple(self.coordinates or default_names(mass.shape[-1]))
        stiffness, terms = _parts("circulatory", "stiffness", self.stiffness)
        damping = self.damping or Damping()
        if damping.matrix is not None:
            symmetric, gyroscopic = _parts("gyroscopic", "damping", damping.matrix)
            damping, terms = damping.model_copy(update={"matrix": symmetric}), terms + gyroscopic
        units = tuple(self.coordinate_units or ("m",))
        units = units * len(names) if len(units) == 1 else units
        system = GearSystem(
            mass, stiffness, tuple(meshes), coordinates=names, terms=periodic_terms([*self.terms, *terms]), units=units,
            deflection_unit=self.deflection_unit, rotations=rotations(self.rotation),
        )  # fmt: skip
        section = self.model_copy(update={"damping": damping})
        return with_forcing(with_damping(system, section), section)


def _parts(name: str, part: str, rows: Any) -> tuple[Array, list[Term]]:
    """Return the symmetric part of a matrix, and terms of the rest, which is the same in a whole batch."""
    full = matrix(rows)
    one = full.reshape(-1, *full.shape[-2:])[0]
    if not np.any(feasibility.asymmetry(one)):
        return full, []
    return 0.5 * (full + np.swapaxes(full, -1, -2)), constructed(list[Term], antisymmetric_terms(name, part, one))


def _told(raw: Any, path: Path, unit: str) -> bool:
    """Whether the number at a path is a text with a unit of a kind."""
    text = value_at(raw, path)
    try:
        return isinstance(text, str) and to_si(text, (unit,)) is not None
    except UnitError:
        return False
