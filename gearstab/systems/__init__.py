"""Kinds of systems: one class for each kind in a file or folder of its own, and one line in ``KINDS``.

The class is the section ``system`` of the configuration, checks it, and builds the :class:`~gearstab.system.GearSystem`
of its parameters; :class:`~gearstab.systems.base.System` says what it may override.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gearstab.system import GearSystem
from gearstab.systems.base import System
from gearstab.systems.gear_pair import GearPair
from gearstab.systems.gearbox import Gearbox
from gearstab.systems.matrices import Matrices
from gearstab.systems.planetary import Planetary
from gearstab.systems.two_stage import TwoStage

if TYPE_CHECKING:
    from gearstab.systems.gearbox.build import Train

KINDS: dict[str, type[System]] = {
    "gear_pair": GearPair,
    "two_stage": TwoStage,
    "planetary": Planetary,
    "gearbox": Gearbox,
    "matrices": Matrices,
}


def model_of(parameters: dict[str, Any]) -> type[System]:
    """Return the class of a system from its section, as written or as parameters."""
    return KINDS[parameters["kind"]].variant(parameters)


def build(parameters: dict[str, Any]) -> GearSystem:
    """Build the system of a validated section ``system``, any number of which may be an array of batch shape.

    With ``units: none`` nothing in it has a unit.
    """
    system = model_of(parameters).build(parameters)
    return replace(system, dimensionless=("mass", "length", "time")) if parameters.get("units") == "none" else system


def train_of(parameters: dict[str, Any]) -> Train | None:
    """Return the train of gears whose teeth a system is computed from; None for other systems."""
    return model_of(parameters).train(parameters)


__all__ = ["KINDS", "build", "model_of", "train_of"]
