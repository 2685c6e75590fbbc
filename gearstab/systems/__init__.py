"""Kinds of systems: one class for each kind in a file or folder of its own, and one line in ``KINDS``.

The class is the section ``system`` of the configuration, checks it, and builds the :class:`~gearstab.system.GearSystem`
of its parameters; :class:`~gearstab.systems.base.System` says what it may override.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, get_args

from gearstab.config.model.fields import ShortName
from gearstab.config.model.reading import bare, constructed, field_types, is_model, short_name
from gearstab.system import GearSystem

if TYPE_CHECKING:
    from gearstab.systems.base import System


class Kinds(UserDict[str, "type[System]"]):
    """A table of names and classes, which may be given as ``module:class`` and are then imported when they are used."""

    data: dict[str, Any]

    def __getitem__(self, name: str) -> type[System]:
        found = self.data[name]
        if isinstance(found, str):
            module, _, attribute = found.partition(":")
            found = self.data[name] = getattr(import_module(module), attribute)
        return found


KINDS = Kinds()
"""By name, ``system.kind`` of a configuration."""
KINDS.data |= {
    "gear_pair": "gearstab.systems.gear_pair:GearPair",
    "two_stage": "gearstab.systems.two_stage:TwoStage",
    "planetary": "gearstab.systems.planetary.sections:Planetary",
    "gearbox": "gearstab.systems.gearbox.sections:Gearbox",
    "matrices": "gearstab.systems.matrices:Matrices",
}


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


def section(numbers: Mapping[str, Any]) -> System:
    """Return the section ``system`` of plain numbers in SI units, any of which may be an array of batch shape.

    Nothing is checked, as in a batch of numbers that were checked before.
    """
    return constructed(KINDS[numbers["kind"]].variant(dict(numbers)), numbers)


def build(system: System | Mapping[str, Any]) -> GearSystem:
    """Build the gear system of a section, or of the same as plain numbers: see :func:`section`."""
    return (section(system) if isinstance(system, Mapping) else system).build()


__all__ = ["KINDS", "build", "section", "short_names", "short_names_of"]
