"""Units that depend on the rest of the model: on which coordinates turn, or on whether it has units at all."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails, PydanticCustomError

from gearstab.config.document.problems import Path
from gearstab.config.document.tree import Document, texts
from gearstab.config.model import conflicts
from gearstab.config.model.conflicts import Conflict
from gearstab.config.model.reading import WRONG, known, quantity, told, type_at
from gearstab.config.model.values import Quantity
from gearstab.systems.base import System

TURNED = {
    "m": ("m", "rad"),
    "m/s": ("m/s", "rad/s"),
    "N": ("N", "N m"),
    "kg": ("kg", "kg m", "kg m^2"),
    "N/m": ("N/m", "N", "N m"),
    "N s/m": ("N s/m", "N s", "N m s"),
}
"""Unit of displacements -> units where none, one or both of the coordinates that it belongs to are rotations in rad."""

NO_UNITS = "the model has none (system.units: none)"
SCALED = "times are in sqrt(m_r/k_rp) with scaling: dimensionless"
OF_A_TORQUE = "of a torque, give the force that it is over the base radius"


def quantity_at(system: System, path: Path, declared: Quantity) -> Quantity:
    """Return the limits of the number at a path, which its field declares, in a section whose values may be wrong.

    path: below ``system``, or beginning with ``mesh_frequency`` or ``respond``.
    """
    if declared.unit in ("1", "rad"):
        return declared
    if told(lambda: system.units == "none") and not system.needs_units:
        return Quantity(advice=NO_UNITS)
    scaled = told(lambda: getattr(system, "scaling", "SI") == "dimensionless")
    if path[0] in ("mesh_frequency", "respond") and scaled and declared.unit != "m":
        return Quantity(advice=SCALED)
    turning, angle = told(system.turning), bool(told(system.turning_meshes))
    if path[0] == "meshes" and path[2:3] == ("direction",):
        given = turning is not None and path[-1] in range(len(turning))
        lever = not given or (turning[path[-1]] and not angle)  # type: ignore[index]
        return declared if lever else Quantity(advice="the mesh deflection is this times the coordinate")
    units = TURNED.get(declared.unit)
    found = set(known(_rotations(system, path, turning, angle))) if declared.others and units else set()
    if not units or len(found) != 1:
        return declared
    unit = units[found.pop()]
    return replace(declared, unit=unit, others=(), advice=OF_A_TORQUE if unit == "N" and path[0] == "load" else "")


def _rotations(system: Any, path: Path, turning: Sequence[bool] | None, angle: bool) -> Iterator[int]:
    """How many of the coordinates that a number belongs to are rotations; several answers where it belongs to many."""
    if path[0] == "meshes":
        stiffness = path[2] not in ("backlash", "transmission_error")
        yield (2 if stiffness else 1) * angle
        return
    groups: list[Sequence[Any]] = []
    if path[0] in ("forces", "terms"):
        item = system[path[0]][path[1]]
        vectors = [item[key] for key in (("direction",) if path[0] == "forces" else ("left", "right"))]
        groups = [[k for k, value in enumerate(vector) if value is WRONG or value != 0] for vector in vectors]
    elif path[0] in ("mass", "stiffness", "damping"):
        groups = [[path[-2]], [path[-1]]]
    elif path[0] in ("load", "respond"):
        groups = [[path[-1]]]
    if (
        turning is None
        or not groups
        or any(not isinstance(k, int) or k >= len(turning) for group in groups for k in group)
    ):
        return
    first, second = groups if len(groups) == 2 else (groups[0], None)
    for i in first:
        for also in [0] if second is None else [int(turning[j]) for j in second]:
            yield int(turning[i]) + also


def report_all(
    document: Document, path: Path, model: type[BaseModel], read: tuple[Any, Sequence[ErrorDetails]],
    rules: Iterable[Conflict], system: System | None, ignore: Collection[Path] = (),
) -> None:  # fmt: skip
    """Report what contradicts itself in a section, units that do not fit the system, and values that are wrong.

    path: of the section, whose model is ``model``. read: the section and its errors. ignore: paths in the document at
    which values are not those of the section.
    """
    section, errors = read
    units = set() if system is None else {*_wrong_units(document, system, str(path[0]), model, ignore)}
    conflicts.report(document, path, rules, section)
    conflicts.report_errors(document, errors, model, path, {*ignore, *units})


def _wrong_units(
    document: Document, system: System, top: str, section: type[BaseModel], ignore: Collection[Path]
) -> Iterator[Path]:
    """Report texts in a section whose unit does not fit the system; yield their places."""
    for path, text in texts(document.data.get(top)):
        declared = quantity(type_at(section, path))
        place = (top, *path)
        if declared is None or place in ignore:
            continue
        wanted = quantity_at(system, path if top == "system" else place, declared)
        if wanted == declared:
            continue
        try:
            wanted.number(text)
        except PydanticCustomError as error:
            conflicts.report_wrong(document, place, error, text)
            yield place
