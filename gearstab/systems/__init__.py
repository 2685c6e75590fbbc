"""Kinds of systems: one class for each kind in a file or folder of its own, and one line in ``KINDS``.

The class is the section ``system`` of the configuration, checks it, and builds the :class:`~gearstab.system.GearSystem`
of its parameters; :class:`~gearstab.systems.base.System` says what it may override.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_args

from gearstab.config.model.fields import ShortName
from gearstab.config.model.introspection import bare, field_types, is_model, short_name
from gearstab.lazy import LazyTable
from gearstab.system import GearSystem

if TYPE_CHECKING:
    from gearstab.systems.base import System
    from gearstab.systems.gearbox.train import Train

KINDS: LazyTable[type[System]] = LazyTable(
    {
        "gear_pair": "gearstab.systems.gear_pair:GearPair",
        "two_stage": "gearstab.systems.two_stage:TwoStage",
        "planetary": "gearstab.systems.planetary.sections:Planetary",
        "gearbox": "gearstab.systems.gearbox.sections:Gearbox",
        "matrices": "gearstab.systems.matrices:Matrices",
    }
)
"""By name, ``system.kind`` of a configuration; a kind is imported when it is used."""


def model_of(parameters: dict[str, Any]) -> type[System]:
    """Return the class of a system from its section, as written or as parameters."""
    return KINDS[parameters["kind"]].variant(parameters)


def short_names() -> dict[str, ShortName]:
    """Return all names that stand for a number of every mesh that has one, in any kind of system."""
    found: dict[str, ShortName] = {}
    for model in KINDS.values():
        found |= {name: short for name, short in short_names_of(model).items() if name not in found}
    return found


def short_names_of(model: type[System]) -> dict[str, ShortName]:
    """Return those in one kind of system."""
    meshes = bare(field_types(model).get("meshes"))
    found: dict[str, ShortName] = {}
    for mesh in field_types(meshes).values() if is_model(meshes) else get_args(meshes):
        names = {name: short_name(annotation) for name, annotation in field_types(mesh).items()}
        found |= {name: short for name, short in names.items() if short is not None and name not in found}
    return found


def build(parameters: dict[str, Any]) -> GearSystem:
    """Build the system of a validated section ``system``, any number of which may be an array of batch shape.

    With ``units: none`` nothing in it has a unit.
    """
    system = model_of(parameters).build(parameters)
    return replace(system, dimensionless=("mass", "length", "time")) if parameters.get("units") == "none" else system


def train_of(parameters: dict[str, Any]) -> Train | None:
    """Return the train of gears whose teeth a system is computed from; None for other systems."""
    return model_of(parameters).train(parameters)


__all__ = ["KINDS", "build", "model_of", "short_names", "short_names_of", "train_of"]
